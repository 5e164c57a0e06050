"""Points of a surface that the layout holds twice: on both sides of a seam between charts.

Sides of triangles with the same ends in space are found by their vertices. Where meshes touch that are cut in other
places (floor tiles beside a long wall's floor, two objects side by side) a short ray beside the edge finds who lies
there. Where a wall stands on the seam, or where a lamp is linked to one side alone, the light really has a step, and
there is no sample.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .components import shared_edges
from .linking import Reach, links_of
from .lumels import UV_WELD
from .pieces import weld
from .receivers import Lumels
from .scene import Scene, surface_of_triangle
from .triangle_normals import corner_normals, normals, unit
from .visibility import OFFSET, Visibility

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]

# Sides of a seam are one surface if their shading normals differ by less than this at both ends: cosine of 8 degrees.
SMOOTH_COSINE = 0.99
# Two objects that touch are stitched only if they are flush: cosine of .8 degrees.
FLUSH_COSINE = 0.9999
# Samples along a seam, one a texel of its longer side, this many at most.
MOST_SAMPLES = 4096
# How far beyond an edge a neighbour is looked for, and how much higher or lower it may lie, texels.
BESIDE, LEVEL = 0.05, 0.05
# The same at least, in offsets of the triangle.
LEAST_STEPS = 16.0


@dataclass(frozen=True, eq=False)
class SeamSamples:
    """Places on seams, each seen from both sides.

    triangle : (n, 2) int, the scene's triangles.
    uv : (n, 2, 2) float64, where the place lies in the layout of each.
    """

    triangle: Int
    uv: Float

    def __len__(self) -> int:
        return len(self.triangle)

    def take(self, index: NDArray[Any]) -> SeamSamples:
        """Some of the samples."""
        return SeamSamples(self.triangle[index], self.uv[index])


def seam_samples(lumels: Lumels, scene: Scene, check: Callable[[], None] = lambda: None,
                 solid: Visibility | None = None) -> SeamSamples:
    """One sample a texel along all seams of smooth surfaces; `check` is called now and then, and may raise; `solid` is
    `Geometry.solid`, made if not given."""
    surface = surface_of_triangle(scene)
    page = lumels.page_of_surface[surface]
    laid = np.flatnonzero(page >= 0)
    uv, normal = layout_of(lumels, scene), corner_normals(scene, slice(None))
    sizes = np.array([(item.width, item.height) for item in lumels.pages], np.float64)
    node = weld(scene.vertices)[scene.triangles[laid]]
    first, second, side, other = shared_edges(node)
    ends, others = _ends(side), _ends(other)
    # The corners of the second side in the order of the first's ends.
    turned = node[first, ends[:, 0]] != node[second, others[:, 0]]
    others = np.where(turned[:, None], others[:, ::-1], others)
    first, second = laid[first], laid[second]
    check()
    apart, smooth = page[first] != page[second], np.ones(len(first), bool)
    cosine = np.where(surface[first] == surface[second], SMOOTH_COSINE, FLUSH_COSINE)
    for k in range(2):
        apart |= np.abs(uv[first, ends[:, k]] - uv[second, others[:, k]]).max(axis=1) > UV_WELD
        smooth &= (normal[first, ends[:, k]] * normal[second, others[:, k]]).sum(axis=1) > cosine
    chosen = np.flatnonzero(apart & smooth)
    pair = np.stack([first, second], axis=1)[chosen]
    corner = np.stack([ends, others], axis=1)[chosen]
    along, seam = _along(uv[pair[:, :, None], corner] * sizes[page[pair]][:, :, None])
    place = uv[pair[:, :, None], corner][seam]
    shared = SeamSamples(pair[seam], place[:, :, 0] * (1 - along) + place[:, :, 1] * along)
    joined = np.zeros((len(scene.triangles), 3), bool)
    joined[first[smooth], side[smooth]] = joined[second[smooth], other[smooth]] = True
    triangle, edge = np.nonzero(~joined[laid])
    corners = scene.vertices[scene.triangles] - scene.origin
    check()
    visibility = solid or Visibility(np.asarray(corners, np.float32))
    check()
    touching = _touching(corners, visibility, uv, normal, page, sizes, laid[triangle], edge)
    check()
    samples = SeamSamples(np.concatenate([shared.triangle, touching.triangle]),
                          np.concatenate([shared.uv, touching.uv]))
    samples = samples.take(_lit_alike(scene, surface[samples.triangle]))
    check()
    return samples.take(_open(corners, visibility, uv, sizes[page], samples))


def _touching(corners: Float, visibility: Visibility, uv: Float, normal: Float, page: Int, sizes: Float, triangle: Int,
              side: Int) -> SeamSamples:
    """Samples along the given sides of triangles (n,) beside which another triangle lies flush.

    A ray starts a little beyond the edge and above the surface, and looks down on it.
    """
    ends = _ends(side)
    along, edge = _along((uv[triangle[:, None], ends] * sizes[page[triangle]][:, None])[:, None])
    along = along[:, 0]
    own, corner = triangle[edge], ends[edge]
    start, end = corners[own, corner[:, 0]], corners[own, corner[:, 1]]
    third = corners[own, 3 - corner.sum(axis=1)]
    point = start * (1 - along) + end * along
    up = unit(normals(corners[own]))
    outward = unit(np.cross(end - start, up))
    outward *= np.where(((third - point) * outward).sum(axis=1) > 0, -1.0, 1.0)[:, None]
    place = uv[own, corner[:, 0]] * (1 - along) + uv[own, corner[:, 1]] * along
    step, level = _steps(corners, uv, sizes[page], own)
    origin = point + outward * step[:, None] + up * (2 * level)[:, None]
    hits = visibility.hits(np.asarray(origin, np.float32), np.asarray(-up, np.float32))
    met = np.maximum(hits.triangle, 0)
    weight = np.stack([1 - hits.u - hits.v, hits.u, hits.v], axis=1).astype(np.float64)
    theirs = unit((normal[met] * weight[:, :, None]).sum(axis=1))
    ours = unit(normal[own, corner[:, 0]] * (1 - along) + normal[own, corner[:, 1]] * along)
    apart = np.abs(hits.distance - 2 * level)
    found = (hits.triangle >= 0) & (apart < np.maximum(level, _least(corners[met]))) & (page[met] >= 0) & (met != own)
    found &= (ours * theirs).sum(axis=1) > FLUSH_COSINE
    rows = np.flatnonzero(found)
    # Where the ray met the neighbour is a little inside it: as near to the edge as rays can tell.
    other = (uv[met[rows]] * weight[rows][:, :, None]).sum(axis=1)
    return SeamSamples(np.stack([own[rows], met[rows]], axis=1), np.stack([place[rows], other], axis=1))


def _lit_alike(scene: Scene, surface: Int) -> NDArray[np.bool_]:
    """(n,) bool: pairs of surfaces (n, 2) that the same lights reach."""
    links = [links_of(light) for light in scene.lights]
    links += [item.links for item in scene.surfaces if item.links is not None]
    kind = Reach.of(links, len(scene.surfaces)).kind[surface]
    return np.asarray(kind[:, 0] == kind[:, 1])


def _open(corners: Float, visibility: Visibility, uv: Float, sizes: Float, samples: SeamSamples) -> NDArray[np.bool_]:
    """(n,) bool: samples between whose sides nothing stands: a line from one to the other just above them is free."""
    ends = []
    for side in (0, 1):
        own = samples.triangle[:, side]
        # Where the sample lies on its triangle, from where it lies in the layout.
        a, b = uv[own, 1] - uv[own, 0], uv[own, 2] - uv[own, 0]
        offset = samples.uv[:, side] - uv[own, 0]
        area = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
        area = np.where(area == 0, np.inf, area)
        u = (offset[:, 0] * b[:, 1] - offset[:, 1] * b[:, 0]) / area
        v = (a[:, 0] * offset[:, 1] - a[:, 1] * offset[:, 0]) / area
        corner = corners[own]
        point = corner[:, 0] + u[:, None] * (corner[:, 1] - corner[:, 0]) + v[:, None] * (corner[:, 2] - corner[:, 0])
        step, level = _steps(corners, uv, sizes, own)
        inward = unit(corner.mean(axis=1) - point)
        ends.append(point + inward * step[:, None] + unit(normals(corner)) * (2 * level)[:, None])
    way = ends[1] - ends[0]
    length = np.linalg.norm(way, axis=1)
    way /= np.maximum(length, 1e-300)[:, None]
    return ~visibility.occluded(*(np.asarray(each, np.float32) for each in (ends[0], way, length)))


def _steps(corners: Float, uv: Float, sizes: Float, triangle: Int) -> tuple[Float, Float]:
    """How far beside and above an edge of the triangles (n,) one looks, metres: parts of their texels."""
    a, b = uv[triangle, 1] - uv[triangle, 0], uv[triangle, 2] - uv[triangle, 0]
    texels = np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) * sizes[triangle].prod(axis=1)
    one, two = (corners[triangle, k] - corners[triangle, 0] for k in (1, 2))
    texel = np.sqrt(np.linalg.norm(np.cross(one, two), axis=1) / np.maximum(texels, 1e-30))
    least = _least(corners[triangle])
    return np.maximum(BESIDE * texel, least), np.maximum(LEVEL * texel, least)


def _least(corner: Float) -> Float:
    """(n,) metres that rays can tell apart for certain on triangles (n, 3, 3)."""
    return np.asarray(LEAST_STEPS * OFFSET * np.abs(corner).max(axis=(1, 2), initial=0))


def _along(ends: Float) -> tuple[Float, Int]:
    """Samples along sides (s, k, 2, 2) in texels: the part of the way from end to end (n, 1, 1), and the side (n,)."""
    length = np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=2).max(axis=1, initial=0)
    count = np.clip(np.ceil(length), 1, MOST_SAMPLES).astype(np.int64)
    side = np.repeat(np.arange(len(count)), count)
    step = np.arange(len(side)) - np.repeat(np.cumsum(count) - count, count)
    return ((step + 0.5) / count[side])[:, None, None], side


def _ends(side: Int) -> Int:
    """(n, 2) corners at the ends of sides (n,)."""
    return np.stack([side, (side + 1) % 3], axis=1)


def layout_of(lumels: Lumels, scene: Scene) -> Float:
    """(t, 3, 2) float64 layout of all triangles, zero where there is none."""
    uv = np.zeros((len(scene.triangles), 3, 2))
    for surface, layout in zip(scene.surfaces, lumels.uv, strict=True):
        if layout is not None:
            uv[surface.triangles] = layout
    return uv

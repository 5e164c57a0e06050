"""Light continuous across the seams of the layout.

Two charts that meet along an edge in space are filtered from different texels there, and the edge shows as a line. The
texels next to it are moved a little so that both sides agree: least squares over samples along the seams (Iwanicki,
Lighting Technology of The Last of Us, SIGGRAPH 2013), solved matrix-free by conjugate gradients.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .components import shared_edges
from .lumels import UV_WELD, surface_of_triangle
from .pieces import weld
from .receivers import Lumels
from .scene import Scene

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]

# Sides of a seam are one surface if their shading normals differ by less than this at both ends: cosine of 8 degrees.
SMOOTH_COSINE = 0.99
# Two objects that touch along an edge are stitched only if they are flush: cosine of .8 degrees.
FLUSH_COSINE = 0.9999
# Weight of a difference across a seam against that of moving a lumel, and of moving a texel of the margin.
SEAM_WEIGHT, MARGIN_WEIGHT = 4.0, 0.1
# Samples along a seam, one a texel of its longer side, this many at most.
MOST_SAMPLES = 4096
TOLERANCE, MOST_STEPS = 1e-4, 60


@dataclass(frozen=True, eq=False)
class _Seams:
    """Pairs of triangle sides that are one edge in space and two in the layout.

    triangle : (s, 2) the scene's triangles; corner : (s, 2, 2) for each of the two the corner at the edge's same first
    and second end.
    """

    triangle: Int
    corner: Int


def stitch(lumels: Lumels, scene: Scene, images: list[Float]) -> list[Float]:
    """Make the light agree on both sides of seams.

    Parameters
    ----------
    images : one (height, width, 3) a page of `lumels`, dilated by one texel at least.

    Returns
    -------
    Copies, changed next to seams only. Never changed are texels at creases, and between objects unless they are flush.
    """
    seams = _find(lumels, scene)
    if not len(seams.triangle):
        return [np.array(image) for image in images]
    sizes = np.array([(page.width, page.height) for page in lumels.pages], np.int64)
    offset = np.concatenate([[0], np.cumsum(sizes.prod(axis=1))])
    chart = np.full(offset[-1], -1, np.int32)
    chart[offset[lumels.page] + lumels.pixel] = lumels.chart
    texel, weight = _differences(seams, lumels, scene, sizes, offset, chart)
    flat = np.concatenate([np.asarray(image, np.float64).reshape(-1, 3) for image in images])
    unknown, column = np.unique(texel, return_inverse=True)
    anchor = np.where(chart[unknown] >= 0, 1.0, MARGIN_WEIGHT)
    change = _solve(column.reshape(texel.shape), weight, anchor, flat[unknown])
    flat[unknown] = np.maximum(flat[unknown] + change, np.minimum(flat[unknown], 0))
    return [flat[offset[k]:offset[k + 1]].reshape(images[k].shape).astype(np.float32) for k in range(len(images))]


def _find(lumels: Lumels, scene: Scene) -> _Seams:
    """Seams: sides with the same ends in space, different ones in the layout, on one smooth surface."""
    surface = surface_of_triangle(scene)
    laid = np.flatnonzero(lumels.page_of_surface[surface] >= 0)
    node = weld(scene.vertices)[scene.triangles[laid]]
    first, second, side, other = shared_edges(node)
    # The corners of the second side in the order of the first's ends.
    ends = np.stack([side, (side + 1) % 3], axis=1)
    others = np.stack([other, (other + 1) % 3], axis=1)
    turned = node[first, ends[:, 0]] != node[second, others[:, 0]]
    others = np.where(turned[:, None], others[:, ::-1], others)
    uv = _layout(lumels, scene)[laid]
    apart = np.zeros(len(first), bool)
    smooth = np.ones(len(first), bool)
    same = surface[laid[first]] == surface[laid[second]]
    normal = _normals(scene, laid)
    for k in range(2):
        gap = np.abs(uv[first, ends[:, k]] - uv[second, others[:, k]]).max(axis=1)
        apart |= gap > UV_WELD
        cosine = (normal[first, ends[:, k]] * normal[second, others[:, k]]).sum(axis=1)
        smooth &= cosine > np.where(same, SMOOTH_COSINE, FLUSH_COSINE)
    apart |= lumels.page_of_surface[surface[laid[first]]] != lumels.page_of_surface[surface[laid[second]]]
    keep = apart & smooth
    return _Seams(np.stack([laid[first], laid[second]], axis=1)[keep], np.stack([ends, others], axis=1)[keep])


def _layout(lumels: Lumels, scene: Scene) -> Float:
    """(t, 3, 2) float64 layout of all triangles, zero where there is none."""
    uv = np.zeros((len(scene.triangles), 3, 2))
    for surface, layout in zip(scene.surfaces, lumels.uv, strict=True):
        if layout is not None:
            uv[surface.triangles] = layout
    return uv


def _normals(scene: Scene, triangle: Int) -> Float:
    """(t, 3, 3) unit normals at the corners."""
    if scene.corner_normals is not None:
        return np.asarray(scene.corner_normals[triangle])
    corners = scene.vertices[scene.triangles[triangle]]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    return np.repeat((normal / np.where(length > 0, length, 1))[:, None], 3, axis=1)


def _differences(seams: _Seams, lumels: Lumels, scene: Scene, sizes: Int, offset: Int,
                 chart: NDArray[np.int32]) -> tuple[Int, Float]:
    """Texels (n, 8) and weights (n, 8) whose sum is the difference of the filtered light at samples of the seams.

    A sample is left out if it reads a lumel of another chart than its own, where charts lie closer than a texel.
    """
    page = lumels.page_of_surface[surface_of_triangle(scene)[seams.triangle]]
    uv = _layout(lumels, scene)[seams.triangle[:, :, None], seams.corner]
    ends = uv * sizes[page][:, :, None] - .5
    length = np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=2).max(axis=1)
    count = np.clip(np.ceil(length), 1, MOST_SAMPLES).astype(np.int64)
    seam = np.repeat(np.arange(len(count)), count)
    step = np.arange(len(seam)) - np.repeat(np.cumsum(count) - count, count)
    along = ((step + .5) / count[seam])[:, None]
    chart_of = np.full(len(scene.triangles), -2, np.int32)
    chart_of[lumels.receivers.triangle] = lumels.chart
    texels, weights, usable = [], [], np.ones(len(seam), bool)
    for side, sign in ((0, 1.0), (1, -1.0)):
        point = ends[seam, side, 0] * (1 - along) + ends[seam, side, 1] * along
        texel, weight = _taps(point, sizes[page[seam, side]], offset[page[seam, side]])
        owner = chart[texel]
        usable &= ((owner < 0) | (owner == chart_of[seams.triangle[seam, side]][:, None]) | (weight == 0)).all(axis=1)
        texels.append(texel)
        weights.append(sign * weight)
    return np.concatenate(texels, axis=1)[usable], np.concatenate(weights, axis=1)[usable]


def _taps(point: Float, size: Int, offset: Int) -> tuple[Int, Float]:
    """The four texels that bilinear filtering reads at a point (n, 2), texels, and their weights."""
    corner = np.floor(point).astype(np.int64)
    part = point - corner
    texel, weight = [], []
    for down in (0, 1):
        for right in (0, 1):
            place = np.clip(corner + np.array([right, down]), 0, size - 1)
            texel.append(offset + place[:, 1] * size[:, 0] + place[:, 0])
            weight.append((part[:, 0] if right else 1 - part[:, 0]) * (part[:, 1] if down else 1 - part[:, 1]))
    return np.stack(texel, axis=1), np.stack(weight, axis=1)


def _solve(column: Int, weight: Float, anchor: Float, value: Float) -> Float:
    """The change d (m, 3) that minimises anchor d^2 + SEAM_WEIGHT (difference of value + d across the seams)^2."""
    count = len(anchor)

    def transposed(rows: Float) -> Float:
        return np.stack([np.bincount(column.ravel(), (weight * rows[:, k, None]).ravel(), count) for k in range(3)], 1)

    def differences(x: Float) -> Float:
        return np.asarray((weight[:, None] @ x[column])[:, 0])

    def apply(x: Float) -> Float:
        return anchor[:, None] * x + SEAM_WEIGHT * transposed(differences(x))

    diagonal = anchor + SEAM_WEIGHT * np.bincount(column.ravel(), (weight**2).ravel(), count)
    residual = -SEAM_WEIGHT * transposed(differences(value))
    change = np.zeros_like(value)
    direction = z = residual / diagonal[:, None]
    rho = (residual * z).sum(axis=0)
    goal = TOLERANCE**2 * rho
    for _ in range(MOST_STEPS):
        if (rho <= goal).all():
            break
        image = apply(direction)
        curvature = (direction * image).sum(axis=0)
        step = np.where(curvature > 0, rho / np.where(curvature > 0, curvature, 1), 0)
        change = change + step * direction
        residual = residual - step * image
        z = residual / diagonal[:, None]
        rho, before = (residual * z).sum(axis=0), rho
        direction = z + np.where(before > 0, rho / np.where(before > 0, before, 1), 0) * direction
    return change

"""Light on mesh corners: sample it inside the triangles, then fit the colours that come closest to it.

Colours sampled at the vertices themselves miss what lies between (a shadow's edge, a lamp's pool of light); the fit of
least squares over the surface does not (Kavan, Bargteil & Sloan, Least Squares Vertex Baking, 2011).
"""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from .components import components, shared_edges
from .corner_samples import CornerSamples, cuts_of
from .layout import flat_triangles, receiving, world_areas
from .lumels import place
from .mesh_walks import sample_neighbours
from .neighbours import Neighbours
from .parallel import Run
from .pieces import weld
from .receivers import Receivers
from .scene import Scene
from .settings import Settings
from .triangle_normals import corner_normals

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]


class Fit(Protocol):
    """From values (n, 3) at the receivers to colours of the corners."""

    def __call__(self, values: Float, whole: Float | None = None) -> list[Float | None]:
        """See `_Fitter.fit`."""
        ...


# Corners that meet share a colour if their normals turn by less: cosine of 30 degrees.
CREASE_COSINE = float(np.cos(np.radians(30)))
# Weight of the bends between neighbouring triangles against the misfit: enough that a shadow's edge does not ring.
SMOOTHNESS = 0.01
# The fit ends at this residual, relative, or after so many steps: well below what a bake's own error leaves, and the
# tail is long (143,000 triangles, most of them thin: 1e-3 after 40 steps, 3e-4 after 160).
TOLERANCE, MOST_STEPS = 2e-4, 40
# Times that colours below zero are held at zero and the rest is fitted again.
CLIPPINGS = 4


def corner_receivers(scene: Scene, settings: Settings, run: Run) -> tuple[Receivers, Neighbours, Fit]:
    """Where to sample the light for vertex colours, and what turns the samples into them.

    Returns
    -------
    receivers : n of them, several in each triangle.
    neighbours : which of them lie side by side.
    fit : from values (n, 3) at the receivers to one (count, 3, 3) float32 an object: triangle, corner, channel; None
        for an object that is not baked. No value is below zero.

    Raises
    ------
    NothingToBake
        If no object receives light.
    """
    chosen, triangle, area = _chosen_triangles(scene, settings)
    samples = CornerSamples.of(area, settings)
    own = triangle[samples.triangle]
    position, normal = place(scene, own, samples.weight)
    footprint = np.zeros((len(own), 2, 2), np.float32)
    footprint[:, 0, 0] = footprint[:, 1, 1] = samples.side
    receivers = Receivers(position.astype(np.float32), normal.astype(np.float32), own.astype(np.int32),
                          samples.weight.astype(np.float32), footprint)
    fitter = _Fitter(scene, chosen, triangle, area, samples)
    return receivers, sample_neighbours(_corners(scene, triangle), fitter.node, samples, run), fitter.fit


def sample_count(scene: Scene, settings: Settings) -> int:
    """How many receivers `corner_receivers` makes, without making them.

    Raises
    ------
    NothingToBake
        If no object receives light.
    """
    *_, area = _chosen_triangles(scene, settings)
    return int((cuts_of(area, settings) ** 2).sum())


def _chosen_triangles(scene: Scene, settings: Settings) -> tuple[list[int], Int, Float]:
    """The objects that are baked, their triangles (t,), and the areas of these (t,) in m2, 0 for flat ones."""
    chosen = receiving(scene, settings)
    triangle = np.concatenate([np.arange(len(scene.triangles))[scene.surfaces[index].triangles] for index in chosen])
    return chosen, triangle, np.where(flat_triangles(scene), 0, world_areas(scene))[triangle]


def _corners(scene: Scene, triangle: Int) -> Float:
    """(t, 3, 3) metres about the scene's origin."""
    return np.asarray(scene.vertices[scene.triangles[triangle]] - scene.origin)


class _Fitter:
    """Colours x of the shared corners that minimise

        sum over samples  area (sum over corners b_c x_c - y)^2
        + SMOOTHNESS  sum over edges  area (bend across the edge)^2

    by conjugate gradients, matrix-free: 3 x 3 sums a triangle, 6 coefficients an edge.
    """

    def __init__(self, scene: Scene, chosen: list[int], triangle: Int, area: Float, samples: CornerSamples) -> None:
        self.chosen, self.surface_count = chosen, len(scene.surfaces)
        self.counts = [scene.surfaces[index].count for index in chosen]
        self.samples, self.triangles = samples, len(triangle)
        self.basis = np.column_stack([1 - samples.weight.sum(axis=1), samples.weight])
        place_of = _places(scene, chosen, triangle)
        self.node = _shared_corners(scene, chosen, triangle, place_of)
        self.nodes = int(self.node.max()) + 1
        pairs = [(a, b) for a in range(3) for b in range(3)]
        self.mass = np.stack([self._per_triangle(self.basis[:, a] * self.basis[:, b]) for a, b in pairs], axis=1)
        self.mass = self.mass.reshape(-1, 3, 3)
        self.bend_node, self.bend = _bends(_corners(scene, triangle), self.node, area)
        diagonal = np.bincount(self.node.ravel(), np.einsum("tcc->tc", self.mass).ravel(), self.nodes)
        diagonal += np.bincount(self.bend_node.ravel(), (self.bend**2).ravel(), self.nodes)
        self.colour_of = _nearest_lit(self.node, place_of, diagonal > 0)
        self.inverse_diagonal = np.where(diagonal > 0, 1 / np.where(diagonal > 0, diagonal, 1), 0)[:, None]

    def fit(self, values: Float, whole: Float | None = None) -> list[Float | None]:
        """From (n, 3) values at the samples to (count, 3, 3) float32 of each object.

        whole : if the values are a part of these, corners are held at zero where these would be, and parts may be
            below zero: so they add up to the whole.
        """
        if whole is None:
            return self._by_object(np.maximum(self._fitted(values)[0], 0))
        return self._by_object(self._fitted(values, self._fitted(whole)[1])[0])

    def _fitted(self, values: Float, free: NDArray[np.bool_] | None = None) -> tuple[Float, NDArray[np.bool_]]:
        """Colours of the nodes (nodes, 3), and which are not held at zero; found out if it is not given."""
        values = np.asarray(values, np.float64)
        load = np.stack([[self._per_triangle(self.basis[:, c] * values[:, k]) for k in range(3)] for c in range(3)])
        right = self._scatter(self.node, load.transpose(2, 0, 1))
        weight = self._scatter(self.node, np.repeat(np.einsum("tcd->tc", self.mass)[:, :, None], 3, axis=2))
        # The mean of the light near each corner: the start, and the answer where samples say no more.
        start: Float = np.where(weight > 0, right / np.where(weight > 0, weight, 1), 0)
        if free is not None:
            return self._solve(start * free, right, free), free
        free = np.ones(start.shape, bool)
        x = start
        for _ in range(CLIPPINGS):
            x = self._solve(x * free, right, free)
            if (x >= 0).all():
                break
            free &= x >= 0  # held at zero, and the others fitted again: cutting alone would add light
        return x, free

    def _by_object(self, nodes: Float) -> list[Float | None]:
        colours = nodes[self.colour_of].astype(np.float32)
        result: list[Float | None] = [None] * self.surface_count
        for index, part in zip(self.chosen, np.split(colours, np.cumsum(self.counts)[:-1]), strict=True):
            result[index] = part
        return result

    def _solve(self, x: Float, right: Float, free: NDArray[np.bool_]) -> Float:
        """Conjugate gradients with the diagonal as preconditioner, all channels side by side (Saad 2003, 9.2), over the
        free unknowns; the others keep their value.
        """
        residual = (right - self._apply(x)) * free
        direction = z = self.inverse_diagonal * residual
        rho = (residual * z).sum(axis=0)
        goal = TOLERANCE**2 * (right * self.inverse_diagonal * right).sum(axis=0)
        for _ in range(MOST_STEPS):
            if (rho <= goal).all():
                break
            image = self._apply(direction) * free
            curvature = (direction * image).sum(axis=0)
            step = np.where(curvature > 0, rho / np.where(curvature > 0, curvature, 1), 0)
            x = x + step * direction
            residual = residual - step * image
            z = self.inverse_diagonal * residual
            rho, before = (residual * z).sum(axis=0), rho
            direction = z + np.where(before > 0, rho / np.where(before > 0, before, 1), 0) * direction
        return x

    def _apply(self, x: Float) -> Float:
        """The normal equations' matrix times (nodes, 3)."""
        result = self._scatter(self.node, self.mass @ x[self.node])
        bend = (self.bend[:, None] @ x[self.bend_node])[:, 0]
        return result + self._scatter(self.bend_node, self.bend[:, :, None] * bend[:, None])

    def _scatter(self, node: Int, values: Float) -> Float:
        """Sums of values (..., 3) at their nodes: (nodes, 3)."""
        return np.stack([np.bincount(node.ravel(), values[..., k].ravel(), self.nodes) for k in range(3)], axis=1)

    def _per_triangle(self, values: Float) -> Float:
        return np.asarray(np.bincount(self.samples.triangle, values * self.samples.area, self.triangles), np.float64)


def _places(scene: Scene, chosen: list[int], triangle: Int) -> Int:
    """(t, 3) int64: corners of one object at one place have the same number."""
    owner = np.repeat(np.arange(len(chosen)), [scene.surfaces[index].count for index in chosen])
    key = weld(scene.vertices)[scene.triangles[triangle]] + owner[:, None] * len(scene.vertices)
    return np.asarray(np.unique(key, return_inverse=True)[1]).reshape(-1, 3)


def _nearest_lit(node: Int, place_of: Int, lit: NDArray[np.bool_]) -> Int:
    """(t, 3) node whose colour each corner shows: its own, or where no sample tells it (a triangle without area) that
    of another at the same place.
    """
    other = np.full(int(place_of.max()) + 1, -1)
    told = lit[node]
    other[place_of[told]] = node[told]
    found = other[place_of]
    return np.asarray(np.where(told | (found < 0), node, found))


def _shared_corners(scene: Scene, chosen: list[int], triangle: Int, place_of: Int) -> Int:
    """(t, 3) int64: corners that share a colour have the same number.

    Joined are the same corner of the mesh (`Surface.corner_ids`), and corners on both sides of an edge of one object
    whose normals are nearly the same.
    """
    normal = corner_normals(scene, triangle)
    first, second, side, other = shared_edges(place_of)
    ends = []
    for a, b in ((side, (other + 1) % 3), ((side + 1) % 3, other)):
        # The other triangle usually runs along the edge the other way; if not, its corners are the other way about.
        swap = place_of[first, a] != place_of[second, b]
        b = np.where(swap, np.where(b == other, (other + 1) % 3, other), b)
        smooth = (normal[first, a] * normal[second, b]).sum(axis=1) > CREASE_COSINE
        ends.append(np.column_stack([first * 3 + a, second * 3 + b])[smooth])
    corner = np.concatenate([_corner_numbers(scene, index) for index in chosen])
    corner += np.repeat(np.cumsum([0] + [int(_corner_numbers(scene, i).max()) + 1 for i in chosen[:-1]]),
                        [scene.surfaces[i].count for i in chosen])[:, None]
    flat = corner.ravel()
    order = np.argsort(flat, kind="stable")
    same = flat[order[1:]] == flat[order[:-1]]
    ends.append(np.column_stack([order[:-1][same], order[1:][same]]))
    pairs = np.concatenate(ends)
    return components(3 * len(triangle), pairs[:, 0], pairs[:, 1]).reshape(-1, 3)


def _corner_numbers(scene: Scene, index: int) -> Int:
    """(count, 3) int64: an object's corners as its mesh counts them."""
    surface = scene.surfaces[index]
    if surface.corner_ids is None:
        return np.arange(3 * surface.count).reshape(-1, 3)
    return np.asarray(surface.corner_ids, np.int64)


def _bends(corners: Float, node: Int, area: Float) -> tuple[Int, Float]:
    """For every edge inside a smooth part, nodes and coefficients (e, 6) of how much the slope changes across it.

    A triangle's slope away from an edge is (value at its third corner - value at the foot of its height) / height; the
    sum of both sides' slopes is zero where the light is linear across the edge. Times the lower height, so that thin
    triangles do not dominate, and the root of the weight.
    """
    first, second, side, other = shared_edges(node)
    parts = []
    for triangle, start in ((first, side), (second, other)):
        p, q, a = (corners[triangle, (start + step) % 3] for step in range(3))
        along = ((a - p) * (q - p)).sum(axis=1) / np.maximum(((q - p) ** 2).sum(axis=1), 1e-300)
        height = np.linalg.norm(a - p - along[:, None] * (q - p), axis=1)
        nodes = np.stack([node[triangle, (start + step) % 3] for step in range(3)], axis=1)
        parts.append((nodes, np.column_stack([along - 1, -along, np.ones(len(along))]), height))
    (nodes, row, height), (nodes_2, row_2, height_2) = parts
    usable = (area[first] > 0) & (area[second] > 0) & (height > 0) & (height_2 > 0)
    least = np.minimum(height, height_2)
    scale = np.sqrt(SMOOTHNESS * (area[first] + area[second]))[usable, None]
    row = (row * (least / np.where(height > 0, height, 1))[:, None])[usable] * scale
    row_2 = (row_2 * (least / np.where(height_2 > 0, height_2, 1))[:, None])[usable] * scale
    return np.concatenate([nodes[usable], nodes_2[usable]], axis=1), np.concatenate([row, row_2], axis=1)

"""The first look at a bake: the light of a few thousand places, spread over every surface that is baked.

It needs no layout of lumels, so it is there before anything is unwrapped. Works on arrays alone.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..solver.errors import NothingToBake
from ..solver.geometry import Geometry
from ..solver.lights import Light
from ..solver.parallel import Run
from ..solver.scene import Scene, Sky, surface_of_triangle
from ..solver.settings import Settings
from .binding import NO_OPAQUE_FACE
from .coarse_light import Places, coarse_light
from .confined import confined
from .look import Look, mean_colours, receiving_triangles

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]

# The places that are looked at, at most: as many as two cores answer in about a second.
PLACES = 4096
# Pieces that triangles are cut into beyond their own number, at most, and the sides of the cuts.
MORE_PIECES = 2**17
MOST_CUTS = 32
# The length of a piece grows by this factor until there are few enough of both.
COARSER = 1.3
# How far a place stands in from the corner of its piece, as part of the way to the middle: corners lie in edges.
INWARD = 0.3


class Shapes:
    """What a first look needs to know of a scene before its sky is known.

    Raises
    ------
    NothingToBake
        If nothing is there to be shown.
    """

    def __init__(self, scene: Scene) -> None:
        self.shown = receiving_triangles(scene)
        if not len(self.shown):
            raise NothingToBake(NO_OPAQUE_FACE)
        hidden = np.setdiff1d(np.arange(len(scene.triangles)), self.shown, assume_unique=True)
        self.geometry = Geometry(scene)
        self.grids = [_Grid(self.geometry, triangles) for triangles in (self.shown, hidden) if len(triangles)]


def first_look(shapes: Shapes, light: tuple[Sky, Sequence[Light]], settings: Settings,
               cancelled: Callable[[], bool]) -> Look:
    """A coarse look at the whole scene.

    Parameters
    ----------
    shapes : of the scene, with its lamps.
    light : its sky, and the sky's suns.

    Raises
    ------
    Cancelled, SceneError, NothingToBake
        As `solver.bake`.
    """
    sky, suns = light
    dark = shapes.geometry.scene
    scene = replace(dark, sky=sky, lights=(*dark.lights, *suns))
    run = Run(settings.thread_count, None, cancelled, stage="first look")
    got = coarse_light(shapes.geometry.in_light_of(scene), settings, _joined(scene, shapes.grids), run) / np.pi
    grid = shapes.grids[0]
    reflectance, glow = mean_colours(scene)
    triangle = shapes.shown[grid.parent]
    colour = got[grid.place] * reflectance[triangle][:, None] + glow[triangle][:, None]
    return Look("first look", np.asarray(grid.pieces, np.float32), np.zeros((len(triangle), 3, 2), np.float32),
                np.full(len(triangle), -1, np.int32), np.asarray(colour, np.float32), ())


class _Grid:
    """Some triangles of a scene, cut into pieces whose corners share places.

    Attributes
    ----------
    triangles : of the scene.
    pieces, parent, place : see `places`.
    points, normals, surface : of the places, see `Places`.
    """

    def __init__(self, geometry: Geometry, triangles: Int) -> None:
        scene = geometry.scene
        self.triangles = triangles
        corners = scene.vertices[scene.triangles[triangles]]
        self.pieces, self.parent, first, self.place = places(corners)
        piece, corner = np.unravel_index(first, self.place.shape)
        middle, whole = self.pieces[piece].mean(axis=1), corners[self.parent[piece]].mean(axis=1)
        at = self.pieces[piece, corner]
        self.normals = _normals(corners[self.parent[piece]])
        self.points = _open(geometry, (at + INWARD * (middle - at), middle, whole), self.normals)
        self.surface = surface_of_triangle(scene)[triangles[self.parent[piece]]]
        # The pieces of a triangle lie next to each other, side x side of them.
        number = np.bincount(self.parent, minlength=len(triangles))
        self._side = np.rint(np.sqrt(number)).astype(np.int64)
        self._start = np.empty(len(triangles), np.int64)
        self._start[self.parent[::-1]] = np.arange(len(self.parent))[::-1]

    def nearest(self, index: Int, u: Float, v: Float) -> Int:
        """The nearest place of points on the triangles `index` of this grid, at barycentric (u, v)."""
        side = self._side[index]
        across, along = u * side, v * side
        i, j = np.floor(across).astype(np.int64), np.floor(along).astype(np.int64)
        # Rounding may lead over an edge.
        i = np.clip(i, 0, side - 1)
        j = np.clip(j, 0, side - 1 - i)
        across, along = across - i, along - j
        upright = (across + along <= 1) | (i + j == side - 1)
        piece = np.where(upright, i * side + j, (side - 1 - i) * side + (side - 1 - j))
        weight = np.where(upright[:, None], np.stack([1 - across - along, across, along], 1),
                          np.stack([across + along - 1, 1 - across, 1 - along], 1))
        return np.asarray(self.place[self._start[index] + piece, weight.argmax(axis=1)])


def _open(geometry: Geometry, choices: tuple[Float, ...], normals: Float) -> Float:
    """Of several points (n, 3) for each place the first that is not confined; where all are, the first."""
    points = choices[0].copy()
    left = np.flatnonzero(confined(geometry, points, normals))
    for choice in choices[1:]:
        shut = confined(geometry, choice[left], normals[left])
        points[left[~shut]] = choice[left[~shut]]
        left = left[shut]
    return points


def _joined(scene: Scene, grids: list[_Grid]) -> Places:
    """The places of all grids, of which those of the first are wanted."""
    count = len(scene.triangles)
    grid_of, row, offset = np.zeros(count, np.int8), np.zeros(count, np.int64), 0
    offsets = []
    for number, grid in enumerate(grids):
        grid_of[grid.triangles], row[grid.triangles] = number, np.arange(len(grid.triangles))
        offsets.append(offset)
        offset += len(grid.points)

    def nearest(triangle: Int, u: Float, v: Float) -> Int:
        found = np.empty(len(triangle), np.int64)
        for number, grid in enumerate(grids):
            here = np.flatnonzero(grid_of[triangle] == number)
            found[here] = offsets[number] + grid.nearest(row[triangle[here]], u[here], v[here])
        return found

    return Places(np.concatenate([grid.points for grid in grids]), np.concatenate([grid.normals for grid in grids]),
                  np.concatenate([grid.surface for grid in grids]), len(grids[0].points), nearest)


def places(corners: Float) -> tuple[Float, Int, Int, Int]:
    """Triangles cut into pieces whose corners share places.

    Parameters
    ----------
    corners : (t, 3, 3), metres.

    Returns
    -------
    Pieces (p, 3, 3); each one's triangle (p,); where, among all corners of pieces, each place was first met (n,); and
    the place of every corner of the pieces (p, 3).
    """
    edges = np.roll(corners, -1, axis=1) - corners
    longest = np.sqrt((edges**2).sum(axis=2)).max(axis=1)
    area = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1).sum() / 2
    length = max(float(np.sqrt(area / PLACES)), 1e-30)
    while True:
        cuts = np.clip(2 ** np.ceil(np.log2(np.maximum(longest / length, 1))), 1, MOST_CUTS).astype(np.int64)
        if (cuts**2).sum() <= len(corners) + MORE_PIECES:
            pieces, parent = _cut(corners, cuts)
            first, place = _welded(pieces, _facing(corners)[parent], length)
            if len(first) <= PLACES:
                return pieces, parent, first, place
        length *= COARSER


def _cut(corners: Float, cuts: Int) -> tuple[Float, Int]:
    """Every triangle as cuts x cuts pieces: their corners (p, 3, 3) and triangles (p,)."""
    found, parents = [], []
    for count in np.unique(cuts):
        some = np.flatnonzero(cuts == count)
        weight = _weights(int(count))
        found.append(np.einsum("pij,tjk->tpik", weight, corners[some]).reshape(-1, 3, 3))
        parents.append(np.repeat(some, len(weight)))
    return np.concatenate(found), np.concatenate(parents)


def _weights(count: int) -> Float:
    """(count^2, 3, 3) weights of a triangle's corners at the corners of its pieces."""
    row, column = np.divmod(np.arange(count * count), count)
    upright = row + column < count
    u, v = np.where(upright, row, count - row), np.where(upright, column, count - column)
    step = np.where(upright, 1, -1)
    corner = np.stack([np.stack([u, v], 1), np.stack([u + step, v], 1), np.stack([u, v + step], 1)], 1) / count
    return np.concatenate([1 - corner.sum(axis=2, keepdims=True), corner], axis=2)


def _welded(pieces: Float, facing: Int, length: float) -> tuple[Int, Int]:
    """Corners in the same cube of the given length, on surfaces that face the same way, are one place."""
    cube = np.rint((pieces.reshape(-1, 3) - pieces.reshape(-1, 3).min(axis=0)) / length).astype(np.int64)
    span = cube.max(axis=0) + 1
    key = ((cube[:, 0] * span[1] + cube[:, 1]) * span[2] + cube[:, 2]) * 6 + np.repeat(facing, 3)
    _, first, place = np.unique(key, return_index=True, return_inverse=True)
    return first, place.reshape(-1, 3)


def _normals(corners: Float) -> Float:
    """(t, 3) unit normals."""
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return np.asarray(normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30))


def _facing(corners: Float) -> Int:
    """(t,) the axis that each triangle faces along, 0 ... 5."""
    normal = _normals(corners)
    axis = np.abs(normal).argmax(axis=1)
    return np.asarray(2 * axis + (normal[np.arange(len(normal)), axis] < 0))

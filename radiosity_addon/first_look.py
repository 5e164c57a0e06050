"""The first look at a bake: the light of a few thousand places, spread over every surface that is baked.

It needs no layout of lumels, so it is there before anything is unwrapped. Works on arrays alone.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ..solver.bake import irradiance
from ..solver.scene import Scene, surface_of_triangle
from ..solver.settings import Settings
from .look import Look, mean_colours, receiving_triangles

Float = NDArray[np.float64]
Int = NDArray[np.int64]

# The places that are looked at, at most: as many as two cores answer in about a second.
PLACES = 4096
# Pieces that triangles are cut into beyond their own number, at most, and the sides of the cuts.
MORE_PIECES = 2**17
MOST_CUTS = 32
# The length of a piece grows by this factor until there are few enough of both.
COARSER = 1.3
# The error of a first look; see `solver.plan` for what it spends.
ERROR = 0.3
# How far a place stands in from the corner of its piece, as part of the way to the middle: corners lie in edges.
INWARD = 0.3


def first_look(scene: Scene, settings: Settings, progress: Callable[[str, float], None],
               cancelled: Callable[[], bool]) -> Look:
    """A coarse look at the whole scene.

    Raises
    ------
    Cancelled, SceneError, NothingToBake
        As `solver.bake`.
    """
    chosen = receiving_triangles(scene)
    corners = scene.vertices[scene.triangles[chosen]]
    pieces, parent, first, place = places(corners)
    normals = _normals(corners)
    at = np.unravel_index(first, place.shape)
    middle = pieces[at[0]].mean(axis=1)
    points = pieces[at] + INWARD * (middle - pieces[at])
    rough = Settings(error=ERROR, passes=settings.passes, seed=settings.seed, threads=settings.threads)
    owner = surface_of_triangle(scene)[chosen[parent[at[0]]]]
    light = irradiance(scene, rough, points, normals[parent[at[0]]], progress, cancelled, owner) / np.pi
    reflectance, glow = mean_colours(scene)
    triangle = chosen[parent]
    colour = light[place] * reflectance[triangle][:, None]
    return Look("first look", np.asarray(pieces, np.float32), np.zeros((len(pieces), 3, 2), np.float32),
                np.full(len(pieces), -1, np.int32), np.asarray(colour, np.float32), glow[triangle], ())


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

"""Fans of rays: cosine-distributed quasi-random rays from many receivers at once.

What all rays of a receiver share is worked out once a receiver: the plane of its footprint, its normal, the frame
about it. The shift of the azimuth (Cranley & Patterson 1976) turns that frame instead of every direction, and rays are
products of small matrices. Where a smooth surface turns within a footprint, each ray has a frame of its own.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .footprints import ReceiverFootprints
from .receivers import Receivers
from .sampling import cosine_directions, frames, kronecker, shifted, shifts

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]
Bool = NDArray[np.bool_]

# Normals that stay within this cosine over a footprint are taken as one: the mean over angles up to t from the middle
# differs by t^2 / 6, less than .1 % here.
SAME_NORMAL = 0.998
# Where the shading normal is off the triangle's own by more than this cosine, rays can lead under the surface. Nothing
# comes from there (as in Cycles).
STRAIGHT = 1 - 1e-6


class Fans:
    """Rays of receivers; point sets' dimensions 0 and 1 are the direction, 2 and 3 the place on the footprint.

    Parameters
    ----------
    places : the receivers.
    """

    def __init__(self, places: ReceiverFootprints) -> None:
        self._places = places
        geometry, receivers = places.geometry, places.receivers
        solid = ~places.free
        triangle = np.maximum(receivers.triangle, 0)
        u, v = receivers.barycentric.T
        flat = geometry.point(triangle, u, v)
        self._start = geometry.lifted(flat, triangle, np.ones(len(triangle), bool))
        edges = geometry.corners[triangle, 1:] - geometry.corners[triangle, :1]
        self._across = np.matmul(places.step, edges) * solid[:, None, None]
        self._normal = geometry.shading_normal(triangle, u, v)
        free = np.flatnonzero(places.free)
        self._start[free] = places.free_start(free)
        self._normal[free] = receivers.normal[free]
        self._whole, self._bent = places.free.copy(), np.zeros(len(triangle), bool)
        self._look_at_corners(np.flatnonzero(solid))
        self._frames = frames(self._normal)
        self._flat_normal = geometry.normal[triangle]
        self._steep = solid & (np.einsum("ij,ij->i", self._flat_normal, self._normal) < STRAIGHT)

    def __len__(self) -> int:
        return len(self.receivers)

    @property
    def receivers(self) -> Receivers:
        """Whose rays these are."""
        return self._places.receivers

    def rays(self, rows: Int, count: int, seed: int) -> tuple[Float, Float, Bool | None]:
        """Of each receiver of `rows`, `count` rays.

        Returns
        -------
        Origins and unit directions (n * count, 3) float32, and at which rays' starts light can arrive (n * count,)
        bool; None for all.
        """
        points = kronecker(count, 4)
        move = shifts(self._places.identity[rows], 4, seed)
        local = np.empty((len(rows), 3, count), np.float32)
        local[:, 0], local[:, 1] = shifted(points[:, 2], move[:, 2]), shifted(points[:, 3], move[:, 3])
        local[:, :2] -= np.float32(0.5)
        local[:, 2] = 1
        astride = np.flatnonzero(~self._whole[rows])
        if len(astride):
            local[astride, :2] = self._inside(rows[astride], local[astride, :2])
        plane = np.concatenate([self._across[rows], self._start[rows, None]], axis=1)
        origins = np.matmul(local.transpose(0, 2, 1), plane)
        hidden = np.flatnonzero(self._places.hidden[rows])
        lit = self._lit(rows, hidden, local) if len(hidden) else None
        bent = np.flatnonzero(self._bent[rows])
        normals = self._normals(rows[bent], local[bent, :2]) if len(bent) else None

        height = shifted(points[:, 0], move[:, 0])
        turn, azimuth = np.float32(2 * np.pi) * move[:, 1, None], np.float32(2 * np.pi) * points[:, 1]
        first, second = self._frames[0][rows], self._frames[1][rows]
        turned = np.stack([first * np.cos(turn) + second * np.sin(turn), second * np.cos(turn) - first * np.sin(turn),
                           self._normal[rows]], axis=1)
        radius = np.sqrt(height)
        np.multiply(radius, np.cos(azimuth), out=local[:, 0])
        np.multiply(radius, np.sin(azimuth), out=local[:, 1])
        np.sqrt(1 - height, out=local[:, 2])
        directions = np.matmul(local.transpose(0, 2, 1), turned)
        if normals is not None:
            around = shifted(points[:, 1], move[bent, 1])
            directions[bent] = cosine_directions(normals, height[bent].reshape(-1, 1), around.reshape(-1, 1)).reshape(
                len(bent), count, 3)
        steep = np.flatnonzero(self._steep[rows] | self._bent[rows])
        if len(steep):
            lit = np.ones(len(directions) * count, bool) if lit is None else lit
            above = np.matmul(directions[steep], self._flat_normal[rows[steep], :, None])[..., 0] > 0
            lit.reshape(-1, count)[steep] &= above
        return origins.reshape(-1, 3), directions.reshape(-1, 3), lit

    def _look_at_corners(self, solid: Int) -> None:
        """Find the footprints that lie whole in their triangles, and those over which a smooth surface turns."""
        geometry, receivers = self._places.geometry, self._places.receivers
        triangle, centre, step = receivers.triangle[solid], receivers.barycentric[solid], self._places.step[solid]
        whole, least = np.ones(len(solid), bool), np.ones(len(solid), np.float32)
        for x, y in ((-0.5, -0.5), (0.5, -0.5), (-0.5, 0.5), (0.5, 0.5)):
            corner = centre + step[:, 0] * np.float32(x) + step[:, 1] * np.float32(y)
            whole &= (corner >= 0).all(axis=1) & (corner.sum(axis=1) <= 1)
            corner = np.clip(corner, 0, 1)
            corner /= np.maximum(corner.sum(axis=1), 1)[:, None]
            turned = np.einsum("ij,ij->i", geometry.shading_normal(triangle, *corner.T), self._normal[solid])
            least = np.minimum(least, turned)
        self._whole[solid], self._bent[solid] = whole, least < SAME_NORMAL

    def _weights(self, rows: Int, local: Float) -> Float:
        """Barycentric (n, count, 2) of places (n, 2, count) about the middles of footprints."""
        return np.asarray(self._places.receivers.barycentric[rows, None]
                          + np.matmul(local.transpose(0, 2, 1), self._places.step[rows]))

    def _inside(self, rows: Int, local: Float) -> Float:
        """The places (n, 2, count); those off the triangle are replaced, in turn, by those on it, or by its middle."""
        weights = self._weights(rows, local)
        inside = (weights >= 0).all(axis=2) & (weights.sum(axis=2) <= 1)
        nowhere = ~inside.any(axis=1)
        local[nowhere] = 0
        inside[nowhere] = True
        number = inside.sum(axis=1)
        first = np.cumsum(number) - number
        kept = np.nonzero(inside)[1]
        row, column = np.nonzero(~inside)
        lost = local.shape[2] - number
        turn = np.arange(len(row)) - np.repeat(np.cumsum(lost) - lost, lost)
        local[row, :, column] = local[row, :, kept[first[row] + turn % number[row]]]
        return local

    def _normals(self, rows: Int, local: Float) -> Float:
        """Shading normals (n * count, 3) at places (n, 2, count)."""
        weights = self._weights(rows, local).reshape(-1, 2)
        triangle = np.repeat(self._places.receivers.triangle[rows], local.shape[2])
        return self._places.geometry.shading_normal(triangle, weights[:, 0], weights[:, 1])

    def _lit(self, rows: Int, hidden: Int, local: Float) -> Bool:
        """(n * count,) whether no touching face lies on the start of each ray."""
        geometry = self._places.geometry
        weights = self._weights(rows[hidden], local[hidden, :2]).reshape(-1, 2)
        triangle = np.repeat(self._places.receivers.triangle[rows[hidden]], local.shape[2])
        lit = np.ones((len(rows), local.shape[2]), bool)
        found = geometry.buried.find(geometry.point(triangle, weights[:, 0], weights[:, 1]), triangle)
        lit[hidden] = ~found.reshape(len(hidden), -1)
        return lit.reshape(-1)


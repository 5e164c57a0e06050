"""Footprints of receivers as flat pieces of surface, so that many points of each are one small matrix product."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from .footprints import ReceiverFootprints

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]
Bool = NDArray[np.bool_]

# Normals that stay within this cosine over a footprint are taken as one: the mean over angles up to t from the middle
# differs by t^2 / 6, less than .1 % here.
SAME_NORMAL = 0.998


class Planes:
    """The planes of footprints.

    Attributes
    ----------
    normal : (n, 3) float32, shading normals at the middles.
    bent : (n,) bool, where a smooth surface turns within the footprint.
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
        self.normal = geometry.shading_normal(triangle, u, v)
        free = np.flatnonzero(places.free)
        self._start[free] = places.free_start(free)
        self.normal[free] = receivers.normal[free]
        self._whole, self.bent = places.free.copy(), np.zeros(len(triangle), bool)
        self._look_at_corners(np.flatnonzero(solid))

    def places(self, rows: Int, x: Float, y: Float) -> Float:
        """Places on the planes of `rows` at x and y (n, k) in [0, 1): (n, 3, k) float32, from the middle in steps of
        the footprint, with 1 in the last row. Those off the triangle are replaced by others on it."""
        local = np.empty((len(rows), 3, x.shape[1]), np.float32)
        np.subtract(x, np.float32(0.5), out=local[:, 0])
        np.subtract(y, np.float32(0.5), out=local[:, 1])
        local[:, 2] = 1
        astride = np.flatnonzero(~self._whole[rows])
        if len(astride):
            local[astride, :2] = self._inside(rows[astride], local[astride, :2])
        return local

    def points(self, rows: Int, local: Float) -> Float:
        """(n * k, 3) float32: the points at `places`, lifted off the surface."""
        across, start = (np.take(table, rows, axis=0) for table in (self._across, self._start))
        plane = np.concatenate([across, start[:, None]], axis=1)
        return np.asarray(np.matmul(local.transpose(0, 2, 1), plane)).reshape(-1, 3)

    def normals(self, rows: Int, local: Float) -> Float:
        """(n * k, 3) float32: shading normals at `places`, each its own."""
        weights, triangle = self._weights(rows, local[:, :2])
        return self._places.geometry.shading_normal(triangle, weights[:, 0], weights[:, 1])

    def buried(self, rows: Int, local: Float) -> Bool:
        """(n * k,) whether a touching face lies on the points at `places`."""
        weights, triangle = self._weights(rows, local[:, :2])
        geometry = self._places.geometry
        return geometry.buried.find(geometry.point(triangle, weights[:, 0], weights[:, 1]), triangle)

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
            turned = np.einsum("ij,ij->i", geometry.shading_normal(triangle, *corner.T), self.normal[solid])
            least = np.minimum(least, turned)
        self._whole[solid], self.bent[solid] = whole, least < SAME_NORMAL

    def _barycentric(self, rows: Int, local: Float) -> Float:
        """Barycentric (n, k, 2) of places (n, 2, k)."""
        return np.asarray(np.take(self._places.receivers.barycentric, rows, axis=0)[:, None]
                          + np.matmul(local.transpose(0, 2, 1), np.take(self._places.step, rows, axis=0)))

    def _weights(self, rows: Int, local: Float) -> tuple[Float, Int]:
        """Barycentric (n * k, 2) of places (n, 2, k), and their triangles."""
        triangle = np.repeat(self._places.receivers.triangle[rows], local.shape[2])
        return self._barycentric(rows, local).reshape(-1, 2), triangle

    def _inside(self, rows: Int, local: Float) -> Float:
        """The places (n, 2, k); those off the triangle are replaced, in turn, by those on it, or by its middle."""
        weights = self._barycentric(rows, local)
        u, v = weights[..., 0], weights[..., 1]
        inside = (u >= 0) & (v >= 0) & (u + v <= 1)
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

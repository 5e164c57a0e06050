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

# Normals that stay within this cosine over a footprint are taken as one for what comes from all around: the mean over
# angles up to t from the middle differs by t^2 / 6, less than .1 % here. A lamp may shine along the surface, where half
# a footprint faces away from it: its light is in doubt by t.
SAME_NORMAL, SAME_FOR_LAMPS = 0.998, 0.9999
# Places along each side of a footprint astride of its triangle's edge, at whose mean its normal is taken.
PLACES = 4
# The corners of a footprint, from the middle in steps of it.
CORNERS = np.array([[[-0.5, 0.5, -0.5, 0.5], [-0.5, -0.5, 0.5, 0.5]]], np.float32)
# Corner normals that cancel out to less than this are of no use.
LOST = 1e-6


class Planes:
    """The planes of footprints.

    Attributes
    ----------
    normal : (n, 3) float32, shading normals at the middles of what lies on the triangles.
    bent : (n,) bool, where a smooth surface turns within the footprint.
    turning : (n,) bool, where it turns so much that lamps find a difference.
    """

    def __init__(self, places: ReceiverFootprints) -> None:
        self._places = places
        geometry, receivers = places.geometry, places.receivers
        solid = ~places.free
        triangle = np.maximum(receivers.triangle, 0)
        flat = geometry.point(triangle, *receivers.barycentric.T)
        self._start = geometry.lifted(flat, triangle, np.ones(len(triangle), bool))
        edges = geometry.corners[triangle, 1:] - geometry.corners[triangle, :1]
        self._across = np.matmul(places.step, edges) * solid[:, None, None]
        corners = self._barycentric(np.arange(len(triangle)), CORNERS)
        self._whole = places.free | _on_triangle(corners).all(axis=1)
        self.normal = geometry.shading_normal(triangle, *self._middles().T)
        free = np.flatnonzero(places.free)
        self._start[free] = places.free_start(free)
        self.normal[free] = receivers.normal[free]
        least = self._least_turned(np.flatnonzero(solid), corners)
        self.bent, self.turning = least < SAME_NORMAL, least < SAME_FOR_LAMPS

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
        """(n * k, 3) float32: shading normals at `places` of smooth surfaces, each its own."""
        receivers, corners = self._places.receivers, self._places.geometry.scene.corner_normals
        assert corners is not None
        corners = np.take(corners.reshape(-1, 9), receivers.triangle[rows], axis=0).reshape(-1, 3, 3)
        edges = corners[:, 1:] - corners[:, :1]
        # Before they are made as long as 1, they change evenly over a triangle.
        middle = corners[:, :1] + np.matmul(receivers.barycentric[rows, None], edges)
        plane = np.concatenate([np.matmul(self._places.step[rows], edges), middle], axis=1)
        blended = np.matmul(local.transpose(0, 2, 1), plane)
        length = np.sqrt(np.einsum("nkc,nkc->nk", blended, blended))
        lost = np.nonzero(~(length > LOST))
        blended[lost], length[lost] = self.normal[rows[lost[0]]], 1
        blended /= length[..., None]
        return np.asarray(blended.reshape(-1, 3))

    def buried(self, rows: Int, local: Float) -> Bool:
        """(n * k,) whether a touching face lies on the points at `places`."""
        weights, triangle = self._weights(rows, local[:, :2])
        geometry = self._places.geometry
        return geometry.buried.find(geometry.point(triangle, weights[:, 0], weights[:, 1]), triangle)

    def _middles(self) -> Float:
        """(n, 2) barycentric middle of each footprint, or of what of it lies on its triangle."""
        middles = np.array(self._places.receivers.barycentric)
        astride = np.flatnonzero(~self._whole)
        along = (np.arange(PLACES, dtype=np.float32) + np.float32(0.5)) / PLACES - np.float32(0.5)
        place = self._barycentric(astride, np.stack(np.meshgrid(along, along)).reshape(1, 2, -1))
        inside = _on_triangle(place)
        count = inside.sum(axis=1, keepdims=True)
        mean = (place * inside[..., None]).sum(axis=1) / np.maximum(count, 1)
        middles[astride] = np.where(count > 0, mean, middles[astride])
        return middles

    def _least_turned(self, solid: Int, corners: Float) -> Float:
        """(n,) the least cosine between normals at the middles and at the corners (n, 4, 2), held to the triangles."""
        least, geometry = np.ones(len(self.normal), np.float32), self._places.geometry
        if geometry.scene.corner_normals is None:
            return least
        triangle = self._places.receivers.triangle[solid]
        for corner in corners[solid].transpose(1, 0, 2):
            held = np.clip(corner, 0, 1)
            held /= np.maximum(held.sum(axis=1), 1)[:, None]
            turned = np.einsum("ij,ij->i", geometry.shading_normal(triangle, *held.T), self.normal[solid])
            least[solid] = np.minimum(least[solid], turned)
        return least

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
        inside = _on_triangle(self._barycentric(rows, local))
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


def _on_triangle(weights: Float) -> Bool:
    """Which of some barycentric places (..., 2) lie on their triangles."""
    u, v = weights[..., 0], weights[..., 1]
    return np.asarray((u >= 0) & (v >= 0) & (u + v <= 1))

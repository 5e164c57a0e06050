"""Fans of rays: cosine-distributed quasi-random rays from many receivers at once.

What all rays of a receiver share is worked out once a receiver: the plane of its footprint (`planes.py`), its normal,
the frame about it. The shift of the azimuth (Cranley & Patterson 1976) turns that frame instead of every direction, and
rays are products of small matrices. Where a smooth surface turns within a footprint, each ray has a frame of its own.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .footprints import ReceiverFootprints
from .guides import Guides
from .receivers import Receivers
from .sampling import cosine_directions, frames, interleaved, rays_of_places, shifted, shifts

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]
Bool = NDArray[np.bool_]

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
        self.places, self._planes = places, places.planes
        self._frames = frames(self._planes.normal)
        self._flat_normal = places.flat_normals(np.arange(len(places)))
        straight = np.einsum("ij,ij->i", self._flat_normal, self._planes.normal) >= STRAIGHT
        self._steep = self._planes.bent | ~straight

    def __len__(self) -> int:
        return len(self.receivers)

    @property
    def receivers(self) -> Receivers:
        """Whose rays these are."""
        return self.places.receivers

    def _shifts(self, rows: Int, seed: int) -> Float:
        """(n, 4)"""
        move = shifts(self.places.identity[rows], 4, seed)
        if self.receivers.texel is not None:
            move[:, :2] = interleaved(self.receivers.texel[rows], self.places.surface[rows], seed + 77)
        return move

    def coordinates(self, rows: Int, count: int, seed: int) -> tuple[Float, Float]:
        """(n, count) float32 in [0, 1) of the first of such rays: squared sine of the polar angle, and part of a
        turn."""
        points, move = rays_of_places(count), self._shifts(rows, seed)
        return shifted(points[:, 0], move[:, 0]), shifted(points[:, 1], move[:, 1])

    def rays(self, rows: Int, count: int, seed: int, start: int = 0,
             guides: Guides | None = None) -> tuple[Float, Float, NDArray[Any] | None]:
        """Of each receiver of `rows`, `count` rays, from point `start` of the point set on.

        Returns
        -------
        Origins and unit directions (n * count, 3) float32, and at which rays' starts light can arrive (n * count,)
        bool, None for all; with guides how many cosine-distributed rays each stands for, float32, 0 for those.
        """
        points = rays_of_places(count, start)
        move = self._shifts(rows, seed)
        local = self._planes.places(rows, shifted(points[:, 2], move[:, 2]), shifted(points[:, 3], move[:, 3]))
        origins = self._planes.points(rows, local)
        hidden = np.flatnonzero(self.places.hidden[rows])
        bent = np.flatnonzero(self._planes.bent[rows])
        steep = np.flatnonzero(self._steep[rows])
        lit = np.ones((len(rows), count), bool) if len(hidden) or len(steep) else None
        if lit is not None and len(hidden):
            lit[hidden] = ~self._planes.buried(rows[hidden], local[hidden]).reshape(-1, count)
        normals = self._planes.normals(rows[bent], local[bent]) if len(bent) else None

        height = shifted(points[:, 0], move[:, 0])
        first, second, normal = (np.take(table, rows, axis=0) for table in (*self._frames, self._planes.normal))
        weight = None
        if guides is None:
            turn, azimuth = np.float32(2 * np.pi) * move[:, 1, None], np.float32(2 * np.pi) * points[:, 1]
            first, second = (first * np.cos(turn) + second * np.sin(turn),
                             second * np.cos(turn) - first * np.sin(turn))
        else:
            height, around, weight = guides.aim(rows, height, shifted(points[:, 1], move[:, 1]))
            azimuth = np.float32(2 * np.pi) * around
        turned = np.stack([first, second, normal], axis=1)
        radius = np.sqrt(height)
        np.multiply(radius, np.cos(azimuth), out=local[:, 0])
        np.multiply(radius, np.sin(azimuth), out=local[:, 1])
        np.sqrt(1 - height, out=local[:, 2])
        directions = np.matmul(local.transpose(0, 2, 1), turned)
        if normals is not None:
            along = shifted(points[:, 1], move[bent, 1]) if weight is None else around[bent]
            directions[bent] = cosine_directions(normals, height[bent].reshape(-1, 1), along.reshape(-1, 1)).reshape(
                len(bent), count, 3)
        if lit is not None and len(steep):
            lit[steep] &= np.matmul(directions[steep], self._flat_normal[rows[steep], :, None])[..., 0] > 0
        counts = weight if lit is None else lit if weight is None else weight * lit
        return origins, directions.reshape(-1, 3), None if counts is None else counts.reshape(-1)

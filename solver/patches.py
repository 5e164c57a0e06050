"""Patches: clusters of cells that carry one value of smooth indirect light each.

A patch is the met sides of cells in one voxel that face one way (the nearest of the six axes) and belong to one
surface. Voxels grow with the distance from the receivers, so that far ground costs what it is worth.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .cells import Cells
from .footprints import CellFootprints

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]

# Voxels double in size when the distance from the receivers' box is beyond this many voxels, and again at twice that.
FAR_VOXELS = 32.0
_LEVELS = 24


class Patches:
    """Sides of cells grouped by voxel, direction and surface.

    Parameters
    ----------
    size : edge of a voxel near the receivers, metres.
    low, high : (3,) the receivers' bounding box, about the scene's origin.

    Attributes
    ----------
    key : (p, 4) int64, what tells a patch from another.
    """

    def __init__(self, size: float, low: Float, high: Float) -> None:
        self.size = size
        self._low, self._high = np.asarray(low, np.float64), np.asarray(high, np.float64)
        self._index: dict[int, int] = {}

    def __len__(self) -> int:
        return len(self._index)

    def of(self, cells: Cells, sides: NDArray[np.int64]) -> NDArray[np.int32]:
        """The patch of each side (n,) int32; new patches are numbered in the order of their keys."""
        half = np.full(len(sides), 1 / 3, np.float32)
        points, normals = CellFootprints(cells, sides).sample(np.arange(len(sides)), half, half)
        keys, inverse = np.unique(self._keys(points.astype(np.float64), normals), return_inverse=True)
        numbers = np.empty(len(keys), np.int32)
        for place, key in enumerate(keys.tolist()):
            numbers[place] = self._index.setdefault(key, len(self._index))
        return numbers[inverse.reshape(-1)]

    def _keys(self, points: Float, normals: Float) -> NDArray[np.uint64]:
        outside = np.maximum(np.maximum(self._low - points, points - self._high), 0).max(axis=1)
        level = np.ceil(np.log2(np.maximum(outside / (FAR_VOXELS * self.size), 1)))
        level = np.minimum(level, _LEVELS).astype(np.int64)
        voxel = np.floor((points - self._low) / (self.size * 2.0**level)[:, None]).astype(np.int64)
        axis = np.argmax(np.abs(normals), axis=1)
        facing = 2 * axis + (normals[np.arange(len(normals)), axis] > 0)
        with np.errstate(over="ignore"):
            key = np.zeros(len(points), np.uint64)
            for part in (voxel[:, 0], voxel[:, 1], voxel[:, 2], level * 8 + facing):
                key = (key ^ part.astype(np.uint64)) * np.uint64(0x9E3779B97F4A7C15)
                key ^= key >> np.uint64(29)
        return key

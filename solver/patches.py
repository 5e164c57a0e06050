"""Patches: clusters of cells that carry one value of smooth indirect light each.

A patch is the met sides of cells in one box of an octree that face one way (the nearest of the six axes). A box is
split where the receivers look often (`grow`), and where the solution turns out to vary inside it (`split`), so that
their number follows the light and not the triangles.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]
Keys = NDArray[np.uint64]

MOST_LEVELS = 24


class Patches:
    """Boxes of an octree, by facing.

    Parameters
    ----------
    low, high : (3,) the scene's bounding box about its origin.
    smallest : no box is split below this edge, metres.

    Attributes
    ----------
    level : (p,) int32 of each patch; its box has the edge `edge / 2^level`.
    """

    def __init__(self, low: Float, high: Float, smallest: float) -> None:
        self._low = np.asarray(low, np.float64)
        self.edge = max(float(np.max(np.asarray(high, np.float64) - self._low)) * 1.001, 1e-30)
        self.depth = int(np.clip(np.floor(np.log2(max(self.edge / smallest, 1.0))), 0, MOST_LEVELS))
        self._split: list[Keys] = [np.empty(0, np.uint64) for _ in range(self.depth + 1)]
        self._index: dict[int, int] = {}
        self.key = np.empty(0, np.uint64)
        self.level = np.empty(0, np.int32)

    def __len__(self) -> int:
        return len(self.key)

    def size(self) -> Float:
        """(p,) float32: the edge of each patch's box, metres."""
        return np.asarray(self.edge / 2.0**self.level, np.float32)

    def grow(self, points: Float, normals: Float, weight: Float, most: float) -> None:
        """Split boxes until none that can be split holds more than `most` of the weight."""
        points = points.astype(np.float64)
        for level in range(self.depth):
            keys, inverse = np.unique(self._keys(points, normals, level), return_inverse=True)
            heavy = np.bincount(inverse.reshape(-1), weight, len(keys)) > most
            self._add_split(level, keys[heavy])
            inside = heavy[inverse.reshape(-1)]
            points, normals, weight = points[inside], normals[inside], weight[inside]
            if not len(points):
                break

    def split(self, patches: Int) -> None:
        """Split the boxes of some patches; those at the smallest size stay."""
        for level in range(self.depth):
            self._add_split(level, self.key[patches[self.level[patches] == level]])

    def of(self, points: Float, normals: Float) -> NDArray[np.int32]:
        """The patch of each point (n,) int32; new patches are numbered in the order of their levels and keys."""
        points = points.astype(np.float64)
        numbers = np.full(len(points), -1, np.int32)
        rest = np.arange(len(points))
        for level in range(self.depth + 1):
            keys = self._keys(points[rest], normals[rest], level)
            deeper = _contains(self._split[level], keys)
            numbers[rest[~deeper]] = self._numbers(keys[~deeper], level)
            rest = rest[deeper]
            if not len(rest):
                break
        return numbers

    def part(self, points: Float, patches: Int) -> NDArray[np.uint8]:
        """Which eighth of its patch's box each point lies in, 0 ... 7."""
        half = self.edge / 2.0 ** (self.level[patches] + 1)
        voxel = np.floor((points - self._low) / half[:, None]).astype(np.int64) & 1
        return np.asarray(voxel @ np.array([1, 2, 4]), np.uint8)

    def _numbers(self, keys: Keys, level: int) -> NDArray[np.int32]:
        unique, inverse = np.unique(keys, return_inverse=True)
        numbers = np.empty(len(unique), np.int32)
        fresh = []
        for place, key in enumerate(unique.tolist()):
            number = self._index.get(key)
            if number is None:
                number = self._index[key] = len(self._index)
                fresh.append(key)
            numbers[place] = number
        self.key = np.concatenate([self.key, np.array(fresh, np.uint64)])
        self.level = np.concatenate([self.level, np.full(len(fresh), level, np.int32)])
        return numbers[inverse.reshape(-1)]

    def _add_split(self, level: int, keys: Keys) -> None:
        self._split[level] = np.union1d(self._split[level], keys)

    def _keys(self, points: Float, normals: Float, level: int) -> Keys:
        voxel = np.floor((points - self._low) * (2.0**level / self.edge)).astype(np.int64)
        axis = np.argmax(np.abs(normals), axis=1)
        facing = 2 * axis + (normals[np.arange(len(normals)), axis] > 0)
        with np.errstate(over="ignore"):
            key = np.zeros(len(points), np.uint64)
            for part in (voxel[:, 0], voxel[:, 1], voxel[:, 2], level * 8 + facing):
                key = (key ^ part.astype(np.uint64)) * np.uint64(0x9E3779B97F4A7C15)
                key ^= key >> np.uint64(29)
        return key


def _contains(sorted_keys: Keys, keys: Keys) -> NDArray[np.bool_]:
    if not len(sorted_keys):
        return np.zeros(len(keys), bool)
    place = np.minimum(np.searchsorted(sorted_keys, keys), len(sorted_keys) - 1)
    return np.asarray(sorted_keys[place] == keys)

"""Shells: the connected pieces of the mesh, joined where corners lie at the same place."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .components import components

Float = NDArray[np.floating[Any]]


@dataclass(frozen=True, eq=False)
class Shells:
    """The shell of each triangle (t,) int32, and the longest side of each shell's bounding box (s,) float32, metres."""

    of_triangle: NDArray[np.int32]
    extent: Float

    @classmethod
    def of(cls, corners: Float) -> Shells:
        """Find the shells of triangles (t, 3, 3) float32."""
        count = len(corners)
        place = _same_place(corners.reshape(-1, 3))
        # Triangles are nodes 0 ... count - 1, places follow; every corner is an edge.
        label = components(count + int(place.max(initial=-1)) + 1, np.repeat(np.arange(count), 3), count + place)
        shell = label[:count]
        order = np.argsort(shell, kind="stable")
        begins = np.searchsorted(shell[order], np.arange(int(shell.max(initial=-1)) + 1))
        if not count:
            return cls(np.empty(0, np.int32), np.empty(0, np.float32))
        low = np.minimum.reduceat(corners.min(axis=1)[order], begins)
        high = np.maximum.reduceat(corners.max(axis=1)[order], begins)
        return cls(shell.astype(np.int32), np.asarray((high - low).max(axis=1), np.float32))


def _same_place(points: Float) -> NDArray[np.int64]:
    """(n,) a number for each point, the same for points that are equal to the last bit."""
    bits = np.ascontiguousarray(points + np.float32(0), np.float32).view(np.uint32).astype(np.uint64)
    key = np.zeros(len(points), np.uint64)
    with np.errstate(over="ignore"):
        for axis in range(3):
            key = (key ^ bits[:, axis]) * np.uint64(0x9E3779B97F4A7C15)
            key ^= key >> np.uint64(31)
    return np.asarray(np.unique(key, return_inverse=True)[1]).reshape(-1).astype(np.int64)

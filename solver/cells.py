"""Cells: every triangle cut on its own barycentric grid, so that a hit finds its cell by arithmetic.

A triangle with n divisions has n^2 congruent cells; a small triangle is one cell. Both sides of a cell are kept
apart. A cell is given a row in the tables only when a ray first meets it ("model no more than a scene needs").
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .geometry import Geometry

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]

# Most sides of cells, whether met or not: the map from cell to row is untouched memory until one is met (4 bytes).
MAX_SIDES = 2**26
# Finest grid on one triangle.
MAX_DIVISIONS = 2**12
NOTHING = -1


class Cells:
    """The sides of cells that rays have met.

    Parameters
    ----------
    geometry : the triangles.
    size : wanted edge of a cell, metres; grows where there would be more than MAX_SIDES.

    Attributes
    ----------
    triangle, front : (rows,) of each met side of a cell.
    """

    def __init__(self, geometry: Geometry, size: float) -> None:
        self.geometry = geometry
        while True:
            # n^2 cells of area size^2 / 2 each.
            divisions = np.ceil(np.sqrt(2.0 * geometry.area.astype(np.float64)) / size)
            self.divisions = np.clip(divisions, 1, MAX_DIVISIONS).astype(np.int64)
            count = self.divisions**2
            if count.sum() * 2 <= MAX_SIDES or size > 1e30:
                break
            size *= 1.5
        self.size = size
        self.base = np.concatenate([[0], np.cumsum(count)[:-1]]) * 2
        self._divisions32 = self.divisions.astype(np.float32)
        self._row_of = np.zeros(int(count.sum()) * 2, np.int32)  # 0: not met; else row + 1
        self.side = np.empty(0, np.int64)

    def __len__(self) -> int:
        return len(self.side)

    def sides(self, triangle: Int, u: Float, v: Float, front: NDArray[np.bool_]) -> NDArray[np.int64]:
        """The side of a cell that each hit lies on: (n,) int64; NOTHING where triangle is negative."""
        met = triangle >= 0
        safe = np.where(met, triangle, 0)
        n = self._divisions32[safe]
        x, y = u * n, v * n
        i, j = x.astype(np.int32), y.astype(np.int32)
        upper = (x - i) + (y - j) > 1
        whole = self.divisions[safe]
        # Rounding may leave the triangle by a hair.
        i = np.clip(i, 0, whole - 1)
        j = np.clip(j, 0, whole - 1 - i)
        upper &= j < whole - 1 - i
        cell = i * (2 * whole - i) + 2 * j + upper
        return np.where(met, self.base[safe] + 2 * cell + front, NOTHING)

    def meet(self, sides: NDArray[np.int64]) -> slice:
        """Give rows to the sides that have none yet, in the order of their numbers; return the new rows."""
        sides = sides[sides >= 0]
        fresh = np.unique(sides[self._row_of[sides] == 0])
        first = len(self.side)
        self._row_of[fresh] = np.arange(first + 1, first + 1 + len(fresh), dtype=np.int32)
        self.side = np.concatenate([self.side, fresh])
        return slice(first, len(self.side))

    def rows(self, sides: NDArray[np.int64]) -> NDArray[np.int32]:
        """The row of each side; NOTHING where it has none."""
        return np.where(sides >= 0, self._row_of[np.maximum(sides, 0)] - 1, NOTHING).astype(np.int32)

    def triangle_of(self, side: NDArray[np.int64]) -> NDArray[np.int32]:
        """The triangle of each side."""
        return np.asarray(np.searchsorted(self.base, side, side="right") - 1, np.int32)

    def area(self, side: NDArray[np.int64]) -> Float:
        """The area of each side, m2."""
        triangle = self.triangle_of(side)
        return np.asarray(self.geometry.area[triangle] / self._divisions32[triangle] ** 2, np.float32)

    def places(self, side: NDArray[np.int64], x: Float, y: Float) -> tuple[NDArray[np.int32], Float, Float, NDArray[np.bool_]]:
        """Points of cells: (triangle, u, v, front) at the unit square's (x, y), area-preserving, for each side."""
        triangle = self.triangle_of(side)
        local = side - self.base[triangle]
        front = (local & 1).astype(bool)
        cell = local >> 1
        n = self.divisions[triangle]
        i = n - np.ceil(np.sqrt((n * n - cell).astype(np.float64))).astype(np.int64)
        rest = cell - i * (2 * n - i)
        j, upper = rest >> 1, (rest & 1).astype(bool)
        # Fold the unit square onto the triangle below its diagonal.
        over = x + y > 1
        x, y = np.where(over, 1 - x, x), np.where(over, 1 - y, y)
        x, y = np.where(upper, 1 - x, x), np.where(upper, 1 - y, y)
        scale = 1 / self._divisions32[triangle]
        return triangle, np.asarray((i + x) * scale, np.float32), np.asarray((j + y) * scale, np.float32), front

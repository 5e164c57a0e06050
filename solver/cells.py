"""Cells: every triangle cut on a grid of its own, so that a hit finds its cell by arithmetic.

The grid runs along the two sides that meet at the triangle's widest angle, so that cells are about as long as wide
however thin the triangle is; a small triangle is one cell. Both sides of a cell are kept apart. A cell is given a row
in the tables only when a ray first meets it ("model no more than a scene needs").

A cell can hold others, which have rows of their own while it stands for all of its area:

* Where the light varies much inside a cell, as right beside a lamp, it can be divided: what meets it later reads FINER
  times FINER smaller ones.
* Rays that start at the back of a triangle are inside of a solid, as a rule, and see the cell from there: they read
  another cell at the same place. A floor is lit around the foot of a chair and dark inside of it.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .geometry import Geometry
from .growing import Growing
from .paged import Paged
from .sampling import kronecker

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]

# Most sides of cells, whether met or not: the number of a pair of sides fits 31 bits.
MAX_SIDES = 2**32 - 2
# Finest grid along one side of a triangle.
MAX_DIVISIONS = 2**15
# By how much the most cells of a triangle are lowered at once, until all are few enough.
FEWER = 1.25
NOTHING = -1
# Along each edge of a cell that is divided, and most cells that are.
FINER, MOST_DIVIDED = 4, 2**16
# The cells that a cell holds are numbered: smaller ones line by line, then that which is seen from behind.
FROM_BEHIND = FINER**2
HELD = FINER**2 + 1
# The weights of the two corners after the widest (which is corner 0, 1 or 2), each as a product with (u, v, 1, 0).
_AXES = np.array([[1, 0, 0, 0, 0, 1, 0, 0], [0, 1, 0, 0, -1, -1, 1, 0], [-1, -1, 1, 0, 1, 0, 0, 0]], np.float32)


class Cells:
    """The sides of cells that rays have met.

    Parameters
    ----------
    geometry : the triangles.
    size : wanted edge of a cell, metres; larger on the largest triangles where there would be more than MAX_SIDES.

    Attributes
    ----------
    divisions : (t, 2) int64, how many cells the two sides of each triangle are cut into.
    """

    def __init__(self, geometry: Geometry, size: float) -> None:
        self.geometry = geometry
        self._first, lengths = _widest_corner(geometry.corners)
        self.size, self.divisions = size, _divisions(lengths, size)
        count = self.divisions.prod(axis=1)
        self._base = np.concatenate([[0], np.cumsum(count)[:-1]]) * 2
        self._share_of_cell = np.asarray(1 / count, np.float32)
        # What a hit's cell follows from: its column and line are products of (u, v, 1) with a row of `_axes`.
        self._axes = _AXES[self._first] * np.repeat(self.divisions, 4, axis=1).astype(np.float32)
        columns = [self._base >> 1, self.divisions[:, 0] - 1, self.divisions[:, 1], self.divisions[:, 1] - 1]
        self._grid = np.stack(columns, axis=1).astype(np.int32)
        # Sides from here on are those of held cells: HELD pairs for each pair before.
        self._first_held = int(count.sum()) * 2
        # 0: not met; else row + 1.
        self._row_of = Paged(self._first_held)
        self._side = Growing((), np.int64)
        # For each row + 1, whether it is divided; and how many are.
        self._divided, self._divisions_made = Growing((), np.bool_), 0
        self._divided.append(np.zeros(1, np.bool_))
        # For each side 0 or the line of what it holds; in each line, for each held cell, 0 or row + 1.
        self._line_of = Paged(self._first_held)
        self._row_of_held = Growing((HELD,), np.int32)
        self._row_of_held.append(np.zeros((1, HELD), np.int32))

    def __len__(self) -> int:
        return len(self._side)

    @property
    def side(self) -> NDArray[np.int64]:
        """(rows,) int64, the met sides of cells, in the order of their rows."""
        return np.asarray(self._side.values)

    def sides(self, triangle: Int, u: Float, v: Float, front: NDArray[np.bool_],
              behind: NDArray[np.bool_] | None = None) -> NDArray[np.int64]:
        """The side of a cell that each hit lies on: (n,) int64; NOTHING where triangle is negative.

        behind : (n,) hits of rays that came from the back of a triangle.
        """
        # Where triangle is negative, this reads the last triangle's.
        axes, grid = np.take(self._axes, triangle, axis=0), np.take(self._grid, triangle, axis=0)
        x = axes[:, 0] * u + axes[:, 1] * v + axes[:, 2]
        y = axes[:, 4] * u + axes[:, 5] * v + axes[:, 6]
        i, j = np.minimum(x.astype(np.int32), grid[:, 1]), np.minimum(y.astype(np.int32), grid[:, 3])
        side = (grid[:, 0] + i * grid[:, 2] + j).astype(np.int64)
        side <<= 1
        side += front
        side[triangle < 0] = NOTHING
        if behind is not None:
            rows = np.flatnonzero(behind & (triangle >= 0))
            side[rows] = self._held(side[rows], FROM_BEHIND)
        if self._divisions_made:
            divided = np.take(self._divided.values, self._row_of.take(side))
            rows = np.flatnonzero(divided & (side >= 0) & (side < self._first_held))
            inside = [np.clip((place[rows] - whole[rows]) * FINER, 0, FINER - 1).astype(np.int32)
                      for place, whole in ((x, i), (y, j))]
            side[rows] = self._held(side[rows], inside[0] * FINER + inside[1])
        return np.asarray(side)

    def _held(self, side: Int, number: Int | int) -> Int:
        """The side of a held cell, by its number in the cell that holds it."""
        return self._first_held + ((side >> 1) * HELD + number) * 2 + (side & 1)

    def _holding(self, side: NDArray[np.int64]) -> tuple[NDArray[np.int64], Int]:
        """The cell that holds each held one (else itself), and its number in there (else -1)."""
        held = side >= self._first_held
        pair = (side - self._first_held) >> 1
        number = np.where(held, pair % HELD, -1)
        return np.where(held, pair // HELD * 2 + (side & 1), side), number

    def meet(self, sides: NDArray[np.int64]) -> slice:
        """Give rows to the sides that have none yet, in the order of their numbers; return the new rows."""
        fresh = self.unmet(sides)
        first = len(self)
        new = np.arange(first + 1, first + 1 + len(fresh), dtype=np.int32)
        whole = int(np.searchsorted(fresh, self._first_held))
        self._row_of.put(fresh[:whole], new[:whole])
        if whole < len(fresh):
            holding, number = self._holding(fresh[whole:])
            self._hold(np.unique(holding[self._line_of.take(holding) == 0]))
            self._row_of_held.values[self._line_of.take(holding), number] = new[whole:]
        self._side.append(fresh)
        self._divided.append(np.zeros(len(fresh), np.bool_))
        return slice(first, len(self))

    def _hold(self, sides: NDArray[np.int64]) -> None:
        """Give sides that hold nothing yet a line for what they will hold."""
        first = len(self._row_of_held)
        self._line_of.put(sides, np.arange(first, first + len(sides)))
        self._row_of_held.append(np.zeros((len(sides), HELD), np.int32))

    def divide(self, rows: Int) -> None:
        """Let what meets these cells from now on read smaller ones; held ones are not divided."""
        rows = rows[(self.side[rows] < self._first_held) & ~self._divided.values[rows + 1]]
        rows = rows[:MOST_DIVIDED - self._divisions_made]
        self._divided.values[rows + 1] = True
        self._divisions_made += len(rows)

    def unmet(self, sides: NDArray[np.int64]) -> NDArray[np.int64]:
        """The sides that have no row yet, each once, in the order of their numbers."""
        return np.asarray(np.unique(sides[self.are_new(sides)]))

    def are_held(self, sides: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Which of the sides (n,) are of cells that others hold."""
        return np.asarray(sides >= self._first_held)

    def are_new(self, sides: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Which of the sides (n,) are cells without a row."""
        return np.asarray((self._number(sides) == 0) & (sides >= 0))

    def rows(self, sides: NDArray[np.int64]) -> NDArray[np.int32]:
        """The row of each side; NOTHING where it has none."""
        return np.asarray(self._number(sides) - np.int32(1))

    def _number(self, sides: NDArray[np.int64]) -> NDArray[np.int32]:
        """0 where a side has no row, else row + 1."""
        number = self._row_of.take(sides)
        held = np.flatnonzero(sides >= self._first_held)
        holding, place = self._holding(sides[held])
        number[held] = self._row_of_held.values[self._line_of.take(holding), place]
        number[sides < 0] = 0
        return number

    def companions(self, most: int) -> NDArray[np.int64]:
        """All cells on the sides of triangles of which one was met; none where that would be more than `most`."""
        triangle = self.triangle_of(self.side)
        face = np.unique(triangle.astype(np.int64) * 2 + (self.side & 1))
        triangle, front = face >> 1, face & 1
        count = self.divisions[triangle].prod(axis=1)
        if count.sum() > most:
            return np.empty(0, np.int64)
        number = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
        columns = np.repeat(self.divisions[triangle], count, axis=0)
        i, j = np.divmod(number, columns[:, 1])
        inside = i / columns[:, 0] + j / columns[:, 1] < 1 - 1e-9
        return np.asarray((np.repeat(self._base[triangle] + front, count) + 2 * number)[inside])

    def fronts(self, most: int) -> NDArray[np.int64]:
        """The cells at points spread evenly over the fronts of all triangles that have an area: about two points a
        cell, fewer where these would be more than `most`, at least one a triangle."""
        triangle = np.flatnonzero(self.geometry.area > 0)
        boxes = self.divisions[triangle].prod(axis=1)
        count = np.maximum(boxes * min(1.0, most / max(int(boxes.sum()), 1)), 1).astype(np.int64)
        number = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
        place = kronecker(int(count.max(initial=0)), 2)[number]
        # The half of the square beyond the triangle, folded back.
        u, v = np.where(place.sum(axis=1, keepdims=True) > 1, 1 - place, place).T
        return self.sides(np.repeat(triangle, count), u, v, np.ones(len(u), np.bool_))

    def triangle_of(self, side: NDArray[np.int64]) -> NDArray[np.int32]:
        """The triangle of each side."""
        return np.asarray(np.searchsorted(self._base, self._holding(side)[0], side="right") - 1, np.int32)

    def share(self, side: NDArray[np.int64], triangle: Int) -> Float:
        """(n,) float32: what each side covers of twice its triangle, cut by that or not."""
        number = self._holding(side)[1]
        smaller = (number >= 0) & (number < FROM_BEHIND)
        whole = np.take(self._share_of_cell, triangle)
        return np.where(smaller, whole / np.float32(FINER**2), whole)

    def area(self, side: NDArray[np.int64], *, of_each: bool = False) -> Float:
        """The area of each side, m2; of held ones only if asked for `of_each`, since it is that of what holds them."""
        box = _Box(self, side)
        counts = of_each | ~self.are_held(side)
        return np.asarray(2 * self.geometry.area[box.triangle] * np.where(counts, box.share, 0), np.float32)

    def places(self, side: NDArray[np.int64], x: Float,
               y: Float) -> tuple[NDArray[np.int32], Float, Float, NDArray[np.bool_]]:
        """Points of cells: (triangle, u, v, front) at the unit square's (x, y), area-preserving, for each side."""
        box = _Box(self, side)
        a, b = box.inside(x, y)
        first = self._first[box.triangle]
        w = 1 - a - b
        u = np.where(first == 0, a, np.where(first == 1, w, b))
        v = np.where(first == 0, b, np.where(first == 1, a, w))
        return box.triangle, np.asarray(u, np.float32), np.asarray(v, np.float32), (side & 1).astype(bool)


class _Box:
    """Cells as boxes of (a, b), the weights of two corners, cut by the triangle's third side a + b = 1.

    share : (n,) the part of the unit square of (a, b) that each covers.
    """

    def __init__(self, cells: Cells, side: NDArray[np.int64]) -> None:
        self.triangle = cells.triangle_of(side)
        divisions = cells.divisions[self.triangle]
        holding, number = cells._holding(side)
        i, j = np.divmod((holding - cells._base[self.triangle]) >> 1, divisions[:, 1])
        smaller = (number >= 0) & (number < FROM_BEHIND)
        row, column = np.divmod(np.where(smaller, number, 0), FINER)
        along = np.where(smaller, FINER, 1)
        self._a, self._b = 1 / (along * divisions[:, 0]), 1 / (along * divisions[:, 1])
        self._low_a, self._low_b = (along * i + row) * self._a, (along * j + column) * self._b
        # How much of a + b is left at the box's low corner, in boxes: the cut runs from (0, height) to (width, 0).
        rest = np.maximum(1 - self._low_a - self._low_b, 1e-9)
        self._width, self._height = rest / self._a, rest / self._b

    @property
    def _flat(self) -> Float:
        """Up to where, across the box, its full height lies inside the triangle: 0 ... 1."""
        return np.asarray(np.clip((self._height - 1) / self._height * self._width, 0, 1))

    @property
    def _slope(self) -> tuple[Float, Float, Float]:
        """The part where the cut runs: its width, and the heights at both ends."""
        flat = self._flat
        end = np.minimum(self._width, 1)
        return (np.maximum(end - flat, 0), np.clip(self._height * (1 - flat / self._width), 0, 1),
                np.clip(self._height * (1 - end / self._width), 0, 1))

    @property
    def share(self) -> Float:
        width, high, low = self._slope
        return np.asarray((self._flat + width * (high + low) / 2) * self._a * self._b)

    def inside(self, x: Float, y: Float) -> tuple[Float, Float]:
        """(a, b) at the unit square's (x, y), area-preserving."""
        flat = self._flat
        width, high, low = self._slope
        sloped = width * (high + low) / 2
        mass = x * (flat + sloped)
        # Inside the sloped part the height falls from `high` to `low`: invert the quadratic of the area so far.
        part = np.clip((mass - flat) / np.maximum(sloped, 1e-30), 0, 1)
        fall = high - low
        square = np.sqrt(np.maximum(high**2 - part * fall * (high + low), 0))
        along = np.where(fall > 1e-6, (high - square) / np.maximum(fall, 1e-30), part)
        s = np.where(mass <= flat, mass, flat + width * along)
        t = y * np.clip(self._height * (1 - s / self._width), 0, 1)
        return self._low_a + s * self._a, self._low_b + t * self._b


def _divisions(lengths: Float, size: float) -> NDArray[np.int64]:
    """(t, 2) into how many cells about `size` wide two sides (t, 2) of each triangle are cut.

    Where these would be more than MAX_SIDES, the triangles with the most get fewer, all as many: a ground plate out to
    the horizon costs nothing elsewhere.
    """
    most = float(MAX_SIDES)
    while True:
        coarser = np.sqrt(np.maximum((lengths / size).prod(axis=1) / most, 1))
        found = np.clip(np.ceil(lengths / (size * coarser[:, None])), 1, MAX_DIVISIONS).astype(np.int64)
        if found.prod(axis=1).sum() * 2 <= MAX_SIDES or most < 1:
            return np.asarray(found)
        most /= FEWER


def _widest_corner(corners: Float) -> tuple[NDArray[np.int8], Float]:
    """The corner opposite the longest side (t,), and the lengths of the two sides that meet there (t, 2)."""
    sides = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)  # side k joins corners k and k + 1
    longest = np.argmax(sides, axis=1)
    first = (longest + 2) % 3
    row = np.arange(len(corners))
    return first.astype(np.int8), np.stack([sides[row, first], sides[row, (first + 2) % 3]], axis=1)

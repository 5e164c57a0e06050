"""Patches: clusters of cells that carry one value of smooth indirect light each.

A patch is the met sides of cells in one box of an octree that face one way (the nearest of the six axes), lie in one
layer of the box across that way, have about the same room in front of them, are all fronts or all backs of their
triangles, and belong to one shell (small shells, gravel or leaves, are taken together): a board, its back and the wall
right behind it are three patches, and so are a pipe, its inside and what stands beside it, for they do not see the same
light. A box is split where the receivers look often (`grow`), and where the solution turns out to vary inside it
(`split`), so that the number of patches follows the light and not the triangles. Cells with a wall between them are of
different patches (`walls`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .geometry import Geometry
from .parallel import Run, shares
from .shells import Shells
from .visibility import Visibility
from .walls import comparable, walled

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]
Keys = NDArray[np.uint64]

MOST_LEVELS = 24
# Layers of a box across the way that its patches face.
LAYERS = 4
# Gaps narrower than the receivers' usual view are told apart by this factor, down to its power GAP_CLASSES.
GAP_FACTOR = 3.0
GAP_CLASSES = 8
# See `Patches.grow`.
NEAR_WEIGHT = 4.0
# Shells smaller than this part of a box are taken together in it.
SMALL_SHELL = 0.5
# Rooms that a box is told apart into, at most.
MOST_ROOMS = 4
# Points lie flat along an axis if they are apart by less than this part of the widest.
FLAT = np.float32(0.02)
# Spots of a thread's piece of work, and the fewest that are worth one.
CHUNK, LEAST = 2**15, 2**11


@dataclass(frozen=True, eq=False)
class Spots:
    """Points of surfaces: where they lie (n, 3), the way they face (n, 3), their triangles (n,), the free distance in
    front of them (n,) metres, inf for the open, and whether they are on the triangles' fronts (n,)."""

    points: Float
    normals: Float
    triangle: Int
    gap: Float
    front: NDArray[np.bool_]

    @classmethod
    def at(cls, geometry: Geometry, triangle: Int, u: Float, v: Float, front: NDArray[np.bool_]) -> Spots:
        """The spots at barycentric points of triangles; one ray each looks for what is in front."""
        points = geometry.point(triangle, u, v)
        normals = np.take(geometry.normal, triangle, axis=0)
        normals = np.where(front[:, None], normals, -normals)
        ahead = geometry.visibility.hits(geometry.lifted(points, triangle, front), normals)
        gap = np.where(ahead.triangle >= 0, ahead.distance, np.float32(np.inf))
        return cls(points, normals, triangle, gap, front)

    def __len__(self) -> int:
        return len(self.gap)

    def take(self, index: Int | slice) -> Spots:
        """Some of the spots, by their numbers."""
        if isinstance(index, slice):
            return Spots(*(getattr(self, name)[index] for name in self.__dataclass_fields__))
        return Spots(*(np.take(getattr(self, name), index, axis=0) for name in self.__dataclass_fields__))

    @classmethod
    def join(cls, some: list[Spots]) -> Spots:
        """All of some."""
        return cls(*(np.concatenate([getattr(one, name) for one in some]) for name in cls.__dataclass_fields__))


class Patches:
    """Boxes of an octree, by facing.

    Parameters
    ----------
    shells : of the scene's triangles.
    low, high : (3,) the scene's bounding box about its origin.
    smallest : no box is split below this edge, metres.
    view : how far the receivers usually see, metres.
    visibility : what stands between cells; None if nothing does.

    Attributes
    ----------
    view : how far the receivers usually see, metres.
    level : (p,) int32 of each patch; its box has the edge `edge / 2^level`.
    """

    def __init__(self, shells: Shells, low: Float, high: Float, smallest: float, view: float,
                 visibility: Visibility | None = None) -> None:
        self._visibility = visibility
        # Of each patch, the place that others are compared with.
        self._place, self._facing = np.empty((0, 3), np.float32), np.empty((0, 3), np.float32)
        self._room = np.empty(0, np.float32)
        self._shells, self.view = shells, view
        self._low = np.asarray(low, np.float64)
        self.edge = max(float(np.max(np.asarray(high, np.float64) - self._low)) * 1.001, 1e-30)
        self.depth = int(np.clip(np.floor(np.log2(max(self.edge / smallest, 1.0))), 0, MOST_LEVELS))
        self._split: list[Keys] = [np.empty(0, np.uint64) for _ in range(self.depth + 1)]
        # The names of the patches, sorted, and the patch of each.
        self._names, self._number_of = np.empty(0, np.uint64), np.empty(0, np.int32)
        self.key = np.empty(0, np.uint64)
        self.level = np.empty(0, np.int32)

    def __len__(self) -> int:
        return len(self.key)

    def size(self) -> Float:
        """(p,) float32: the edge of each patch's box, metres."""
        return np.asarray(self.edge / 2.0**self.level, np.float32)

    def widths(self, patch: NDArray[np.int32], points: Float, area: Float) -> Float:
        """(p,) float32: how wide each patch is, from the spread of its cells and their own width, metres.

        The longest side of a box that is evenly filled is sqrt(12) standard deviations; the octree's box may be far
        wider than what of a patch lies in it.

        Parameters
        ----------
        patch, points, area : of cells: the patch (n,) of each, its middle (n, 3) in metres, and its area (n,) in m2.
        """
        count = len(self)
        number = np.maximum(np.bincount(patch, minlength=count), 1)
        square = np.zeros(count)
        for axis in range(3):
            place = points[:, axis].astype(np.float64)
            mean = np.bincount(patch, place, count) / number
            deviation = (place - mean[patch]) ** 2
            square = np.maximum(square, np.bincount(patch, deviation, count) / number)
        own = np.bincount(patch, area, count) / number
        return np.asarray(np.minimum(np.sqrt(12 * square + own), self.size()), np.float32)

    def uneven(self, patch: NDArray[np.int32], light: Float, peak: float, width: Float) -> Int:
        """Patches that reach over more than the receivers see at once and in which some cells are brighter than `peak`,
        others not; those first that differ most. Where a row matters little, its few rays don't tell.

        Of a slot beside a lamp few cells are known. They were in one patch with dark ones far away.

        Parameters
        ----------
        patch, light : of cells: the patch (n,) of each, and its radiosity by lamps alone (n,) float64, W/m2.
        width : (p,) see `widths`.
        """
        number, bright, whole, square = (np.bincount(patch, weight, len(self))
                                         for weight in (None, light > peak, light, light**2))
        uneven = np.flatnonzero((width > self.view) & (bright > 0) & (bright < number))
        varied = square[uneven] - whole[uneven] ** 2 / number[uneven]
        return np.asarray(uneven[np.argsort(-varied, kind="stable")])

    def grow(self, spots: Spots, weight: Float, seen_from: Float, most: float) -> None:
        """Split boxes until none that can be split holds more than `most` of the weight.

        Parameters
        ----------
        weight, seen_from : (n,) what each spot matters, and the distance from which it is looked at, metres. What is
            looked at from nearer than its box is wide counts NEAR_WEIGHT times: there the box would be seen through.
        """
        marks = self._marks(spots)
        for level in range(self.depth):
            keys, inverse = np.unique(self._keys(marks, level), return_inverse=True)
            counted = np.where(seen_from < self.edge / 2.0**level, weight * np.float32(NEAR_WEIGHT), weight)
            heavy = np.bincount(inverse.reshape(-1), counted, len(keys)) > most
            self._add_split(level, keys[heavy])
            inside = heavy[inverse.reshape(-1)]
            marks, weight, seen_from = marks.where(inside), weight[inside], seen_from[inside]
            if not len(weight):
                break

    def split(self, spots: Spots, patch: NDArray[np.int32], width: Float) -> None:
        """Split the boxes of some patches, down to boxes no wider than what of them lies there; those of the smallest
        size stay.

        Parameters
        ----------
        spots, patch : where the cells of these patches lie, and the patch (n,) of each.
        width : (p,) of all patches, see `widths`.
        """
        goal = np.ceil(np.log2(self.edge / np.maximum(width, self.edge * 2.0**-MOST_LEVELS))).astype(np.int32)
        goal = np.clip(goal, self.level + 1, self.depth)[patch]
        start, marks = self.level[patch], self._marks(spots)
        for level in range(int(start.min(initial=self.depth)), self.depth):
            self._add_split(level, self._keys(marks.where((start <= level) & (level < goal)), level))

    def of(self, spots: Spots, run: Run | None = None) -> NDArray[np.int32]:
        """The patch of each spot (n,) int32; new patches are numbered in the order of their names."""
        run = run or Run()
        if not len(spots):
            return np.empty(0, np.int32)
        boxes = run.map(lambda part: self._boxes(spots.take(part)), shares(len(spots), CHUNK, LEAST))
        keys, level = (np.concatenate([box[column] for box in boxes]) for column in (0, 1))
        return self._rooms(spots, keys, level, run)

    def _boxes(self, spots: Spots) -> tuple[Keys, Int]:
        """The box of each spot: its key and its level (n,)."""
        count = len(spots)
        keys, level = np.empty(count, np.uint64), np.empty(count, np.int32)
        rest, marks = np.arange(count), self._marks(spots)
        for depth in range(self.depth + 1):
            here = self._keys(marks, depth)
            deeper = _contains(self._split[depth], here)
            keys[rest[~deeper]], level[rest[~deeper]] = here[~deeper], depth
            rest, marks = rest[deeper], marks.where(deeper)
            if not len(rest):
                break
        return keys, level

    def _rooms(self, spots: Spots, keys: Keys, level: Int, run: Run) -> NDArray[np.int32]:
        """The patch of each spot (n,): of a box's patches the first that no wall hides from it."""
        numbers = self._numbers(spots, keys, keys, level)
        here = np.arange(len(keys))
        for room in range(1, MOST_ROOMS):
            parts = [here[part] for part in shares(len(here), CHUNK, LEAST)]
            walls = run.map(lambda some: self._walled(spots.take(some), numbers[some], level[some]), parts)
            here = here[np.concatenate(walls)]
            if not len(here):
                break
            behind = (keys[here] ^ np.uint64(room)) * np.uint64(0x9E3779B97F4A7C15)
            numbers[here] = self._numbers(spots.take(here), behind, keys[here], level[here])
        return numbers

    def _walled(self, spots: Spots, numbers: NDArray[np.int32], level: Int) -> NDArray[np.bool_]:
        """Whether a wall stands between each spot and the place that its patch is known by."""
        found = np.zeros(len(numbers), bool)
        if self._visibility is None:
            return found
        rows = np.flatnonzero(comparable(spots.points, spots.normals, self._place[numbers], self._facing[numbers]))
        one, patch = spots.take(rows), numbers[rows]
        found[rows] = walled(self._visibility, one.points, one.normals, np.minimum(one.gap, self._room[patch]),
                             self._place[patch], np.asarray(self.edge / 2.0 ** level[rows], np.float32))
        return found

    def _numbers(self, spots: Spots, names: Keys, keys: Keys, level: Int) -> NDArray[np.int32]:
        """The patches of these names; those that are new are known by the first spot with that name."""
        unique, first, inverse = np.unique(names, return_index=True, return_inverse=True)
        fresh = ~_contains(self._names, unique)
        numbers = np.empty(len(unique), np.int32)
        numbers[~fresh] = self._number_of[np.searchsorted(self._names, unique[~fresh])]
        numbers[fresh] = np.arange(len(self), len(self) + np.count_nonzero(fresh), dtype=np.int32)
        if fresh.any():
            self._add(unique[fresh], numbers[fresh], keys[first[fresh]], level[first[fresh]], spots.take(first[fresh]))
        return np.asarray(numbers[inverse.reshape(-1)])

    def _add(self, names: Keys, numbers: NDArray[np.int32], keys: Keys, level: Int, known_by: Spots) -> None:
        place = np.searchsorted(self._names, names)
        self._names = np.insert(self._names, place, names)
        self._number_of = np.insert(self._number_of, place, numbers)
        self.key = np.concatenate([self.key, keys])
        self.level = np.concatenate([self.level, level.astype(np.int32)])
        self._place = np.concatenate([self._place, known_by.points])
        self._facing = np.concatenate([self._facing, known_by.normals])
        self._room = np.concatenate([self._room, known_by.gap])

    def _add_split(self, level: int, keys: Keys) -> None:
        self._split[level] = np.union1d(self._split[level], keys)

    def _marks(self, spots: Spots) -> _Marks:
        axis = np.argmax(np.abs(spots.normals), axis=1)
        facing = 4 * axis + 2 * (spots.normals[np.arange(len(axis)), axis] > 0) + spots.front
        with np.errstate(divide="ignore"):
            gap = np.floor(np.log(np.minimum(spots.gap / self.view, 1.0)) / np.log(GAP_FACTOR))
        shell = self._shells.of_triangle[spots.triangle]
        return _Marks(spots.points.astype(np.float64) - self._low, axis, facing, shell, self._shells.extent[shell],
                      np.maximum(gap, -GAP_CLASSES).astype(np.int64))

    def _keys(self, marks: _Marks, level: int) -> Keys:
        edge = self.edge / 2.0**level
        place = marks.place / edge
        place[np.arange(len(marks.axis)), marks.axis] *= LAYERS
        voxel = np.floor(place).astype(np.int64)
        shell = np.where(marks.shell_extent >= SMALL_SHELL * edge, marks.shell, -1)
        with np.errstate(over="ignore"):
            key = np.zeros(len(shell), np.uint64)
            for part in (voxel[:, 0], voxel[:, 1], voxel[:, 2], level * 16 + marks.facing, shell, marks.gap):
                key = (key ^ part.astype(np.uint64)) * np.uint64(0x9E3779B97F4A7C15)
                key ^= key >> np.uint64(29)
        return key


@dataclass(frozen=True, eq=False)
class _Marks:
    """What the patch of a spot depends on at any level: its place about the octree's low corner (n, 3) metres, the axis
    that it faces along, which way and on which side of its triangle (n,), its shell and how wide that is (n,) metres,
    and its class of gap (n,)."""

    place: Float
    axis: Int
    facing: Int
    shell: Int
    shell_extent: Float
    gap: Int

    def where(self, chosen: NDArray[np.bool_]) -> _Marks:
        """Those of them that are chosen."""
        return _Marks(*(np.compress(chosen, getattr(self, name), axis=0) for name in self.__dataclass_fields__))


def eighths(points: Float) -> NDArray[np.uint8]:
    """Which eighth of what they span points (p, n, 3) lie in, (p, n) 0 ... 7, by their mean along each axis. Where they
    lie flat, rounding is no difference."""
    away = points - points.mean(axis=1, keepdims=True)
    widest = np.abs(away).max(axis=(1, 2), keepdims=True)
    return np.asarray((away > FLAT * widest) @ np.array([1, 2, 4]), np.uint8)


def _contains(sorted_keys: Keys, keys: Keys) -> NDArray[np.bool_]:
    if not len(sorted_keys):
        return np.zeros(len(keys), bool)
    place = np.minimum(np.searchsorted(sorted_keys, keys), len(sorted_keys) - 1)
    return np.asarray(sorted_keys[place] == keys)

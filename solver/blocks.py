"""Blocks: receivers that lie together and face one way, so that lamps are judged for all of them at once."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .footprints import Footprints
from .lights import dot
from .parallel import Run, slices

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]

# Levels of the octree that blocks are boxes of: more than float32's digits tell nothing.
MOST_LEVELS = 20
# Footprints looked at in one chunk of work.
CHUNK = 2**15
# A block's sphere goes through two opposite corners of its footprints; the other two may stick out this far.
MARGIN = 1.5


@dataclass(frozen=True, eq=False)
class Blocks:
    """Runs of receivers.

    order : (n,) receivers, block by block.
    begin : (b + 1,) where each block begins in `order`.
    centre, radius : (b, 3), (b,) float32, metres: a sphere that holds the footprints.
    normal, spread : (b, 3), (b,) float32: the mean way they face, and what the widest angle to it adds to a cosine at
        most.
    kind : (b,) int, the kind of surface that all of a block lie on (see `linking.Reach`).
    """

    order: Int
    begin: Int
    centre: Float
    radius: Float
    normal: Float
    spread: Float
    kind: Int

    def __len__(self) -> int:
        return len(self.begin) - 1

    @property
    def size(self) -> Int:
        """(b,) receivers of each block."""
        return np.diff(self.begin)

    @property
    def rows(self) -> Int:
        """The receivers of all of them."""
        return self.order[self.begin[0]:self.begin[-1]]

    def take(self, part: slice) -> Blocks:
        """A run of the blocks."""
        return Blocks(self.order, self.begin[part.start:part.stop + 1], self.centre[part], self.radius[part],
                      self.normal[part], self.spread[part], self.kind[part])

    def members(self, block: Int) -> tuple[Int, Int]:
        """All receivers of some blocks: which of `block` each belongs to, and its place in `order`."""
        size = self.size[block]
        which = np.repeat(np.arange(len(block)), size)
        step = np.arange(len(which)) - (np.cumsum(size) - size)[which]
        return which, self.begin[:-1][block][which] + step

    @classmethod
    def nested(cls, places: Footprints, most: tuple[int, ...], run: Run, kind: Int | None = None) -> tuple[Blocks, ...]:
        """Blocks of at most so many footprints, for each of `most`, of which each is a multiple of the next; a block is
        made of whole ones of the next size. The last are the footprints themselves, one by one. Footprints of unlike
        kinds (n,) are never in one block."""
        def corners(part: slice) -> tuple[Float, Float, Float, Float]:
            rows = np.arange(part.start, part.stop)
            low, high = np.zeros(len(rows), np.float32), np.full(len(rows), 1 - 2.0**-24, np.float32)
            return *places.sample(rows, low, low), *places.sample(rows, high, high)

        parts = run.map(corners, slices(len(places), CHUNK))
        one, facing, other, turned = (np.concatenate([part[column] for part in parts]) for column in range(4))
        kind = np.zeros(len(one), np.int64) if kind is None else kind
        # As many levels as the bits of a key have place for beside kind and facing.
        levels = min(MOST_LEVELS, (62 - (6 * int(kind.max(initial=0)) + 6).bit_length()) // 3)
        key = _keys((one + other) / 2, facing, kind, levels)
        order = np.argsort(key, kind="stable")
        key = key[order]
        corner = one[order], other[order], facing[order], turned[order]
        firsts = [*(_boxes(key, number, levels) for number in most), np.arange(len(order))]
        return tuple(cls._of(order, first, kind, corner) for first in firsts)

    @classmethod
    def _of(cls, order: Int, first: Int, kind: Int, corner: tuple[Float, ...]) -> Blocks:
        """The blocks that begin at `first`."""
        centre, radius, normal, spread = _spheres(first, *corner)
        return cls(order, np.append(first, len(order)), centre, radius, normal, spread, kind[order[first]])


def _spheres(first: Int, one: Float, other: Float, facing: Float, turned: Float) -> tuple[Float, ...]:
    """Centre, radius, normal and spread of the blocks that begin at `first`, from two corners of each footprint."""
    size = np.diff(np.append(first, len(one)))
    block = np.repeat(np.arange(len(first)), size)
    centre = np.add.reduceat((one + other) / 2, first) / size[:, None]
    squared = np.maximum(*(np.square(place - centre[block]).sum(axis=1) for place in (one, other)))
    radius = MARGIN * np.sqrt(np.maximum.reduceat(squared, first))
    normal = np.add.reduceat(facing + turned, first)
    normal = normal / np.maximum(np.sqrt(dot(normal, normal)), np.float32(1e-20))[:, None]
    cosine = np.minimum(dot(facing, normal[block]), dot(turned, normal[block]))
    least = np.clip(np.minimum.reduceat(cosine, first), -1, 1)
    # Wider than a right angle, or partly without a normal: any way. Rounding of a flat block's normals counts as none,
    # for the square root makes 1e-7 of it 3e-4.
    spread = np.where(least > 1e-3, np.where(least > 1 - 1e-6, 0, np.sqrt(1 - least**2) + 1 - least), 2)
    return tuple(np.asarray(array, np.float32) for array in (centre, radius, normal, spread))


def _keys(points: Float, normals: Float, kind: Int, levels: int) -> Int:
    """(n,) int64: of which kind each is, which way it faces, and where it lies along a curve that fills the boxes of an
    octree one by one (Morton 1966)."""
    low = points.min(axis=0)
    edge = max(float(np.max(points.max(axis=0) - low)), 1e-30)
    place = np.minimum((points - low) * np.float32(2**levels / edge), 2**levels - 1).astype(np.int64)
    axis = np.argmax(np.abs(normals), axis=1)
    key = 6 * kind + 2 * axis + (normals[np.arange(len(axis)), axis] > 0)
    for level in reversed(range(levels)):
        key = key * 8 + ((place >> level) & 1) @ np.array([1, 2, 4])
    return np.asarray(key)


def _boxes(key: Int, most: int, levels: int) -> Int:
    """Where the largest boxes begin that hold at most `most` of the sorted keys; the smallest are cut into pieces."""
    starts = np.zeros(len(key), bool)
    starts[0] = True
    full = np.ones(len(key), bool)
    for level in range(levels + 1):
        begin = np.append(0, np.flatnonzero(np.diff(key >> (3 * (levels - level)))) + 1)
        count = np.diff(np.append(begin, len(key)))
        starts[begin] |= full[begin]
        full &= np.repeat(count, count) > most
        if not full.any():
            break
    within = np.arange(len(key)) - np.repeat(begin, count)
    starts |= full & (within % most == 0)
    return np.flatnonzero(starts)

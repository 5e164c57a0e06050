"""Where cells are seen: the points at which rays met them.

A cell may be seen in part only: most of it under a cupboard, or behind a lamp. What rays that meet it should read is
the mean over the part that is seen, so that is where its light is asked for.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .cells import Cells
from .footprints import EachPoint
from .geometry import Geometry
from .parallel import Run, shares
from .sampling import mixed

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]

# Points of a thread's piece of work, and fewer than are worth a thread.
CHUNK_POINTS, LEAST_POINTS = 2**15, 2**12
# Points of a cell that are kept.
PLACES = 4
# A cell that was seen from nowhere higher than this part of its width lies in a gap, and its highest point stands for
# it alone: light at its other points, out in the open perhaps, would go round in the gap that rows find closed.
LOW = 0.03
# Bits of a cell's side (of `cells.MAX_SIDES` and HELD times as many) in a key to sort by; the others are random.
SIDE_BITS = 37


@dataclass(frozen=True, eq=False)
class Seen:
    """Points of cells that rays met: side (n,) int64 of each cell, u and v (n,) float32 in its triangle, and from how
    high (n,) float32 above it, metres."""

    side: NDArray[np.int64]
    u: Float
    v: Float
    height: Float

    def take(self, index: NDArray[Any]) -> Seen:
        """Some of them."""
        return Seen(self.side[index], self.u[index], self.v[index], self.height[index])

    @classmethod
    def join(cls, some: Sequence[Seen]) -> Seen:
        """All of some."""
        return cls(*(np.concatenate([getattr(one, name) for one in some]) for name in ("side", "u", "v", "height")))

    def few(self) -> Seen:
        """At most PLACES of each cell, drawn by where they lie; ordered by cell, the one that was seen from the highest
        first.

        A few of a few are the few of all: however rays are cut into chunks, the same points are kept.
        """
        bits = (self.u.view(np.uint32).astype(np.uint64) << np.uint64(32)) | self.v.view(np.uint32)
        # One key is sorted much faster than two. Its random bits differ between points of a cell.
        cell = self.side.astype(np.uint64) << np.uint64(64 - SIDE_BITS)
        key = cell | mixed(bits, 0, 0) >> np.uint64(SIDE_BITS)
        order = np.argsort(key)
        ordered = key[order]
        if (ordered[1:] == ordered[:-1]).any():
            # Where even these agree, the points decide, or it would be up to how the rays were cut.
            order = np.lexsort((bits, key))
        side = (ordered >> np.uint64(64 - SIDE_BITS)).astype(np.int64)
        first = np.flatnonzero(np.diff(side, prepend=-1))
        count = np.diff(first, append=len(side))
        kept = np.minimum(count, PLACES)
        turn = np.arange(kept.sum()) - np.repeat(np.cumsum(kept) - kept, kept)
        few = order[np.repeat(first, kept) + turn]
        ends = np.cumsum(kept)
        highest = np.repeat(np.maximum.reduceat(self.height[few], ends - kept), kept) if len(few) else self.height[few]
        there = np.flatnonzero(self.height[few] == highest)[::-1]
        best = np.empty(len(kept), np.int64)
        best[np.repeat(np.arange(len(kept)), kept)[there]] = there  # the first of several is written last
        few[ends - kept], few[best] = few[best], few[ends - kept]
        return self.take(few)


class SeenFootprints(EachPoint):
    """Cells, as footprints made of a few points each.

    Parameters
    ----------
    seen : the points, as `Seen.few` returns them.

    Attributes
    ----------
    count, first : (n,) points of each cell, and which of all is its first.
    triangle, front : (n,) where each cell lies.
    start, normal : (m, 3) each point lifted off its side of the surface, and its shading normal there.
    """

    def __init__(self, geometry: Geometry, cells: Cells, seen: Seen, run: Run) -> None:
        self.first = np.flatnonzero(np.diff(seen.side, prepend=-1))
        self.identity = seen.side[self.first]
        self.triangle = cells.triangle_of(self.identity)
        self.front = (self.identity & 1).astype(bool)
        share = cells.share(self.identity, self.triangle)
        width = np.sqrt(2 * np.take(geometry.area, self.triangle) * share)
        low = np.repeat(seen.height[self.first] < LOW * width, np.diff(self.first, append=len(seen.side)))
        low[self.first] = False
        if low.any():
            seen = seen.take(~low)
            self.first = np.flatnonzero(np.diff(seen.side, prepend=-1))
        self._geometry, self._seen, self._run = geometry, seen, run
        self.count = np.diff(self.first, append=len(seen.side))
        self._triangle, self._front = np.repeat(self.triangle, self.count), np.repeat(self.front, self.count)
        self._share = np.repeat(share, self.count)
        parts = run.map(self._settle, shares(len(seen.side), CHUNK_POINTS, LEAST_POINTS))
        self.start, self.normal = (np.concatenate([part[column] for part in parts]) for column in (0, 1))

    def _settle(self, part: slice) -> tuple[Float, Float]:
        triangle, u, v, front = self._triangle[part], self._seen.u[part], self._seen.v[part], self._front[part]
        normals = self._geometry.shading_normal(triangle, u, v)
        start = self._geometry.lifted(self._geometry.point(triangle, u, v), triangle, front)
        return start, np.where(front[:, None], normals, -normals)

    def __len__(self) -> int:
        return len(self.identity)

    @property
    def surface(self) -> Int:
        """See Footprints."""
        return self._geometry.surface[self.triangle]

    def first_places(self, part: slice) -> tuple[Int, Float, Float]:
        """Triangle, u and v (n,) of the first point of some of the cells."""
        point = self.first[part]
        return self.triangle[part], self._seen.u[point], self._seen.v[point]

    def mean(self, values: Callable[[Int, Float, Float, Float], Float]) -> Float:
        """(n, 3) the mean over each cell's points of what `values` says of triangles and u, v, for the cell's share of
        twice its triangle (m,)."""
        def work(part: slice) -> Float:
            return values(self._triangle[part], self._seen.u[part], self._seen.v[part], self._share[part])

        found = self._run.map(work, shares(len(self._seen.side), CHUNK_POINTS, LEAST_POINTS))
        total = np.add.reduceat(np.concatenate(found), self.first, axis=0)
        return np.asarray(total / self.count.astype(np.float32)[:, None])

    def sample(self, rows: Int, x: Float, y: Float) -> tuple[Float, Float]:
        """See Footprints."""
        point = self.first[rows] + (x * self.count[rows]).astype(np.int64)
        return np.take(self.start, point, axis=0), np.take(self.normal, point, axis=0)

    def flat_normals(self, rows: Int) -> Float:
        """See Footprints."""
        side = np.where(self.front[rows], np.float32(1), np.float32(-1))
        return np.asarray(np.take(self._geometry.normal, self.triangle[rows], axis=0) * side[:, None])

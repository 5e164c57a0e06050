"""Where cells are seen: the points at which rays met them.

A cell may be seen in part only: most of it under a cupboard, or behind a lamp. What rays that meet it should read is
the mean over the part that is seen, so that is where its light is asked for.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .cells import Cells
from .footprints import EachPoint
from .geometry import Geometry
from .sampling import mixed

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]

# Points of a cell that are kept.
PLACES = 4
# Bits of a cell's side (of `cells.MAX_SIDES` and FINER^2 times as many) in a key to sort by; the others are random.
SIDE_BITS = 31


@dataclass(frozen=True, eq=False)
class Seen:
    """Points of cells that rays met: side (n,) int64 of each cell, u and v (n,) float32 in its triangle."""

    side: NDArray[np.int64]
    u: Float
    v: Float

    def take(self, index: NDArray[Any]) -> Seen:
        """Some of them."""
        return Seen(self.side[index], self.u[index], self.v[index])

    @classmethod
    def join(cls, some: Sequence[Seen]) -> Seen:
        """All of some."""
        return cls(*(np.concatenate([getattr(one, name) for one in some]) for name in ("side", "u", "v")))

    def few(self) -> Seen:
        """At most PLACES of each cell, drawn by where they lie; ordered by cell.

        A few of a few are the few of all: however rays are cut into chunks, the same points are kept.
        """
        bits = (self.u.view(np.uint32).astype(np.uint64) << np.uint64(32)) | self.v.view(np.uint32)
        # One key is sorted much faster than two. Its random bits differ between points of a cell.
        cell = self.side.astype(np.uint64) << np.uint64(64 - SIDE_BITS)
        order = np.argsort(cell | mixed(bits, 0, 0) >> np.uint64(SIDE_BITS))
        side = self.side[order]
        first = np.flatnonzero(np.diff(side, prepend=-1))
        count = np.diff(first, append=len(side))
        kept = np.minimum(count, PLACES)
        turn = np.arange(kept.sum()) - np.repeat(np.cumsum(kept) - kept, kept)
        return self.take(order[np.repeat(first, kept) + turn])


class SeenFootprints(EachPoint):
    """Cells, as footprints made of a few points each.

    Attributes
    ----------
    count : (n,) points of each.
    """

    def __init__(self, geometry: Geometry, cells: Cells, seen: Seen) -> None:
        """`seen` is what `Seen.few` returns."""
        self._geometry = geometry
        self._first = np.flatnonzero(np.diff(seen.side, prepend=-1))
        self.count = np.diff(self._first, append=len(seen.side))
        self._u, self._v = seen.u, seen.v
        self.identity = seen.side[self._first]
        self.triangle = cells.triangle_of(self.identity)
        self._front = (self.identity & 1).astype(bool)

    def __len__(self) -> int:
        return len(self.identity)

    @property
    def surface(self) -> Int:
        """See Footprints."""
        return self._geometry.surface[self.triangle]

    def at(self, rows: Int, x: Float) -> tuple[Int, Float, Float]:
        """Triangle, u and v (n,) of points of cells `rows`, drawn by x in [0, 1)."""
        point = self._first[rows] + (x * self.count[rows]).astype(np.int64)
        return self.triangle[rows], self._u[point], self._v[point]

    def sample(self, rows: Int, x: Float, y: Float) -> tuple[Float, Float]:
        """See Footprints."""
        triangle, u, v = self.at(rows, x)
        front = self._front[rows]
        points = self._geometry.lifted(self._geometry.point(triangle, u, v), triangle, front)
        normals = self._geometry.shading_normal(triangle, u, v)
        return points, np.where(front[:, None], normals, -normals)

    def flat_normals(self, rows: Int) -> Float:
        """See Footprints."""
        side = np.where(self._front[rows], np.float32(1), np.float32(-1))
        return np.asarray(self._geometry.normal[self.triangle[rows]] * side[:, None])

"""Where on its footprint a sample lies: one protocol for lumels, mesh corners, probes and cells."""

from __future__ import annotations

from functools import cached_property
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from .cells import Cells
from .geometry import Geometry
from .planes import Planes
from .receivers import Receivers
from .sampling import uniform
from .visibility import OFFSET

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]

# Draws of a place on the footprint that fall off the triangle, before its centre is taken (as Cycles does).
TRIES = 10
# For the triangle that a receiver lies on one looks from the largest offset of all at first, then so many times
# nearer, so many times at most.
NEARER, MOST_LOOKS = 8, 8


class Footprints(Protocol):
    """Small pieces of surface whose mean light is wanted."""

    identity: NDArray[np.int64]

    def __len__(self) -> int: ...

    @property
    def surface(self) -> Int:
        """(n,) the surface of the scene that each lies on; -1 for none."""
        ...

    def sample(self, rows: Int, x: Float, y: Float) -> tuple[Float, Float]:
        """Points lifted off the surface and unit normals, (n, 3) each, at (x, y) in [0, 1)^2 of footprints `rows`.

        The normal is zero where no light can arrive, because a face of something else lies on the point.
        """
        ...

    def fan(self, rows: Int, x: Float, y: Float) -> tuple[Float, Float]:
        """The same (n * k, 3) each at k places (n, k) of every footprint."""
        ...

    def flat_normals(self, rows: Int) -> Float:
        """(n, 3) unit normals of the surfaces themselves: nothing comes from behind those, whatever way a smooth
        surface's shading normal leads (as in Cycles)."""
        ...


class EachPoint:
    """Footprints whose points are worked out one by one."""

    def fan(self: Footprints, rows: Int, x: Float, y: Float) -> tuple[Float, Float]:
        """See Footprints."""
        return self.sample(np.repeat(rows, x.shape[1]), x.reshape(-1), y.reshape(-1))


class ReceiverFootprints:
    """The part of a texel (or of nothing, for a probe) that a receiver is the mean of.

    Parameters
    ----------
    geometry, receivers : the surfaces and the points on them.
    part : `Settings.footprint`.

    Attributes
    ----------
    step : (n, 2, 2) float32, change of (u, v) along the two sides of that part.
    free : (n,) bool, receivers on no triangle.
    hidden, covered : (n,) bool, whether some of the footprint may lie under a face that touches it, and whether all of
        it does.
    """

    def __init__(self, geometry: Geometry, receivers: Receivers, part: float, seed: int) -> None:
        self.geometry, self.receivers = geometry, receivers
        self.identity = np.arange(len(receivers), dtype=np.int64)
        self._seed = seed
        self.step = receivers.footprint * np.float32(part)
        self.free = receivers.triangle < 0
        self._any_free = bool(self.free.any())
        self._lift = self._lifts()
        self.hidden, self.covered = self._touched()

    def __len__(self) -> int:
        return len(self.receivers)

    @cached_property
    def surface(self) -> Int:
        """See Footprints."""
        if self.receivers.surface is not None:
            return self.receivers.surface
        return self.geometry.surface[self.receivers.triangle]

    def sample(self, rows: Int, x: Float, y: Float) -> tuple[Float, Float]:
        """See Footprints."""
        triangle = self.receivers.triangle[rows]
        centre, step = np.take(self.receivers.barycentric, rows, axis=0), np.take(self.step, rows, axis=0)
        place = self._offset(centre, step, x, y)
        lost = _outside(place)
        lost &= ~_outside(centre)
        for attempt in range(1, TRIES):
            again = np.flatnonzero(lost)
            if not len(again):
                break
            key = rows[again].astype(np.int64) * 1_000_003 + (x[again] * 2.0**24).astype(np.int64)
            place[again] = self._offset(centre[again], step[again], uniform(key, 2 * attempt, self._seed),
                                        uniform(key, 2 * attempt + 1, self._seed))
            lost[again] = _outside(place[again])
        place[lost] = centre[lost]
        if self._any_free:
            triangle = np.maximum(triangle, 0)
        u, v = place[:, 0], place[:, 1]
        flat = self.geometry.point(triangle, u, v)
        points = self.geometry.lifted(flat, triangle, np.ones(len(rows), bool))
        normals = self.geometry.shading_normal(triangle, u, v)
        doubtful = np.flatnonzero(self.hidden[rows])
        if len(doubtful):
            normals[doubtful[self.geometry.buried.find(flat[doubtful], triangle[doubtful])]] = 0
        if self._any_free:
            free = self.free[rows]
            normals[free] = self.receivers.normal[rows[free]]
            points[free] = self.free_start(rows[free])
        return points, normals

    @cached_property
    def planes(self) -> Planes:
        """The footprints as flat pieces."""
        return Planes(self)

    def fan(self, rows: Int, x: Float, y: Float) -> tuple[Float, Float]:
        """See Footprints."""
        local, count = self.planes.places(rows, x, y), x.shape[1]
        normals = np.repeat(np.take(self.planes.normal, rows, axis=0), count, axis=0)
        whole = normals.reshape(-1, count, 3)
        turning, hidden = np.flatnonzero(self.planes.turning[rows]), np.flatnonzero(self.hidden[rows])
        if len(turning):
            whole[turning] = self.planes.normals(rows[turning], local[turning]).reshape(-1, count, 3)
        if len(hidden):
            whole[hidden] *= ~self.planes.buried(rows[hidden], local[hidden]).reshape(-1, count, 1)
        return self.planes.points(rows, local), normals

    def flat_normals(self, rows: Int) -> Float:
        """See Footprints."""
        normals = np.take(self.geometry.normal, self.receivers.triangle[rows], axis=0)
        return np.where(self.free[rows, None], self.receivers.normal[rows], normals)

    def free_start(self, rows: Int) -> Float:
        """(n, 3) float32: where rays of receivers on no triangle start."""
        return np.asarray(self.receivers.position[rows] + self.receivers.normal[rows] * self._lift[rows, None])

    def _lifts(self) -> Float:
        """(n,) float32, metres: how far off their places receivers on no triangle start.

        It is the offset of the triangle that they lie on, if one look back from further and further away finds it;
        else what their own coordinates ask for.
        """
        place, normal = (np.asarray(each, np.float32) for each in (self.receivers.position, self.receivers.normal))
        lift = np.asarray(np.abs(place).max(axis=1, initial=0) * np.float32(OFFSET))
        if not self._any_free:
            return lift
        rows = np.flatnonzero(self.free)
        reach, least = self.geometry.offset.max(initial=0), lift[rows].min()
        for _ in range(MOST_LOOKS):
            hits = self.geometry.solid.hits(place[rows] + normal[rows] * reach, -normal[rows])
            offset = np.where(hits.triangle >= 0, self.geometry.offset[hits.triangle], 0)
            lift[rows] = np.maximum(lift[rows], np.where(np.abs(hits.distance - reach) <= offset, offset, 0))
            reach /= NEARER
            if reach < least:
                break
        return lift

    def _touched(self) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Footprints of which touching faces hide a corner or the middle, and those of which they hide all these."""
        rows = np.flatnonzero(~self.free)
        some, every = np.zeros((2, len(self)), bool)
        if not len(rows):
            return some, every
        every[rows] = True
        for x, y in ((0.5, 0.5), (0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)):
            place = self._offset(self.receivers.barycentric[rows], self.step[rows],
                                 np.full(len(rows), x, np.float32), np.full(len(rows), y, np.float32))
            triangle = self.receivers.triangle[rows]
            found = self.geometry.buried.find(self.geometry.point(triangle, place[:, 0], place[:, 1]), triangle)
            some[rows] |= found
            every[rows] &= found
        return some, every

    @staticmethod
    def _offset(centre: Float, step: Float, x: Float, y: Float) -> Float:
        return centre + step[:, 0] * (x - np.float32(0.5))[:, None] + step[:, 1] * (y - np.float32(0.5))[:, None]


class CellFootprints(EachPoint):
    """Sides of cells."""

    def __init__(self, cells: Cells, sides: NDArray[np.int64]) -> None:
        self.cells, self.sides = cells, sides
        self.identity = sides

    def __len__(self) -> int:
        return len(self.identity)

    @cached_property
    def surface(self) -> Int:
        """See Footprints."""
        return self.cells.geometry.surface[self.cells.triangle_of(self.sides)]

    def sample(self, rows: Int, x: Float, y: Float) -> tuple[Float, Float]:
        """See Footprints."""
        triangle, u, v, front = self.cells.places(self.sides[rows], x, y)
        geometry = self.cells.geometry
        points = geometry.lifted(geometry.point(triangle, u, v), triangle, front)
        normals = geometry.shading_normal(triangle, u, v)
        return points, np.where(front[:, None], normals, -normals)

    def flat_normals(self, rows: Int) -> Float:
        """See Footprints."""
        side = self.sides[rows]
        normals = self.cells.geometry.normal[self.cells.triangle_of(side)]
        return np.asarray(normals * np.where(side & 1, 1, -1)[:, None].astype(np.float32))


def _outside(place: Float) -> NDArray[np.bool_]:
    return (place[:, 0] < 0) | (place[:, 1] < 0) | (place[:, 0] + place[:, 1] > 1)

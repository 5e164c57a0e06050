"""Which receivers lie side by side: lumels in an image, and across the seams between charts."""

from __future__ import annotations

from abc import ABC, abstractmethod
from copy import copy
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .across import WAYS, Links
from .receivers import Lumels

Int = NDArray[np.integer[Any]]


class Neighbours(ABC):
    """The receivers around each one."""

    def __init__(self) -> None:
        self._apart: NDArray[np.bool_] | None = None

    def without(self, apart: NDArray[np.bool_]) -> Neighbours:
        """The same, but that some receivers (n,) have no neighbours and are nobody's."""
        other = copy(self)
        other._apart = apart if self._apart is None else apart | self._apart
        return other

    def at(self, step: int) -> NDArray[np.int32]:
        """(n, 8) int32: the receivers `step` steps away, each of eight ways; -1 where there is none."""
        out = self._reached(step)
        if self._apart is not None:
            out[self._apart[:, None] | self._apart[out]] = -1
        return out

    @abstractmethod
    def inner(self) -> NDArray[np.bool_]:
        """(n,) which receivers are compared with a renderer's."""

    @abstractmethod
    def _reached(self, step: int) -> NDArray[np.int32]:
        """`at`, of all receivers, in an array of its own."""


class LumelNeighbours(Neighbours):
    """The lumels around each one.

    Parameters
    ----------
    lumels : of the pages.
    links : ways over seams; without them a chart's lumels know one another alone.
    """

    def __init__(self, lumels: Lumels, links: Links | None = None) -> None:
        super().__init__()
        self._lumels, self._links = lumels, links
        self._members = [np.flatnonzero(lumels.page == number) for number in range(len(lumels.pages))]

    def inner(self) -> NDArray[np.bool_]:
        """(n,) those with all eight neighbours in their own chart."""
        return np.asarray((self.in_chart(1) >= 0).all(axis=1))

    def in_chart(self, step: int) -> NDArray[np.int32]:
        """(n, 8) int32: the lumels `step` texels away, sideways and diagonally, in the same chart; -1 where there is
        none."""
        lumels = self._lumels
        out = np.full((len(lumels), len(WAYS)), -1, np.int32)
        for page, rows in zip(lumels.pages, self._members, strict=True):
            # A frame of empty texels, so that no neighbour lies outside.
            width = page.width + 2 * step
            grid = np.full(width * (page.height + 2 * step), -1, np.int32)
            y, x = np.divmod(lumels.pixel[rows], page.width)
            place = (y + step) * width + x + step
            grid[place] = rows
            for column, (step_x, step_y) in enumerate(WAYS):
                other = grid[place + step * (step_y * width + step_x)]
                same = (other >= 0) & (lumels.chart[other] == lumels.chart[rows])
                out[rows, column] = np.where(same, other, -1)
        return out

    def _reached(self, step: int) -> NDArray[np.int32]:
        inside = self.in_chart(step)
        links = self._links
        if links is None:
            return inside
        beside = inside.copy() if step == 1 else self.in_chart(1)
        onward = np.broadcast_to(np.arange(len(WAYS), dtype=np.int8), beside.shape).copy()
        beside[links.lumel, links.way], onward[links.lumel, links.way] = links.other, links.onward
        # Over seams, step by step, where the chart has nothing.
        row, way = np.nonzero(inside < 0)
        inside[row, way] = hops(beside, onward, step, row, way)
        return inside


def hops(beside: NDArray[np.int32], onward: NDArray[np.int8], steps: int, row: Int, way: Int) -> Int:
    """Where so many steps lead, one after the other.

    Parameters
    ----------
    beside, onward : (n, 8) each, where each way leads, -1 for nowhere, and by which way one goes on there.
    row, way : (m,) from where, and which way first.

    Returns
    -------
    (m,) the ends, -1 where a way leads nowhere.
    """
    for _ in range(steps):
        there = row >= 0
        row, way = np.where(there, beside[row, way], -1), onward[row, way]
    return row

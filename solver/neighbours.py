"""Which lumels lie side by side: in an image, and across the seams between charts."""

from __future__ import annotations

from copy import copy

import numpy as np
from numpy.typing import NDArray

from .across import WAYS, Links
from .receivers import Lumels


class Neighbours:
    """The lumels around each one.

    Parameters
    ----------
    lumels : of the pages.
    links : ways over seams; without them a chart's lumels know one another alone.
    """

    def __init__(self, lumels: Lumels, links: Links | None = None) -> None:
        self._lumels, self._links = lumels, links
        self._apart: NDArray[np.bool_] | None = None
        self._members = [np.flatnonzero(lumels.page == number) for number in range(len(lumels.pages))]

    def without(self, apart: NDArray[np.bool_]) -> Neighbours:
        """The same, but that some lumels (n,) have no neighbours and are nobody's."""
        other = copy(self)
        other._apart = apart if self._apart is None else apart | self._apart
        return other

    def at(self, step: int) -> NDArray[np.int32]:
        """(n, 8) int32: the lumels `step` texels away, sideways and diagonally; -1 where there is none."""
        out = self.in_chart(step)
        if self._links is not None:
            out = self._beyond(out, step, self._links)
        if self._apart is not None:
            out[self._apart[:, None] | self._apart[out]] = -1
        return out

    def in_chart(self, step: int) -> NDArray[np.int32]:
        """The same, of each lumel's own chart alone."""
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

    def _beyond(self, inside: NDArray[np.int32], step: int, links: Links) -> NDArray[np.int32]:
        """`inside`, with what is reached over seams by `step` steps one after the other where it has nothing."""
        beside = inside if step == 1 else self.in_chart(1)
        onward = np.broadcast_to(np.arange(len(WAYS), dtype=np.int8), beside.shape).copy()
        beside = beside.copy()
        beside[links.lumel, links.way], onward[links.lumel, links.way] = links.other, links.onward
        row, column = np.nonzero(inside < 0)
        lumel, way = row, column
        for _ in range(step):
            there = beside[lumel, way] >= 0
            row, column, lumel, way = row[there], column[there], lumel[there], way[there]
            lumel, way = beside[lumel, way], onward[lumel, way]
        out = inside.copy()
        out[row, column] = lumel
        return out

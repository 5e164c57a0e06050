"""Which lumels lie side by side in an image."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .receivers import Lumels

_AROUND = ((-1, -1), (0, -1), (1, -1), (-1, 0), (1, 0), (-1, 1), (0, 1), (1, 1))


class Neighbours:
    """The lumels around each one, in its chart.

    Parameters
    ----------
    lumels : of the pages.
    """

    def __init__(self, lumels: Lumels) -> None:
        self._lumels = lumels
        self._members = [np.flatnonzero(lumels.page == number) for number in range(len(lumels.pages))]

    def at(self, step: int) -> NDArray[np.int32]:
        """(n, 8) int32: the lumels `step` texels away, sideways and diagonally; -1 where there is none."""
        lumels = self._lumels
        out = np.full((len(lumels), 8), -1, np.int32)
        for page, rows in zip(lumels.pages, self._members, strict=True):
            # A frame of empty texels, so that no neighbour lies outside.
            width = page.width + 2 * step
            grid = np.full(width * (page.height + 2 * step), -1, np.int32)
            y, x = np.divmod(lumels.pixel[rows], page.width)
            place = (y + step) * width + x + step
            grid[place] = rows
            for column, (step_x, step_y) in enumerate(_AROUND):
                other = grid[place + step * (step_y * width + step_x)]
                same = (other >= 0) & (lumels.chart[other] == lumels.chart[rows])
                out[rows, column] = np.where(same, other, -1)
        return out

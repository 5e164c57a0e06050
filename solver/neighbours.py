"""Which lumels lie side by side in an image."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .receivers import Lumels

_AROUND = ((-1, -1), (0, -1), (1, -1), (-1, 0), (1, 0), (-1, 1), (0, 1), (1, 1))


def neighbours(lumels: Lumels) -> NDArray[np.int32]:
    """(n, 8) int32: the lumels around each one in its chart; -1 where there is none."""
    out = np.full((len(lumels), 8), -1, np.int32)
    for number, page in enumerate(lumels.pages):
        rows = np.flatnonzero(lumels.page == number)
        # A frame of one empty texel, so that no neighbour lies outside.
        width = page.width + 2
        grid = np.full(width * (page.height + 2), -1, np.int32)
        y, x = np.divmod(lumels.pixel[rows], page.width)
        place = (y + 1) * width + x + 1
        grid[place] = rows
        for column, (step_x, step_y) in enumerate(_AROUND):
            other = grid[place + step_y * width + step_x]
            same = (other >= 0) & (lumels.chart[other] == lumels.chart[rows])
            out[rows, column] = np.where(same, other, -1)
    return out

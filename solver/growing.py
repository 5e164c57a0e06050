"""An array that rows are appended to, in constant time a row on average."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray


class Growing:
    """Rows of one shape and type.

    Parameters
    ----------
    tail : shape of a row.
    """

    def __init__(self, tail: tuple[int, ...] = (), dtype: DTypeLike = np.float32) -> None:
        self._held = np.empty((0, *tail), dtype)
        self._count = 0

    def __len__(self) -> int:
        return self._count

    @property
    def values(self) -> NDArray[Any]:
        """(n, ...) the rows so far: a view that is good until the next `append`."""
        return self._held[: self._count]

    def append(self, rows: NDArray[Any]) -> None:
        """Add rows at the end."""
        needed = self._count + len(rows)
        if needed > len(self._held):
            held = np.empty((max(needed, 2 * len(self._held)), *self._held.shape[1:]), self._held.dtype)
            held[: self._count] = self.values
            self._held = held
        self._held[self._count:needed] = rows
        self._count = needed

    def cut(self, count: int) -> None:
        """Keep the first `count` rows."""
        self._count = min(count, self._count)

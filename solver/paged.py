"""Numbers by an index out of very many, of which few are ever given one: memory only where they are."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .growing import Growing

Int = NDArray[np.integer[Any]]

# Numbers of a page, as bits of the index: 4 kB.
PAGE_BITS = 10
_WITHIN = (1 << PAGE_BITS) - 1


class Paged:
    """An int32 for each index from 0 to `count` - 1, at first 0."""

    def __init__(self, count: int) -> None:
        # Where the page of each index starts; the first is that of all whose page holds nothing.
        self._start = np.zeros((count >> PAGE_BITS) + 1, np.int64)
        self._numbers = Growing((), np.int32)
        self._numbers.append(np.zeros(1 << PAGE_BITS, np.int32))

    def take(self, index: NDArray[np.int64]) -> NDArray[np.int32]:
        """The numbers of indices (n,); any of what is outside."""
        return np.asarray(np.take(self._numbers.values, self._place(index)))

    def put(self, index: NDArray[np.int64], numbers: Int) -> None:
        """Give indices (n,) numbers."""
        page = index >> PAGE_BITS
        new = np.unique(page[self._start[page] == 0])
        self._start[new] = len(self._numbers) + (np.arange(len(new)) << PAGE_BITS)
        self._numbers.append(np.zeros(len(new) << PAGE_BITS, np.int32))
        self._numbers.values[self._place(index)] = numbers

    def _place(self, index: NDArray[np.int64]) -> NDArray[np.int64]:
        place = np.take(self._start, index >> PAGE_BITS, mode="clip")
        place += index & _WITHIN
        return place

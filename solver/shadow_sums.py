"""Sums over the shadow rays of some footprints towards one lamp, and what follows from them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]


@dataclass(frozen=True, eq=False)
class ShadowSums:
    """Sums over each footprint's rays.

    weight, seen : (n,) of all weights, and of those of free rays.
    squared : (n,) of the squares of the free rays' weights.
    tried, met : (n,) rays that have a weight, and those of them that are free.
    closed : (n,) the unoccluded closed form over the lamp's colour, the mean over some places; nan for none.
    varied : (n,) its standard deviation between those places; 0 for none.
    places : (n,) how many they are.
    """

    weight: Float
    seen: Float
    squared: Float
    tried: Int
    met: Int
    closed: Float
    varied: Float
    places: Int

    @classmethod
    def concatenate(cls, parts: Sequence[ShadowSums]) -> ShadowSums:
        """Of several lists of footprints, one after the other."""
        if len(parts) == 1:
            return parts[0]
        return cls(*(np.concatenate([getattr(part, name) for part in parts]) for name in cls.__dataclass_fields__))

    @property
    def level(self) -> Float:
        """Unoccluded irradiance over the lamp's colour."""
        return np.where(np.isnan(self.closed), self.weight / np.maximum(self.tried, 1), self.closed)

    def take(self, index: Int) -> ShadowSums:
        """The sums of some of the footprints."""
        return ShadowSums(*(getattr(self, name)[index] for name in self.__dataclass_fields__))

    def plus(self, other: ShadowSums) -> ShadowSums:
        """Sums over both sets of rays."""
        places = self.places + other.places
        share = other.places / np.maximum(places, 1)
        closed = np.where(other.places > 0, self.closed + share * (other.closed - self.closed), self.closed)
        return ShadowSums(self.weight + other.weight, self.seen + other.seen, self.squared + other.squared,
                          self.tried + other.tried, self.met + other.met, closed, self.varied, places)

    @property
    def is_closed(self) -> NDArray[np.bool_]:
        """(n,) whether there is a closed form."""
        return ~np.isnan(self.closed)


def ratio(sums: ShadowSums, count: Int | int) -> tuple[Float, Float]:
    """The irradiance over the lamp's colour, and the standard deviation of a single ray's estimate of it."""
    part = sums.seen / np.maximum(sums.weight, np.float32(1e-30))
    mean = sums.seen / count
    value = np.where(np.isnan(sums.closed), mean, sums.closed * part)
    varied = np.sqrt(np.maximum(sums.squared / count - mean**2, 0))
    spread = np.where(np.isnan(sums.closed), varied, sums.level * np.sqrt(np.clip(part * (1 - part), 0, 0.25)))
    return np.asarray(value, np.float32), np.asarray(spread, np.float32)


def doubtful(sums: ShadowSums, rows: Int, asked: NDArray[np.bool_], count: int,
             neighbours: Int | None) -> NDArray[np.bool_]:
    """Footprints whose rays, or whose neighbours' rays, did not all agree; and all of a lamp without closed form.

    rows : (n,) the footprints, of `count`; asked : (n,) whether the closed form was asked for; neighbours : (count, 8)
    footprints around each, -1 for none.
    """
    doubt = np.asarray((sums.met > 0) & (sums.met < sums.tried) | (asked & ~sums.is_closed))
    if neighbours is None:
        return doubt
    # 0: not asked, 1: all free, 2: none free, 3: mixed
    state = np.zeros(count + 1, np.int8)
    told = sums.tried > 0
    state[rows] = np.where(doubt, 3, np.where(~told, 0, np.where(sums.met > 0, 1, 2)))
    around = np.take(state, np.take(neighbours, rows, axis=0))
    own = state[rows][:, None]
    return np.asarray(doubt | (((around != own) & (around > 0)).any(axis=1) & told))


def missed(sums: ShadowSums, rows: Int, count: int, neighbours: Int | None) -> NDArray[np.bool_]:
    """Footprints of which no ray to a lamp without closed form has a weight, though one of a footprint beside it has:
    the lamp's beam may reach a part of them. Arguments as in `doubtful`."""
    if neighbours is None:
        return np.zeros(len(rows), bool)
    lit = np.zeros(count + 1, bool)
    lit[rows] = sums.met > 0
    beside = np.take(lit, np.take(neighbours, rows, axis=0)).any(axis=1)
    return np.asarray((sums.tried == 0) & ~sums.is_closed & beside)

"""Which receivers look at which of many lamps, and with how many rays.

Receivers are judged in blocks. A bound says what each lamp could give a block at most; a few shadow rays from the block
to each lamp that matters say what arrives. With J_l the root mean square that is expected of lamp l, it is looked at
with the probability

    p_l = min(1, J_l / tau)      and counts 1 / p_l times

which is unbiased whatever J is (p is above 0 wherever the bound is), and adds the variance  sum J_l (tau - J_l)  over
the lamps below tau: tau follows from the error that is wanted. A lamp so near that it has no bound is always looked at.
Lamps are drawn systematically: a receiver takes every lamp at which its own running sum of p passes a whole number
plus its own random part (so the number of lamps hardly varies between receivers).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .blocks import Blocks
from .footprints import Footprints
from .light_bounds import LightBounds
from .parallel import shares
from .sampling import uniform

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]

# Part of the wanted standard deviation that may come from lamps that are not looked at.
SAMPLING_PART = 0.5
# Lamps that are looked at if nothing is known of the error, at least; and those drawn by chance, at most.
LEAST_LOOKS, MOST_DRAWN = 8, 64
# A lamp that would give less than this part of all light to a region is not tried out there.
TRIED_SHARE = 5e-3
# A lamp that is expected to give less than this part of all light to a block is drawn by chance, whatever the error.
APART = 1e-3
# Shadow rays of a region to the lamps that are tried out: for each receiver, in all; and to one lamp at most.
TRIES, MOST_TRIES = 1.0, 16
# Part of the bound that is added to what is expected: what is found against expectation counts 1 / p times.
BOUND_PART = 0.02
# Pairs of block and lamp, and about how many looks, that are worked on at once (up to 100 bytes each); lamps that a
# receiver looks at where there are very many; and receivers that are worth a thread.
BATCH_PAIRS, BATCH_LOOKS = 2**19, 2**19
USUAL_LOOKS, LEAST_RECEIVERS = 256, 512
# Error of the visible part by n rays: half of the light times n^-RATE.
RATE = 0.75
# From this many rays on, more are spent where they disagree.
TELLING = 4
# Fewest rays towards a lamp that is wide as seen from a receiver.
WIDE_RAYS = 4
# Halvings of the interval that tau lies in.
HALVINGS = 24

# (lamps, receivers) -> the irradiance that one shadow ray stands for, were it free, and as it is: (n,) each.
Try = Callable[[Int, Int], tuple[Float, Float]]


@dataclass(frozen=True, eq=False)
class Looks:
    """Pairs of receiver and lamp.

    rows, lamp : (n,) receivers and lamps.
    factor : (n,) one over the probability that the receiver looks at the lamp.
    rays : (n,) int of the first look, powers of two.
    closed : (n,) whether the lamp's closed form is worth asking for.
    """

    rows: Int
    lamp: Int
    factor: Float
    rays: Int
    closed: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.rows)

    def take(self, index: Int) -> Looks:
        """Some of the pairs."""
        return Looks(*(getattr(self, name)[index] for name in self.__dataclass_fields__))

    @classmethod
    def join(cls, some: list[Looks]) -> Looks:
        """All of some."""
        return cls(*(np.concatenate([getattr(one, name) for one in some]) for name in cls.__dataclass_fields__))


@dataclass(frozen=True)
class Wish:
    """How well lamps are to be looked at.

    tolerance : wanted standard deviation of each value, W/m2; 0 if not known.
    pilot : shadow rays of a first look at a lamp that gives all light.
    small_share : with no tolerance, lamps below this part of all light are drawn by chance.
    closed : places of a receiver at which closed forms are asked for.
    """

    tolerance: float
    pilot: int
    small_share: float
    closed: int


@dataclass(frozen=True, eq=False)
class _Beside:
    """Receivers of blocks that lamps are near to, each with one of these.

    block, lamp, place : (n,) the block, the lamp, and the receiver by its place in the blocks' order.
    expected, near : (n,) what it expects of the lamp, W/m2, and whether it is so near itself that this says little.
    mean : what a pair of block and lamp expects, over its receivers that are not so near, W/m2.
    """

    block: Int
    lamp: Int
    place: Int
    expected: Float
    near: NDArray[np.bool_]
    mean: Float


@dataclass(frozen=True, eq=False)
class _Judged:
    """Receivers in blocks, and what each block is judged by.

    blocks, places : the blocks, and the receivers in them.
    limit : (b,) tau, W/m2.
    whole : (b,) what is expected of all lamps together, W/m2; no less than what is of any of them.
    wish : how well lamps are to be looked at.
    """

    blocks: Blocks
    places: Footprints
    limit: Float
    whole: Float
    wish: Wish

    def rays(self, level: Float, block: Int, wide: NDArray[np.bool_]) -> Int:
        """Rays of the first look at lamps that give `level`, W/m2: by the wanted error; or `pilot` for all light, and
        fewer for a part of it; but no fewer than a `wide` one needs."""
        wish = self.wish
        wanted = (level / wish.tolerance) ** (1 / RATE) if wish.tolerance > 0 else wish.pilot * (
            level / np.maximum(self.whole[block], 1e-30)) ** (1 / (0.5 + RATE))
        power = np.round(np.log2(np.clip(wanted, 1, wish.pilot)))
        rays = np.minimum(2 ** power.astype(np.int64), wish.pilot)
        return np.asarray(np.where(wide, np.maximum(rays, min(WIDE_RAYS, wish.pilot)), rays))


def everybody(rows: Int, lamp: int, wish: Wish) -> Looks:
    """Every one of some receivers looks at a lamp."""
    count = len(rows)
    return Looks(rows, np.full(count, lamp), np.ones(count, np.float32), np.full(count, wish.pilot),
                 np.ones(count, bool))


class Chooser:
    """Chooses lamps for blocks.

    Parameters
    ----------
    bounds : of all lamps.
    seed : of the random parts.
    """

    def __init__(self, bounds: LightBounds, seed: int) -> None:
        self._bounds, self._seed = bounds, seed

    def shown(self, regions: Blocks, places: Footprints, attempt: Try) -> Float:
        """What part of each lamp's light is expected to arrive in each region: (r, m) float32, above 0.

        The root of the mean square over receivers of which some see the whole lamp and the others nothing of it.
        """
        usual, _, near = self._bounds.of_all(regions)
        total = usual.sum(axis=1)
        region, lamp = np.nonzero(near | (usual > TRIED_SHARE * total[:, None]))
        weight = usual[region, lamp]
        tries = TRIES * regions.size[region] * weight / np.maximum(total[region], 1e-30)
        tries = np.round(np.clip(tries, 1, MOST_TRIES)).astype(np.int64)
        # Rays that were all stopped do not say that nothing arrives: count one more, that arrives.
        share = np.sqrt((tries * self._tried(regions, places, region, lamp, tries, attempt) + 1) / (tries + 1))
        whole = np.bincount(region, weight, len(regions))
        mean = np.divide(np.bincount(region, weight * share, len(regions)), whole, out=np.ones(len(regions)),
                         where=whole > 0)
        # Lamps that were not tried: as hidden as the others.
        out = np.repeat(mean[:, None].astype(np.float32), usual.shape[1], axis=1)
        out[region, lamp] = share
        return out

    def looks(self, blocks: Blocks, single: Blocks, shown: Float, places: Footprints, wish: Wish) -> Looks:
        """Who looks at which lamp.

        Parameters
        ----------
        blocks, single : receivers in blocks, and one by one.
        shown : (b, m) as found for the regions that the blocks lie in.
        """
        usual, most, near = self._bounds.of_all(blocks)
        rest = usual * shown + np.float32(BOUND_PART) * most
        block, lamp = np.nonzero(near | (rest > APART * rest.sum(axis=1)[:, None]))
        expected, close = rest[block, lamp], near[block, lamp]
        rest[block, lamp] = 0
        whole = np.asarray((usual * shown).sum(axis=1), np.float64)
        np.maximum.at(whole, block, expected)
        beside = self._beside(blocks, single, block[close], lamp[close], shown)
        expected[close] = beside.mean
        limit = _limit(len(blocks), block, expected, close, rest.sum(axis=1, dtype=np.float64), wish)
        surely = ~close & (expected >= limit[block])
        faint = ~close & ~surely
        rest[block[faint], lamp[faint]] = expected[faint]
        judged = _Judged(blocks, places, limit, whole, wish)
        return Looks.join([
            self._sure(judged, block[surely], lamp[surely], expected[surely]),
            self._close(judged, single, beside),
            self._drawn(judged, rest)])

    def batches(self, blocks: Blocks) -> list[slice]:
        """Runs of blocks to be handed to `looks` one by one: enough of them for all threads."""
        lamps = len(self._bounds.strength)
        receivers = max(1, BATCH_LOOKS // min(lamps, USUAL_LOOKS))
        share = max(1, shares(int(blocks.size.sum()), receivers, LEAST_RECEIVERS)[0].stop)
        end = np.cumsum(np.maximum(blocks.size / share, lamps / BATCH_PAIRS))
        edges = np.append(np.append(0, np.flatnonzero(np.diff(np.floor(end))) + 1), len(blocks))
        return [slice(first, last) for first, last in zip(edges[:-1], edges[1:], strict=True)]

    def _sure(self, judged: _Judged, block: Int, lamp: Int, expected: Float) -> Looks:
        """All receivers of a block look at a lamp."""
        which, place = judged.blocks.members(block)
        closed = self._bounds.wide(judged.blocks, block, lamp)
        rays = judged.rays(expected, block, closed)
        rows, factor = judged.blocks.order[place], np.ones(len(which), np.float32)
        return Looks(rows, lamp[which], factor, rays[which], closed[which])

    def _beside(self, blocks: Blocks, single: Blocks, block: Int, lamp: Int, shown: Float) -> _Beside:
        """Lamps that are near a block, judged anew for each of its receivers: from pairs of block and lamp."""
        which, place = blocks.members(block)
        usual, most, near = self._bounds.of_pairs(single, place, lamp[which])
        expected = usual * shown[block, lamp][which] + np.float32(BOUND_PART) * most
        mean = np.bincount(which, np.where(near, 0, expected), len(block)) / blocks.size[block]
        return _Beside(block[which], lamp[which], place, expected, near, mean)

    def _close(self, judged: _Judged, single: Blocks, beside: _Beside) -> Looks:
        """Receivers look at lamps beside their block."""
        chance = np.where(beside.near, 1, np.minimum(beside.expected / judged.limit[beside.block], 1))
        rows = judged.blocks.order[beside.place]
        key = judged.places.identity[rows] * np.int64(1_000_003) + beside.lamp
        kept = np.flatnonzero((chance > 0) & (beside.near | (uniform(key, 98, self._seed) < chance)))
        place, lamp, block = (array[kept] for array in (beside.place, beside.lamp, beside.block))
        near, expected, chance = beside.near[kept], beside.expected[kept], chance[kept]
        closed = self._bounds.wide(single, place, lamp)
        rays = judged.rays(expected / chance, block, near | closed)
        return Looks(rows[kept], lamp, np.asarray(1 / chance, np.float32), rays, closed)

    def _tried(self, blocks: Blocks, places: Footprints, block: Int, lamp: Int, tries: Int, attempt: Try) -> Float:
        """(n,) the part of its light that arrives, for pairs of block and lamp; 1 where there is none."""
        pair = np.repeat(np.arange(len(block)), tries)
        step = np.arange(len(pair)) - (np.cumsum(tries) - tries)[pair]
        first = places.identity[blocks.order[blocks.begin[:-1]]][block][pair]
        part = uniform(first * np.int64(1_000_003) + lamp[pair] * 31 + step, 71, self._seed)
        size = blocks.size[block][pair]
        member = np.minimum(((step + part) / tries[pair] * size).astype(np.int64), size - 1)
        given, seen = (np.bincount(pair, each, len(block)) for each in attempt(
            lamp[pair], blocks.order[blocks.begin[:-1][block][pair] + member]))
        return np.divide(seen, given, out=np.ones(len(block)), where=given > 0)

    def _drawn(self, judged: _Judged, rest: Float) -> Looks:
        """Lamps that are drawn by chance, with the probability rest / limit."""
        blocks, limit = judged.blocks, judged.limit
        running = np.cumsum(rest, axis=1, dtype=np.float64) / limit[:, None]
        number = running[:, -1]
        block = np.repeat(np.arange(len(blocks)), blocks.size)
        rows = blocks.rows
        part = uniform(judged.places.identity[rows], 99, self._seed).astype(np.float64)
        count = np.maximum(np.ceil(number[block] - part), 0).astype(np.int64)
        rows, block = np.repeat(rows, count), np.repeat(block, count)
        step = np.arange(len(rows)) - np.repeat(np.cumsum(count) - count, count)
        at = np.repeat(part, count) + step
        # One search for all blocks: each block's running sum starts at a whole number above the last one's end.
        base = np.concatenate([[0.0], np.cumsum(np.ceil(number[:-1]) + 1)])
        flat = (running + base[:, None]).reshape(-1)
        lamp = np.searchsorted(flat, at + base[block], side="right") - block * rest.shape[1]
        good = (lamp >= 0) & (lamp < rest.shape[1])
        rows, block, lamp = rows[good], block[good], lamp[good]
        expected = rest[block, lamp]
        good = expected > 0
        rows, block, lamp, expected = rows[good], block[good], lamp[good], expected[good]
        factor = limit[block] / expected
        closed = self._bounds.wide(blocks, block, lamp)
        rays = judged.rays(limit[block], block, closed)
        return Looks(rows, lamp, np.asarray(factor, np.float32), rays, closed)


def _limit(count: int, block: Int, expected: Float, close: NDArray[np.bool_], rest: Float, wish: Wish) -> Float:
    """(count,) tau, above 0, from what blocks expect of single lamps (n,), close ones too, and of all the rest.

    Of close lamps the mean over receivers is expected. These differ: J (tau - J) is then tau times that mean at most,
    and nowhere more than tau^2 / 4.
    """
    free, beside = np.where(close, 0, expected), np.where(close, expected, 0)
    total = np.bincount(block, expected, count) + rest
    if wish.tolerance > 0:
        wanted = (SAMPLING_PART * wish.tolerance) ** 2
        low, high = np.zeros(count), np.maximum(total, 1e-30)
        for _ in range(HALVINGS):
            middle = (low + high) / 2
            tau = middle[block]
            single = free * np.maximum(tau - free, 0) + tau * np.minimum(beside, tau / 4)
            variance = np.bincount(block, single, count) + middle * rest
            low, high = np.where(variance <= wanted, middle, low), np.where(variance <= wanted, high, middle)
        limit = np.minimum(low, total / LEAST_LOOKS)
    else:
        limit = wish.small_share * total
    drawn = np.bincount(block, np.where(free < limit[block], free, 0), count) + rest
    return np.maximum(np.maximum(limit, drawn / MOST_DRAWN), 1e-30)

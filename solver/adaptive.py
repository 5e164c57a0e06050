"""Rays where the gather is noisy, and no more of them than the wanted error asks for.

Every receiver is gathered twice, with independent random shifts, and both looks are smoothed. What is left of the
error then, blur and noise, is estimated from the two (`remaining.py`): the estimates tell where more rays are
needed, and their mean how good the whole is. More rays go on with the point set of the rays before. Given v_i, the mean
square error of receiver i at n rays, and errors falling as n^-RATE, the mean falls fastest for the rays spent if n_i
grows as v_i^(1 / (1 + RATE)).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .blocks import Blocks
from .estimator import TRIMMED_FRACTION
from .fans import Fans
from .gather import Gather, Look
from .guides import BLOCK, BLOCK_SHARE, WORTH, Guides, Tally
from .kernels import Kernel, Kernels, among, around, for_all, kernels
from .neighbours import Neighbours
from .parallel import Run
from .plan import Plan
from .remaining import remaining, remaining_after
from .smooth import light_of, smooth
from .transport import Transport

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]

# What a ray brings beyond this many times what rays bring on the average is a peak, smoothed apart.
PEAK = 4.0
# The mean square error of n quasi-random rays falls as n^-RATE (measured in rooms: n^-1.1 to n^-1.3).
RATE = 1.2
# Most rays of a receiver over those of the first look.
MOST_FACTOR = 128
# Looks after the first: each can mend what the one before misjudged.
MOST_ROUNDS = 3
# Part of a receiver's error that is taken from all receivers, since its own is known from few samples only.
PRIOR = 0.2
# The same for receivers without neighbours.
LONE_PRIOR = 0.6
# Such receivers are guided by so many rays that found light, or not at all: of fewer, most of what shines lies where
# none did, and nobody beside tells.
LONE_FOUND = 24.0
# A receiver stands out, as a speckle, if its error is this many times what is wanted on the average.
SPECKLE = 3.0
# Filtered light stands alone if it is so many times further from the mean of those beside than any of them is, at least
# so many, and by more than the error that is wanted on the average; it is looked at with so many times the rays.
ALONE, LEAST_BESIDE, CLOSER = 2.0, 5, 16
# The least part of the receivers that is taken to be lit.
LEAST_LIT = 1e-3
# The least mean square error that is worth a ray, W2/m4: far below any light that matters, far above zero.
DARK = 1e-30
# A look is not worth its while if the error is within this factor of what is wanted.
CLOSE_ENOUGH = 1.1
# Guided rays' shifts are not those of the rays before.
GUIDED_SEED = 500


@dataclass(frozen=True, eq=False)
class Gathered:
    """What the gather found, float32, W/m2.

    first, bounced : (n, 3) irradiance from sky and gathered emitters, and from reflected light.
    apart : (n, 3 g) what is wanted of both of each light group.
    square_error : (n,) mean square error of each receiver that is expected, W2/m4.
    lit : the part of the receivers that some light arrives at.
    """

    first: Float
    bounced: Float
    apart: Float
    square_error: Float
    lit: float

    @property
    def error(self) -> float:
        """Root mean square error over the lit receivers that is expected, W/m2."""
        return float(np.sqrt(_mean(self.square_error) / self.lit))


@dataclass(frozen=True)
class Level:
    """How bright receivers are, as far as it is known before they gather.

    lamps : the lamps' mean direct light at their footprints, W/m2; counted with what is gathered.
    lit : the part of the footprints that lamps shine on, 0 ... 1.
    usual : what rays bring on the average, W/m2, about.
    """

    lamps: float
    lit: float
    usual: float


def gather_adaptively(transport: Transport, fans: Fans, plan: Plan, level: Level, seed: int,
                      neighbours: Neighbours | None) -> Gathered:
    """Gather until the error is about `plan.gather_error` of the mean light. Receivers count that any light arrives at:
    those in boxes that none gets into would make the others seem dim.

    Parameters
    ----------
    transport : solved; its `run` does the work.
    fans, level : of the receivers.
    seed : of the rays' shifts.
    neighbours : of the footprints; None for receivers that have none, which are not smoothed.
    """
    run, lit = transport.run, level.lit
    gather = Gather(transport, PEAK * level.usual)
    # Every look is smoothed, and its error told, with the same neighbours.
    near = None if neighbours is None else kernels(fans.receivers, neighbours, run)
    half = plan.gather_rays // 2
    rays = np.full(len(fans), half, np.int64)
    tally = _tally(fans, level.usual, run)
    looks = gather.light(fans, _both(np.arange(len(fans)), half, 0, seed), run, tally)
    guides = tally.guides(0 if near is not None else LONE_FOUND)
    errors = _errors(looks, near, run)
    for _ in range(MOST_ROUNDS):
        error = np.sum(errors, axis=0)
        light = (looks[0] + looks[1]).sum(axis=1)[:, :6]
        found = light.any(axis=1)
        lit = max(lit, float(found.mean()), LEAST_LIT)
        # Of all receivers; above zero, also where all is dark and nothing is left to be wanted.
        wanted = max((plan.gather_error * (level.lamps + float(light.mean()))) ** 2 / lit, DARK)
        most = MOST_FACTOR * half / rays
        factor = _speckle_factors(error, wanted, most)
        if _mean(error) > wanted * CLOSE_ENOUGH**2:
            factor = np.maximum(factor, _factors(_known(error, found, near), wanted, most))
        if not (factor > 1).any():
            break
        _go_on(gather, fans, looks, rays, factor, seed, run, guides, half)
        errors = _errors(looks, near, run, np.flatnonzero(factor > 1), errors)
    value = _value(looks, near, run)
    if near is not None:
        alone = _standing_alone(light_of(value).mean(axis=1), near[0], float(np.sqrt(wanted)), run)
        if len(alone):
            factor = np.ones(len(fans))
            factor[alone] = 2.0 ** np.floor(np.log2(np.minimum(CLOSER, MOST_FACTOR * half / rays[alone])))
            _go_on(gather, fans, looks, rays, factor, seed, run, guides, half)
            needed = around(alone, [*near, *near])
            again = _value([look[needed] for look in looks], among(needed, near), run)
            value[alone] = again[np.searchsorted(needed, alone)]
    return Gathered(value[:, :3], value[:, 3:6], value[:, 6:], np.sum(errors, axis=0), lit)


def _tally(fans: Fans, usual: float, run: Run) -> Tally:
    """What takes down where the first rays find light, block by block."""
    blocks = Blocks.nested(fans.places, (max(BLOCK, int(BLOCK_SHARE * len(fans))),), run)[0]
    block = np.empty(len(fans), np.int32)
    block[blocks.order] = np.repeat(np.arange(len(blocks)), blocks.size)
    return Tally(block, len(blocks), usual)


def _mean(error: Float) -> float:
    """The mean of errors (n,), the largest left out as `estimator.score` does."""
    return float(np.sort(error)[: max(1, int(len(error) * (1 - TRIMMED_FRACTION)))].mean())


def _both(rows: Int, count: int, start: int, seed: int, guides: Guides | None = None) -> list[Look]:
    """The same rays twice, with independent shifts."""
    return [Look(rows, count, start, seed + 1000 * number, guides) for number in (1, 2)]


def _go_on(gather: Gather, fans: Fans, looks: list[Float], rays: Int, factor: Float, seed: int, run: Run,
           guides: Guides, first: int) -> None:
    """Multiply the receivers' rays (n,) by powers of two, and take what more of them find into the two looks.

    Guided rays are a point set of their own, apart from the `first` rays of each receiver; each counts as WORTH of
    these.
    """
    asked, shares = [], []
    for before, more, rows in _groups(rays, factor):
        guided = guides.pays[rows]
        if not guided.all():
            asked += _both(rows[~guided], more, before, seed)
            shares += 2 * [more / (before + more)]
        if guided.any():
            start = before // WORTH if before > first else 0
            count = (before + more) // WORTH - start
            asked += _both(rows[guided], count, start, seed + GUIDED_SEED, guides)
            shares += 2 * [count * WORTH / (first + (start + count) * WORTH)]
    for number, (look, share, found) in enumerate(zip(asked, shares, gather.light(fans, asked, run), strict=True)):
        held = looks[number % 2]
        held[look.rows] += (found - held[look.rows]) * np.float32(share)
    rays[:] = rays * factor


def _groups(rays: Int, factor: Float) -> list[tuple[int, int, Int]]:
    """How many rays receivers have, how many more they get, and which receivers those are."""
    kinds = np.unique(np.stack([rays, rays * (factor - 1)], axis=1).astype(np.int64)[factor > 1], axis=0)
    return [(int(before), int(more), np.flatnonzero((rays == before) & (rays * (factor - 1) == more)))
            for before, more in kinds]


def _parts(looks: list[Float]) -> list[tuple[Float, Float]]:
    """Two looks without peaks, and these alone if there are any."""
    first, second = looks
    count = 2 if first[:, 1].any() or second[:, 1].any() else 1
    return [(np.ascontiguousarray(first[:, part]), np.ascontiguousarray(second[:, part])) for part in range(count)]


def _value(looks: list[Float], near: Kernels | None, run: Run) -> Float:
    """(n, 6 ...) the mean of two looks, smoothed if neighbours are known."""
    smoothed = [_smoothed(*part, near, run, rare=bool(number)) for number, part in enumerate(_parts(looks))]
    return np.asarray(np.sum(smoothed, axis=0) / 2)


def _standing_alone(light: Float, kernel: Kernel, least: float, run: Run) -> Int:
    """Receivers whose light (n,) is by `least` and more unlike that of all beside them, which is alike.

    Where both looks happened to err alike, noise looks like light. Among many receivers there are some.
    """
    out = np.zeros(len(light), np.bool_)

    def work(part: slice) -> None:
        there = kernel.weights[part] > 0
        count = there.sum(axis=1)
        beside = np.take(light, kernel.others[part])
        mean = np.where(there, beside, 0).sum(axis=1) / np.maximum(count, 1)
        spread = np.where(there, np.abs(beside - mean[:, None]), 0).max(axis=1)
        apart = np.abs(light[part] - mean)
        out[part] = (count >= LEAST_BESIDE) & (apart > ALONE * spread) & (apart > least)

    for_all(work, len(light), run)
    return np.flatnonzero(out)


def _smoothed(first: Float, second: Float, near: Kernels | None, run: Run, *, rare: bool) -> Float:
    """The sum of two looks, smoothed if neighbours are known."""
    if near is not None:
        first, second = smooth(first, second, near, run, rare=rare)
    return first + second


def _errors(looks: list[Float], near: Kernels | None, run: Run, changed: Int | None = None,
            before: Sequence[Float] = ()) -> list[Float]:
    """(n,) mean square error of the mean of two looks, W2/m4, of each of their parts; from those before some receivers'
    looks changed, if these are given."""
    if near is None:
        return [np.asarray(np.square(light_of((looks[0] - looks[1]).sum(axis=1))).mean(axis=1) / 4)]
    parts = _parts(looks)
    if changed is None or len(before) != len(parts):
        return [remaining(*part, near, run) for part in parts]
    return [remaining_after(*part, changed, known, near, run) for part, known in zip(parts, before, strict=True)]


def _known(error: Float, found: NDArray[np.bool_], near: Kernels | None) -> Float:
    """(n,) float64: errors with a part of their mean over all that have any or where light was `found` (n,): two looks
    may find the same by chance. What stands alone may have missed all of its light by chance, too: were only those
    followed that found some, all together would be too dark."""
    prior = LONE_PRIOR if near is None else PRIOR
    counts = found | (error > 0) | (near is None)
    return np.where(counts, (1 - prior) * error + prior * error.mean(where=counts), 0).astype(np.float64)


def _speckle_factors(error: Float, wanted: float, most: Float) -> Float:
    """By which power of two to multiply the rays of the few receivers that stand out, however good the mean is."""
    factor = np.clip((error / (SPECKLE**2 * wanted)) ** (1 / RATE), 1, most)
    return np.asarray(2.0 ** np.ceil(np.log2(factor)))


def _factors(error: Float, wanted: float, most: Float) -> Float:
    """By which power of two to multiply each receiver's rays, so that the mean of the errors becomes `wanted`.

    Where that is out of reach, it becomes so without the receivers that have the most rays by then: no number of rays
    for all the others makes up for these.
    """
    reached = bool((error * most**-RATE).mean() <= wanted)
    low, high = 1e-3, 1e6
    for _ in range(60):
        middle = np.sqrt(low * high)
        factor = np.clip(middle * (error / wanted) ** (1 / (1 + RATE)), 1, most)
        left = error * factor**-RATE
        if (left if reached else left * (factor < most)).mean() > wanted:
            low = middle
        else:
            high = middle
    factor = np.clip(high * (error / wanted) ** (1 / (1 + RATE)), 1, most)
    return np.asarray(2.0 ** np.round(np.log2(factor)))

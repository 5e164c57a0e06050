"""Rays where the gather is noisy, and no more of them than the wanted error asks for.

Every receiver is gathered twice, with independent random shifts. Half the difference of the two is a sample of the
error of their mean; averaged over neighbours it tells where more rays are needed, and averaged over all how good the
whole is. Given v_i, the variance of receiver i at n rays, and variance falling as n^-1.5 (quasi-random rays), the mean
variance falls fastest for the rays spent if n_i grows as v_i^(1 / 2.5).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .footprints import Footprints
from .gather import Gather
from .parallel import Run
from .plan import Plan
from .transport import Transport

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]

# The variance of the mean of n quasi-random rays falls as n^-RATE.
RATE = 1.5
# Most rays of a receiver over those of the first look.
MOST_FACTOR = 32
# Looks after the first: each can mend what the one before misjudged.
MOST_ROUNDS = 3
# Part of a receiver's variance that is taken from all receivers, since its own is known from two samples only.
PRIOR = 0.2
# A look is not worth its while if the error is within this factor of what is wanted.
CLOSE_ENOUGH = 1.1


def gather_adaptively(transport: Transport, places: Footprints, plan: Plan, level: float, seed: int,
                      neighbours: Int | None, run: Run) -> tuple[Float, Float]:
    """Gather until the sampling error is about `plan.gather_error` of the mean light.

    Parameters
    ----------
    level : the lamps' mean direct light at the footprints, W/m2; counted with what is gathered.

    Returns
    -------
    (n, 3) float32 irradiance from sky and gathered emitters, and from reflected light, W/m2.
    """
    everything = np.arange(len(places))

    def look(rows: Int, rays: int, number: int) -> Float:
        gather = Gather(transport, rays, seed + 1000 * number)
        return np.concatenate(gather.light(places, rows, run), axis=1)

    half = plan.gather_rays // 2
    first, second = look(everything, half, 1), look(everything, half, 2)
    value = (first + second) / 2
    rays = np.full(len(places), plan.gather_rays, np.float64)
    variance = _pooled(((first - second)[:, :3] + (first - second)[:, 3:]), neighbours)
    for number in range(MOST_ROUNDS):
        wanted = (plan.gather_error * (level + float((value[:, :3] + value[:, 3:]).mean()))) ** 2
        if variance.mean() <= wanted * CLOSE_ENOUGH**2:
            break
        factor = _factors(variance, wanted, MOST_FACTOR * plan.gather_rays / rays)
        before = value.copy()
        for power in range(1, int(np.log2(MOST_FACTOR)) + 1):
            rows = np.flatnonzero(factor == 2**power)
            if not len(rows):
                continue
            for count in np.unique(rays[rows]):
                some = rows[rays[rows] == count]
                more = int(count) * (2**power - 1)
                found = look(some, more, 10 * (number + 1) + power)
                value[some] = (value[some] * count + found * more) / (count + more)
                rays[some] += more
                variance[some] *= (count / (count + more)) ** RATE
        # What a receiver moved by is another look at how wrong it was: pool it where it says more than expected.
        if np.array_equal(before, value):
            break
    return value[:, :3], value[:, 3:]


def _pooled(difference: Float, neighbours: Int | None) -> Float:
    """(n,) variance of the mean of two looks, averaged over neighbours, with a part of the average over all."""
    own = np.square(difference).mean(axis=1) / 4
    pooled = own
    if neighbours is not None:
        padded = np.append(own, 0)
        there = neighbours >= 0
        pooled = (own + np.where(there, padded[neighbours], 0).sum(axis=1)) / (1 + there.sum(axis=1))
    return np.asarray((1 - PRIOR) * pooled + PRIOR * own.mean(), np.float64)


def _factors(variance: Float, wanted: float, most: Float) -> Float:
    """By which power of two to multiply each receiver's rays, so that the mean variance becomes `wanted`."""
    low, high = 1e-3, 1e6
    for _ in range(60):
        middle = np.sqrt(low * high)
        factor = np.clip(middle * (variance / wanted) ** (1 / (1 + RATE)), 1, most)
        if (variance * factor**-RATE).mean() > wanted:
            low = middle
        else:
            high = middle
    factor = np.clip(high * (variance / wanted) ** (1 / (1 + RATE)), 1, most)
    return np.asarray(2.0 ** np.round(np.log2(factor)))

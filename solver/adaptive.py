"""Rays where the gather is noisy, and no more of them than the wanted error asks for.

Every receiver is gathered twice, with independent random shifts, and both looks are smoothed. Half the difference of
the two is a sample of the error of their mean; averaged over neighbours it tells where more rays are needed, and
averaged over all how good the whole is. Given v_i, the variance of receiver i at n rays, and variance falling as
n^-1.5 (quasi-random rays), the mean variance falls fastest for the rays spent if n_i grows as v_i^(1 / 2.5).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .fans import Fans
from .gather import Gather
from .neighbours import Neighbours
from .parallel import Run
from .plan import Plan
from .smooth import smooth
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
# The same for receivers without neighbours.
LONE_PRIOR = 0.6
# A look is not worth its while if the error is within this factor of what is wanted.
CLOSE_ENOUGH = 1.1


def gather_adaptively(transport: Transport, fans: Fans, plan: Plan, level: float, seed: int,
                      neighbours: Neighbours | None, run: Run) -> tuple[Float, Float, Float]:
    """Gather until the sampling error is about `plan.gather_error` of the mean light.

    Parameters
    ----------
    level : the lamps' mean direct light at the footprints, W/m2; counted with what is gathered.
    neighbours : of the footprints; None for receivers that have none, which are not smoothed.

    Returns
    -------
    (n, 3) float32 irradiance from sky and gathered emitters, and from reflected light, W/m2; and (n, 3 g) what is
    wanted of both of each light group.
    """
    def look(rows: Int, rays: int, number: int) -> Float:
        return np.concatenate(Gather(transport, rays, seed + 1000 * number).light(fans, rows, run), axis=1)

    half = plan.gather_rays // 2
    everything = np.arange(len(fans))
    looks = [look(everything, half, 1), look(everything, half, 2)]
    rays = np.full(len(fans), half, np.int64)
    around = None if neighbours is None else neighbours.at(1)
    for number in range(MOST_ROUNDS + 1):
        both = [all_columns[:, :6] for all_columns in looks]
        smoothed = both if neighbours is None else smooth(both[0], both[1], fans.receivers, neighbours, run)
        value = (smoothed[0] + smoothed[1]) / 2
        variance = _pooled(smoothed[0] - smoothed[1], around)
        wanted = (plan.gather_error * (level + float((value[:, :3] + value[:, 3:]).mean()))) ** 2
        if number == MOST_ROUNDS or variance.mean() <= wanted * CLOSE_ENOUGH**2:
            break
        factor = _factors(variance, wanted, MOST_FACTOR * half / rays)
        for more, rows in _groups(rays, factor):
            for which in (0, 1):
                found = look(rows, more, 10 * (number + 1) + 3 + which)
                looks[which][rows] += (found - looks[which][rows]) * (more / (rays[rows] + more))[:, None]
            rays[rows] += more
    if looks[0].shape[1] > 6:
        # The groups were no part of what was decided: they are filtered once, at the end.
        smoothed = looks if neighbours is None else smooth(looks[0], looks[1], fans.receivers, neighbours, run)
        value = (smoothed[0] + smoothed[1]) / 2
    return value[:, :3], value[:, 3:6], value[:, 6:]


def _groups(rays: Int, factor: Float) -> list[tuple[int, Int]]:
    """How many more rays, for which receivers."""
    more = np.asarray(rays * (factor - 1), np.int64)
    return [(int(count), np.flatnonzero(more == count)) for count in np.unique(more) if count > 0]


def _pooled(difference: Float, around: Int | None) -> Float:
    """(n,) variance of the mean of two looks, averaged over neighbours, with a part of the average over all."""
    own = np.square(difference[:, :3] + difference[:, 3:]).mean(axis=1) / 4
    pooled = own
    if around is not None:
        there = around >= 0
        pooled = (own + np.where(there, own[around], 0).sum(axis=1)) / (1 + there.sum(axis=1))
    prior = LONE_PRIOR if around is None else PRIOR
    return np.asarray((1 - prior) * pooled + prior * own.mean(), np.float64)


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

"""Gathered light without its noise: neighbours that differ by no more than noise would make them are averaged.

An edge-avoiding wavelet filter (Dammertz, Sewtz, Hanika & Lensch 2010) over the texels of a chart. Every receiver was
gathered twice; each of the two is filtered with weights that the other one gives (Rousselle, Knaus & Zwicker 2012), so
that noise can't vote for itself, and half the difference of the two results is still an honest sample of the error of
their mean. Only gathered light is filtered; the lamps' shadows are not.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .neighbours import Neighbours
from .parallel import Run, shares
from .receivers import Receivers

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]

# Steps of the filter, texels: seven to each side in all.
STEPS = (1, 2, 4)
# Weights of a neighbour beside and across, over the middle's own (the separable 1-2-1 kernel).
BESIDE, ACROSS = np.float32(0.5), np.float32(0.25)
_KERNEL = np.array([ACROSS, BESIDE, ACROSS, BESIDE, BESIDE, ACROSS, BESIDE, ACROSS], np.float32)
# Neighbours that differ by this many standard deviations more than noise explains hardly count.
DEVIATIONS = 1.8
# Where the excess is this many times that, they don't count at all: no light seeps into the dark.
FARTHEST = 8.0
# Receivers that face apart by more than this cosine do not share light.
SAME_WAY = 0.95
CHUNK = 2**16


def smooth(first: Float, second: Float, receivers: Receivers, neighbours: Neighbours, run: Run) -> tuple[Float, Float]:
    """Filter two independent looks at the same receivers, (n, 6 ...) each: emitted and reflected light, RGB, and more
    columns that are filtered with the weights that these give."""
    variance = _variance(first, second, neighbours)
    for step in STEPS:
        around = neighbours.at(step)
        jobs = [(part, first, second, receivers, around, variance) for part in shares(len(first), CHUNK)]
        done = run.map(_filter, jobs)
        first, second, variance = (np.concatenate([piece[axis] for piece in done]) for axis in range(3))
    return first, second


def remaining(first: Float, second: Float, receivers: Receivers, neighbours: Neighbours, run: Run) -> Float:
    """(n,) mean square error that is left in the mean of two filtered looks, W2/m4.

    What a filter blurs does not show in the difference of two filtered looks. Against the *other* look, unfiltered, it
    does: with v the variance of a look, and a filter that knows nothing of it,

        mean((filtered first - second)^2) = (blur^2 + variance of the filtered look) + v

    (cross-validation, Stone 1974). Such filters are the kernels of `smooth` by themselves, after each of its steps; at
    every receiver the one counts that is best around it.
    """
    looks = np.concatenate([_light(first), _light(second)], axis=1)
    filtered, kernels = looks, [_Kernel.of(step, receivers, neighbours, run) for step in STEPS]
    best = _around(np.square(looks[:, :3] - looks[:, 3:]).mean(axis=1) / 4, kernels, run)
    for kernel in kernels:
        filtered = kernel.filtered(filtered, run)
        other = np.concatenate([looks[:, 3:], looks[:, :3]], axis=1)
        noise = np.square(looks[:, :3] - looks[:, 3:]).mean(axis=1)
        halves = np.square(filtered[:, :3] - filtered[:, 3:]).mean(axis=1)
        # The mean of both has all of the blur, and half of the variance; by chance the blur may come out below 0.
        left = np.square(filtered - other).mean(axis=1) - noise / 2 - halves / 4
        best = np.minimum(best, np.maximum(_around(left, kernels, run), _around(halves / 4, kernels, run)))
    return best


def _around(values: Float, kernels: list[_Kernel], run: Run) -> Float:
    """(n,) float32: means of values (n,) over the neighbours."""
    means = np.asarray(values[:, None], np.float32)
    for kernel in kernels[:2]:
        means = kernel.filtered(means, run)
    return means[:, 0]


@dataclass(frozen=True, eq=False)
class _Kernel:
    """One step of the filter where nothing but the layout decides: neighbours and their weights, (n, 8) each."""

    others: Int
    weights: Float

    @classmethod
    def of(cls, step: int, receivers: Receivers, neighbours: Neighbours, run: Run) -> _Kernel:
        others = neighbours.at(step)
        parts = run.map(lambda part: _beside(receivers, others, part), shares(len(others), CHUNK))
        weights = np.concatenate(parts)
        return cls(others, weights / (1 + weights.sum(axis=1, keepdims=True)))

    def filtered(self, values: Float, run: Run) -> Float:
        """(n, c) from (n, c)."""
        def work(part: slice) -> Float:
            weights = self.weights[part]
            own = values[part] * (1 - weights.sum(axis=1, keepdims=True))
            return np.asarray(own + np.einsum("nk,nkc->nc", weights, values[self.others[part]]))

        return np.concatenate(run.map(work, shares(len(values), CHUNK)))


def _beside(receivers: Receivers, others: Int, part: slice) -> Float:
    """(m, 8): the kernel's weights of the neighbours of some receivers, 0 where there is none or it faces apart."""
    facing = np.einsum("nkc,nc->nk", receivers.normal[others[part]], receivers.normal[part])
    return np.where((others[part] >= 0) & (facing > SAME_WAY), _KERNEL, np.float32(0))


def _variance(first: Float, second: Float, neighbours: Neighbours) -> Float:
    """(n,) variance of one look, W2/m4, the mean over channels and over as many neighbours as are filtered.

    A single difference has one degree of freedom: where it decided alone, two looks that happen to err alike would
    look clean and not be smoothed.
    """
    variance = np.square(_light(first) - _light(second)).mean(axis=1) / 2
    for step in STEPS:
        around = neighbours.at(step)
        there = around >= 0
        variance = (variance + np.where(there, variance[around], 0).sum(axis=1)) / (1 + there.sum(axis=1))
    return np.asarray(variance, np.float32)


def _light(look: Float) -> Float:
    return look[:, :3] + look[:, 3:6]


def _filter(job: tuple[slice, Float, Float, Receivers, Int, Float]) -> tuple[Float, Float, Float]:
    part, first, second, receivers, around, variance = job
    others, kernel = around[part], _beside(receivers, around, part)
    noise = variance[part][:, None] + variance[others]
    out = []
    power = np.zeros(len(others), np.float32)
    for guide, source in ((second, first), (first, second)):
        apart = np.square(_light(guide)[others] - _light(guide)[part][:, None]).mean(axis=2)
        excess = np.maximum(apart - noise, 0) / np.maximum(noise * np.float32(DEVIATIONS**2), np.float32(1e-30))
        weight = np.where(excess < FARTHEST, kernel * np.exp(-excess), np.float32(0))
        total = 1 + weight.sum(axis=1)
        around = np.einsum("nk,nkc->nc", weight, source[others])
        out.append(np.asarray((source[part] + around) / total[:, None], np.float32))
        power += (variance[part] + (weight**2 * variance[others]).sum(axis=1)) / total**2 / 2
    return out[0], out[1], power

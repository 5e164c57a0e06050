"""Gathered light without its noise: neighbours that differ by no more than noise would make them are averaged.

An edge-avoiding wavelet filter (Dammertz, Sewtz, Hanika & Lensch 2010) over the texels of a chart. Every receiver was
gathered twice; each of the two is filtered with weights that the other one gives (Rousselle, Knaus & Zwicker 2012), so
that noise can't vote for itself, and half the difference of the two results is still an honest sample of the error of
their mean. Only gathered light is filtered; the lamps' shadows are not.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .neighbours import Neighbours
from .parallel import Run, slices
from .receivers import Receivers

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]

# Steps of the filter, texels: seven to each side in all.
STEPS = (1, 2, 4)
# Weights of a neighbour beside and across, over the middle's own (the separable 1-2-1 kernel).
BESIDE, ACROSS = np.float32(0.5), np.float32(0.25)
_KERNEL = np.array([ACROSS, BESIDE, ACROSS, BESIDE, BESIDE, ACROSS, BESIDE, ACROSS], np.float32)
# Neighbours that differ by this many standard deviations more than noise explains hardly count.
DEVIATIONS = 0.3
# Receivers that face apart by more than this cosine do not share light.
SAME_WAY = 0.95
CHUNK = 2**16


def smooth(first: Float, second: Float, receivers: Receivers, neighbours: Neighbours, run: Run) -> tuple[Float, Float]:
    """Filter two independent looks at the same receivers, (n, 6 ...) each: emitted and reflected light, RGB, and more
    columns that are filtered with the weights that these give."""
    variance = _variance(first, second, neighbours)
    for step in STEPS:
        around = neighbours.at(step)
        jobs = [(part, first, second, receivers, around, variance) for part in slices(len(first), CHUNK)]
        done = run.map(_filter, jobs)
        first, second, variance = (np.concatenate([piece[axis] for piece in done]) for axis in range(3))
    return first, second


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
    others = around[part]
    there = others >= 0
    facing = np.einsum("nkc,nc->nk", receivers.normal[others], receivers.normal[part])
    kernel = np.where(there & (facing > SAME_WAY), _KERNEL, np.float32(0))
    noise = variance[part][:, None] + variance[others]
    out = []
    power = np.zeros(len(others), np.float32)
    for guide, source in ((second, first), (first, second)):
        apart = np.square(_light(guide)[others] - _light(guide)[part][:, None]).mean(axis=2)
        excess = np.maximum(apart - noise, 0) / np.maximum(noise * np.float32(DEVIATIONS**2), np.float32(1e-30))
        weight = kernel * np.exp(-excess)
        total = 1 + weight.sum(axis=1)
        around = np.einsum("nk,nkc->nc", weight, source[others])
        out.append(np.asarray((source[part] + around) / total[:, None], np.float32))
        power += (variance[part] + (weight**2 * variance[others]).sum(axis=1)) / total**2 / 2
    return out[0], out[1], power

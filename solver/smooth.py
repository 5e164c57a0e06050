"""Gathered light without its noise: neighbours that differ by no more than noise would make them are averaged.

An edge-avoiding wavelet filter (Dammertz, Sewtz, Hanika & Lensch 2010) over the texels of a chart. Every receiver was
gathered twice; each of the two is filtered with weights that the other one gives (Rousselle, Knaus & Zwicker 2012), so
that noise can't vote for itself, and half the difference of the two results is still an honest sample of the error of
their mean. Only gathered light is filtered; the lamps' shadows are not.
"""

from __future__ import annotations

from collections.abc import Sequence
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
DEVIATIONS = 1.4
# The same of rare light, which is judged by the receivers beside as well.
RARE_DEVIATIONS = 1.0
# Where the excess is this many times that, they don't count at all: no light seeps into the dark.
FARTHEST = 8.0
# Receivers that face apart by more than this cosine do not share light.
SAME_WAY = 0.95
CHUNK = 2**16


def smooth(first: Float, second: Float, receivers: Receivers, neighbours: Neighbours, run: Run, *,
           rare: bool = False) -> tuple[Float, Float]:
    """Filter two independent looks at the same receivers, (n, 6 ...) each: emitted and reflected light, RGB, and more
    columns that are filtered with the weights that these give.

    rare : of light that few rays bring. What the two looks agree on counts less if it is not in the receivers
        beside: among many receivers there are some to which both looks brought such a ray by chance.
    """
    rings = [neighbours.at(step) for step in STEPS]
    variance = _variance(first, second, rings)
    for ring in rings:
        guides = [light_of(look) for look in (second, first)]
        if rare:
            guides = _with_neighbours(guides, receivers, rings[0], run)
        softness = np.float32((RARE_DEVIATIONS if rare else DEVIATIONS) ** 2)
        jobs = [(part, first, second, guides, receivers, ring, variance, softness)
                for part in shares(len(first), CHUNK)]
        done = run.map(_filter, jobs)
        first, second, variance = (np.concatenate([piece[axis] for piece in done]) for axis in range(3))
    return first, second


def kernel_weights(receivers: Receivers, others: Int, part: slice) -> Float:
    """(m, 8): the kernel's weights of the neighbours of some receivers, 0 where there is none or it faces apart."""
    facing = np.einsum("nkc,nc->nk", np.take(receivers.normal, others[part], axis=0), receivers.normal[part])
    return np.where((others[part] >= 0) & (facing > SAME_WAY), _KERNEL, np.float32(0))


def _variance(first: Float, second: Float, rings: Sequence[Int]) -> Float:
    """(n,) variance of one look, W2/m4, the mean over channels and over as many neighbours as are filtered.

    A single difference has one degree of freedom: where it decided alone, two looks that happen to err alike would
    look clean and not be smoothed.
    """
    variance = np.square(light_of(first) - light_of(second)).mean(axis=1) / 2
    for ring in rings:
        there = ring >= 0
        variance = (variance + np.where(there, variance[ring], 0).sum(axis=1)) / (1 + there.sum(axis=1))
    return np.asarray(variance, np.float32)


def light_of(look: Float) -> Float:
    """(n, 3) all light of a look (n, 6 ...)."""
    return look[:, :3] + look[:, 3:6]


def _with_neighbours(guides: list[Float], receivers: Receivers, beside: Int, run: Run) -> list[Float]:
    """Means over receivers and those beside them of each of some (n, 3). (Over those beside alone, no speckle is left,
    but contact shadows are blurred half as much again.)"""
    def work(part: slice) -> list[Float]:
        weight, others = kernel_weights(receivers, beside, part), beside[part]
        total = 1 + weight.sum(axis=1, keepdims=True)
        return [(guide[part] + np.einsum("nk,nkc->nc", weight, np.take(guide, others, axis=0))) / total
                for guide in guides]

    parts = run.map(work, shares(len(beside), CHUNK))
    return [np.concatenate([part[number] for part in parts]) for number in range(len(guides))]


def _filter(job: tuple[slice, Float, Float, list[Float], Receivers, Int, Float, np.float32]
            ) -> tuple[Float, Float, Float]:
    part, first, second, guides, receivers, around, variance, softness = job
    others, kernel = around[part], kernel_weights(receivers, around, part)
    noise = variance[part][:, None] + variance[others]
    out = []
    power = np.zeros(len(others), np.float32)
    for guide, source in zip(guides, (first, second), strict=True):
        squares = np.square(np.take(guide, others, axis=0) - guide[part][:, None])
        apart = (squares[..., 0] + squares[..., 1] + squares[..., 2]) / np.float32(3)
        excess = np.maximum(apart - noise, 0) / np.maximum(noise * softness, np.float32(1e-30))
        weight = np.where(excess < FARTHEST, kernel * np.exp(-excess), np.float32(0))
        total = 1 + weight.sum(axis=1)
        around = np.einsum("nk,nkc->nc", weight, np.take(source, others, axis=0))
        out.append(np.asarray((source[part] + around) / total[:, None], np.float32))
        power += (variance[part] + (weight**2 * variance[others]).sum(axis=1)) / total**2 / 2
    return out[0], out[1], power

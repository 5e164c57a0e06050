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

from .kernels import Kernel, Kernels, for_all
from .parallel import Run

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]

# Neighbours that differ by this many standard deviations more than noise explains hardly count.
DEVIATIONS = 1.4
# The same of rare light, which is judged by the receivers beside as well.
RARE_DEVIATIONS = 1.0
# Where the excess is this many times that, they don't count at all: no light seeps into the dark.
FARTHEST = 8.0


def smooth(first: Float, second: Float, kernels: Kernels, run: Run, *, rare: bool = False) -> tuple[Float, Float]:
    """Filter two independent looks at the same receivers, (n, 6 ...) each: emitted and reflected light, RGB, and more
    columns that are filtered with the weights that these give.

    rare : of light that few rays bring. What the two looks agree on counts less if it is not in the receivers
        beside: among many receivers there are some to which both looks brought such a ray by chance.
    """
    variance = _variance(first, second, kernels, run)
    softness = np.float32((RARE_DEVIATIONS if rare else DEVIATIONS) ** 2)
    for kernel in kernels:
        guides = [light_of(look) for look in (second, first)]
        if rare:
            guides = [_with_neighbours(guide, kernels[0], run) for guide in guides]
        first, second, variance = _filtered(first, second, guides, variance, softness, kernel, run)
    return first, second


def _variance(first: Float, second: Float, kernels: Kernels, run: Run) -> Float:
    """(n,) variance of one look, W2/m4, the mean over channels and over as many neighbours as are filtered.

    A single difference has one degree of freedom: where it decided alone, two looks that happen to err alike would
    look clean and not be smoothed.
    """
    variance = np.square(light_of(first) - light_of(second)).mean(axis=1) / 2
    for kernel in kernels:
        variance = _pooled(variance, kernel.others, run)
    return np.asarray(variance, np.float32)


def _pooled(values: Float, others: Int, run: Run) -> Float:
    """Means (n,) over receivers and their neighbours."""
    out = np.empty_like(values)

    def work(part: slice) -> None:
        there = others[part] >= 0
        near = np.where(there, np.take(values, others[part]), 0)
        out[part] = (values[part] + near.sum(axis=1)) / (1 + there.sum(axis=1))

    for_all(work, len(values), run)
    return out


def light_of(look: Float) -> Float:
    """(n, 3) all light of a look (n, 6 ...)."""
    return look[:, :3] + look[:, 3:6]


def _with_neighbours(guide: Float, kernel: Kernel, run: Run) -> Float:
    """Means (n, 3) over receivers and those beside them. (Over those beside alone, no speckle is left, but contact
    shadows are blurred half as much again.)"""
    out = np.empty_like(guide)

    def work(part: slice) -> None:
        out[part] = kernel.mean(guide, part)

    for_all(work, len(guide), run)
    return out


def _filtered(first: Float, second: Float, guides: list[Float], variance: Float, softness: np.float32, kernel: Kernel,
              run: Run) -> tuple[Float, Float, Float]:
    """Both looks filtered by one kernel, and the variance that is left of each."""
    out = np.empty_like(first), np.empty_like(second)
    power = np.empty_like(variance)

    def work(part: slice) -> None:
        others, own = kernel.others[part], variance[part]
        near = np.take(variance, others)
        noise = own[:, None] + near
        left = np.zeros(len(others), np.float32)
        for guide, source, filtered in zip(guides, (first, second), out, strict=True):
            apart = np.take(guide, others, axis=0) - guide[part][:, None]
            squares = np.einsum("nkc,nkc->nk", apart, apart) / np.float32(3)
            excess = np.maximum(squares - noise, 0) / np.maximum(noise * softness, np.float32(1e-30))
            weight = np.where(excess < FARTHEST, kernel.weights[part] * np.exp(-excess), np.float32(0))
            total = 1 + weight.sum(axis=1)
            around = np.einsum("nk,nkc->nc", weight, np.take(source, others, axis=0))
            filtered[part] = (source[part] + around) / total[:, None]
            left += (own + (weight**2 * near).sum(axis=1)) / total**2 / 2
        power[part] = left

    for_all(work, len(first), run)
    return *out, power

"""How much error is left in gathered light that is filtered: noise, and what the filter blurs.

What a filter blurs does not show in the difference of two filtered looks. Against the *other* look, unfiltered, it
does: with v the variance of a look, and a filter that knows nothing of it,

    mean((filtered first - second)^2) = (blur^2 + variance of the filtered look) + v

(cross-validation, Stone 1974).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .neighbours import Neighbours
from .parallel import Run, shares
from .receivers import Receivers
from .smooth import CHUNK, STEPS, kernel_weights, light_of

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]


def remaining(first: Float, second: Float, receivers: Receivers, neighbours: Neighbours, run: Run) -> Float:
    """(n,) mean square error that is left in the mean of two filtered looks, W2/m4.

    Filters that know nothing of the other look are the kernels of `smooth` by themselves, after each of its steps; at
    every receiver the one counts that is best around it.
    """
    looks = np.concatenate([light_of(first), light_of(second)], axis=1)
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
        parts = run.map(lambda part: kernel_weights(receivers, others, part), shares(len(others), CHUNK))
        weights = np.concatenate(parts)
        return cls(others, weights / (1 + weights.sum(axis=1, keepdims=True)))

    def filtered(self, values: Float, run: Run) -> Float:
        """(n, c) from (n, c)."""
        def work(part: slice) -> Float:
            weights = self.weights[part]
            own = values[part] * (1 - weights.sum(axis=1, keepdims=True))
            return np.asarray(own + np.einsum("nk,nkc->nc", weights, np.take(values, self.others[part], axis=0)))

        return np.concatenate(run.map(work, shares(len(values), CHUNK)))

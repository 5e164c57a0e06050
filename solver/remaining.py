"""How much error is left in gathered light that is filtered: noise, and what the filter blurs.

What a filter blurs does not show in the difference of two filtered looks. Against the *other* look, unfiltered, it
does: with v the variance of a look, and a filter that knows nothing of it,

    mean((filtered first - second)^2) = (blur^2 + variance of the filtered look) + v

(cross-validation, Stone 1974).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .kernels import Kernel, Kernels, among, around, for_all
from .parallel import Run
from .smooth import light_of

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]

# Where more than this part of the receivers is asked for, all are.
MOST_APART = 0.25


def remaining(first: Float, second: Float, kernels: Kernels, run: Run) -> Float:
    """(n,) float32: mean square error that is left in the mean of two filtered looks, W2/m4.

    Filters that know nothing of the other look are the kernels of `smooth` by themselves, after each of its steps; at
    every receiver the one counts that is best around it.
    """
    count = len(first)
    looks = np.empty((count, 6), np.float32)
    # Of the looks as they are, and of each filter: the error, and the least that it can be.
    found = np.empty((count, 1 + 2 * len(kernels)), np.float32)

    def begin(part: slice) -> None:
        looks[part, :3], looks[part, 3:] = light_of(first[part]), light_of(second[part])
        found[part, 0] = _square(looks[part, :3] - looks[part, 3:]) / 4

    for_all(begin, count, run)
    filtered = looks
    for number, kernel in enumerate(kernels):
        filtered = _filtered(filtered, looks, kernel, found[:, 2 * number:], run)
    halfway, best = np.empty_like(found), np.empty(count, np.float32)

    def average(part: slice) -> None:
        halfway[part] = kernels[0].mean(found, part)

    def end(part: slice) -> None:
        near = kernels[1].mean(halfway, part)
        best[part] = np.minimum(near[:, 0], np.maximum(near[:, 1::2], near[:, 2::2]).min(axis=1))

    for_all(average, count, run)
    for_all(end, count, run)
    return best


def remaining_after(first: Float, second: Float, rows: Int, before: Float, kernels: Kernels, run: Run) -> Float:
    """`remaining`, where it is known from before some rows of the looks changed: worked out anew around these."""
    reach = [*kernels, *kernels[:2]]
    changed = around(rows, reach)
    needed = around(changed, reach) if len(changed) <= MOST_APART * len(first) else changed
    if len(needed) > MOST_APART * len(first):
        return remaining(first, second, kernels, run)
    there = remaining(first[needed], second[needed], among(needed, kernels), run)
    after = before.copy()
    after[changed] = there[np.searchsorted(needed, changed)]
    return after


def _filtered(values: Float, looks: Float, kernel: Kernel, found: Float, run: Run) -> Float:
    """Values (n, 6), the first look's and the second's, filtered once more; `found` gets the error that is left in the
    mean of both, and its least, in columns 1 and 2."""
    out = np.empty_like(values)

    def work(part: slice) -> None:
        out[part] = filtered = kernel.mean(values, part)
        first, second = looks[part, :3], looks[part, 3:]
        halves = _square(filtered[:, :3] - filtered[:, 3:])
        against = (_square(filtered[:, :3] - second) + _square(filtered[:, 3:] - first)) / 2
        # The mean of both has all of the blur, and half of the variance; by chance the blur may come out below 0.
        found[part, 1] = against - _square(first - second) / 2 - halves / 4
        found[part, 2] = halves / 4

    for_all(work, len(values), run)
    return out


def _square(values: Float) -> Float:
    """(n,): the mean of the squares of (n, 3)."""
    return np.asarray(np.einsum("nc,nc->n", values, values) / np.float32(3))

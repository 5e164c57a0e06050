"""Tables that rays read, and means over many of them.

Rows are fetched by `np.take`, several times as fast as `table[rows]`, there and everywhere else where there are many.
A cell has one row of four float32, since NumPy copies rows of sixteen bytes much faster than those of twelve.
Means over rays are products with a row of weights, much faster than `mean` over a middle axis.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .parallel import Run, shares

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]

CHUNK = 2**18
# Fewer rays than this are not worth a thread.
LEAST = 2**14
# Rays that one product adds up: BLAS shares longer ones out to the machine's cores, and bits would depend on these.
RUN = 2**10


def padded(values: Float) -> Float:
    """(n + 1, 4) float32: values (n, 3) in the first columns, and a row of zeros, for index -1."""
    out = np.zeros((len(values) + 1, 4), np.float32)
    out[:-1, :3] = values
    return out


def mean_of_channels(values: Float) -> Float:
    """(n,): mean of the first three columns of (n, 3 or 4); of many rows several times as fast as `mean(axis=1)`."""
    return np.asarray((values[:, 0] + values[:, 1] + values[:, 2]) / np.float32(3))


def mean_over_rays(values: Float, count: int) -> Float:
    """(n, 3): means over runs of `count` rows of values (n * count, 4)."""
    rows, weights = values.reshape(-1, count, 4), _weights(count)
    sums = [np.matmul(weights[:, :, first:first + RUN], rows[:, first:first + RUN]) for first in range(0, count, RUN)]
    return np.asarray(sum(sums[1:], sums[0])[:, 0, :3])


def mean_of_hits(table: Float, hits: NDArray[np.int32], run: Run) -> Float:
    """(p, 3): means over each row (p, rays) of indices into a padded table."""
    count = hits.shape[1]
    parts = run.map(lambda part: mean_over_rays(np.take(table, hits[part].reshape(-1), axis=0), count),
                    shares(len(hits), max(1, CHUNK // count), LEAST // count))
    return np.concatenate(parts)


@cache
def _weights(count: int) -> Float:
    return np.full((1, 1, count), 1 / count, np.float32)

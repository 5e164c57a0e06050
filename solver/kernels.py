"""The wavelet filter of gathered light where nothing but the layout decides: neighbours and their weights.

Made once for all passes over the same receivers: weights by the angle between normals, for the steps of an
edge-avoiding wavelet (Dammertz, Sewtz, Hanika & Lensch 2010).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
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
# Receivers that face apart by more than this cosine do not share light.
SAME_WAY = 0.95
# Receivers that a thread filters at once.
CHUNK = 2**15


@dataclass(frozen=True, eq=False)
class Kernel:
    """One step of the filter.

    others : (n, 8) int32, the neighbours; any where the weight is 0.
    weights : (n, 8) float32, over the middle's own, 0 where there is no neighbour or it faces apart.
    share : (n,) float32, what the middle has of the whole.
    """

    others: Int
    weights: Float
    share: Float

    def mean(self, values: Float, part: slice) -> Float:
        """(m, c): weighted means of values (n, c) around some receivers."""
        around = np.einsum("nk,nkc->nc", self.weights[part], np.take(values, self.others[part], axis=0))
        return np.asarray((values[part] + around) * self.share[part, None])


Kernels = Sequence[Kernel]


def kernels(receivers: Receivers, neighbours: Neighbours, run: Run) -> Kernels:
    """Those of all steps, with 68 bytes a receiver each."""
    return [_kernel(receivers, neighbours.at(step), run) for step in STEPS]


def _kernel(receivers: Receivers, others: Int, run: Run) -> Kernel:
    weights, share = np.empty(others.shape, np.float32), np.empty(len(others), np.float32)

    def work(part: slice) -> None:
        facing = np.einsum("nkc,nc->nk", np.take(receivers.normal, others[part], axis=0), receivers.normal[part])
        weights[part] = np.where((others[part] >= 0) & (facing > SAME_WAY), _KERNEL, np.float32(0))
        share[part] = 1 / (1 + weights[part].sum(axis=1))

    for_all(work, len(others), run)
    return Kernel(others, weights, share)


def for_all(work: Callable[[slice], None], count: int, run: Run) -> None:
    """`work` for all of so many receivers, in parts; it writes what comes of them to arrays of its own."""
    run.map(work, shares(count, CHUNK))


def around(rows: Int, some: Kernels) -> Int:
    """Rows, and all that one step of each of some kernels brings them together with, ascending."""
    for kernel in some:
        near = kernel.others[rows][kernel.weights[rows] > 0]
        rows = np.unique(np.concatenate([rows, near.astype(rows.dtype)]))
    return rows


def among(rows: Int, some: Kernels) -> Kernels:
    """The kernels among rows alone; what reaches beyond them is wrong at those."""
    place = np.zeros(len(some[0].others), np.int32)
    place[rows] = np.arange(len(rows), dtype=np.int32)
    return [Kernel(place[kernel.others[rows]], kernel.weights[rows], kernel.share[rows]) for kernel in some]

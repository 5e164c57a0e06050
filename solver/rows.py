"""Rows of form factors as ray hits, kept raw: F_ij is the part of row i's rays that meet cells of patch j."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.floating[Any]]

# A patch is only split where its eighths differ this many times as much (in variance) as noise would make them.
NOISE_LEVEL = 5.0


@dataclass(frozen=True, eq=False)
class Rows:
    """Form factors of a run of patches.

    patch : (p,) int32.
    hits : (p, rays) int32 rows of `cells`, NOTHING for the sky.
    part : (p, rays) uint8, the eighth of what the patch's rays start from that each ray starts in.
    sky : (p, rays, 3) float32, irradiance from the sky that each ray stands for, W/m2; None for a black sky.
    """

    patch: NDArray[np.int32]
    hits: NDArray[np.int32]
    part: NDArray[np.uint8]
    sky: Float | None

    def take(self, index: NDArray[Any]) -> Rows:
        """Some of the rows."""
        sky = None if self.sky is None else self.sky[index]
        return Rows(self.patch[index], self.hits[index], self.part[index], sky)

    @cached_property
    def _mean_sky(self) -> Float:
        if self.sky is None:
            return np.zeros((len(self.patch), 3), np.float32)
        rays = self.sky.shape[1]
        # A product with a row of ones: much faster than a mean over a middle axis.
        return np.asarray(np.matmul(np.full((1, 1, rays), 1 / rays, np.float32), self.sky)[:, 0])

    def mean_sky(self) -> Float:
        """(p, 3) W/m2."""
        return self._mean_sky

    def deviation(self, table: Float) -> Float:
        """(p,) RMS deviation of the irradiance between the eighths of each patch, its noise taken out, W/m2.

        table : (cells + 1,) float32, the radiosity of cells, mean of the channels.
        """
        value = self._brought(table)
        count = len(self.patch)
        group = (np.arange(count)[:, None] * 8 + self.part).reshape(-1)
        number = np.bincount(group, minlength=count * 8).reshape(-1, 8)
        total = np.bincount(group, value.reshape(-1), count * 8).reshape(-1, 8)
        square = np.square(value, dtype=np.float64).sum(axis=1)
        mean = total / np.maximum(number, 1)
        free = np.maximum(number.sum(axis=1) - (number > 0).sum(axis=1), 1)
        inside = (square - (number * mean**2).sum(axis=1)) / free
        overall = (total.sum(axis=1) / number.sum(axis=1))[:, None]
        groups = np.maximum((number > 0).sum(axis=1) - 1, 1)
        between = (number * (mean - overall) ** 2).sum(axis=1) / groups
        # One-way analysis of variance: without a difference, `between` is `inside` times F(groups, rays) about 1.
        excess = np.maximum(between - NOISE_LEVEL * inside, 0)
        return np.asarray(np.sqrt(excess * groups / number.sum(axis=1)))

    def sums(self, table: Float) -> tuple[Float, Float]:
        """(p,) irradiance of each row, mean of the channels, W/m2; and its variance, were its rays random."""
        value = self._brought(table)
        return value.mean(axis=1), value.var(axis=1) / value.shape[1]

    def _brought(self, table: Float) -> Float:
        """(p, rays) what each ray brings, mean of the channels, W/m2."""
        value = np.take(table, self.hits)
        if self.sky is None:
            return value
        return np.asarray(value + (self.sky[..., 0] + self.sky[..., 1] + self.sky[..., 2]) / np.float32(3))


def level_noise(rows: Sequence[Rows], weight: Float, leaving: Float, direct: Float) -> float:
    """About the standard deviation that the noise of rows gives a mean of the patches' irradiance, W/m2.

    All receivers see the same patches: what their rows err by shifts the light of all, and no neighbour tells. Each
    row's own error goes on by reflection, as the light of the first bounce does.

    Parameters
    ----------
    weight : (p,) of each patch in that mean.
    leaving, direct : (cells + 1,) float32, radiosity of cells, and what of it does not come from patches; mean of the
        channels.
    """
    variance = whole = first = 0.0
    for some in rows:
        own = weight[some.patch]
        value, noise = some.sums(leaving)
        variance += float((own**2 * noise).sum())
        whole += float((own * value).sum())
        first += float((own * some.sums(direct)[0]).sum())
    return float(np.sqrt(variance)) * whole / max(first, 1e-30)

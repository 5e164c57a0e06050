"""Where the light of receivers comes from, learnt from their first rays, so that further ones go there.

Through a window, or from a small bright wall, light comes from few directions, and cosine-distributed rays seldom lead
there. Receivers that lie together and face one way see it in about the same directions: blocks of them have one
density, by the root mean square of what their first rays brought (after Vorba et al. 2014, who learn mixtures of
Gaussians). It is kept as its inverse: heights that part the hemisphere into strips of equal probability, and azimuths
that part each strip, so that quasi-random points stay spread as evenly as they were. Whatever the density, rays that
are weighted by its inverse are without bias. Blocks where that gains little go on with cosine-distributed rays.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]

# Receivers of a block at most: so many, or so large a part of all.
BLOCK, BLOCK_SHARE = 48, 1 / 2048
# Bins over squared sine of the polar angle, and over azimuth, in which light is taken down.
HEIGHTS, AZIMUTHS = 8, 16
# The hemisphere is parted into so many strips of equal probability, and each of these into so many parts.
STRIPS, PARTS = 16, 16
# Part of the rays that goes on as without a guide: none stands for more than 1 / UNGUIDED others.
UNGUIDED = 0.2
# Part of its weight that a bin takes from the four beside it: where an edge of the light lies differs within a block.
BLUR = 0.4
# Guided rays must lessen the variance by this factor at least; each counts as WORTH others (a power of two).
LEAST_GAIN, WORTH = 2.5, 4
# Light is taken down in whole numbers of this part of the usual, up to MOST_LIGHT times that: sums of them and of their
# squares are exact, whatever their order.
STEP, MOST_LIGHT = 2.0**-8, 2.0**10


class Tally:
    """What rays brought from where, block by block.

    Parameters
    ----------
    block : (n,) int, the block of each receiver.
    count : of the blocks.
    usual : what rays bring on the average, W/m2, about.
    """

    def __init__(self, block: Int, count: int, usual: float) -> None:
        self.block, self._usual = block, max(usual, 1e-30)
        self._sums = np.zeros((3, count, HEIGHTS * AZIMUTHS))

    def of(self, rows: Int, height: Float, azimuth: Float, light: Float) -> tuple[Int, Float]:
        """What rays (n, k) of some receivers (n,) brought: (b,) their blocks, and (3, b, bins) number of rays, sum, and
        sum of squares.

        height, azimuth : in [0, 1), squared sine of the polar angle, and part of a turn.
        light : (n * k,) W/m2.
        """
        light = np.rint(np.minimum(light / self._usual, MOST_LIGHT) / STEP)
        blocks, place = np.unique(self.block[rows], return_inverse=True)
        bins = HEIGHTS * AZIMUTHS
        row = (height * np.float32(HEIGHTS)).astype(np.int32) * AZIMUTHS
        row += (azimuth * np.float32(AZIMUTHS)).astype(np.int32)
        row += (place * bins).astype(np.int32)[:, None]
        where, most = row.reshape(-1), len(blocks) * bins
        sums = [np.bincount(where, weight, most) for weight in (None, light, np.square(light))]
        return blocks, np.asarray(np.stack(sums).reshape(3, len(blocks), bins), np.float64)

    def add(self, blocks: Int, sums: Float) -> None:
        """Take down what `of` found."""
        self._sums[:, blocks] += sums

    def guides(self, least: float = 0.0) -> Guides:
        """What was learnt; of blocks where fewer rays than `least` found light, in effect (Kish 1965), nothing."""
        number, light, square = self._sums
        found = light.sum(axis=1) ** 2 / np.maximum(square.sum(axis=1), 1)
        shape = (-1, HEIGHTS, AZIMUTHS)
        # A bin without a ray is as bright as its block.
        usual = (square.sum(axis=1) / np.maximum(number.sum(axis=1), 1))[:, None]
        square = np.where(number > 0, square / np.maximum(number, 1), usual)
        mean = light.sum(axis=1) / np.maximum(number.sum(axis=1), 1)
        density = _density(np.sqrt(square).reshape(shape))
        before = square.mean(axis=1) - mean**2
        after = (square / density.reshape(square.shape)).mean(axis=1) - mean**2
        pays = (before > 0) & (found >= least) & (before > LEAST_GAIN * np.maximum(after, 0))
        edges = np.arange(HEIGHTS + 1) / HEIGHTS
        strips = _quantiles(density.mean(axis=2), STRIPS)
        low, high = strips[:, :-1, None], strips[:, 1:, None]
        shared = np.minimum(high, edges[1:]) - np.maximum(low, edges[:-1])
        across = np.matmul(np.maximum(shared, 0), density)
        parts = _quantiles(across.reshape(-1, AZIMUTHS), PARTS).reshape(-1, STRIPS, PARTS + 1)
        return Guides(self.block, pays[self.block], np.asarray(strips, np.float32),
                      np.asarray(parts, np.float32))


@dataclass(frozen=True, eq=False)
class Guides:
    """Densities over directions.

    block : (n,) int, the block of each receiver.
    pays : (n,) bool, the receivers whose rays should be guided.
    strips : (b, STRIPS + 1) heights, and
    parts : (b, STRIPS, PARTS + 1) azimuths, between which lie directions of equal probability.
    """

    block: Int
    pays: NDArray[np.bool_]
    strips: Float
    parts: Float

    def aim(self, rows: Int, height: Float, azimuth: Float) -> tuple[Float, Float, Float]:
        """Heights and azimuths (n, k) of rays of receivers (n,), from evenly spread ones, and how many of those each
        stands for (n, k)."""
        block = self.block[rows].astype(np.int32)[:, None]
        strip, height, weight = _between(self.strips, block, height, STRIPS)
        _, azimuth, across = _between(self.parts, block * np.int32(STRIPS) + strip, azimuth, PARTS)
        weight *= across
        return height, azimuth, weight


def _between(knots: Float, row: Int, place: Float, count: int) -> tuple[Int, Float, Float]:
    """Which of `count` steps places (n, k) in [0, 1) lie in, what lies there between the knots (.., count + 1) of a row
    of these, and how wide that step is in parts of the usual."""
    place = place * np.float32(count)
    step = place.astype(np.int32)
    place -= step
    at = row * np.int32(count + 1) + step
    table = knots.reshape(-1)
    low = np.take(table, at)
    at += 1
    width = np.take(table, at)
    width -= low
    place *= width
    place += low
    width *= np.float32(count)
    return step, np.minimum(place, np.float32(1 - 2.0**-24), out=place), width


def _density(root: Float) -> Float:
    """(b, heights, azimuths) density, 1 in the mean, from the root mean square of the light in each bin."""
    above = np.concatenate([root[:, :1], root[:, :-1]], axis=1)
    below = np.concatenate([root[:, 1:], root[:, -1:]], axis=1)
    beside = (above + below + np.roll(root, 1, axis=2) + np.roll(root, -1, axis=2)) / 4
    blurred = (1 - BLUR) * root + BLUR * beside
    mean = blurred.mean(axis=(1, 2), keepdims=True)
    return np.asarray((1 - UNGUIDED) * np.where(mean > 0, blurred / np.maximum(mean, 1e-300), 1) + UNGUIDED)


def _quantiles(density: Float, count: int) -> Float:
    """(b, count + 1) places in [0, 1] between which densities (b, bins), constant in bins of equal width, have equal
    parts of their whole."""
    bins = density.shape[1]
    running = np.cumsum(density, axis=1)
    running /= running[:, -1:]
    goal = np.arange(1, count) / count
    into = (running[:, None, :-1] <= goal[:, None]).sum(axis=2)
    row = np.arange(len(density))[:, None]
    before = np.concatenate([np.zeros((len(density), 1)), running], axis=1)
    part = (goal - before[row, into]) / (before[row, into + 1] - before[row, into])
    inner = (into + part) / bins
    return np.concatenate([np.zeros((len(density), 1)), inner, np.ones((len(density), 1))], axis=1)

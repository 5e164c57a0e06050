"""Rays of lumels: even in their directions, and such that neighbours complete one another."""

from __future__ import annotations

import numpy as np
import pytest
from radiosity.solver.kernels import STEPS
from radiosity.solver.sampling import interleaved, kronecker, rays_of_places, shifted, shifts


def _half_planes(points):
    """Whether points (n, k, 2) of the unit square lie on one side of 16 lines: (n, k, 16)."""
    angle = np.pi * (np.arange(16) + 0.3) / 16
    across = (points - 0.5) @ np.stack([np.cos(angle), np.sin(angle)])
    return (across < 0.17 * np.sin(3 * angle)).astype(float)


def _means(points, move):
    """(n, 16): of the first two coordinates of points (k, d), moved by (n, 2)."""
    return _half_planes(np.stack([shifted(points[:, axis], move[:, axis]) for axis in (0, 1)], axis=-1)).mean(axis=1)


@pytest.mark.parametrize("count", [64, 128, 256])
def test_directions_are_more_even_than_the_first_two_of_four_dimensions(count):
    # 16 half-planes, 4,000 shifts, against the mean over all shifts. The first step of the four-dimensional recurrence
    # is nearly 6/7.
    move = shifts(np.arange(4000), 2, seed=8)
    ours, theirs = (_means(points, move).std(axis=0) for points in (rays_of_places(count), kronecker(count, 4)))
    assert np.square(ours).mean() < 0.9 * np.square(theirs).mean()


def test_rays_can_be_continued():
    # 16 points and the next 48 are the 64.
    assert np.array_equal(np.concatenate([rays_of_places(16), rays_of_places(48, 16)]), rays_of_places(64))


def _smoothed(image):
    """The filter of `smooth.py` where all neighbours are alike, inside an image."""
    for step in STEPS:
        for axis in (0, 1):
            image = image / 2 + (np.roll(image, step, axis) + np.roll(image, -step, axis)) / 4
    reach = sum(STEPS)
    return image[reach:-reach, reach:-reach]


@pytest.mark.parametrize("count", [32, 128])
def test_smoothing_takes_more_of_the_noise_of_interleaved_lumels(count):
    # An image of 80 x 80 lumels that all see the same 16 half-planes; independent shifts leave 1 / 11 of their noise.
    side = 80
    row, column = np.divmod(np.arange(side * side), side)
    texel, same = np.stack([column, row], axis=1), np.zeros(side * side, np.int64)
    left = [_smoothed(_means(rays_of_places(count), move).reshape(side, side, -1)).std(axis=(0, 1)).mean()
            for move in (interleaved(texel, same, 4), shifts(np.arange(side * side), 2, seed=4))]
    assert left[0] < 0.6 * left[1]


def test_interleaved_shifts_are_even_and_start_anywhere():
    # 64 x 64 lumels of two surfaces: 64 in each of 8 x 8 boxes, give or take a quarter; another seed moves them all.
    row, column = np.divmod(np.arange(64 * 64), 64)
    texel, surface = np.stack([column, row], axis=1), np.repeat([3, 5], 32 * 64)
    move = interleaved(texel, surface, 11)
    assert move.min() >= 0
    assert move.max() < 1
    counts = np.histogramdd(move.astype(float), bins=8, range=[(0, 1)] * 2)[0]
    assert np.abs(counts - 64).max() < 16
    apart = (interleaved(texel, surface, 12) - move) % 1
    assert len(np.unique(apart.round(4), axis=0)) <= 8
    assert np.abs(apart - apart[0]).max() > 0.01

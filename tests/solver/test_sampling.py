"""Points and shifts: even, independent, the same however they are asked for, and better than random ones."""

from __future__ import annotations

import numpy as np
import pytest
from radiosity.solver.sampling import cosine_directions, frames, kronecker, shifted, shifts, uniform

MANY = 100_000


def _smooth_integrand(points):
    """prod (1 + (x - 1/2) / 2 + sin(2 pi x) / 3) over the cube: the integral is 1."""
    return np.prod(1 + (points - 0.5) / 2 + np.sin(2 * np.pi * points) / 3, axis=-1)


def _error(count, dimensions, seeds=100):
    """RMS error of the integral over random shifts."""
    move = shifts(np.arange(seeds), dimensions, 5)
    points = np.stack([shifted(kronecker(count, dimensions)[:, axis], move[:, axis])
                       for axis in range(dimensions)], axis=-1).astype(float)
    return np.sqrt(np.mean((_smooth_integrand(points).mean(axis=1) - 1) ** 2))


@pytest.mark.parametrize(("dimensions", "most"), [(1, 12), (2, 12), (4, 14)])
def test_the_error_of_a_smooth_integrand_falls_faster_than_the_three_quarters_power(dimensions, most):
    # Integral 1 over the cube, 16 ... 4,096 points (16,384 where there are four dimensions, which need more until the
    # law shows): slope of log error over log count, 100 shifts.
    counts = 2 ** np.arange(4, most + 1)
    errors = [_error(int(count), dimensions) for count in counts]
    slope = np.polyfit(np.log(counts), np.log(errors), 1)[0]
    assert slope < -0.75


def test_shifted_estimates_are_unbiased():
    # 16 points, 20,000 shifts: the mean is 1 within four standard errors, and these are below 1e-3.
    move = shifts(np.arange(20_000), 2, 1)
    points = np.stack([shifted(kronecker(16, 2)[:, axis], move[:, axis]) for axis in (0, 1)], axis=-1).astype(float)
    found = _smooth_integrand(points).mean(axis=1)
    error = found.std(ddof=1) / len(found) ** 0.5
    assert error < 1e-3
    assert found.mean() == pytest.approx(1, abs=4 * error)


def test_a_set_of_points_can_be_continued():
    # 16 points and the next 48 are the 64.
    whole = kronecker(64, 4)
    assert np.array_equal(np.concatenate([kronecker(16, 4), kronecker(48, 4, 16)]), whole)


def test_random_numbers_do_not_depend_on_how_identities_are_cut_into_chunks():
    # 1,000 identities at once, one by one, shuffled.
    identity = np.arange(1000)
    whole = uniform(identity, 3, 9)
    assert np.array_equal(np.concatenate([uniform(identity[n:n + 1], 3, 9) for n in identity]), whole)
    order = np.random.default_rng(0).permutation(1000)
    assert np.array_equal(uniform(identity[order], 3, 9), whole[order])
    assert np.array_equal(uniform(identity.astype(np.int32), 3, 9), whole)


def test_random_numbers_are_even():
    # Mean 1/2, variance 1/12, and as many in each of 64 bins: chi^2 with 63 degrees of freedom stays below 115 (1e-4).
    drawn = uniform(np.arange(MANY), 0, 0).astype(float)
    assert drawn.mean() == pytest.approx(1 / 2, abs=4 / (12 * MANY) ** 0.5)
    assert drawn.var() == pytest.approx(1 / 12, rel=0.02)
    bins = np.bincount((drawn * 64).astype(int), minlength=64)
    assert ((bins - MANY / 64) ** 2 / (MANY / 64)).sum() < 115


@pytest.mark.parametrize("other", [{"dimension": 1}, {"seed": 1}, {"step": 1}, {"dimension": 2, "seed": 3}])
def test_random_numbers_of_other_dimensions_seeds_and_neighbours_are_independent(other):
    # Correlation of 100,000 pairs: 0 within four standard errors.
    identity = np.arange(MANY)
    first = uniform(identity, 0, 0)
    second = uniform(identity + other.get("step", 0), other.get("dimension", 0), other.get("seed", 0))
    assert abs(np.corrcoef(first, second)[0, 1]) < 4 / MANY**0.5


def test_shifted_points_never_reach_one():
    # A float32 sum of almost 1 and almost nothing may round to 1.
    below = np.float32(1 - 2.0**-24)
    moved = shifted(np.array([0, 0.5, below], np.float32), np.array([0, 2.0**-24, 0.5, below], np.float32))
    assert moved.dtype == np.float32
    assert moved.min() >= 0
    assert moved.max() < 1


def test_frames_are_orthonormal_and_right_handed():
    # Normals all over the sphere, the poles too.
    normal = np.random.default_rng(2).normal(size=(10_000, 3))
    normal = np.concatenate([normal / np.linalg.norm(normal, axis=1, keepdims=True), np.eye(3), -np.eye(3)])
    normal = normal.astype(np.float32)
    first, second = frames(normal)
    matrix = np.stack([first, second, normal], axis=1)
    assert matrix @ matrix.transpose(0, 2, 1) == pytest.approx(np.broadcast_to(np.eye(3), matrix.shape), abs=3e-6)
    assert np.linalg.det(matrix) == pytest.approx(1, abs=1e-5)


def test_cosine_directions_have_the_density_of_the_cosine():
    # About a skew normal: unit length, E[cos] = 2/3, E[cos^2] = 1/2, mean direction 2/3 of the normal.
    normal = np.array([[2, -1, 2]], np.float32) / np.float32(3)
    points = kronecker(MANY, 2)
    directions = cosine_directions(normal, points[None, :, 0], points[None, :, 1])[0]
    cosine = directions.astype(float) @ normal[0]
    assert np.linalg.norm(directions, axis=1) == pytest.approx(1, abs=1e-5)
    assert cosine.min() >= -1e-6
    assert [cosine.mean(), (cosine**2).mean()] == pytest.approx([2 / 3, 1 / 2], rel=1e-4)
    assert directions.mean(axis=0, dtype=float) == pytest.approx(normal[0] * 2 / 3, abs=1e-4)

"""The error estimate against bakes whose error is known because truth and noise are made here."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from radiosity.solver import estimator

LUMELS = 40_000


def _truth(random: np.random.Generator, lumels: int = LUMELS) -> NDArray[np.float64]:
    return random.uniform(0.5, 1.5, (lumels, 3))


def _references(
    truth: NDArray[np.float64], noise: float, random: np.random.Generator
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    return truth + random.normal(0, noise, truth.shape), truth + random.normal(0, noise, truth.shape)


def test_a_perfect_bake_has_no_error_however_noisy_the_references_are() -> None:
    # Truth of mean 1, references with 20 % noise, the bake is the truth: the exact error is 0.
    random = np.random.default_rng(1)
    truth = _truth(random)
    first, second = _references(truth, 0.2, random)
    square, standard_error = estimator.mean_square_error(truth, first, second)
    assert abs(square) < 3 * standard_error
    assert standard_error < 0.2**2 / np.sqrt(LUMELS)
    score = estimator.score(truth, first, second, fraction=0)
    assert score.noise == pytest.approx(0.2, rel=0.01)
    # The percentile can't shed the noise, but what it would be for a perfect bake is known.
    assert score.p95 == pytest.approx(score.p95_noise, rel=0.02)


@pytest.mark.parametrize("error", [0.01, 0.03, 0.1])
def test_a_known_error_is_found_under_reference_noise_three_times_as_large(error: float) -> None:
    # Truth of mean 1, the bake is off by a normal deviation of `error`, the references by 3 * error: rms = error.
    random = np.random.default_rng(2)
    truth = _truth(random)
    first, second = _references(truth, 3 * error, random)
    ours = truth + random.normal(0, error, truth.shape)
    score = estimator.score(ours, first, second, fraction=0)
    assert score.rms_low < error < score.rms_high
    assert score.rms == pytest.approx(error, rel=0.06)
    assert score.noise == pytest.approx(3 * error, rel=0.02)
    assert abs(score.bias) < 4 * score.bias_standard_error


def test_the_interval_holds_the_exact_error_about_nineteen_times_in_twenty() -> None:
    # 200 bakes with error .05 and reference noise .1: a 95 % interval misses 10 of them, binomially 3 ... 20.
    missed = 0
    for seed in range(200):
        random = np.random.default_rng(seed)
        truth = _truth(random, 2_000)
        first, second = _references(truth, 0.1, random)
        score = estimator.score(truth + random.normal(0, 0.05, truth.shape), first, second, fraction=0)
        missed += not score.rms_low < 0.05 < score.rms_high
    assert 2 <= missed <= 21


def test_a_bake_that_is_two_per_cent_too_bright_has_that_bias_and_that_error() -> None:
    # Ours = 1.02 * truth, truth constant 2: bias = rms = p95 = .02, exactly where the references are free of noise.
    truth = np.full((1000, 3), 2.0)
    score = estimator.score(1.02 * truth, truth, truth)
    assert score.bias == pytest.approx(0.02)
    assert score.rms == pytest.approx(0.02)
    assert score.p95 == pytest.approx(0.02)
    assert score.mean == pytest.approx(2.0)
    assert score.trimmed == 1


def test_error_is_a_part_of_the_mean_so_no_unit_matters() -> None:
    # The same images in another unit (times 683) give the same relative numbers.
    random = np.random.default_rng(3)
    truth = _truth(random, 2_000)
    first, second = _references(truth, 0.05, random)
    ours = np.asarray(truth * random.normal(1, 0.1, truth.shape), np.float64)
    one, other = estimator.score(ours, first, second), estimator.score(683.0 * ours, 683.0 * first, 683.0 * second)
    assert other.rms == pytest.approx(one.rms)
    assert other.p95 == pytest.approx(one.p95)
    assert other.bias == pytest.approx(one.bias)


def test_trimming_leaves_out_the_few_worst_lumels_and_says_how_many() -> None:
    # 10,000 lumels off by .01, ten of them by 1: .1 % = 10 are left out and rms = .01; with them it is .0332.
    truth = np.ones((10_000, 3))
    ours = truth + 0.01
    ours[::1000] = 2.0
    score = estimator.score(ours, truth, truth)
    assert (score.trimmed, score.lumels) == (10, 9_990)
    assert score.rms == pytest.approx(0.01)
    assert score.rms_untrimmed == pytest.approx(np.sqrt((9990 * 1e-4 + 10) / 10_000))


def test_references_noisier_than_three_times_the_error_are_called_unclean() -> None:
    # Noise 2 times and 4 times the error of .05.
    random = np.random.default_rng(4)
    truth = _truth(random)
    ours = truth + random.normal(0, 0.05, truth.shape)
    assert estimator.score(ours, *_references(truth, 0.1, random)).is_clean()
    assert not estimator.score(ours, *_references(truth, 0.2, random)).is_clean()


def test_inner_lumels_have_eight_neighbours_of_their_own_chart() -> None:
    # Two charts of 5 x 4 texels side by side in an image of 5 x 8: 3 x 2 inner lumels each, 14 edge lumels each.
    chart = np.zeros((5, 8), np.int32)
    chart[:, 4:] = 1
    lit = np.ones((5, 8, 3))
    counted = estimator.counted_lumels(chart, lit, lit)
    assert counted.inner[1:4, 1:3].all()
    assert counted.inner[1:4, 5:7].all()
    assert counted.inner.sum() == 12
    assert counted.edge.sum() == 28


def test_lumels_that_are_black_in_either_reference_or_uncovered_do_not_count() -> None:
    # A 4 x 4 chart inside 6 x 6: 4 inner, 12 edge; one inner is black in one reference, one edge in the other.
    chart = np.full((6, 6), -1, np.int32)
    chart[1:5, 1:5] = 0
    first, second = np.ones((6, 6, 3)), np.ones((6, 6, 3))
    first[2, 2] = 0
    second[1, 1] = 0
    counted = estimator.counted_lumels(chart, first, second)
    assert counted.inner.sum() == 3
    assert counted.edge.sum() == 11


def test_an_empty_set_and_values_that_are_not_finite_are_refused() -> None:
    good, bad = np.ones((4, 3)), np.full((4, 3), np.nan)
    with pytest.raises(ValueError, match="no lumel"):
        estimator.score(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 3)))
    with pytest.raises(ValueError, match="ours holds 12"):
        estimator.score(bad, good, good)
    with pytest.raises(ValueError, match=r"\(n, 3\)"):
        estimator.score(good, good[:2], good)


def test_percentile_and_worst_deviation_are_those_of_the_bake_and_not_of_the_noise() -> None:
    # Normal deviations of 5 % of the mean under references of 10 % noise: the RMS over three channels of 95 % of the
    # lumels is known from the noise-free bake. One lumel in 500 is off by 3 in every channel: the worst are off by 3.
    random = np.random.default_rng(6)
    truth = _truth(random)
    first, second = _references(truth, 0.1, random)
    ours = truth + random.normal(0, 0.05, truth.shape)
    exact = float(np.percentile(np.sqrt(np.square(ours - truth).mean(axis=1)), 95))
    found = estimator.score(ours, first, second)
    assert found.p95 > 1.5 * exact / found.mean
    assert found.p95_clean == pytest.approx(exact / found.mean, rel=0.1)
    ours[::500] = truth[::500] + 3
    assert estimator.score(ours, first, second).worst * found.mean == pytest.approx(3, rel=0.03)


def test_the_worst_deviation_of_a_perfect_bake_is_nothing() -> None:
    # Truth of mean 1 under references of 20 % noise: the largest of 40,000 deviations is noise alone, near 80 %.
    random = np.random.default_rng(7)
    truth = _truth(random)
    first, second = _references(truth, 0.2, random)
    found = estimator.score(truth, first, second)
    assert found.worst < 0.03

"""Cycles' curve fitted to points that lie on it exactly."""

from __future__ import annotations

import pytest
from radiosity.solver import sampling_law as law


def test_points_on_the_law_give_it_back_and_its_time_at_any_error() -> None:
    # seconds = 2 + .05 N, error = .8 / sqrt(N): error .05 needs N = 256 and 14.8 s, error .02 needs 1,600 and 82 s.
    samples = [16, 64, 400]
    fitted = law.fit(samples, [2 + 0.05 * n for n in samples], [0.8 / n**0.5 for n in samples])
    assert fitted.seconds_at(0.05) == pytest.approx(14.8)
    assert fitted.seconds_at(0.02) == pytest.approx(82)
    assert fitted.spread == pytest.approx(1)
    assert fitted.is_measured_at(0.05)
    assert not fitted.is_measured_at(0.02)
    assert not fitted.is_measured_at(0.5)


def test_one_point_gives_time_in_proportion_to_samples() -> None:
    # 64 samples, 6 s, error .1: half the error is four times the time.
    fitted = law.fit([64], [6.0], [0.1])
    assert fitted.seconds_at(0.05) == pytest.approx(24)


def test_an_overhead_never_comes_out_below_zero() -> None:
    # Times that grow faster than the samples (1 s, 20 s at ten times as many) would put it at -1.1 s.
    fitted = law.fit([10, 100], [1.0, 20.0], [0.1, 0.03])
    assert fitted.overhead == 0
    assert fitted.per_sample == pytest.approx((0.1 * 0.2) ** 0.5)


def test_no_points_and_errors_of_zero_are_refused() -> None:
    with pytest.raises(ValueError, match="no law"):
        law.fit([], [], [])
    with pytest.raises(ValueError, match="no law"):
        law.fit([16], [1.0], [0.0])

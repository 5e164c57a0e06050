"""The audit's error bar on made-up light: the error put in is the error found, within its interval."""

from __future__ import annotations

import numpy as np
import pytest
from radiosity.solver import Settings, bake
from radiosity.solver.audit import GROUPS, LEAST_LIT, error_bar
from radiosity.solver.plan import AUDIT_LUMELS
from radiosity.tests.solver.rooms import box

RECEIVERS = 1024


def _case(seed, error, noise, bias=0.0):
    """Baked values (k, 3) with a known relative RMS error, noisy groups (k, GROUPS, 3), and that error."""
    rng = np.random.default_rng(seed)
    truth = 1 + 0.5 * rng.random((RECEIVERS, 1)) * np.ones(3)
    baked = truth + (bias + error * rng.normal(size=(RECEIVERS, 1))) * truth.mean()
    groups = truth[:, None] + noise * GROUPS**0.5 * rng.normal(size=(RECEIVERS, GROUPS, 3)) * truth.mean()
    return baked, groups, np.sqrt(np.mean((baked - truth) ** 2)) / truth.mean()


@pytest.mark.parametrize("noise", [0.0, 0.01, 0.03, 0.09])
def test_the_interval_holds_the_true_error_in_nine_of_ten_bakes(noise):
    # Error .03, the audit's noise at one receiver 0 to three times that: 95 of 100 intervals are expected to hold it.
    holds = 0
    for seed in range(100):
        baked, groups, true = _case(seed, 0.03, noise)
        bar = error_bar(baked, groups)
        holds += bar.rms_low <= true <= bar.rms_high
    assert holds >= 90


def test_the_error_is_freed_of_the_audits_noise(stability):
    # Error .03 under noise of .09: without the correction .095 would be found.
    cases = [_case(seed, 0.03, 0.09)[:2] for seed in range(50)]
    freed, plain = (np.sqrt(np.mean(np.square(each))) / 0.03 - 1 for each in (
        [error_bar(baked, groups).rms for baked, groups in cases],
        [np.sqrt(np.mean((baked - groups.mean(axis=1)) ** 2)) / groups.mean() for baked, groups in cases]))
    assert freed == pytest.approx(0, abs=0.1)
    stability("S-21", "RMS against a noisy reference, over the true error, less 1", plain, freed)


def test_a_perfect_bake_has_an_error_of_about_nothing():
    # Error 0 under noise of .03: the lower end of the interval is 0, the upper one far below the noise.
    bar = error_bar(*_case(1, 0.0, 0.03)[:2])
    assert bar.rms_low == 0
    assert bar.rms_high < 0.015


@pytest.mark.parametrize("bias", [-0.02, 0.0, 0.02])
def test_a_bias_is_found_with_its_sign_and_standard_error(bias):
    # Bias -2, 0, 2 % under an error of 3 % and noise of 3 %: within four standard errors, and these are about .1 %.
    bar = error_bar(*_case(2, 0.03, 0.03, bias)[:2])
    assert bar.bias == pytest.approx(bias, abs=4 * bar.bias_standard_error)
    assert bar.bias_standard_error == pytest.approx((0.03**2 + 0.03**2 / 3) ** 0.5 / RECEIVERS**0.5, rel=0.1)


def test_the_95th_percentile_of_even_noise_is_twice_its_deviation():
    # A normal error of .03, no noise: 1.96 x .03.
    bar = error_bar(*_case(3, 0.03, 0.0)[:2])
    assert bar.p95 == pytest.approx(1.96 * 0.03, rel=0.1)
    assert bar.p95 < bar.worst < 5 * 0.03


def test_one_receiver_in_a_thousand_is_left_out():
    # One of 1,024 is wrong by a hundred times the mean: two are left out.
    baked, groups, _ = _case(4, 0.03, 0.01)
    baked[17] += 100
    assert error_bar(baked, groups).rms == pytest.approx(0.03, rel=0.1)
    baked[[18, 19]] += 100
    assert error_bar(baked, groups).rms > 1


def test_of_few_receivers_no_more_than_one_in_a_thousand_is_left_out():
    # One receiver in twenty is off by as much as the mean light, no other at all. Without .256 of the 256, the mean
    # square is (12.8 - .256) / 255.744; without one of them it would be 11.8 / 255. Over 2,000 audits, to 4 deviations.
    off = np.random.default_rng(11).random((2000, 256, 1)) < 0.05
    squares = [error_bar(1 + some * np.ones(3), np.ones((256, GROUPS, 3))).rms ** 2 for some in off]
    doubt = 4 * np.std(squares) / 2000**0.5
    assert doubt < 0.5 * (12.544 / 255.744 - 11.8 / 255)
    assert np.mean(squares) == pytest.approx(12.544 / 255.744, abs=doubt)


def test_what_a_bake_expects_of_itself_is_not_believed_against_the_audit():
    # An error of .02, as is expected; and seven receivers of 384 that are too bright by .7 of the mean, of which the
    # bake knows nothing: .097 in all. Without the audit's word .02 would be reported, far below its interval.
    baked, groups, _ = _case(6, 0.02, 0.05)
    baked, groups = baked[:384], groups[:384]
    assert error_bar(baked, groups, 0.02).rms == pytest.approx(0.02, rel=0.1)
    baked[:7] += 0.7 * groups.mean()
    bar = error_bar(baked, groups, 0.02)
    assert bar.rms == pytest.approx((0.02**2 + 7 / 384 * 0.7**2) ** 0.5, rel=0.15)
    assert bar.rms_low <= bar.rms <= bar.rms_high


def test_an_audit_that_can_not_see_the_error_does_not_call_it_nothing():
    # An error of .01 under noise of .1: with 384 receivers the audit finds a mean square of .0001 +- .0004, often below
    # zero. Of 100 audits 95 leave in their interval what the bake expects, and tell about that.
    told = np.array([error_bar(baked[:384], groups[:384], 0.012).rms
                     for baked, groups, _ in (_case(seed, 0.01, 0.1) for seed in range(100))])
    assert np.count_nonzero((told > 0.01 / 1.5) & (told < 0.01 * 1.5)) >= 95
    assert told.min() > 0.005


def test_strength_of_light_changes_no_relative_error():
    # A thousand times brighter, a millionth as bright.
    baked, groups, _ = _case(5, 0.03, 0.03)
    bar = error_bar(baked, groups)
    for strength in (1e3, 1e-6):
        other = error_bar(baked * strength, groups * strength)
        assert [other.rms, other.rms_low, other.rms_high, other.p95, other.bias] == pytest.approx(
            [bar.rms, bar.rms_low, bar.rms_high, bar.p95, bar.bias], rel=1e-6)


def test_darkness_has_no_error():
    # No light anywhere: nothing to be relative to.
    bar = error_bar(np.zeros((10, 3)), np.zeros((10, GROUPS, 3)))
    assert (bar.rms, bar.rms_low, bar.rms_high, bar.p95, bar.worst, bar.bias) == (0,) * 6


def test_a_closed_dark_box_does_not_use_up_the_audit():
    # A room with a glowing ceiling beside a box without light that has five times its walls. Exact answer: so many lit
    # lumels as are wanted are audited all the same, and the error is found.
    room = box((0, 0, 0), (3, 3, 3), 0.5, (0, 1, 0, 0, 0, 0))
    dark = box((10, 0, 0), (17, 7, 7), 0.5)
    error = bake((room + dark).scene(), Settings(error=0.1, texel_density=10)).report["error"]["estimated"]
    assert LEAST_LIT * AUDIT_LUMELS <= error["lumels_audited"] <= AUDIT_LUMELS
    assert 0 < error["rms_high"] < 0.1


@pytest.mark.parametrize("reflectance", [0.9, 0.98])
def test_a_bright_closed_room_is_as_bright_as_it_is(reflectance):
    # A furnace: all walls glow with 1 W/m2. Exact answer: the light is 1 / (1 - rho) everywhere, a bake finds it, and
    # an audit says so; were paths of 64 bounces all, it would lack rho^64, which is 27 % of it at .98.
    result = bake(box((0, 0, 0), (3, 3, 3), reflectance, (1,) * 6).scene(),
                  Settings(error=0.03, resolution=64, quantity="irradiance"))
    error, pixels = result.report["error"]["estimated"], result.lightmaps[0].pixels
    assert pixels[pixels > 0].mean() == pytest.approx(1 / (1 - reflectance), rel=2e-3)
    assert error["bias"] == pytest.approx(0, abs=4 * error["bias_standard_error"] + 2e-3)
    assert error["rms"] < 0.03

"""The filter of gathered light: noise falls, edges and means stay, and no light goes round a corner."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from radiosity.solver.kernels import kernels
from radiosity.solver.neighbours import LumelNeighbours
from radiosity.solver.parallel import Run
from radiosity.solver.remaining import remaining, remaining_after
from radiosity.solver.smooth import smooth
from radiosity.tests.solver.test_neighbours import lumels

SIDE = 64
NOISE = 0.1


def _plane(normal=(0, 0, 1)):
    """A square image of receivers that face one way."""
    flat = lumels(SIDE, SIDE, range(SIDE**2))
    normals = np.broadcast_to(np.asarray(normal, np.float32), (SIDE**2, 3))
    return flat, replace(flat.receivers, normal=normals)


def _looks(truth, noise=NOISE, seed=1):
    """Two noisy looks (n, 6) at the same light (n,), reflected light only, the channels alike."""
    out = []
    for generator in (np.random.default_rng([seed, number]) for number in (0, 1)):
        look = np.zeros((len(truth), 6), np.float32)
        look[:, 3:] = (truth + noise * generator.normal(size=len(truth)))[:, None]
        out.append(look)
    return out


def _smoothed(truth, receivers, flat, noise=NOISE, seed=1):
    first, second = smooth(*_looks(truth, noise, seed), kernels(receivers, LumelNeighbours(flat), Run(1)), Run(1))
    return first[:, 3], second[:, 3]


def test_even_light_without_noise_stays_to_the_bit_of_rounding():
    # Two equal looks at the value 1.
    flat, receivers = _plane()
    first, second = _smoothed(np.ones(SIDE**2), receivers, flat, noise=0)
    assert first == pytest.approx(1, rel=1e-6)
    assert np.array_equal(first, second)


def test_noise_on_even_light_falls_and_its_mean_stays():
    # Truth 1, noise .1 a look: the mean of the looks has .0707. The mean over n texels moves by no more than its noise.
    flat, receivers = _plane()
    first, second = _smoothed(np.ones(SIDE**2), receivers, flat)
    value = (first + second) / 2
    assert value.std() < NOISE / 2**0.5 / 3
    assert value.mean() == pytest.approx(1, abs=4 * NOISE / 2**0.5 / SIDE)


def test_an_edge_of_many_times_the_noise_stays():
    # 1 on the left, 3 on the right, noise .1: the texels beside the edge keep their side's value.
    flat, receivers = _plane()
    right = np.arange(SIDE**2) % SIDE >= SIDE // 2
    truth = np.where(right, 3.0, 1.0)
    value = sum(_smoothed(truth, receivers, flat)) / 2
    beside = np.isin(np.arange(SIDE**2) % SIDE, (SIDE // 2 - 1, SIDE // 2))
    assert (value - truth)[beside].mean() == pytest.approx(0, abs=0.01)
    assert (value - truth)[beside].std() < NOISE


def test_no_light_goes_round_a_corner():
    # The left half faces up, the right half sideways: 1 and 1.05, an edge far below the noise, is not blurred away.
    flat, receivers = _plane()
    right = np.arange(SIDE**2) % SIDE >= SIDE // 2
    receivers = replace(receivers, normal=np.where(right[:, None], (1, 0, 0), (0, 0, 1)).astype(np.float32))
    first, second = _looks(np.where(right, 1.05, 1.0))
    changed_first, changed_second = first.copy(), second.copy()
    changed_first[right] *= 2
    changed_second[right] *= 2
    run = Run(1)
    near = kernels(receivers, LumelNeighbours(flat), run)
    before = smooth(first, second, near, run)
    after = smooth(changed_first, changed_second, near, run)
    # Only the noise's level, pooled from the eight beside and theirs, reaches across: three texels by the first step.
    deep = np.arange(SIDE**2) % SIDE < SIDE // 2 - 20
    assert np.array_equal(before[0][deep], after[0][deep])
    left = ~right
    assert after[0][left, 3].mean() == pytest.approx(1.0, abs=0.01)


def test_a_slope_of_light_keeps_its_place():
    # Light 1 ... 2 across 64 texels, noise .1: the filter is symmetric, so that inside a slope's mean is its own.
    flat, receivers = _plane()
    x = np.arange(SIDE**2) % SIDE
    truth = 1 + x / (SIDE - 1)
    value = sum(_smoothed(truth, receivers, flat)) / 2
    inner = (x > 8) & (x < SIDE - 9)
    assert (value - truth)[inner].mean() == pytest.approx(0, abs=0.01)


def test_threads_change_no_bit():
    # One thread and three.
    flat, receivers = _plane()
    first, second = _looks(np.ones(SIDE**2))
    near = LumelNeighbours(flat)
    one, three = (smooth(first, second, kernels(receivers, near, run), run) for run in (Run(1), Run(3)))
    assert np.array_equal(one[0], three[0])
    assert np.array_equal(one[1], three[1])


def test_half_the_difference_still_tells_the_error_of_the_mean():
    # Even light: the RMS of (first - second) / 2 and that of the mean's true error agree to a quarter, over ten seeds.
    flat, receivers = _plane()
    estimated, true = [], []
    for seed in range(10):
        first, second = _smoothed(np.ones(SIDE**2), receivers, flat, seed=seed)
        estimated.append(np.mean((first - second) ** 2) / 4)
        true.append(np.mean(((first + second) / 2 - 1) ** 2))
    assert np.mean(estimated) ** 0.5 == pytest.approx(np.mean(true) ** 0.5, rel=0.25)


def test_what_remains_is_the_noise_where_light_is_even():
    # Truth 1, noise .1 a look: what remains lies between the error of the filtered mean and that of the mean itself.
    flat, receivers = _plane()
    first, second = _looks(np.ones(SIDE**2))
    filtered = sum(smooth(first, second, kernels(receivers, LumelNeighbours(flat), Run(1)), Run(1)))[:, 3] / 2
    left = remaining(first, second, kernels(receivers, LumelNeighbours(flat), Run(1)), Run(1)).mean()
    assert np.mean((filtered - 1) ** 2) < left < NOISE**2 / 2 / 4


def test_what_remains_tells_of_blur_that_two_filtered_looks_share():
    # Light of 1 and 1.2 in single texels by turns, noise .1: no filter helps, and each that is blurred errs by .1. What
    # remains is the noise of the plain mean, .1^2 / 2, not the far smaller difference of two blurred looks.
    flat, receivers = _plane()
    x, y = np.arange(SIDE**2) % SIDE, np.arange(SIDE**2) // SIDE
    first, second = _looks(1 + 0.2 * ((x + y) % 2))
    left = remaining(first, second, kernels(receivers, LumelNeighbours(flat), Run(1)), Run(1)).mean()
    assert left == pytest.approx(NOISE**2 / 2, rel=0.2)


@pytest.mark.parametrize("changed", [[], [5], [5, 6, 700], np.arange(SIDE**2)])
def test_what_remains_after_some_receivers_changed_is_what_remains_of_all(changed):
    # Exact answer: all worked out anew, within rounding. 16 texels off one that changed nothing is touched.
    flat, receivers = _plane()
    near = kernels(receivers, LumelNeighbours(flat), Run(1))
    first, second = _looks(np.ones(SIDE**2))
    before = remaining(first, second, near, Run(1))
    changed = np.asarray(changed, np.int64)
    first[changed] += np.float32(0.3)
    after = remaining_after(first, second, changed, before, near, Run(1))
    assert after == pytest.approx(remaining(first, second, near, Run(1)), rel=1e-5, abs=1e-9)
    assert (len(changed) > 0) == bool((after != before).any())


def test_a_lumel_that_is_bright_where_nothing_is_in_doubt_stays():
    # Two looks without noise agree on 1, and on 6 at one lumel (what a gap lets in): it keeps its light.
    flat, receivers = _plane()
    truth = np.ones(SIDE**2)
    truth[SIDE**2 // 2 + SIDE // 2] = 6
    value = sum(_smoothed(truth, receivers, flat, noise=0)) / 2
    assert value == pytest.approx(truth, rel=1e-6)


def _rare(both=(), chance=0.01, seed=3):
    """Two looks at light that one ray in a hundred brings, 1 each time; and which texels both looks happened to see."""
    first, second = (np.zeros((SIDE**2, 6), np.float32) for _ in range(2))
    for number, look in enumerate((first, second)):
        look[np.random.default_rng([seed, number]).random(SIDE**2) < chance, 3:] = 1
    for look in (first, second):
        look[list(both), 3:] = 1
    return first, second


def test_rare_light_that_both_looks_see_at_one_texel_alone_is_shared():
    # In the middle of a plane both looks have 1, and about .01 elsewhere: a speckle, unless told that it is rare.
    flat, receivers = _plane()
    middle = SIDE**2 // 2 + SIDE // 2
    first, second = _rare(both=[middle])
    plain = sum(smooth(first, second, kernels(receivers, LumelNeighbours(flat), Run(1)), Run(1)))[:, 3] / 2
    rare = sum(smooth(first, second, kernels(receivers, LumelNeighbours(flat), Run(1)), Run(1), rare=True))[:, 3] / 2
    assert plain[middle] > 0.5
    assert rare[middle] < 0.3
    assert rare.mean() == pytest.approx(sum(_rare(both=[middle]))[:, 3].mean() / 2, rel=0.2)


def test_rare_light_keeps_an_edge_that_is_wider_than_a_texel():
    # Light 1 in both looks on the right half, none on the left: it stays on its side.
    flat, receivers = _plane()
    right = np.arange(SIDE**2) % SIDE >= SIDE // 2
    first, second = _rare(both=np.flatnonzero(right))
    value = sum(smooth(first, second, kernels(receivers, LumelNeighbours(flat), Run(1)), Run(1), rare=True))[:, 3] / 2
    far = np.abs(np.arange(SIDE**2) % SIDE - SIDE // 2 + 0.5) > 1
    assert value[right & far].min() > 0.9
    assert value[~right & far].max() < 0.25

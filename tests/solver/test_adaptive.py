"""How rays are shared out: to the wanted mean square error, with the fewest rays."""

from __future__ import annotations

import numpy as np
import pytest
from radiosity.solver.adaptive import (
    LONE_PRIOR,
    RATE,
    SPECKLE,
    Gathered,
    _errors,
    _factors,
    _groups,
    _known,
    _speckle_factors,
    _standing_alone,
)
from radiosity.solver.kernels import Kernel
from radiosity.solver.parallel import Run

COUNT = 5000


def _variance(seed=0):
    return np.random.default_rng(seed).lognormal(0, 1.5, COUNT)


def _unrounded(variance, wanted):
    """The best factors, found by scanning the multiplier: n_i ~ v_i^(1 / (1 + RATE)), at least 1 and at most 32."""
    powers = (variance / wanted) ** (1 / (1 + RATE))
    multipliers = np.geomspace(1e-3, 1e6, 3000)
    for multiplier in multipliers:
        factor = np.clip(multiplier * powers, 1, 32)
        if (variance * factor**-RATE).mean() <= wanted:
            return factor
    raise AssertionError("out of reach")


def test_nothing_is_added_where_the_error_is_met():
    # Mean variance half of what is wanted.
    variance = _variance()
    assert (_factors(variance, 2 * variance.mean(), np.full(COUNT, 32.0)) == 1).all()


@pytest.mark.parametrize("times", [2, 5, 20, 60])
def test_the_wanted_variance_is_about_reached_with_about_the_fewest_rays(times):
    # Factors are rounded to powers of two: variance by up to 2^(RATE / 2), on the average far less.
    variance = _variance()
    wanted = variance.mean() / times
    factor = _factors(variance, wanted, np.full(COUNT, 32.0))
    assert (variance * factor**-RATE).mean() == pytest.approx(wanted, rel=0.35)
    assert factor.mean() == pytest.approx(_unrounded(variance, wanted).mean(), rel=0.2)
    assert set(np.log2(factor) % 1) == {0}


def test_noisier_receivers_get_no_fewer_rays():
    # Sorted by variance, factors are sorted.
    variance = np.sort(_variance())
    factor = _factors(variance, variance.mean() / 10, np.full(COUNT, 32.0))
    assert (np.diff(factor) >= 0).all()
    assert factor[-1] > factor[0]


def test_even_noise_is_answered_by_the_law_of_quasi_random_rays():
    # Errors 8^RATE times too large everywhere: 8 times the rays.
    assert (_factors(np.full(100, 8.0**RATE), 1.0, np.full(100, 32.0)) == 8).all()


def test_what_is_out_of_reach_costs_the_others_nothing():
    # A thousandth of the receivers errs so that even the most rays leave too much: they get these, and all others what
    # they would get without them.
    variance = _variance()
    wanted = variance.mean() / 5
    usual = _factors(variance, wanted, np.full(COUNT, 32.0))
    variance[:5] = 1e6 * variance.mean()
    factor = _factors(variance, wanted, np.full(COUNT, 32.0))
    assert (factor[:5] == 32).all()
    assert factor[5:].mean() == pytest.approx(usual[5:].mean(), rel=0.1)


def test_where_no_light_was_found_no_rays_are_added():
    # Three of four receivers lie in a closed box, with no error at all. Exact answer: they get no more rays, and the
    # others what they would get without them; those of which two looks agree by chance are doubted all the same.
    lit = _variance()
    error = np.concatenate([lit, np.zeros(3 * COUNT)])
    lit[:10] = error[:10] = 0
    found = np.arange(4 * COUNT) < COUNT
    alone, all_known = _known(lit, found[:COUNT], [_grid()]), _known(error, found, [_grid()])
    assert all_known[:10].min() > 0
    assert all_known[:COUNT] == pytest.approx(alone)
    wanted = lit.mean() / 5
    factor = _factors(all_known, wanted / 4, np.full(4 * COUNT, 32.0))
    assert np.array_equal(factor[:COUNT], _factors(alone, wanted, np.full(COUNT, 32.0)))
    assert (factor[COUNT:] == 1).all()


def test_what_stands_alone_and_found_nothing_is_doubted_as_much_as_all():
    # Nine of ten receivers without neighbours found no light, and so no error: they get a part of the mean of all.
    error, found = np.repeat([0.0, 1.0], [900, 100]), np.arange(1000) >= 900
    known = _known(error, found, None)
    assert known.mean() == pytest.approx(error.mean())
    assert known[:900] == pytest.approx(LONE_PRIOR * error.mean())


def test_the_error_is_that_of_lit_receivers():
    # Mean square error 4 of a hundred receivers and none of three hundred in a closed box: 2, not 1.
    light = np.zeros((400, 3))
    assert Gathered(light, light, light, np.repeat([4.0, 0.0], [100, 300]), 0.25).error == pytest.approx(2, rel=0.01)


def test_no_receiver_gets_more_than_the_most():
    # A variance out of any reach: each at its own bound.
    most = np.where(np.arange(100) < 50, 4.0, 32.0)
    assert np.array_equal(_factors(np.full(100, 1e12), 1.0, most), most)


def test_receivers_of_equal_need_are_asked_together():
    # Rays 10, 10, 20, 10, 10 times factors 1, 2, 2, 4, 2: 0, 10, 20, 30, 10 more.
    groups = _groups(np.array([10, 10, 20, 10, 10]), np.array([1.0, 2, 2, 4, 2]))
    assert [(before, more, rows.tolist()) for before, more, rows in groups] == [
        (10, 10, [1, 4]), (10, 30, [3]), (20, 20, [2])]


def test_the_error_of_two_lone_looks_is_that_of_their_mean():
    # Looks of noise .6 without peaks and .8 in these, 1 together: their mean has variance 1/2; emitted and reflected
    # light count together.
    rng = np.random.default_rng(5)
    looks = [np.zeros((200_000, 2, 6), np.float32) for _ in range(2)]
    for look in looks:
        look[:, 0, :3] = 0.6 * rng.normal(size=(200_000, 3))
        look[:, 1, 3:] = 0.8 * rng.normal(size=(200_000, 3))
    assert _errors(looks, None, None)[0].mean() == pytest.approx(0.5, rel=0.01)


def test_only_receivers_that_stand_out_get_rays_where_the_mean_is_good():
    # Errors of what is wanted, and of 8^RATE times what counts as a speckle: none, and 8 times the rays; then the most.
    error = np.array([1.0, 8**RATE * SPECKLE**2, 1e9])
    assert _speckle_factors(error, 1.0, np.full(3, 32.0)) == pytest.approx([1, 8, 32])


SIDE = 12


def _grid():
    """The kernel of SIDE x SIDE receivers in a square, eight neighbours each but at its edge."""
    row, column = np.divmod(np.arange(SIDE**2), SIDE)
    steps = [(dy, dx) for dy in (-1, 0, 1) for dx in (-1, 0, 1) if (dy, dx) != (0, 0)]
    y, x = (np.stack([place + step[axis] for step in steps], 1) for axis, place in ((0, row), (1, column)))
    there = (y >= 0) & (y < SIDE) & (x >= 0) & (x < SIDE)
    return Kernel(np.where(there, y * SIDE + x, 0), np.where(there, np.float32(0.5), np.float32(0)),
                  np.ones(SIDE**2, np.float32))


def _alone(change, least=0.1):
    light = np.ones((SIDE, SIDE))
    change(light)
    return _standing_alone(light.reshape(-1), _grid(), least, Run(2, None, None)).tolist()


def test_a_speckle_stands_alone_bright_or_dark():
    # One receiver 20 % brighter than all beside it, another 20 % darker; one by 5 %, which is less than is looked for.
    def change(light):
        light[3, 4], light[8, 8], light[6, 2] = 1.2, 0.8, 1.05
    assert _alone(change) == [3 * SIDE + 4, 8 * SIDE + 8]


def test_edges_lines_and_slopes_do_not_stand_alone():
    # The edge of a shadow, a strip one receiver wide, a steep slope, and a pair: each has some like it beside it.
    assert _alone(lambda light: np.copyto(light[:, 6:], 3.0)) == []
    assert _alone(lambda light: np.copyto(light[:, 6], 3.0)) == []
    assert _alone(lambda light: np.multiply(light, np.arange(SIDE), out=light)) == []
    assert _alone(lambda light: np.copyto(light[5, 5:7], 3.0)) == []


def test_a_receiver_with_few_beside_is_left_as_it_is():
    # In the corner of the square there are three neighbours: too few to say what is usual.
    def change(light):
        light[0, 0] = 3.0
    assert _alone(change) == []

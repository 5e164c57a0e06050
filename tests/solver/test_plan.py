"""How much work the wanted error asks for."""

from __future__ import annotations

import numpy as np
import pytest
from radiosity.solver.plan import CELL_FACTORS, CELL_SHARE, MOST_ROW_RAYS, plan


@pytest.mark.parametrize("error", [0.1, 0.03, 0.003])
def test_the_parts_of_the_error_add_up_to_no_more_than_is_wanted(error):
    # Independent errors: the root of the sum of squares.
    wanted = plan(error, 1.0, 0.5, 1000)
    parts = np.array([wanted.gather_error, wanted.direct_error, wanted.patch_error])
    assert np.sqrt((parts**2).sum()) <= error


def test_less_error_never_takes_less_work():
    # From 10 % to .3 %.
    plans = [plan(error, 1.0, 0.5, 1000) for error in (0.1, 0.03, 0.01, 0.003)]
    for name in ("patches", "gather_rays", "row_rays", "cell_samples"):
        assert sorted(getattr(one, name) for one in plans) == [getattr(one, name) for one in plans]
    assert sorted((one.cell_size for one in plans), reverse=True) == [one.cell_size for one in plans]


def test_many_rows_have_few_rays_and_few_rows_many():
    # All rows together have about as many rays, within the most and the least of one.
    wanted = plan(0.03, 1.0, 0.5, 1000)
    everything, least = wanted.row_rays
    assert wanted.rays_of_row(1) == MOST_ROW_RAYS
    assert wanted.rays_of_row(10**6) == least
    assert wanted.rays_of_row(4000) == pytest.approx(everything / 4000, abs=1)


def test_a_bake_expects_what_its_gather_left_and_a_little_more():
    # Nothing left: half of what direct light and patches may have; far more left: that.
    wanted = plan(0.03, 1.0, 0.5, 1000)
    assert wanted.expected_error(0.0) == pytest.approx(np.hypot(wanted.direct_error, wanted.patch_error) / 2)
    assert wanted.expected_error(1.0) == pytest.approx(1.0, rel=1e-3)


def test_many_receivers_start_with_fewer_rays_each_than_few():
    # Half as many at 3 %, and never more.
    few, many = ([plan(error, 1.0, 0.5, count).gather_rays for error in (0.1, 0.03, 0.01, 0.003)]
                 for count in (10**4, 10**6))
    assert few[1] == 2 * many[1]
    assert all(one >= other for one, other in zip(few, many, strict=True))


def test_the_less_light_bounces_the_coarser_cells_are_and_the_fewer_rays_they_ask_with():
    # From all of the light to none; within the bounds.
    plans = [plan(0.03, 1.0, share, 25_000) for share in (1.0, 0.5, 0.25, 0.1, 0.0)]
    sizes = [one.cell_size for one in plans]
    assert sorted(sizes) == sizes
    assert sizes[1] == pytest.approx(CELL_SHARE)
    assert sizes[-1] == pytest.approx(CELL_SHARE * CELL_FACTORS[1])
    assert [one.cell_samples for one in plans] == [16, 8, 4, 4, 4]


def test_cells_are_smaller_where_many_receivers_may_stand_close_by_and_where_few_stand_alone():
    # The fourth root of their number over 25,000; below that the eighth root of its inverse.
    sizes = [plan(0.03, 1.0, 0.5, count).cell_size for count in (25_000 / 256, 25_000, 400_000)]
    assert sizes == pytest.approx([CELL_SHARE / 2, CELL_SHARE, CELL_SHARE / 2])


def test_cells_are_small_where_receivers_see_surfaces_that_glow():
    # Half of the light from glowing surfaces and none bounced: as small as if half of it bounced.
    assert plan(0.03, 1.0, 0.0, 25_000, 0.5).cell_size == pytest.approx(plan(0.03, 1.0, 0.5, 25_000).cell_size)


def test_cells_ask_lamps_with_more_rays_where_less_error_is_wanted():
    # 8 rays at 3 %, in proportion to one over the error, to a power of two, from 4 to 16.
    assert [plan(error, 1.0, 0.5, 1000).cell_samples for error in (0.3, 0.1, 0.03, 0.02, 0.01, 0.003)] == [
        4, 4, 8, 16, 16, 16]


def test_cells_ask_lamps_with_more_rays_where_many_receivers_show_how_they_err():
    # In proportion to the root of their number over 25,000, to a power of two, up to 8 times as many.
    assert [plan(0.03, 1.0, 0.5, count).cell_samples for count in (25_000, 100_000, 400_000, 10**8)] == [8, 16, 32, 64]

"""Which lumels lie side by side: by arithmetic on a small image."""

from __future__ import annotations

import numpy as np
from radiosity.solver.neighbours import LumelNeighbours
from radiosity.solver.receivers import Lumels, Page, Receivers


def lumels(width, height, pixel, chart=None, page=None, pages=1):
    """Lumels at pixels of images of one size; one chart and one page unless said otherwise."""
    pixel = np.asarray(pixel, np.int64)
    count = len(pixel)
    nothing, zero = np.zeros((count, 3), np.float32), np.zeros(count, np.int32)
    receivers = Receivers(nothing, nothing, zero, nothing[:, :2], np.zeros((count, 2, 2), np.float32))
    images = tuple(Page(f"page {number}", width, height) for number in range(pages))
    return Lumels(receivers, zero, zero if page is None else np.asarray(page, np.int32), pixel,
                  zero if chart is None else np.asarray(chart, np.int32), images, np.zeros(1, np.int32), (None,),
                  zero[:1])


def test_the_middle_of_nine_lumels_has_eight_neighbours_and_a_corner_three():
    # 3 x 3 pixels, numbered row by row from below: the middle is 4.
    around = LumelNeighbours(lumels(3, 3, range(9))).at(1)
    assert sorted(around[4]) == [0, 1, 2, 3, 5, 6, 7, 8]
    assert sorted(around[0][around[0] >= 0]) == [1, 3, 4]
    assert around.dtype == np.int32


def test_neighbours_do_not_wrap_around_the_image():
    # The last pixel of a row and the first of the next are not side by side, whatever the step.
    for step in (1, 2, 3):
        around = LumelNeighbours(lumels(4, 4, range(16))).at(step)
        x, y = np.arange(16) % 4, np.arange(16) // 4
        row, column = np.nonzero(around >= 0)
        other = around[row, column]
        assert set(np.abs(x[other] - x[row])) | set(np.abs(y[other] - y[row])) == {0, step}


def test_every_pair_knows_one_another():
    # Random lumels of a 20 x 13 image in three charts: j is i's neighbour one way, i is j's the other way.
    rng = np.random.default_rng(3)
    pixel = np.sort(rng.choice(260, 150, replace=False))
    around = LumelNeighbours(lumels(20, 13, pixel, rng.integers(0, 3, 150))).at(2)
    row, column = np.nonzero(around >= 0)
    assert len(row) > 50
    assert np.array_equal(around[around[row, column], 7 - column], row)


def test_neighbours_are_asked_for_across_no_chart():
    # 4 x 1 pixels, two charts of two.
    around = LumelNeighbours(lumels(4, 1, range(4), [5, 5, 9, 9])).at(1)
    assert [sorted(each[each >= 0]) for each in around] == [[1], [0], [3], [2]]


def test_the_same_pixel_of_another_page_is_not_next_to_it():
    # Two pages of 2 x 1: each lumel's only neighbour is on its own page.
    around = LumelNeighbours(lumels(2, 1, [0, 0, 1, 1], page=[0, 1, 0, 1], pages=2)).at(1)
    assert [sorted(each[each >= 0]) for each in around] == [[2], [3], [0], [1]]


def test_a_page_without_lumels_changes_nothing():
    # The first page is empty.
    around = LumelNeighbours(lumels(2, 1, [0, 1], page=[1, 1], pages=2)).at(1)
    assert [sorted(each[each >= 0]) for each in around] == [[1], [0]]


def test_lumels_that_are_left_out_have_no_neighbours_and_are_nobodys():
    # 3 x 3 lumels without the middle one: nobody has it, it has nobody; all else is as before.
    every = LumelNeighbours(lumels(3, 3, range(9)))
    before, left = every.at(1), every.without(np.arange(9) == 4).at(1)
    assert (left[4] == -1).all()
    assert not (left == 4).any()
    others = np.arange(9) != 4
    assert np.array_equal(np.where(before == 4, -1, before)[others], left[others])
    assert np.array_equal(every.at(1), before)

"""Cells of triangles: areas that add up, places that lie where the cell is, rows in the order of meeting."""

from __future__ import annotations

import numpy as np
import pytest
from radiosity.solver.cells import FINER, MAX_SIDES, NOTHING, Cells
from radiosity.solver.geometry import Geometry
from radiosity.solver.paged import Paged
from radiosity.tests.solver.rooms import shape

TRIANGLES = {
    "right-angled": [[0, 0, 0], [1, 0, 0], [0, 1, 0]],
    "turned": [[0, 1, 0], [0, 0, 0], [1, 0, 0]],
    "needle": [[0, 0, 0], [3, 0, 0], [1, 0.02, 0]],
    "oblique": [[0.1, -0.3, 0.2], [1, 0.4, 0.9], [0.3, 1.1, -0.5]],
}


def _cells(corners, size):
    return Cells(Geometry(shape(corners).scene()), size)


def _all_sides(cells, count=400):
    """The sides that a fine lattice over every triangle meets."""
    step = (np.arange(count) + 0.5) / count
    u, v = (each.reshape(-1).astype(np.float32) for each in np.meshgrid(step, step))
    inside = u + v < 1
    u, v = u[inside], v[inside]
    triangles = len(cells.geometry.area)
    triangle = np.repeat(np.arange(triangles), len(u))
    u, v = np.tile(u, triangles), np.tile(v, triangles)
    return np.unique(np.concatenate([cells.sides(triangle, u, v, np.full(len(u), front)) for front in (False, True)]))


@pytest.mark.parametrize("name", TRIANGLES)
@pytest.mark.parametrize("size", [10.0, 0.3, 0.07])
def test_cells_areas_add_up_to_the_triangles_on_either_side(name, size):
    # The companions of one met side are all the cells on that side: their areas are the triangle's.
    cells = _cells([TRIANGLES[name]], size)
    third = np.full(1, 1 / 3, np.float32)
    for front in (False, True):
        cells.meet(cells.sides(np.zeros(1, int), third, third, np.array([front])))
    every = cells.companions(10**6)
    for front in (0, 1):
        assert cells.area(every[every & 1 == front]).sum() == pytest.approx(cells.geometry.area[0], rel=1e-5)


@pytest.mark.parametrize("name", TRIANGLES)
def test_a_place_in_a_cell_lies_in_that_cell(name):
    # sides(places(side, x, y)) = side, but for rounding at the rim: x and y keep 1 % off it.
    cells = _cells([TRIANGLES[name]], 0.07)
    sides = _all_sides(cells, 150)
    x, y = np.random.default_rng(1).uniform(0.01, 0.99, (2, len(sides)))
    back = cells.sides(*cells.places(sides, x, y))
    near_rim = back != sides
    assert near_rim.mean() < 0.002


@pytest.mark.parametrize("name", TRIANGLES)
def test_places_spread_evenly_over_the_triangle(name):
    # Cells drawn by area, places drawn evenly: the mean barycentric coordinates are 1/3, E[u^2] = 1/6, E[uv] = 1/12.
    cells = _cells([TRIANGLES[name]], 0.2)
    sides = _all_sides(cells)
    sides = sides[sides & 1 == 1]
    rng = np.random.default_rng(2)
    area = cells.area(sides).astype(float)
    count = 200_000
    drawn = rng.choice(sides, count, p=area / area.sum())
    _, u, v, _ = cells.places(drawn, *rng.random((2, count)))
    deviation = 4 * 0.25 / count**0.5
    assert [u.mean(), v.mean()] == pytest.approx([1 / 3] * 2, abs=deviation)
    assert [(u * u).mean(), (v * v).mean(), (u * v).mean()] == pytest.approx([1 / 6, 1 / 6, 1 / 12], abs=deviation)


@pytest.mark.parametrize("name", TRIANGLES)
def test_places_lie_inside_the_triangle_at_the_corners_of_the_unit_square_too(name):
    # u, v >= 0 and u + v <= 1, up to float32's rounding.
    cells = _cells([TRIANGLES[name]], 0.07)
    sides = _all_sides(cells)
    for x in (0.0, 0.5, 1 - 2.0**-24):
        for y in (0.0, 0.5, 1 - 2.0**-24):
            _, u, v, _ = cells.places(sides, np.full(len(sides), x), np.full(len(sides), y))
            assert min(u.min(), v.min()) >= -1e-6
            assert (u + v).max() <= 1 + 1e-6


def test_cells_are_about_as_long_as_wide_on_a_thin_triangle():
    # A right-angled sliver of 4 x .1 m with cells of .1 m: 40 along its long leg, 1 across.
    cells = _cells([[[0, 0, 0], [4, 0, 0], [0, 0.1, 0]]], 0.1001)
    assert len(_all_sides(cells)) == 2 * 40


def test_a_triangle_smaller_than_the_size_is_one_cell_with_two_sides():
    # Half a square metre, size 10 m: sides 0 (back) and 1 (front), each of the triangle's area.
    cells = _cells([TRIANGLES["right-angled"]], 10.0)
    sides = _all_sides(cells)
    assert sides.tolist() == [0, 1]
    assert cells.area(sides) == pytest.approx([0.5, 0.5])


def test_a_giant_plate_does_not_make_cells_coarser_elsewhere():
    # A board of 1 m and plates of 10 km, with far more cells of 1 mm than there can be: the board keeps its cells, the
    # plates share what can be.
    board, plate = ([[0, 0, 1], [1, 0, 1], [0, 1, 1]], [[0, 0, 0], [1e4, 0, 0], [0, 1e4, 0]])

    def divisions(*corners):
        return Cells(Geometry(shape(corners).scene()), 0.001).divisions

    alone = divisions(board)
    for plates in (3, 6):
        found = divisions(board, *[plate] * plates)
        assert (found[0] == alone[0]).all()
        assert (found[1:] == found[1]).all()
        assert 0.7 * MAX_SIDES < 2 * found.prod(axis=1).sum() <= MAX_SIDES


def test_a_floor_that_runs_to_the_horizon_has_cells_as_small_as_elsewhere():
    # A plate of 200 m with cells of 1 cm, 400 million of them: two points 2 cm apart lie in different cells, and what
    # is held in memory is a few pages.
    plate = [[-100, -100, 0], [100, -100, 0], [-100, 100, 0]]
    cells = _cells([plate], 0.01)
    assert cells.divisions.tolist() == [[20000, 20000]]
    weights = np.float32((np.array([[-50.0, -50.0], [-50.02, -50.0]]) + 100) / 200)
    sides = cells.sides(np.zeros(2, int), *weights.T, np.ones(2, bool))
    cells.meet(sides)
    assert cells.rows(sides).tolist() == [1, 0]
    assert cells.area(sides) == pytest.approx([1e-4] * 2, rel=1e-3)
    _, u, v, _ = cells.places(sides, np.full(2, 0.5), np.full(2, 0.5))
    assert np.abs(np.stack([u, v], axis=1) - weights).max() * 200 < 0.0101


def test_pages_hold_what_was_put_and_zero_elsewhere():
    # Against a plain array, with pages in part and whole, put in three turns, some anew.
    random = np.random.default_rng(7)
    plain, paged = np.zeros(10_000, np.int32), Paged(10_000)
    for turn in range(3):
        index = random.choice(10_000, 50 if turn else 3000, replace=False)
        plain[index] = 10_000 * turn + np.arange(len(index))
        paged.put(index, plain[index])
        assert np.array_equal(paged.take(np.arange(10_000)), plain)
    far = Paged(2**32)
    far.put(np.array([2**32 - 1, 5]), np.array([3, 4]))
    assert far.take(np.array([5, 2**32 - 1, 2**31, 6])).tolist() == [4, 3, 0, 0]


def test_rows_are_given_once_and_in_the_order_of_meeting():
    # Met: 5, 3, 3, sky; then 3, 1. Rows: 3 -> 0, 5 -> 1, 1 -> 2; what was not met has none.
    cells = _cells([TRIANGLES["right-angled"]], 0.3)
    assert cells.meet(np.array([5, 3, 3, NOTHING])) == slice(0, 2)
    assert cells.meet(np.array([3, 1])) == slice(2, 3)
    assert cells.meet(np.array([3, 5, NOTHING])) == slice(3, 3)
    assert cells.side.tolist() == [3, 5, 1]
    assert cells.rows(np.array([1, 3, 5, 0, NOTHING])).tolist() == [2, 0, 1, NOTHING, NOTHING]


def test_a_missed_ray_has_no_side():
    # Triangle -1.
    cells = _cells([TRIANGLES["right-angled"]], 0.3)
    nothing = np.zeros(1, np.float32)
    assert cells.sides(np.array([-1]), nothing, nothing, np.array([True])).tolist() == [NOTHING]


def test_companions_are_all_cells_that_have_an_area_or_none_where_there_are_too_many():
    # The lattice meets every cell of more than a sliver; companions of one cell are those of its side alone.
    cells = _cells(list(TRIANGLES.values()), 0.3)
    sides = _all_sides(cells)
    wanted = sides[(cells.triangle_of(sides) == 3) & (sides & 1 == 1)]
    cells.meet(wanted[:1])
    found = cells.companions(1000)
    assert np.isin(wanted, found).all()
    assert set(cells.triangle_of(found)) == {3}
    assert (cells.area(found) > 0).all()
    assert len(cells.companions(3)) == 0


@pytest.mark.parametrize("name", TRIANGLES)
def test_fronts_are_met_in_proportion_to_the_area_of_their_cells(name):
    # Two triangles, the second nine times the area of the first: nine times the places, and in each cell about as many
    # as its part of the area; few places leave none out.
    corners = np.asarray(TRIANGLES[name], float)
    cells = _cells([corners, corners * 3 + 5], 0.07)
    side, places = np.unique(cells.fronts(4000), return_counts=True)
    assert (side & 1).all()
    share = np.bincount(cells.triangle_of(side), places) / places.sum()
    assert share == pytest.approx([0.1, 0.9], abs=0.01)
    assert places / places.sum() == pytest.approx(cells.area(side) / cells.geometry.area.sum(), abs=4 / places.sum())
    assert list(cells.triangle_of(cells.fronts(1))) == [0, 1]


def _divided(name, size):
    """Cells of which every one was met and divided, and the sides of all smaller ones that are met then."""
    cells = _cells([TRIANGLES[name]], size)
    sides = _all_sides(cells)
    cells.meet(sides)
    cells.divide(np.arange(len(cells)))
    return cells, sides, _all_sides(cells, 900)


@pytest.mark.parametrize("name", TRIANGLES)
def test_a_place_in_a_smaller_cell_lies_in_it_and_in_the_cell_that_holds_it(name):
    # sides(places(side, x, y)) = side again; a plain `Cells` of the same size tells the cell around: its places spread
    # over the smaller ones evenly, 16 to a cell that lies inside the triangle.
    cells, sides, smaller = _divided(name, 0.3)
    assert not np.isin(smaller, sides).any()
    x, y = np.random.default_rng(1).uniform(0.01, 0.99, (2, len(smaller)))
    places = cells.places(smaller, x, y)
    assert (cells.sides(*places) != smaller).mean() < 0.01
    around = _cells([TRIANGLES[name]], 0.3).sides(*places)
    assert np.isin(around, sides).all()
    assert np.array_equal(cells.triangle_of(smaller), np.zeros(len(smaller)))
    assert np.bincount(np.unique(around, return_inverse=True)[1]).max() == FINER**2


def test_a_divided_cell_keeps_its_row_and_its_area():
    # Smaller ones count no area, have rows of their own once they are met, and are not divided again.
    cells, sides, smaller = _divided("oblique", 0.3)
    before, area = cells.rows(sides), cells.area(sides)
    assert (cells.rows(smaller) == NOTHING).all()
    new = cells.meet(smaller)
    assert new == slice(len(sides), len(sides) + len(smaller))
    assert cells.rows(smaller).tolist() == list(range(new.start, new.stop))
    assert np.array_equal(cells.rows(sides), before)
    assert np.array_equal(cells.area(sides), area)
    assert not cells.area(smaller).any()
    assert cells.rows(np.array([NOTHING])).tolist() == [NOTHING]
    cells.divide(np.arange(len(cells)))
    assert np.array_equal(_all_sides(cells, 900), smaller)


@pytest.mark.parametrize("name", TRIANGLES)
def test_what_is_seen_from_behind_is_another_cell_at_the_same_place(name):
    # The same hits, every other one by a ray from a back: those have rows of their own, whose places lie in the cells
    # that hold them. They are not divided with these, and their area counts only if it is asked for.
    cells = _cells([TRIANGLES[name]], 0.3)
    whole = _all_sides(cells)
    x, y = np.random.default_rng(4).uniform(0.01, 0.99, (2, len(whole)))
    places = cells.places(whole, x, y)
    usual = cells.sides(*places)
    from_behind = cells.sides(*places, np.ones(len(whole), bool))
    assert not np.isin(from_behind, whole).any()
    assert len(np.unique(from_behind)) == len(np.unique(usual))
    assert np.array_equal(cells.sides(*places, np.arange(len(whole)) % 2 == 0)[::2], from_behind[::2])
    assert np.array_equal(cells.sides(*places, np.zeros(len(whole), bool)), usual)
    cells.meet(from_behind)
    assert (cells.rows(usual) == NOTHING).all()
    cells.meet(usual)
    cells.divide(np.arange(len(cells)))
    assert np.array_equal(cells.sides(*places, np.ones(len(whole), bool)), from_behind)
    assert not np.isin(cells.sides(*places), usual).any()
    for before, now in zip(cells.places(usual, x, y), cells.places(from_behind, x, y), strict=True):
        assert np.array_equal(before, now)
    assert not cells.area(from_behind).any()
    assert np.array_equal(cells.area(from_behind, of_each=True), cells.area(usual))


def test_a_ray_from_a_back_that_meets_nothing_has_no_side():
    # Triangle -1, from behind; also where every cell is divided.
    cells = _divided("oblique", 0.3)[0]
    nothing = np.zeros(1, np.float32)
    assert cells.sides(np.array([-1]), nothing, nothing, np.array([True])).tolist() == [NOTHING]
    assert cells.sides(np.array([-1]), nothing, nothing, np.array([True]), np.array([True])).tolist() == [NOTHING]

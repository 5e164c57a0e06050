"""The element's closed form: every place where the textbook's formula breaks."""

from __future__ import annotations

import numpy as np
import pytest
from radiosity.benchmarks.form_factors.cases import disc, facing_down, level, upright
from radiosity.solver.polygon import FAR_RADII, paired_form_factor, polygon_form_factor, polygons_form_factor

UP = np.array([[0.0, 0.0, 1.0]])
TYPES = [np.float32, np.float64]
# Rounding errors that a value may be off by: the sum of a polygon's edges loses a few digits more than one.
FEW = 40


def eps(dtype):
    return float(np.finfo(dtype).eps)


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=1)[:, None]


def box():
    """The inside of [0, 1]^3: (6, 4, 3), facing inwards."""
    xz = np.array([[0, 0, 0], [0, 0, 1], [1, 0, 1], [1, 0, 0]], float)
    opposite = xz[::-1] + np.array([0, 1, 0])
    return np.stack([level(0, 1, 0, 1, 0), facing_down(0, 1, 0, 1, 1), upright(0, 1, 0, 1),
                     upright(0, 1, 0, 1, 1)[::-1], xz, opposite])


def one(point, normal, polygon, dtype=np.float64, sides="front"):
    points, normals = np.array([point], dtype), np.array([normal], dtype)
    result = polygon_form_factor(points, normals, np.asarray(polygon, dtype), sides)
    assert result.dtype == dtype
    return float(result[0])


@pytest.mark.parametrize("dtype", TYPES)
def test_dtype_and_shape_of_the_points_come_back(dtype):
    points, normals = np.zeros((7, 3), dtype), np.tile(UP.astype(dtype), (7, 1))
    result = polygon_form_factor(points, normals, facing_down(0, 1, 0, 1, 1))
    assert (result.shape, result.dtype) == ((7,), dtype)
    assert polygon_form_factor(points[:0], normals[:0], facing_down(0, 1, 0, 1, 1)).shape == (0,)


@pytest.mark.parametrize("dtype", TYPES)
def test_element_under_a_square(dtype):
    # P-18: origin, n = +z, square [0, .5]^2 at z = 1: .05986411761519.
    assert one((0, 0, 0), (0, 0, 1), facing_down(0, 0.5, 0, 0.5, 1), dtype) == pytest.approx(
        0.05986411761519, rel=FEW * eps(dtype) + 1e-13)


@pytest.mark.parametrize("dtype", TYPES)
def test_polygon_through_the_horizon_is_clipped(dtype):
    # P-17 (S-4): .2278886058235; without clipping .1756547388923.
    triangle = [[0.25, 0.2, 1.5], [1, 1, -0.25], [0.5, -1, -0.5]]
    assert one((0, 0, 0), (0, 0, 1), triangle, dtype) == pytest.approx(0.2278886058235, rel=FEW * eps(dtype) + 1e-12)


@pytest.mark.parametrize("corner", range(3))
def test_clipping_does_not_depend_on_where_the_corners_start(corner):
    # P-17 with its corners rolled: one corner above, or two in a row, across the end of the list.
    triangle = np.roll([[0.25, 0.2, 1.5], [1, 1, -0.25], [0.5, -1, -0.5]], corner, axis=0)
    assert one((0, 0, 0), (0, 0, 1), triangle) == pytest.approx(0.2278886058235, rel=1e-12)


@pytest.mark.parametrize("dtype", TYPES)
def test_walls_of_a_box_add_up_to_one_from_any_point_and_any_normal(dtype):
    # A closed box holds the whole hemisphere: the sum over its six walls is 1, nearly all of them clipped.
    rng = np.random.default_rng(1)
    points = rng.uniform(0.01, 0.99, (4000, 3)).astype(dtype)
    normals = unit(rng.normal(size=points.shape)).astype(dtype)
    total = polygons_form_factor(points, normals, box())
    np.testing.assert_allclose(total, 1, atol=FEW * eps(dtype) / 0.1)


@pytest.mark.parametrize("dtype", TYPES)
@pytest.mark.parametrize("axis", range(3))
def test_walls_of_a_box_add_up_to_one_at_normals_along_its_edges(dtype, axis):
    # The horizon lies along walls' edges and through their corners: heights of exactly zero.
    normals = np.zeros((2, 3), dtype)
    normals[:, axis] = 1, -1
    for point in ([0.5, 0.5, 0.5], [0.25, 0.5, 0.75]):
        total = polygons_form_factor(np.array([point, point], dtype), normals, box())
        np.testing.assert_allclose(total, 1, atol=FEW * eps(dtype))


@pytest.mark.parametrize("dtype", TYPES)
@pytest.mark.parametrize("gap", [1e-2, 1e-4, 1e-6])
def test_point_very_near_a_wall_sees_the_walls_add_up_to_one(dtype, gap):
    # S-1 for elements: the point stands on the floor, nearly; the other five walls fill its hemisphere.
    rng = np.random.default_rng(2)
    points = rng.uniform(0.1, 0.9, (500, 3)).astype(dtype)
    points[:, 2] = gap
    values = polygons_form_factor(points, np.tile(UP, (500, 1)).astype(dtype), box())
    np.testing.assert_allclose(values, 1, atol=FEW * eps(dtype))
    under = polygon_form_factor(points, np.tile(-UP, (500, 1)).astype(dtype), level(0, 1, 0, 1, 0))
    np.testing.assert_allclose(under, 1, atol=200 * gap**2 + FEW * eps(dtype))


@pytest.mark.parametrize("dtype", TYPES)
def test_point_in_a_corner_of_the_room_sees_half_or_a_quarter_where_it_should(dtype):
    # Points on the floor where a wall begins, looking up: the wall is 1 high, 2 wide, the point at the middle of its
    # foot: it fills exactly half of the hemisphere but for what passes above and beside it. Limit from the front.
    wall = upright(-1, 1, 0, 1)
    near, at = (one((x, 0, 0), (0, 0, 1), wall, dtype) for x in (1e-3, 0.0))
    assert at == pytest.approx(0.5, abs=4 * np.sqrt(eps(dtype)))
    assert near == pytest.approx(at, abs=2e-3)


@pytest.mark.parametrize("dtype", TYPES)
@pytest.mark.parametrize(("point", "exact"), [
    ((0.5, 0.5, 1), 1.0),  # inside: what is straight before it
    ((0.5, 1.5, 1), 0.0),  # outside
    ((2.0, 0.0, 1), 0.0),  # on an edge's line
    ((-3.0, 1.0, 1), 0.0),  # on another
    ((0.0, 0.5, 1), 0.5),  # on an edge
    ((1.0, 1.0, 1), 0.25),  # on a corner
])  # fmt: skip
def test_point_in_the_polygons_plane_gets_the_limit_from_the_front(point, exact, dtype):
    # Square [0, 1]^2 at z = 1 facing down, elements facing up.
    value = one(point, (0, 0, 1), facing_down(0, 1, 0, 1, 1), dtype)
    assert value == pytest.approx(exact, abs=4 * np.sqrt(eps(dtype)))
    if exact == 0:
        assert value == pytest.approx(0, abs=FEW * eps(dtype))


@pytest.mark.parametrize("dtype", TYPES)
@pytest.mark.parametrize("normal", [(0, 0, -1), (1, 0, 0), (0.6, 0, 0.8), (0, -0.6, 0.8)])
def test_lumel_coplanar_with_a_lamp_beside_it_gets_nothing(normal, dtype):
    # S-12: whichever way it looks; nothing but rounding.
    for point in ((1.5, 0.5, 1), (-2, 0.3, 1), (0.5, 7, 1), (2, 1, 1)):
        assert one(point, normal, facing_down(0, 1, 0, 1, 1), dtype) == pytest.approx(0, abs=FEW * eps(dtype))


@pytest.mark.parametrize("dtype", TYPES)
def test_wall_that_a_lamp_touches_is_lit_up_to_the_edge(dtype):
    # S-12: a ceiling lamp that touches the wall y = 0: just below, half of the wall's hemisphere is lamp, and at it.
    lamp = facing_down(0, 1, 0, 1, 1)
    below, at = (one((0.5, 0, z), (0, 1, 0), lamp, dtype) for z in (0.999, 1.0))
    assert below == pytest.approx(0.5, abs=2e-3)
    assert at == pytest.approx(0.5, abs=4 * np.sqrt(eps(dtype)))


def test_point_on_an_edges_line_is_as_its_neighbours():
    # (c) of the formula's failures: points on the line of an edge of an upright polygon; F is smooth across the line.
    wall = upright(0, 1, 0.5, 1.5)
    for y in (-0.5, 1.5, 3.0):
        here, left, right = (one((dx, y, 0.5), (0.8, 0, 0.6), wall, sides="both") for dx in (0, -1e-7, 1e-7))
        assert here == pytest.approx((left + right) / 2, abs=1e-7)


@pytest.mark.parametrize("dtype", TYPES)
@pytest.mark.parametrize("distance", [3.0, 10.0, 30.0, 140.0, 142.0, 1e3, 1e4, 1e5])
def test_distance_costs_no_digits(dtype, distance):
    # S-3: coaxial square of side 1 seen from d: F = (4/pi) q atan(q), q = .5 / sqrt(.25 + d^2) (quarter squares, P-18).
    q = 0.5 / np.sqrt(0.25 + distance**2)
    exact = 4 / np.pi * q * np.arctan(q)
    value = one((0, 0, 0), (0, 0, 1), facing_down(-0.5, 0.5, -0.5, 0.5, distance), dtype)
    assert value == pytest.approx(exact, rel=FEW * eps(dtype) * (1 if distance > 200 else 10) + 2e-14)


@pytest.mark.parametrize("dtype", TYPES)
def test_switch_to_gauss_points_makes_no_step(dtype):
    # Both sides of FAR_RADII: the same value times distance squared, to a few rounding errors times the radii.
    radii = FAR_RADII[np.dtype(dtype).itemsize]
    distances = radii * np.sqrt(0.5) * np.array([0.999, 1.001])
    values = [one((0, 0, 0), (0.6, 0, 0.8), facing_down(-0.5, 0.5, -0.5, 0.5, d), dtype) * d**2 for d in distances]
    assert values[0] == pytest.approx(values[1], rel=FEW * eps(dtype) * radii / 10 + 0.01 / radii**2)


def test_small_light_far_away_at_the_horizon_is_clipped_too():
    # A square of 1 m at 10 km, its middle in the horizon: the upper half's cosine is a quarter metre over 10 km.
    value = one((0, 0, 0), (0, 0, 1), upright(-0.5, 0.5, -0.5, 0.5, -1e4))
    assert value == pytest.approx(0.5 * 0.25 / 1e4 / (np.pi * 1e8), rel=1e-6)


@pytest.mark.parametrize("dtype", TYPES)
def test_sides(dtype):
    # The square faces down: an element below sees .0599 of it; above it sees its back.
    square = facing_down(0, 0.5, 0, 0.5, 1)
    below = [one((0, 0, 0), (0, 0, 1), square, dtype, sides) for sides in ("front", "both", "signed")]
    above = [one((0, 0, 2), (0, 0, -1), square, dtype, sides) for sides in ("front", "both", "signed")]
    np.testing.assert_allclose(below, 0.05986411761519, rtol=1e-5)
    np.testing.assert_allclose(above, [0, 0.05986411761519, -0.05986411761519], rtol=1e-5)


def test_element_that_looks_away_gets_nothing_at_all():
    rng = np.random.default_rng(3)
    points = rng.uniform(-1, 1, (1000, 3)) * (1, 1, 0.4)
    values = polygon_form_factor(points, np.tile(-UP, (1000, 1)), facing_down(-1, 1, -1, 1, 0.5))
    assert not values.any()


def test_parts_of_a_polygon_add_up_to_it():
    # A hexagon cut along a chord: whatever the point, the normal and the horizon.
    rng = np.random.default_rng(4)
    hexagon = disc(1, 0, 6)
    points, normals = rng.normal(size=(3000, 3)), unit(rng.normal(size=(3000, 3)))
    whole, first, second = (
        polygon_form_factor(points, normals, part, "signed") for part in (hexagon, hexagon[:4], hexagon[[3, 4, 5, 0]]))
    np.testing.assert_allclose(first + second, whole, atol=1e-12)


@pytest.mark.parametrize("corners", [3, 4, 7])
def test_agrees_with_summing_over_the_area(corners):
    # A twin: 10,000 small pieces of a polygon, each clipped by its cosine; their rule is good to about 5e-4 here.
    rng = np.random.default_rng(corners)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    polygon = disc(1, 0, corners) @ turn.T
    points = rng.normal(size=(80, 3)) * 2
    front = np.cross(polygon[1] - polygon[0], polygon[2] - polygon[1])
    front /= np.linalg.norm(front)
    points = points[np.abs(points @ front) > 0.3]
    normals = unit(rng.normal(size=points.shape))
    u, v = ((np.arange(100) + 0.5) / 100 for _ in range(2))
    u, v = (grid.ravel()[:, None] for grid in np.meshgrid(u, v))
    total = np.zeros(len(points))
    for i in range(1, corners - 1):
        p, q = polygon[i] - polygon[0], polygon[i + 1] - polygon[0]
        places = polygon[0] + u * (p + v * (q - p))
        weight = u[:, 0] * np.linalg.norm(np.cross(p, q)) / len(u)
        for k, (point, normal) in enumerate(zip(points, normals, strict=True)):
            d = places - point
            total[k] += (weight * np.maximum(d @ normal, 0) * -(d @ front) / (np.pi * (d**2).sum(axis=1) ** 2)).sum()
    np.testing.assert_allclose(polygon_form_factor(points, normals, polygon, "signed"), total, atol=5e-4)


@pytest.mark.parametrize("dtype", TYPES)
def test_nothing_is_ever_negative_above_one_or_not_a_number(dtype):
    # Points, normals and corners on a coarse grid: in planes, on edges, on corners, along horizons; also polygons
    # without area.
    rng = np.random.default_rng(12)
    points, normals = rng.integers(-2, 3, (20_000, 3)), rng.integers(-1, 2, (20_000, 3))
    normals[~normals.any(axis=1)] = (0, 0, 1)
    flat = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0]], float)
    for polygon in (level(-1, 1, -1, 1, 0), disc(1, 0, 7), disc(1, 0, 3), flat, np.zeros((3, 3))):
        values = polygon_form_factor(points.astype(dtype), unit(normals).astype(dtype), polygon)
        assert np.isfinite(values).all()
        assert values.min() >= 0
        assert values.max() <= 1 + FEW * eps(dtype)


def test_float32_agrees_with_float64_to_its_own_digits():
    # 100,000 pairs around a unit square, the nearest a millimetre off: no value is off by more than 2e-5.
    rng = np.random.default_rng(6)
    points = rng.uniform(-1, 2, (100_000, 3)).astype(np.float32)
    points = points[np.abs(points[:, 2]) > 1e-3]
    normals = unit(rng.normal(size=points.shape)).astype(np.float32)
    square = level(0, 1, 0, 1, 0)
    single = polygon_form_factor(points, normals, square, "signed")
    double = polygon_form_factor(points.astype(float), normals.astype(float), square, "signed")
    assert np.abs(single - double).max() < 2e-5
    assert np.sqrt(((single - double) ** 2).mean()) < 3e-7


def test_scale_and_place_do_not_matter():
    # S-5: from millimetres to kilometres; shifted by 10,000 sizes in float64.
    square = facing_down(0, 0.5, 0, 0.5, 1)
    for scale in (1e-3, 1.0, 1e3):
        for shift in (0.0, 1e4):
            move = np.array([1, -0.5, 0.25]) * shift * scale
            value = one(move, (0, 0, 1), square * scale + move)
            assert value == pytest.approx(0.05986411761519, rel=1e-10)
            assert one((0, 0, 0), (0, 0, 1), square * scale, np.float32) == pytest.approx(0.0598641176, rel=1e-5)


def test_many_polygons_at_once_are_the_sum_of_each():
    # 300 triangles and 50 points, more pairs than one chunk; weights are two channels.
    rng = np.random.default_rng(7)
    polygons, points = rng.normal(size=(300, 3, 3)), rng.normal(size=(50, 3))
    normals = unit(rng.normal(size=points.shape))
    weights = rng.random((300, 2))
    each = np.stack([polygon_form_factor(points, normals, polygon, "both") for polygon in polygons], axis=1)
    plain, weighted = (polygons_form_factor(points, normals, polygons, w, "both") for w in (None, weights))
    np.testing.assert_allclose(plain, each.sum(axis=1), atol=1e-12)
    np.testing.assert_allclose(weighted, each @ weights, atol=1e-12)


def test_pairs_are_what_each_gets_by_itself():
    rng = np.random.default_rng(8)
    polygons, points = rng.normal(size=(50, 3, 3)), rng.normal(size=(50, 3))
    normals = unit(rng.normal(size=points.shape))
    each = [polygon_form_factor(points[[k]], normals[[k]], polygons[k])[0] for k in range(50)]
    np.testing.assert_allclose(paired_form_factor(points, normals, polygons), each, atol=1e-15)


def test_chunks_do_not_show():
    # 20,000 points in one call, and one by one hundred: the same bits.
    rng = np.random.default_rng(9)
    points, normals = rng.normal(size=(20_000, 3)), unit(rng.normal(size=(20_000, 3)))
    square = level(0, 1, 0, 1, 0)
    whole = polygon_form_factor(points, normals, square)
    pieces = np.concatenate([polygon_form_factor(points[k : k + 5000], normals[k : k + 5000], square)
                             for k in range(0, 20_000, 5000)])
    np.testing.assert_array_equal(whole, pieces)


def test_monotony_away_from_a_lamp():
    # Along the floor away from a lamp's foot the form factor falls, step by step, to the horizon.
    x = np.linspace(0, 50, 2000)
    points = np.stack([x, 0 * x, 0 * x], axis=1).astype(np.float32)
    normals = np.tile(UP, (2000, 1)).astype(np.float32)
    values = polygon_form_factor(points, normals, facing_down(-0.5, 0.5, -0.5, 0.5, 2))
    assert (np.diff(values[20:]) < 0).all()

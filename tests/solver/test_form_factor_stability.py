"""Form factors under everything that breaks the usual formulas."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from radiosity.benchmarks.form_factors.cases import BY_NAME, CEILING, UNIT, facing_down, level, upright, wing
from radiosity.solver.form_factor import element_form_factor, form_factor
from radiosity.solver.polygon import polygon_form_factor

UP = np.array([0.0, 0.0, 1.0])
ORIGIN = np.zeros(3)


@pytest.mark.parametrize("gap", [1e-2, 1e-3, 1e-4])
def test_gap_closes_without_a_jump(gap, validation):
    # S-1: parallel unit squares; exact by the catalogue's C-11 with 60 digits.
    import mpmath

    with mpmath.workdps(60):
        x = 1 / mpmath.mpf(gap)
        root = mpmath.sqrt(1 + x * x)
        exact = 2 / (mpmath.pi * x * x) * (
            mpmath.log((1 + x * x) / mpmath.sqrt(1 + 2 * x * x)) + 2 * x * root * mpmath.atan(x / root)
            - 2 * x * mpmath.atan(x))
    value = form_factor(UNIT, facing_down(0, 1, 0, 1, gap)).value
    validation("S-1", f"gap {gap:g}", float(exact), value, relative=1e-11)


@pytest.mark.parametrize("degrees", [1, 30, 150, 175, 179])
def test_shared_edge_at_any_angle(degrees, validation):
    # S-2: a twin of the contour: Gauss points of the element's closed form, on panels that halve towards the shared
    # edge and its ends, where it isn't smooth.
    x, wx = graded(np.concatenate([2.0 ** -np.arange(30, 0, -1), 1 - 2.0 ** -np.arange(2, 12), [1]]))
    y, wy = graded(0.5 * 2.0 ** -np.arange(24, -1, -1))
    grid = np.stack([*np.meshgrid(x, y, indexing="ij"), np.zeros((len(x), len(y)))], axis=2).reshape(-1, 3)
    values = polygon_form_factor(grid, np.broadcast_to(UP, grid.shape), wing(degrees))
    exact = 2 * wx @ values.reshape(len(x), len(y)) @ wy
    value = form_factor(UNIT, wing(degrees)).value
    validation("S-2", f"shared edge at {degrees} degrees", exact, value, relative=1e-10 if degrees < 170 else 1e-8)


def graded(cuts):
    """12 Gauss points and weights on each of the panels between 0 and the cuts."""
    g, w = np.polynomial.legendre.leggauss(12)
    low, width = np.concatenate([[0], cuts[:-1]]), np.diff(cuts, prepend=0)
    return (low[:, None] + width[:, None] * (g + 1) / 2).ravel(), (width[:, None] * w / 2).ravel()


@pytest.mark.parametrize("distance", [1e1, 1e2, 1e3, 1e4, 1e5])
def test_distance_costs_no_digits(distance, validation):
    # S-3: parallel unit squares at d; exact: 1/(pi d^2) (1 - 2/3 d^-2 ...) by C-11 with 60 digits.
    import mpmath

    with mpmath.workdps(60):
        x = 1 / mpmath.mpf(distance)
        root = mpmath.sqrt(1 + x * x)
        exact = 2 / (mpmath.pi * x * x) * (
            mpmath.log((1 + x * x) / mpmath.sqrt(1 + 2 * x * x)) + 2 * x * root * mpmath.atan(x / root)
            - 2 * x * mpmath.atan(x))
    value = form_factor(UNIT, facing_down(0, 1, 0, 1, distance)).value
    validation("S-3", f"distance {distance:g} sides", float(exact), value, relative=1e-11)


def test_polygon_that_crosses_the_others_plane_counts_with_its_front_part_alone(validation):
    # S-4: an upright square, half below the floor's plane: exactly what its upper half gives.
    whole, upper = upright(0, 1, -1, 1), upright(0, 1, 0, 1)
    validation("S-4", "upright square half below the floor", form_factor(UNIT, upper).value,
               form_factor(UNIT, whole).value, relative=1e-12)


def test_planes_that_cut_both_polygons_clip_both(validation):
    # S-4: floor [-1, 1] x [0, 1] and wall z in [-1, 1] cross in the y axis: the fronts are P-05, of half the area.
    value = form_factor(level(-1, 1, 0, 1, 0), upright(0, 1, -1, 1)).value
    validation("S-4", "crossing rectangles", BY_NAME["P-05"].exact / 2, value, relative=1e-11)


def test_backs_see_nothing():
    assert form_factor(UNIT[::-1], CEILING).value == 0
    assert form_factor(UNIT, CEILING[::-1]).value == 0
    assert element_form_factor(ORIGIN, -UP, CEILING).value == 0


def test_element_sees_a_polygon_from_either_side_past_occluders():
    # P-27 at x = .25 with the source turned over: .1611880253512.
    source, edge = facing_down(-1, 1, -1, 1, 2), level(-50, 0, -50, 50, 1)
    for polygon in (source, source[::-1]):
        value = element_form_factor((0.25, 0, 0), UP, polygon, [edge]).value
        assert value == pytest.approx(0.1611880253512, rel=1e-10)


def test_coplanar_polygons_see_nothing():
    assert form_factor(UNIT, level(1, 2, 0, 1, 0)).value == 0
    assert form_factor(UNIT, level(1, 2, 0, 1, 0)[::-1]).value == 0


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("shift", [0.0, 1e4])
@pytest.mark.parametrize("name", ["P-02", "P-05", "P-09", "P-14"])
def test_scale_and_place_of_a_scene_do_not_matter(name, scale, shift, validation):
    # S-5: form factors have no unit. The shift is in sizes of the scene: 1e4 of them leave 12 digits of 16.
    case = BY_NAME[name]
    move = np.array([1.0, -0.7, 0.4]) * shift * scale
    estimate = form_factor(case.a * scale + move, case.b * scale + move, [q * scale + move for q in case.occluders])
    validation("S-5", f"{name} times {scale:g}, {shift:g} sizes off", case.exact, estimate.value,
               estimate.standard_error, relative=1e-9)


def test_rotation_does_not_matter(validation):
    # S-19: 37 degrees about (1, 2, 3).
    axis = np.array([1, 2, 3]) / np.sqrt(14)
    skew = np.cross(np.eye(3), axis)
    turn = np.eye(3) + np.sin(np.radians(37)) * skew + (1 - np.cos(np.radians(37))) * skew @ skew
    for name in ("P-02", "P-05", "P-09", "P-11c"):
        case = BY_NAME[name]
        value = form_factor(case.a @ turn.T, case.b @ turn.T).value
        validation("S-19", f"{name} turned by 37 degrees", case.exact, value, relative=1e-10)


def test_needles_keep_their_digits(validation):
    # S-6: strips 1 x 10^-4 m side by side make up the square: the needles' mean is P-01.
    edges = np.linspace(0, 1, 10001)[[0, 1, 2500, 2501, 9999, 10000]]
    for low, high in zip(edges[::2], edges[1::2], strict=True):
        needle = level(0, 1, low, high, 0)
        weights = np.polynomial.legendre.leggauss(40)[1] / 2
        exact = weights @ [element_form_factor((x, (low + high) / 2, 0), UP, CEILING).value
                           for x in (np.polynomial.legendre.leggauss(40)[0] + 1) / 2]
        validation("S-6", f"needle of .1 mm from y = {low:g} to a square", exact, form_factor(needle, CEILING).value,
                   relative=1e-7)


@pytest.mark.parametrize("shift", [0.0, 0.02])
def test_thin_occluder_on_or_off_the_line_of_centres_blocks_the_same(shift, validation):
    # S-7: occluder of 1 cm2 midway. Its blocked part hardly moves with it; rays between centroids see all or nothing.
    # Exact: blocked part is about the area's 1e-4 times 4 P-01-like: here from a 40 x 40 Gauss rule over the occluder:
    # flux through a small area = projected radiance: F_blocked = (1/A) int int cos cos' over lines through it.
    half = 0.005
    c = 0.5 + shift
    occluder = level(c - half, c + half, c - half, c + half, 0.5)
    estimate = form_factor(UNIT, CEILING, [occluder])
    exact = BY_NAME["P-01"].exact - flux_through(occluder)
    validation("S-7", f"occluder of 1 cm2, {shift:g} m off the centre", exact, estimate.value, estimate.standard_error,
               relative=1e-9)


def flux_through(small):
    """What crosses a level square at z = .5 on its way from UNIT to CEILING, lines counted by cos dA dw / pi.

    For a point on the square, the lines upwards reach CEILING inside one projected rectangle and come from UNIT inside
    the mirrored one; with both at the same distance their overlap is a rectangle, and its form factor is closed. The
    overlap has a kink at x = .5 and y = .5: Gauss points on either side of it.
    """
    g, w = np.polynomial.legendre.leggauss(6)

    def nodes(low, high):
        cuts = [low, 0.5, high] if low < 0.5 < high else [low, high]
        return [((a + b + x * (b - a)) / 2, weight * (b - a) / 2)
                for a, b in pairwise(cuts) for x, weight in zip(g, w, strict=True)]

    (x0, y0, z), (x1, y1, _) = small[0], small[2]
    return sum(
        wx * wy * element_form_factor(
            (x, y, z), UP, facing_down(max(0, 2 * x - 1), min(1, 2 * x), max(0, 2 * y - 1), min(1, 2 * y), 1)).value
        for x, wx in nodes(x0, x1) for y, wy in nodes(y0, y1))


def test_occluder_over_a_thousandth_of_the_light_is_not_lost(validation):
    # S-8: seen from the element, a square of 1/1000 of the light's area, just below it, covers one 1000th.
    side = np.sqrt(1e-3)
    light = facing_down(-0.5, 0.5, -0.5, 0.5, 1)
    near = 1 - 1e-9
    occluder = level(0.1, 0.1 + side, 0.2, 0.2 + side, near)
    exact = element_form_factor(ORIGIN, UP, light).value - element_form_factor(ORIGIN, UP, occluder[::-1]).value
    validation("S-8", "occluder over 1/1000 of the light", exact,
               element_form_factor(ORIGIN, UP, light, [occluder]).value, relative=1e-12)


def test_occluder_that_hides_all_gives_exactly_nothing():
    assert form_factor(UNIT, CEILING, [level(-1, 2, -1, 2, 0.5)]).value == 0
    assert form_factor(UNIT, CEILING, [level(-1, 2, -1, 2, 0.5)]).standard_error == 0


@pytest.mark.parametrize("occluder", [
    level(2, 3, 0, 1, 0.5), level(0, 1, 0, 1, -0.5), level(0, 1, 0, 1, 1.5), level(0, 1, 0, 1, 1), level(0, 1, 0, 1, 0),
    upright(0, 1, 0, 1, 1.0),
], ids=["beside", "below", "above", "on b", "on a", "touching edge-on"])  # fmt: skip
def test_occluder_out_of_the_way_leaves_the_exact_answer(occluder):
    estimate = form_factor(UNIT, CEILING, [occluder])
    assert estimate.value == pytest.approx(BY_NAME["P-01"].exact, rel=1e-12)
    assert estimate.standard_error == 0


def turned(rng, shift, scale):
    """A rotation, a shift of so many sizes and a scale, for polygons."""
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    turn *= np.linalg.det(turn)
    move = rng.normal(size=3) * shift
    return lambda polygon: (polygon @ turn.T + move) * scale


@pytest.mark.parametrize("shift", [0.0, 1e2, 1e5])
def test_surfaces_that_touch_or_coincide_do_not_shadow_one_another_far_from_the_origin(shift):
    # P-05, given both polygons and a neighbour in a's plane as occluders: none is in the way, though the coordinates'
    # last digits say so. Coplanar neighbours see nothing of each other.
    rng = np.random.default_rng(10)
    for scale in (1e-3, 1, 1e3):
        place = turned(rng, shift, scale)
        a, b, neighbour = place(UNIT), place(wing(90)), place(level(1, 2, 0, 1, 0))
        estimate = form_factor(a, b, [a, b, neighbour])
        assert estimate.standard_error == 0
        assert estimate.value == pytest.approx(BY_NAME["P-05"].exact, rel=1e-9)
        assert form_factor(a, neighbour).value == 0
        centre, up = a.mean(axis=0), np.cross(a[1] - a[0], a[2] - a[1])
        free = element_form_factor(centre, up, b)
        assert element_form_factor(centre, up, b, [a, b, neighbour]).value == pytest.approx(free.value, rel=1e-9)


def test_walls_of_any_tetrahedron_fill_each_others_view():
    # 30 random tetrahedra, flat and pointed ones too: every row sums to 1.
    rng = np.random.default_rng(11)
    for _ in range(30):
        corners = rng.normal(size=(4, 3)) * 10 ** rng.uniform(-1, 1, (4, 1))
        faces = [corners[list(face)] for face in ((0, 1, 2), (0, 3, 1), (0, 2, 3), (1, 3, 2))]
        middle = corners.mean(axis=0)
        inward = [f if np.cross(f[1] - f[0], f[2] - f[0]) @ (middle - f[0]) > 0 else f[::-1] for f in faces]
        for face in inward:
            total = sum(form_factor(face, other).value for other in inward if other is not face)
            assert total == pytest.approx(1, abs=1e-11)


def test_overlapping_occluders_shadow_once():
    # P-15's occluder twice, and cut in two overlapping parts: 3/4 of P-01.
    quarter = level(0, 0.5, 0, 0.5, 0.5)
    parts = [level(0, 0.3, 0, 0.5, 0.5), level(0.2, 0.5, 0, 0.5, 0.5)]
    for occluders in ([quarter, quarter], parts):
        estimate = form_factor(UNIT, CEILING, occluders)
        assert abs(estimate.value - BY_NAME["P-15"].exact) < 4 * estimate.standard_error
        assert estimate.standard_error < 2e-6


def test_pin_hole_is_found_or_the_error_bar_says_so(validation):
    # S-9: a wall with a hole of 2 mm: four strips around it. Exact: what crosses the hole.
    low, high = 0.499, 0.501
    strips = [level(-9, low, -9, 9, 0.5), level(high, 9, -9, 9, 0.5), level(low, high, -9, low, 0.5),
              level(low, high, high, 9, 0.5)]
    exact = flux_through(level(low, high, low, high, 0.5))
    estimate = form_factor(UNIT, CEILING, strips)
    assert 0 < estimate.standard_error < 0.05 * exact
    validation("S-9", "a hole of 2 mm between unit squares", exact, estimate.value, estimate.standard_error)


def test_visible_part_agrees_with_brute_force_rays():
    # A twin: 200,000 random lines between two skew triangles past two skew occluders; no exact answer, 4 sigma.
    rng = np.random.default_rng(5)
    a, b = np.array([[0, 0, 0], [1, 0, 0.1], [0.2, 1, 0]]), np.array([[0, 0.1, 1], [0.3, 1, 1.2], [1, 0.2, 0.9]])
    occluders = [np.array([[0.1, 0.1, 0.5], [0.6, 0.2, 0.4], [0.3, 0.6, 0.6]]),
                 np.array([[0.5, 0.5, 0.3], [0.9, 0.4, 0.8], [0.4, 0.9, 0.5]])]
    estimate = form_factor(a, b, occluders)
    kernel, blocked = lines_between(a, b, occluders, rng, 200_000)
    values = kernel * ~blocked
    error = np.hypot(values.std() / np.sqrt(len(values)), estimate.standard_error)
    assert abs(values.mean() - estimate.value) < 4 * error
    assert blocked.mean() > 0.1


def lines_between(a, b, occluders, rng, count):
    """Integrand of F_ab for random lines, and whether a triangle blocks each."""
    def points(triangle):
        u, v = np.sqrt(rng.random(count))[:, None], rng.random(count)[:, None]
        return triangle[0] + u * (triangle[1] - triangle[0]) + u * v * (triangle[2] - triangle[1])

    def area_vector(t):
        return np.cross(t[1] - t[0], t[2] - t[0]) / 2

    x, y = points(a), points(b)
    d = y - x
    area = np.linalg.norm(area_vector(a))
    cosines = np.maximum(d @ area_vector(a) / area, 0) * np.maximum(-(d @ area_vector(b)), 0)
    blocked = np.zeros(count, bool)
    for t in occluders:
        inside = [np.einsum("nk,nk->n", d, np.cross(t[i] - x, t[(i + 1) % 3] - x)) for i in range(3)]
        turn = np.sign(np.stack(inside))
        height = [(p - t[0]) @ area_vector(t) for p in (x, y)]
        blocked |= ((turn == turn[0]).all(axis=0)) & (height[0] * height[1] < 0)
    return cosines / (np.pi * (d**2).sum(axis=1) ** 2), blocked

"""Form factors of polygons and elements against the catalogue of exact answers."""

from __future__ import annotations

import numpy as np
import pytest
from radiosity.benchmarks.form_factors.cases import (
    BY_NAME,
    CEILING,
    OCCLUDED,
    UNIT,
    UNOCCLUDED,
    disc,
    facing_down,
    level,
    upright,
)
from radiosity.solver.contour import convex_form_factor
from radiosity.solver.form_factor import element_form_factor, form_factor

UP = np.array([0.0, 0.0, 1.0])
ORIGIN = np.zeros(3)


def extrapolated(coarse, fine):
    """Limit of an error ~ 1/n^2, from n and 2 n corners."""
    return fine + (fine - coarse) / 3


@pytest.mark.parametrize("case", UNOCCLUDED, ids=lambda case: f"{case.name} {case.about}")
def test_two_polygons_without_occluders_agree_with_the_catalogue_to_ten_digits(case, validation):
    # Exact: the catalogue's closed form; P-04 is published with 11 digits, the others with 13.
    estimate = form_factor(case.a, case.b)
    assert estimate.standard_error == 0
    validation(case.name, case.about, case.exact, estimate.value, relative=2e-11)


@pytest.mark.parametrize("case", UNOCCLUDED, ids=lambda case: case.name)
def test_area_times_form_factor_is_the_same_both_ways(case):
    # Exact: A_a F_ab = A_b F_ba.
    area = [np.linalg.norm(np.cross(p[1] - p[0], p[2] - p[1])) for p in (case.a, case.b)]
    there, back = form_factor(case.a, case.b).value, form_factor(case.b, case.a).value
    np.testing.assert_allclose(area[0] * there, area[1] * back, rtol=1e-11)


@pytest.mark.parametrize("case", OCCLUDED, ids=lambda case: f"{case.name} {case.about}")
def test_shadow_of_an_occluder_lies_within_four_standard_errors_and_these_are_small(case, validation):
    # Exact: a two-dimensional reduction of the blocked part, 10 digits; P-15 is 3/4 of P-01 by symmetry.
    estimate = form_factor(case.a, case.b, case.occluders)
    assert 0 < estimate.standard_error < 2e-6 * case.exact
    validation(case.name, case.about, case.exact, estimate.value, estimate.standard_error, relative=1e-10)


def test_standard_error_is_honest_over_thirty_seeds(validation):
    # P-14; exact .0995062945996. Normal deviates: rms 1, and with 16 shifts rarely beyond 3.
    case = BY_NAME["P-14"]
    estimates = [form_factor(case.a, case.b, case.occluders, seed=seed) for seed in range(30)]
    deviates = np.array([(e.value - case.exact) / e.standard_error for e in estimates])
    rms = np.sqrt((deviates**2).mean())
    assert 0.7 < rms < 1.4
    # An RMS of n normal deviates is off by 1 / sqrt(2 n).
    validation("S-21", "deviates of 30 seeds in their standard errors, RMS", 1, rms, 60**-0.5)
    assert np.abs(deviates).max() < 4


def test_a_seed_gives_the_same_bits_again():
    case = BY_NAME["P-14"]
    assert form_factor(case.a, case.b, case.occluders, 3) == form_factor(case.a, case.b, case.occluders, 3)


@pytest.mark.parametrize(("case", "radii", "gap", "exact"), [
    ("P-12a", (1, 1), 1, 0.3819660112501), ("P-12b", (0.5, 2), 1, 0.7917560805262),
])  # fmt: skip
def test_discs_are_the_limit_of_regular_polygons(case, radii, gap, exact, validation):
    # Coaxial discs, exact in closed form; polygons of 48 and 96 corners, extrapolated: the error falls as n^-4.
    values = [form_factor(disc(radii[0], 0, n), disc(radii[1], gap, n)[::-1]).value for n in (48, 96)]
    about = f"coaxial discs r {radii[0]}, {radii[1]}; 48- and 96-gons"
    validation(case, about, exact, extrapolated(*values), relative=1e-6)


def test_disc_between_discs(validation):
    # P-22: unit discs, gap 1, occluding disc r .5 midway: .2107555172319; 24-gons of the discs' areas are 9e-6 off.
    estimate = form_factor(disc(1, 0, 24), disc(1, 1, 24)[::-1], [disc(0.5, 0.5, 24)])
    validation("P-22", "disc between discs; 24-gons", 0.2107555172319, estimate.value, estimate.standard_error, 1e-5)


def test_walls_of_a_tetrahedron_get_a_third_each(validation):
    # P-23: regular tetrahedron, seen from inside.
    corners = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]], float)
    faces = [corners[list(face)] for face in ((0, 1, 2), (0, 3, 1), (0, 2, 3), (1, 3, 2))]
    inward = [f if np.cross(f[1] - f[0], f[2] - f[0]) @ f.mean(axis=0) < 0 else f[::-1] for f in faces]
    for k, face in enumerate(inward[1:], 2):
        value = form_factor(inward[0], face).value
        validation("P-23", f"tetrahedron, wall 1 to wall {k}", 1 / 3, value, relative=1e-11)


def test_row_of_an_l_shaped_room(validation):
    # P-28 (Pinney and Bean's test 4): View3D's digits, whose row sums to 1.000004; ours to 1. The inner corner shadows.
    def wall(x0, y0, x1, y1):
        return np.array([[x0, y0, 0], [x0, y0, 3], [x1, y1, 3], [x1, y1, 0]], float)

    outline = [(0, 0), (3, 0), (3, 1), (1, 1), (1, 3), (0, 3)]
    walls = [wall(*p, *q) for p, q in zip(outline, outline[1:] + outline[:1], strict=True)]
    ceiling = np.array([[x, y, 3] for x, y in outline], float)
    row = [form_factor(walls[0], other, [walls[2], walls[3]]) for other in [*walls, ceiling[::-1]]]
    row.append(row[-1])  # the floor, by symmetry
    published = [0, 0.113154, 0.378093, 0.027473, 0.032894, 0.182356, 0.133017, 0.133017]
    for k, (estimate, exact) in enumerate(zip(row, published, strict=True)):
        validation("P-28", f"L-shaped room, F 1 -> {k + 1} (View3D's digits)", exact, estimate.value,
                   estimate.standard_error, relative=5e-6 / max(exact, 1e-9))
    error = np.sqrt(sum(e.standard_error**2 for e in row[:-2]) + 4 * row[-1].standard_error ** 2)
    validation("P-28", "sum of the row", 1, sum(e.value for e in row), error, relative=1e-9)


def test_published_table_of_small_squares(validation):
    # P-29: .1 x .1 squares .05 apart: .4153 in EES's table, .415253 by the catalogue's formula.
    estimate = form_factor(level(0, 0.1, 0, 0.1, 0), facing_down(0, 0.1, 0, 0.1, 0.05))
    validation("P-29", "squares of .1 m, gap .05 m", 0.415253, estimate.value, relative=2e-6)


def test_rows_of_a_box_sum_to_one():
    # Box 1 x 1 x 1: 4 P-05 + P-01 = 1.
    box = [facing_down(0, 1, 0, 1, 1), upright(0, 1, 0, 1), upright(0, 1, 0, 1, 1)[::-1],
           np.array([[0, 0, 0], [0, 0, 1], [1, 0, 1], [1, 0, 0]]),
           np.array([[0, 1, 0], [1, 1, 0], [1, 1, 1], [0, 1, 1]])]
    assert sum(form_factor(UNIT, wall).value for wall in box) == pytest.approx(1, abs=1e-12)


@pytest.mark.parametrize(("case", "about", "polygon", "exact"), [
    ("P-17", "element, triangle through the horizon",
     [[0.5, -1, -0.5], [1, 1, -0.25], [0.25, 0.2, 1.5]], 0.2278886058235),
    ("P-18a", "element, square overhead", facing_down(0, 0.5, 0, 0.5, 1), 0.05986411761519),
    ("P-18b", "element, rectangle overhead", facing_down(0, 2, 0, 3, 1), 0.2175752061078),
    ("P-19a", "element, upright square", upright(0, 1, 0, 1, 1)[::-1], 0.05573419700255),
    ("P-19b", "element, upright rectangle", upright(0, 1, 0, 2, 0.25)[::-1], 0.2019187576875),
])  # fmt: skip
def test_element_to_polygon_agrees_with_the_catalogue(case, about, polygon, exact, validation):
    estimate = element_form_factor(ORIGIN, UP, polygon)
    assert estimate.standard_error == 0
    validation(case, about, exact, estimate.value, relative=1e-12)
    assert element_form_factor(ORIGIN, UP, polygon[::-1]).value == pytest.approx(exact, rel=1e-12)


@pytest.mark.parametrize(("case", "radius", "height", "offset", "exact"), [
    ("P-20a", 1, 1, 1, 0.27639320225), ("P-20b", 0.5, 0.75, 2, 0.007394122590163),
])  # fmt: skip
def test_element_to_disc_is_the_limit_of_polygons(case, radius, height, offset, exact, validation):
    values = [element_form_factor(ORIGIN, UP, disc(radius, height, n, offset)[::-1]).value for n in (200, 400)]
    validation(case, "element, parallel disc off the axis; 200- and 400-gons", exact, extrapolated(*values))


def test_disc_behind_a_disc(validation):
    # P-21: disc R 1 at height 1 behind disc r .25 at height .5: sin^2 45 - sin^2(atan .5) = .5 - .2 = .3.
    values = [element_form_factor(ORIGIN, UP, disc(1, 1, n)[::-1], [disc(0.25, 0.5, n)]).value for n in (100, 200)]
    validation("P-21", "element, disc behind a disc; 100- and 200-gons", 0.3, extrapolated(*values))


@pytest.mark.parametrize(("x", "exact"), [
    (-0.75, 0.01318443288285), (-0.5, 0.03705534802), (0, 0.1197282352304), (0.25, 0.1611880253512),
    (0.5, 0.1859108490138), (1, 0.1803687411231),
])  # fmt: skip
def test_penumbra_of_a_knife_edge(x, exact, validation):
    # P-27: source [-1, 1]^2 at z = 2, the half-plane x < 0 at z = 1.
    estimate = element_form_factor((x, 0, 0), UP, facing_down(-1, 1, -1, 1, 2), [level(-50, 0, -50, 50, 1)])
    validation("P-27", f"knife edge, receiver at x = {x}", exact, estimate.value, relative=1e-10)


@pytest.mark.parametrize(("x", "y", "exact"), [
    (0, 0, 0.03410679489971), (1, 0, 0.02798915630256), (1, 1, 0.02334826258771), (1.5, 1.5, 0.01571496642135),
])  # fmt: skip
def test_source_under_a_ceiling_lights_the_floor(x, y, exact, validation):
    # P-46, after CIE 171 5.3: a source of 1 m2 at z = 3.
    value = element_form_factor((x, y, 0), UP, facing_down(-0.5, 0.5, -0.5, 0.5, 3)).value
    validation("P-46", f"source of 1 m2, floor at ({x}, {y})", exact, value, relative=1e-12)


def test_source_under_a_ceiling_lights_the_wall(validation):
    # P-46: the wall's point (2, 0, 1.5) looks along -x.
    value = element_form_factor((2, 0, 1.5), (-1, 0, 0), facing_down(-0.5, 0.5, -0.5, 0.5, 3)).value
    validation("P-46", "source of 1 m2, wall at (2, 0, 1.5)", 0.02428514065092, value, relative=1e-12)


@pytest.mark.parametrize(("z", "exact"), [(0.5, 0.4038375153749), (1.5, 0.2462297383607), (2.5, 0.147122632499)])
def test_wall_sees_the_floor_that_it_stands_on(z, exact, validation):
    # P-47, after CIE 171 5.6: the floor [0, 4] x [-2, 2] touches the wall's plane.
    value = element_form_factor((0, 0, z), (1, 0, 0), level(0, 4, -2, 2, 0)).value
    validation("P-47", f"wall above a floor, z = {z}", exact, value, relative=1e-11)


def test_floor_of_a_courtyard_sees_the_sky(validation):
    # P-50: centre of the floor of an open unit cube: four times P-18a.
    value = element_form_factor((0.5, 0.5, 0), UP, CEILING).value
    validation("P-50", "sky factor on a courtyard's floor", 0.2394564704608, value, relative=1e-12)


def test_element_average_is_the_form_factor():
    # A twin of the contour: 24 x 24 Gauss points of the element's closed form on P-07; the rule is exact to 1e-12.
    case = BY_NAME["P-07"]
    g, w = np.polynomial.legendre.leggauss(24)
    mean = sum(wx * wy / 4 * element_form_factor(((1 + x) / 2, (1 + y) / 2, 0), UP, case.b).value
               for x, wx in zip(g, w, strict=True) for y, wy in zip(g, w, strict=True))
    assert convex_form_factor(case.a, case.b) == pytest.approx(mean, rel=1e-11)

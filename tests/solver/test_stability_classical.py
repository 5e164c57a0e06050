"""Where the classical methods fail, they are shown failing, and ours beside them not: the table of docs/stability.md.

Exact answers come from closed forms in 60 digits, or from quadratures that share nothing with the contour integrals.
"""

from __future__ import annotations

from pathlib import Path

import mpmath
import numpy as np
import pytest
from radiosity.benchmarks.form_factors import centroid, disc_to_point, double_contour, hemicube, monte_carlo_rays
from radiosity.benchmarks.form_factors.cases import (
    BY_NAME,
    CEILING,
    PARALLEL,
    UNIT,
    facing_down,
    level,
    upright,
    wing,
)
from radiosity.benchmarks.linear.methods import SOLVERS
from radiosity.benchmarks.linear.systems import cube, two_rooms
from radiosity.solver import contour
from radiosity.solver.form_factor import element_form_factor, form_factor
from radiosity.solver.linear import solve_linear
from radiosity.solver.polygon import polygon_form_factor
from radiosity.tests.solver.stability import CASES, FOLDER
from radiosity.tests.solver.test_form_factor_stability import graded

UP = np.array([0.0, 0.0, 1.0])
# Logarithms of the double contour: 10 x 10 nodes for each of 16 pairs of edges.
CONTOUR = 1600
# Pairs of patches of the point methods: 8 x 8 patches on both.
PATCHES = 8**4


def off(method, a, b, exact, samples, *more):
    """Relative error of a classical method."""
    return method.form_factor(a, b, samples, *more) / exact - 1


def ours_off(a, b, exact):
    """Relative error of ours."""
    return form_factor(a, b).value / exact - 1


def parallel_squares(gap):
    """F of unit squares a gap apart (Howell's C-11), from 60 digits."""
    with mpmath.workdps(60):
        x = 1 / mpmath.mpf(gap)
        root = mpmath.sqrt(1 + x * x)
        return float(2 / (mpmath.pi * x * x) * (mpmath.log((1 + x * x) / mpmath.sqrt(1 + 2 * x * x))
                                                + 2 * x * root * mpmath.atan(x / root) - 2 * x * mpmath.atan(x)))


def upright_rectangles(width, height):
    """F from a rectangle 1 x width to one of 1 x height that stands on their common edge (C-14), from 60 digits."""
    with mpmath.workdps(60):
        w, h = mpmath.mpf(width), mpmath.mpf(height)
        w2, h2 = w * w, h * h
        both = mpmath.sqrt(w2 + h2)
        logarithm = (mpmath.log((1 + w2) * (1 + h2) / (1 + w2 + h2))
                     + w2 * mpmath.log(w2 * (1 + w2 + h2) / ((1 + w2) * (w2 + h2)))
                     + h2 * mpmath.log(h2 * (1 + w2 + h2) / ((1 + h2) * (w2 + h2))))
        return float((w * mpmath.atan(1 / w) + h * mpmath.atan(1 / h) - both * mpmath.atan(1 / both) + logarithm / 4)
                     / (mpmath.pi * w))


def from_square(polygon):
    """F from the unit square to a polygon on its side of the edge x = 0: Lambert's closed form at Gauss points, on
    panels that halve towards that edge and its ends, where it isn't smooth."""
    x, wx = graded(np.concatenate([2.0 ** -np.arange(30, 0, -1), 1 - 2.0 ** -np.arange(2, 12), [1]]))
    y, wy = graded(0.5 * 2.0 ** -np.arange(24, -1, -1))
    grid = np.stack([*np.meshgrid(x, y, indexing="ij"), np.zeros((len(x), len(y)))], axis=2).reshape(-1, 3)
    values = polygon_form_factor(grid, np.broadcast_to(UP, grid.shape), polygon)
    return 2 * wx @ values.reshape(len(x), len(y)) @ wy


def element_mean(polygon, count=24):
    """F from the unit square to a polygon well apart: Lambert's closed form at Gauss points."""
    g, w = np.polynomial.legendre.leggauss(count)
    x, y = (each.ravel() for each in np.meshgrid((g + 1) / 2, (g + 1) / 2))
    points = np.stack([x, y, 0 * x], axis=1)
    return np.outer(w, w).ravel() / 4 @ polygon_form_factor(points, np.broadcast_to(UP, points.shape), polygon)


def plain_semi_analytic(a, b, nodes):
    """F_ab with the inner contour integral solved and Gauss nodes on the outer edges (Mitalas and Stephenson 1966)."""
    x, w = np.polynomial.legendre.leggauss(nodes)
    x, w = (x + 1) / 2, w / 2
    total = 0.0
    for start, end in zip(a, np.roll(a, -1, axis=0), strict=True):
        points = start + x[:, None] * (end - start)
        for begin, stop in zip(b, np.roll(b, -1, axis=0), strict=True):
            direction = (stop - begin) / np.linalg.norm(stop - begin)
            total += (end - start) @ direction * (contour._logarithm_integral(points, begin, stop, direction) @ w)
    return total / (2 * np.pi * np.linalg.norm(np.cross(a[1] - a[0], a[2] - a[1])))


@pytest.mark.parametrize("name", CASES)
def test_every_stability_case_has_its_tests(name):
    # S-1 to S-22: every test that the page names is there.
    for test in CASES[name].tests:
        file, function = test.split("::")
        assert f"\ndef {function}(" in (FOLDER / file).read_text(encoding="utf-8"), test


def test_every_test_that_the_page_of_stability_names_is_there():
    # docs/stability.md: twenty-two cases; its measured rows name the tests of this file.
    page = (Path(__file__).resolve().parents[2] / "docs" / "stability.md").read_text(encoding="utf-8")
    assert all(f"| {name} | {case.breaks} |" in page for name, case in CASES.items())


@pytest.mark.parametrize("gap", [1e-2, 1e-3, 1e-4])
def test_centres_explode_where_squares_nearly_touch(gap, stability):
    # S-1: unit squares a gap apart: F is just below 1 (C-11).
    near = facing_down(0, 1, 0, 1, gap)
    exact = parallel_squares(gap)
    ours = ours_off(UNIT, near, exact)
    stability("S-1", f"centroid, gap {gap:g}", off(centroid, UNIT, near, exact, 1), ours)
    stability("S-1", f"centroid, 8 x 8 patches, gap {gap:g}", off(centroid, UNIT, near, exact, PATCHES), ours)
    stability("S-1", f"double contour, 10 nodes, gap {gap:g}", off(double_contour, UNIT, near, exact, CONTOUR), ours)
    assert off(centroid, UNIT, near, exact, 1) > 0.3 / gap**2


@pytest.mark.parametrize(("degrees", "least"), [(1, 5), (30, 0.5), (150, 0.03), (175, 0.03), (179, 0.03)])
def test_all_but_closed_forms_are_off_at_a_shared_edge(degrees, least, stability):
    # S-2: unit squares with a common edge, opened by 1 to 179 degrees.
    other = wing(degrees)
    exact = from_square(other)
    ours = ours_off(UNIT, other, exact)
    patches = off(centroid, UNIT, other, exact, PATCHES)
    assert patches > least
    stability("S-2", f"centroid, 8 x 8 patches, {degrees} degrees", patches, ours)
    stability("S-2", f"disc to point, {degrees} degrees", off(disc_to_point, UNIT, other, exact, 1), ours)
    lost = off(double_contour, UNIT, other, exact, CONTOUR)
    assert not np.isfinite(lost)
    stability("S-2", f"double contour, {degrees} degrees", lost, ours)
    stability("S-2", f"one contour solved, 30 plain nodes, {degrees} degrees",
              plain_semi_analytic(UNIT, other, 30) / exact - 1, ours)


@pytest.mark.parametrize("distance", [1e3, 1e4, 1e5])
def test_contours_cancel_between_squares_far_apart(distance, stability):
    # S-3: parallel unit squares: the terms are as large as the distance's logarithm, F is 1 / (pi d^2).
    far = facing_down(0, 1, 0, 1, distance)
    exact = parallel_squares(distance)
    ours = ours_off(UNIT, far, exact)
    stability("S-3", f"double contour, distance {distance:g}", off(double_contour, UNIT, far, exact, CONTOUR), ours)
    seen = off(monte_carlo_rays, UNIT, far, exact, 4096)
    assert seen == -1
    stability("S-3", f"4,096 random rays, distance {distance:g}", seen, ours)


def test_an_arc_cosine_loses_a_far_light(stability):
    # S-3: Lambert's sum over a light of 1 m2, straight above. The angle between two corners as the arc cosine of their
    # product has half of the digits of a small angle; as the arc tangent of both products it has all.
    for distance in (1e3, 1e4, 1e5):
        light = facing_down(-0.5, 0.5, -0.5, 0.5, distance)
        with mpmath.workdps(30):
            half = mpmath.mpf(1) / 2
            slant = mpmath.sqrt(mpmath.mpf(distance) ** 2 + half**2)
            exact = float(4 * half / (mpmath.pi * slant) * mpmath.atan(half / slant))
        ray = light / np.linalg.norm(light, axis=1, keepdims=True)
        turned = np.roll(ray, -1, axis=0)
        around = np.cross(ray, turned)
        angle = np.arccos(np.minimum((ray * turned).sum(axis=1), 1))
        found = abs((angle * around[:, 2] / np.linalg.norm(around, axis=1)).sum()) / (2 * np.pi)
        stability("S-3", f"Lambert's sum with arc cosines, distance {distance:g}", found / exact - 1,
                  element_form_factor((0, 0, 0), UP, light).value / exact - 1)


def test_without_clipping_what_lies_below_the_horizon_is_taken_away(stability):
    # S-4, P-17: .2278886058235; the sum over all of the triangle's edges is .1756547388923.
    triangle = np.array([[0.5, -1, -0.5], [1, 1, -0.25], [0.25, 0.2, 1.5]])
    exact = 0.2278886058235
    begin, end = triangle, np.roll(triangle, -1, axis=0)
    around = np.cross(begin, end)
    angle = np.arctan2(np.linalg.norm(around, axis=1), (begin * end).sum(axis=1))
    unclipped = abs((angle * around[:, 2] / np.linalg.norm(around, axis=1)).sum()) / (2 * np.pi)
    assert unclipped == pytest.approx(0.1756547388923, rel=1e-9)
    ours = element_form_factor((0, 0, 0), UP, triangle).value / exact - 1
    stability("S-4", "Lambert's sum, not clipped", unclipped / exact - 1, ours)
    # A wall half below the floor: without clipping its two halves cancel.
    wall = upright(0, 1, -1, 1, -0.5)
    exact = from_square(upright(0, 1, 0, 1, -0.5))
    stability("S-4", "double contour, not clipped", off(double_contour, UNIT, wall, exact, CONTOUR),
              ours_off(UNIT, wall, exact))


def test_a_threshold_with_a_unit_loses_a_small_scene(stability):
    # S-5: P-01, a millimetre wide. Centres whose |cos cos'| r^2 is below 1e-5 m2 are left out: all of them.
    scale, threshold = 1e-3, 1e-5
    case = BY_NAME["P-01"]
    x = (np.arange(8) + 0.5) / 8
    grid = np.stack([*(g.ravel() for g in np.meshgrid(x, x)), np.zeros(64)], axis=1)
    for size in (1.0, scale):
        between = (grid + UP - grid[:, None]) * size
        r2 = (between**2).sum(axis=2)
        height2 = between[..., 2] ** 2  # (n . d)(-n' . d)
        kept = np.where(height2 > threshold, height2 / (np.pi * r2**2), 0) * (size / 8) ** 2
        value = kept.sum(axis=1).mean()
        if size == 1:
            assert value == pytest.approx(case.exact, rel=0.01)
    ours = form_factor(case.a * scale, case.b * scale).value / case.exact - 1
    stability("S-5", "centroid with a threshold of 1e-5 m2, unit squares of 1 mm", value / case.exact - 1, ours)


def test_points_are_lost_on_needles_side_by_side(stability):
    # S-6: needles of 1 m x .1 mm, at right angles along their common long edge: crossed strings say 1 - 1 / sqrt 2,
    # less the little that goes out at the ends.
    floor = level(0, 1, 0, 1e-4, 0)
    wall = np.array([[0, 0, 0], [0, 0, 1e-4], [1, 0, 1e-4], [1, 0, 0]])
    exact = upright_rectangles(1e-4, 1e-4)
    assert exact == pytest.approx(1 - 0.5**0.5, rel=1e-4)
    ours = ours_off(floor, wall, exact)
    stability("S-6", "centroid", off(centroid, floor, wall, exact, 1), ours)
    stability("S-6", "centroid, 8 x 8 patches", off(centroid, floor, wall, exact, PATCHES), ours)
    stability("S-6", "disc to point, 8 x 8 patches", off(disc_to_point, floor, wall, exact, PATCHES), ours)
    stability("S-6", "double contour", off(double_contour, floor, wall, exact, CONTOUR), ours)


def test_a_line_between_centres_sees_all_or_nothing(stability):
    # S-7: 1 cm2 midway between unit squares hides .00028 of F, on the line of centres or beside it.
    on, beside = (level(c - 0.005, c + 0.005, c - 0.005, c + 0.005, 0.5) for c in (0.5, 0.52))
    for name, occluder in (("on", on), ("beside", beside)):
        estimate = form_factor(UNIT, CEILING, [occluder])
        hidden = PARALLEL - estimate.value
        assert 1e-4 < hidden / PARALLEL < 1e-3
        line = (centroid.form_factor(UNIT, CEILING, 1) - centroid.form_factor(UNIT, CEILING, 1, [occluder]))
        stability("S-7", f"one line of centres, 1 cm2 {name} it, of what is hidden", line / hidden - 1,
                  estimate.standard_error / hidden)


def test_few_rays_miss_an_occluder_of_a_thousandth(stability):
    # S-8: a square over 1/1000 of a light of 1 m2, seen from 1 m below its middle: 256 random points of the light
    # miss it three times of four.
    light = facing_down(-0.5, 0.5, -0.5, 0.5, 1)
    side = np.sqrt(1e-3)
    low, high = np.array([0.1, 0.2]), np.array([0.1, 0.2]) + side
    occluder = level(low[0], high[0], low[1], high[1], 1 - 1e-9)
    whole = element_form_factor((0, 0, 0), UP, light).value
    hidden = whole - element_form_factor((0, 0, 0), UP, light, [occluder]).value
    exact = element_form_factor((0, 0, 0), UP, occluder[::-1]).value
    points = np.random.default_rng(0).random((400, 256, 2)) - 0.5
    met = ((points > low) & (points < high)).all(axis=2).any(axis=1).mean()
    assert met == pytest.approx(1 - 0.999**256, abs=0.1)
    stability("S-8", "256 random rays that all agree, of what is hidden", -1, hidden / exact - 1)


def test_rays_through_a_pin_hole_claim_an_error_of_nothing(stability):
    # S-9: F = 1e-4 in all. 256 rays see nothing, 97 times of 100, and their own standard error is 0 then.
    side = (1e-4 * np.pi) ** 0.5
    far = facing_down(0.5 - side / 2, 0.5 + side / 2, 0.5 - side / 2, 0.5 + side / 2, 1)
    exact = element_mean(far)
    counts = np.array([monte_carlo_rays.form_factor(UNIT, far, 256, seed=seed) for seed in range(60)])
    silent = (counts == 0).mean()
    assert silent > 0.9
    claimed = np.sqrt(counts * (1 - counts) / 256)
    assert (claimed[counts == 0] == 0).all()
    stability("S-9", "256 random rays, F below 1 / 256, the median of 60 tries", np.median(counts) / exact - 1,
              ours_off(UNIT, far, exact))


@pytest.mark.parametrize("reflectance", [0.99, 0.999])
def test_sweeps_and_shots_crawl_in_a_bright_room(reflectance, stability):
    # S-10: a closed cube of 216 patches; 400 products for each.
    system = cube(6, reflectance)
    exact = system.radiosity()
    arguments = (system.F, system.reflectance, system.emission, system.areas, 1e-6)
    ours = SOLVERS["ours"](*arguments, 400)
    assert ours.products <= 15
    deviation = np.abs(ours.radiosity / exact - 1).max()
    for name in ("Jacobi", "Gauss-Seidel", "shooting", "overshooting"):
        found = SOLVERS[name](*arguments, 400)
        wrong = np.abs(found.radiosity / exact - 1).max()
        stability("S-10", f"{name}, 400 products (ours {ours.products}), rho {reflectance:g}", wrong, deviation)


def test_rows_averaged_with_their_transposes_lose_a_bright_room(stability):
    # S-10: a cube of 384 patches, rho .99, 64 random rays a row. Averaging F with its transpose makes it reciprocal,
    # but its rows no longer sum to 1; rows kept raw do.
    system = cube(8, 0.99)
    exact = system.radiosity()
    random = np.random.default_rng(0)
    raw = np.stack([random.multinomial(64, row / row.sum()) / 64 for row in system.F])
    errors = []
    for F in (raw, (raw + raw.T) / 2):
        found = solve_linear(lambda h, F=F: F @ (0.99 * h), F @ system.emission, 1e-6).value
        radiosity = system.emission + 0.99 * found
        errors.append(np.sqrt(np.mean((radiosity - exact) ** 2)) / exact.mean())
    assert errors[0] < 0.03
    stability("S-10", "rows of 64 rays averaged with their transposes, rho .99", errors[1], errors[0])


def test_only_krylov_finds_two_rooms_by_itself(stability, validation):
    # S-11: two cubes of 215 patches joined by a pin-hole, rho .99; 100 products for each.
    system = two_rooms(6, 0.99)
    exact = system.radiosity()
    arguments = (system.F, system.reflectance, system.emission, system.areas, 1e-6)
    ours = SOLVERS["ours"](*arguments, 100)
    assert ours.products <= 20
    deviation = np.abs(ours.radiosity / exact - 1).max()
    dark = slice(len(exact) // 2, None)
    validation("S-11", "mean B behind a pin-hole, rho .99, by LU", exact[dark].mean(), ours.radiosity[dark].mean(),
               relative=1e-6)
    for name in ("Jacobi", "Gauss-Seidel", "overshooting", "overshooting, mended"):
        wrong = np.abs(SOLVERS[name](*arguments, 100).radiosity / exact - 1).max()
        stability("S-11", f"{name}, 100 products (ours {ours.products})", wrong, deviation)


def test_a_lamp_that_touches_a_wall_is_no_point(stability):
    # S-12: a strip of wall 2 mm high, just under a ceiling lamp of 1 m2 that touches it: half of what it sees is lamp,
    # but not by way of the lamp's middle.
    strip, lamp = upright(0, 1, 0.998, 1.0), CEILING
    exact = upright_rectangles(0.002, 1)
    assert exact == pytest.approx(0.5, abs=0.005)
    ours = ours_off(strip, lamp, exact)
    stability("S-12", "centroid", off(centroid, strip, lamp, exact, 1), ours)
    stability("S-12", "centroid, 8 x 8 patches", off(centroid, strip, lamp, exact, PATCHES), ours)
    stability("S-12", "disc to point, 8 x 8 patches", off(disc_to_point, strip, lamp, exact, PATCHES), ours)
    stability("S-12", "double contour, 10 nodes", off(double_contour, strip, lamp, exact, CONTOUR), ours)
    stability("S-12", "hemicube, 216 pixels", off(hemicube, strip, lamp, exact, 216), ours)

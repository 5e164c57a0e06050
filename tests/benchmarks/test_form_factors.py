"""The classical methods fail where they are known to, and ours doesn't, behind the same signature."""

from __future__ import annotations

import csv
import inspect

import numpy as np
import pytest
from radiosity.benchmarks.form_factors import (
    centroid,
    disc_to_point,
    double_contour,
    exact,
    hemicube,
    monte_carlo_rays,
    peers,
    picture,
    qmc_rays,
)
from radiosity.benchmarks.form_factors.cases import BY_NAME, OCCLUDED, UNIT, UNOCCLUDED, facing_down, level
from radiosity.benchmarks.form_factors.methods import METHODS, NO_OCCLUDERS, RANDOM
from radiosity.benchmarks.form_factors.polygons import blocked
from radiosity.benchmarks.form_factors.run import COLUMNS, write

P01, P03, P05 = (BY_NAME[name] for name in ("P-01", "P-03", "P-05"))


def relative_error(method, case, samples, **words):
    return method(case.a, case.b, samples, case.occluders, **words) / case.exact - 1


@pytest.mark.parametrize("name", METHODS)
def test_every_method_has_the_same_signature_and_tells_what_it_costs(name):
    assert list(inspect.signature(METHODS[name]).parameters) == ["a", "b", "samples", "occluders", "seed"]
    text = inspect.getdoc(inspect.getmodule(METHODS[name]))
    assert [word for word in ("Cost ", "Accuracy ", "Fails ", "Reference ") if word not in text] == []


@pytest.mark.parametrize("name", METHODS)
def test_every_method_is_right_where_nothing_is_hard(name):
    # P-07: parallel, apart: .09920383877349. 10,000 to 65,536 samples give 3 %; the hemicube knows the centre alone.
    case = BY_NAME["P-07"]
    allowed = 0.25 if name == "hemicube" else 0.03
    assert abs(relative_error(METHODS[name], case, 65536)) < allowed


def test_centroid_explodes_near_contact():
    # P-03, gap .01: F = 1 / (pi 10^-4) = 3183, 3,200 times too much; 8 x 8 patches on both: 51 times.
    assert centroid.form_factor(P03.a, P03.b, 1) == pytest.approx(1e4 / np.pi)
    assert 49 < relative_error(centroid.form_factor, P03, 8**4) + 1 < 53
    assert abs(relative_error(exact.form_factor, P03, 1)) < 1e-10


def test_centroid_is_off_by_half_at_a_shared_edge_and_by_seven_at_thirty_degrees():
    assert relative_error(centroid.form_factor, P05, 1) == pytest.approx(0.59, abs=0.01)
    assert relative_error(centroid.form_factor, BY_NAME["P-10a"], 1) + 1 == pytest.approx(7.2, abs=0.1)


def test_disc_is_bounded_but_never_right_near_contact():
    # Gap .1: one disc 17 % too much, 8 x 8 discs 12 % too little.
    near = facing_down(0, 1, 0, 1, 0.1)
    true = exact.form_factor(UNIT, near, 1)
    assert disc_to_point.form_factor(UNIT, near, 1) / true - 1 == pytest.approx(0.17, abs=0.01)
    assert disc_to_point.form_factor(UNIT, near, 8**4) / true - 1 == pytest.approx(-0.12, abs=0.01)
    assert relative_error(disc_to_point.form_factor, P01, 1) == pytest.approx(0.21, abs=0.01)


def test_double_contour_is_spectral_apart_and_lost_at_a_shared_edge():
    # 10 x 10 nodes for each of 16 pairs: 3e-15 at a gap of one side, 7 % at .01, ln 0 at a shared edge.
    assert abs(relative_error(double_contour.form_factor, P01, 1600)) < 1e-13
    assert 0.03 < abs(relative_error(double_contour.form_factor, P03, 1600)) < 0.15
    assert not np.isfinite(double_contour.form_factor(P05.a, P05.b, 1600))
    for case in (P03, P05):
        assert abs(relative_error(exact.form_factor, case, 1)) < 1e-10


def test_double_contour_refuses_what_it_can_not_know():
    with pytest.raises(ValueError, match="occluders"):
        double_contour.form_factor(UNIT, P01.b, 1600, OCCLUDED[0].occluders)


def test_hemicube_converges_to_the_centre_and_not_to_the_form_factor():
    # P-01: the centre's form factor is .239456 (P-50), 20 % above .199825. The square spans half the top face: with
    # 258 and 516 pixels a side, half a pixel at each edge is 1/64 and 1/128 of it.
    for samples, aliasing in ((200_000, 1 / 64), (800_000, 1 / 128)):
        assert hemicube.form_factor(P01.a, P01.b, samples) == pytest.approx(0.2394564704608, rel=aliasing)
        assert relative_error(hemicube.form_factor, P01, samples) > 0.18


def test_hemicube_pixels_add_up_to_the_hemisphere():
    # A polygon that fills the sky: 1.
    assert hemicube.form_factor(UNIT, facing_down(-1e4, 1e4, -1e4, 1e4, 1), 30_000) == pytest.approx(1, abs=1e-3)


def test_hemicube_misses_a_small_far_light():
    # A square of .02 m at 1 m, beside the axis: F = 9.4e-5; 12 x 12 pixels and their sides see none of it.
    light = facing_down(0.6, 0.62, 0.55, 0.57, 1)
    assert hemicube.form_factor(UNIT, light, 432) == 0
    assert exact.form_factor(UNIT, light, 1) == pytest.approx(9.4075e-5, rel=1e-4)


@pytest.mark.parametrize("case", [*UNOCCLUDED, *OCCLUDED], ids=lambda case: case.name)
def test_random_rays_are_unbiased(case):
    # 20,000 rays: the binomial standard error, within four of it.
    rays = 20_000
    error = np.sqrt(case.exact * (1 - case.exact) / rays)
    value = monte_carlo_rays.form_factor(case.a, case.b, rays, case.occluders, seed=1)
    assert abs(value - case.exact) <= 4 * error + 1 / rays


def test_qmc_rays_converge_faster_than_random_ones():
    # P-01 over 12 seeds: log-log slopes of the RMS error from 256 to 16,384 rays; random N^-.5.
    counts = np.array([256, 1024, 4096, 16384])
    slopes = []
    for method in (monte_carlo_rays, qmc_rays):
        errors = [
            np.sqrt(np.mean([(method.form_factor(P01.a, P01.b, n, seed=s) - P01.exact) ** 2 for s in range(12)]))
            for n in counts
        ]
        slopes.append(np.polyfit(np.log(counts), np.log(errors), 1)[0])
    assert slopes[0] == pytest.approx(-0.5, abs=0.15)
    assert slopes[1] < -0.65


def test_rays_do_not_see_what_is_smaller_than_their_share():
    # P-04, F = 3.2e-5: 1,000 rays see nothing, 97 times of 100.
    case = BY_NAME["P-04"]
    assert monte_carlo_rays.form_factor(case.a, case.b, 1000, seed=0) == 0
    assert abs(relative_error(exact.form_factor, case, 1)) < 1e-10


def test_lines_between_centres_see_all_of_a_shadow_or_none():
    # S-7: 1 cm2 midway between unit squares blocks 1e-4 of F; on the line of centres all of it, beside it nothing.
    on, off = (level(c - 0.005, c + 0.005, c - 0.005, c + 0.005, 0.5) for c in (0.5, 0.52))
    assert centroid.form_factor(P01.a, P01.b, 1, [on]) == 0
    assert centroid.form_factor(P01.a, P01.b, 1, [off]) == centroid.form_factor(P01.a, P01.b, 1)
    values = [exact.form_factor(P01.a, P01.b, 1, [occluder]) for occluder in (on, off)]
    assert all(0.999 < value / P01.exact < 0.99999 for value in values)


def test_uniform_visible_fraction_is_biased():
    # P-14: the kernel's mean times the visible fraction of uniform lines gives .0874, 12 % below .0995.
    rng = np.random.default_rng(0)
    start, end = np.zeros((100_000, 3)), np.ones((100_000, 3))
    start[:, :2], end[:, :2] = rng.random((2, 100_000, 2))
    case = BY_NAME["P-14"]
    fraction = 1 - blocked(start, end, case.occluders).mean()
    assert P01.exact * fraction == pytest.approx(0.0874, abs=0.0015)
    assert exact.form_factor(case.a, case.b, 1, case.occluders) == pytest.approx(case.exact, rel=1e-5)


@pytest.mark.parametrize("case", UNOCCLUDED, ids=lambda case: case.name)
def test_ours_beats_every_classical_method_on_every_case_with_thousands_of_samples(case):
    ours = abs(relative_error(exact.form_factor, case, 1))
    others = {name: abs(relative_error(method, case, 4096)) for name, method in METHODS.items() if name != "ours"}
    assert ours < 2e-11
    assert all(not error < ours - 1e-12 for error in others.values())


@pytest.mark.parametrize("name", sorted(set(METHODS) - NO_OCCLUDERS - {"hemicube"}))
def test_shadow_of_the_middle_is_seen_by_all_who_can(name):
    # P-14: .0995062945996; 65,536 samples: 16 x 16 x 16 x 16 pairs of centres are within 10 %, rays within 3 %.
    case = BY_NAME["P-14"]
    allowed = 0.03 if name in RANDOM else 0.1
    assert abs(relative_error(METHODS[name], case, 65536)) < allowed


def test_driver_writes_one_row_for_every_case_method_and_size(tmp_path):
    write(tmp_path / "table.csv", (P01, OCCLUDED[1]), most=256)
    with (tmp_path / "table.csv").open(encoding="utf-8") as file:
        table = list(csv.DictReader(file))
    assert tuple(table[0]) == COLUMNS
    # Two sizes for each of six methods and one for ours; the double contour doesn't know occluders.
    assert len(table) == (6 * 2 + 1) + (5 * 2 + 1)
    ours = [row for row in table if row["method"] == "ours"]
    assert all(float(row["relative_error"]) < 1e-5 for row in ours)


def test_the_picture_has_one_style_for_every_method_and_program():
    # Nothing that is measured is left out, and no two curves look alike.
    styles = picture.styles()
    assert set(styles) == {*METHODS, *peers.PACKAGES}
    assert len({(style["color"], style["marker"]) for style in styles.values()}) == len(styles)

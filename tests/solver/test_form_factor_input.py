"""What polygons a form factor takes, and how it refuses the others."""

from __future__ import annotations

import numpy as np
import pytest
from radiosity.benchmarks.form_factors.cases import CEILING, UNIT, level
from radiosity.solver.convex_pieces import convex_pieces
from radiosity.solver.errors import SceneError
from radiosity.solver.form_factor import element_form_factor, form_factor

UP = np.array([0.0, 0.0, 1.0])
ORIGIN = np.zeros(3)


def test_l_shape_is_the_sum_of_its_rectangles():
    # An L of three unit squares under a ceiling: P-01-like parts add up, weighted by area.
    shape = np.array([[0, 0, 0], [2, 0, 0], [2, 1, 0], [1, 1, 0], [1, 2, 0], [0, 2, 0]], float)
    parts = [level(0, 2, 0, 1, 0), level(0, 1, 1, 2, 0)]
    exact = sum(area * form_factor(part, CEILING).value for area, part in zip((2, 1), parts, strict=True)) / 3
    assert form_factor(shape, CEILING).value == pytest.approx(exact, rel=1e-11)
    assert form_factor(np.roll(shape, 2, axis=0), CEILING).value == pytest.approx(exact, rel=1e-11)


def test_hollow_outline_is_cut_right():
    # A spiral of 10 corners: its triangles' areas add up to its area, 11 unit squares less the groove.
    xy = [(0, 0), (4, 0), (4, 4), (0, 4), (0, 1.5), (2.5, 1.5), (2.5, 2.5), (1, 2.5), (1, 3), (3, 3), (3, 1), (0, 1)]
    pieces = convex_pieces([(x, y, 0.0) for x, y in xy], "spiral")
    x, y = np.array(xy).T
    exact = (x * np.roll(y, -1) - np.roll(x, -1) * y).sum() / 2
    areas = [np.cross(p[1] - p[0], p[2] - p[0])[2] / 2 for p in pieces]
    assert min(areas) > 0
    assert sum(areas) == pytest.approx(exact, rel=1e-12)


@pytest.mark.parametrize(("polygon", "words"), [
    ([[0, 0, 0], [1, 0, 0]], "shape"),
    ([[0, 0], [1, 0], [1, 1]], "shape"),
    ("square", "not an array"),
    ([[0, 0, 0], [1, 0, 0], [np.nan, 1, 0]], "corner 2 .* finite"),
    ([[0, 0, 0], [1, 0, 0], [np.inf, 1, 0]], "corner 2 .* finite"),
    ([[0, 0, 0], [1, 0, 0], [2, 0, 0]], "no area"),
    ([[0, 0, 0], [0, 0, 0], [0, 0, 0]], "repeats"),
    ([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 0]], "corner 0 repeats"),
    ([[0, 0, 0], [1, 0, 0], [1, 1, 0.1], [0, 1, 0]], "not planar"),
    ([[0, 0, 0], [3, 3, 0], [3, 0, 0], [0, 2, 0]], "crosses itself"),
    ([[np.cos(t), np.sin(t), 0] for t in np.arange(5) * 4 * np.pi / 5], "crosses itself"),
])  # fmt: skip
def test_polygon_that_makes_no_sense_is_refused_in_one_line(polygon, words):
    for call in (lambda: form_factor(polygon, CEILING), lambda: form_factor(CEILING, polygon),
                 lambda: form_factor(UNIT, CEILING, [polygon]), lambda: element_form_factor(ORIGIN, UP, polygon)):
        with pytest.raises(SceneError, match=words) as caught:
            call()
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize(("point", "normal"), [
    ((0, 0, np.nan), UP), ((0, 0), UP), (ORIGIN, (0, 0, 0)), (ORIGIN, (0, np.inf, 1)), (ORIGIN, 3.0),
])  # fmt: skip
def test_element_that_makes_no_sense_is_refused(point, normal):
    with pytest.raises(SceneError):
        element_form_factor(point, normal, CEILING)


def test_normal_of_any_length_is_a_direction():
    assert element_form_factor(ORIGIN, 7 * UP, CEILING) == element_form_factor(ORIGIN, UP, CEILING)


def test_fine_polygons_are_not_refused_as_bent_when_they_come_from_float32():
    # A quad on a slope, rounded to float32 at 100 m from the origin: off its plane by 1e-5 m.
    quad = np.array([[100.1, 50.3, 7.77], [101.3, 50.3, 8.31], [101.3, 51.9, 9.13], [100.1, 51.9, 8.59]], np.float32)
    assert form_factor(quad, quad[::-1] + np.array([0, 0, 2], np.float32)).value > 0

"""Two plates whose light is known exactly (P-34), put in every state that breaks solvers: the light stays the same.

Unit squares, gap 1, open, rho .8, E = 1 below and 0 above.
"""

from __future__ import annotations

import numpy as np
import pytest
from radiosity.tests.solver.light import at
from radiosity.tests.solver.rooms import Shape, quad, shape

UP, DOWN = (0, 0, 1), (0, 0, -1)
PLACES = (((0.5, 0.5, 0), UP), ((0, 0, 0), UP), ((0.5, 0.5, 1), DOWN), ((0.5, 0, 1), DOWN))
NAMES = ("H1 centre", "H1 corner", "H2 centre", "H2 edge")
EXACT = np.array([0.040093848576, 0.022788517776, 0.245954160251, 0.185211932873])
ERROR = 0.03
# How much longer than wide the needles are.
SLENDER = 10_000
# 37 degrees about (1, 2, 3).
AXIS = np.array([1, 2, 3]) / 14**0.5
SKEW = np.cross(np.eye(3), AXIS)
TURN = np.eye(3) + np.sin(np.radians(37)) * SKEW + (1 - np.cos(np.radians(37))) * SKEW @ SKEW

LOW = quad((0, 0, 0), (1, 0, 0), (0, 1, 0), 0.8, 1.0)
HIGH = quad((0, 0, 1), (0, 1, 0), (1, 0, 0), 0.8, 0.0)


def _needles():
    """The lower plate in 2 x 10,000 triangles of 1 m x .1 mm."""
    near, far = (np.stack([0 * y, y, 0 * y], axis=1) for y in
                 (np.arange(SLENDER) / SLENDER, np.arange(1, SLENDER + 1) / SLENDER))
    along = np.array([1.0, 0, 0])
    return shape(np.concatenate([np.stack([near, near + along, far + along], axis=1),
                                 np.stack([near, far + along, far], axis=1)]), 0.8, 1.0)


def _turned_over(plates, which):
    corners = plates.corners.copy()
    corners[which] = corners[which][:, ::-1]
    return Shape(corners, plates.reflectance, plates.emission)


@pytest.mark.parametrize(("case", "state", "plates"), [
    ("S-6", "lower plate in needles of 1 : 10,000", _needles() + HIGH),
    ("S-13", "both plates turned over", _turned_over(LOW + HIGH, [0, 1, 2, 3])),
    ("S-13", "one triangle of each plate turned over", _turned_over(LOW + HIGH, [0, 2])),
    ("S-20", "both plates twice over", LOW + HIGH + LOW + HIGH),
    ("S-20", "upper plate twice over, cut the other way", LOW + HIGH + quad((1, 0, 1), (-1, 0, 0), (0, 1, 0), 0.8)),
])  # fmt: skip
def test_plates_made_of_bad_faces_get_the_exact_light(case, state, plates, judge):
    found = at(plates.scene(), ERROR, PLACES)
    judge(case, [f"{name}, {state}" for name in NAMES], EXACT, found, ERROR)


@pytest.mark.parametrize(("scale", "shift"), [(1e-3, 0), (1e3, 0), (1, 1e4), (1, 1e5)])
def test_plates_of_any_size_and_place_get_the_exact_light(scale, shift, judge):
    # S-5: 1 mm and 1 km wide; 10,000 and 100,000 sizes from the origin.
    offset = np.array([1, -0.7, 0.4]) * shift
    places = [(np.array(point) * scale + offset, normal) for point, normal in PLACES]
    found = at((LOW + HIGH).moved(scale, offset).scene(), ERROR, places)
    judge("S-5", [f"{name}, plates times {scale:g}, {shift:g} off" for name in NAMES], EXACT, found, ERROR)


@pytest.mark.parametrize("strength", [1e-6, 1e6])
def test_plates_of_any_strength_get_the_exact_light(strength, judge):
    # S-14: emission of 1e-6 and 1e+6 W/m2.
    found = at((quad((0, 0, 0), (1, 0, 0), (0, 1, 0), 0.8, strength) + HIGH).scene(), ERROR, PLACES)
    judge("S-14", [f"{name}, E1 = {strength:g}" for name in NAMES], EXACT * strength, found, ERROR)


def test_turned_plates_get_the_exact_light(judge):
    # S-19: 37 degrees about (1, 2, 3).
    places = [(TURN @ point, TURN @ normal) for point, normal in PLACES]
    found = at((LOW + HIGH).moved(TURN).scene(), ERROR, places)
    judge("S-19", [f"{name}, plates turned by 37 degrees" for name in NAMES], EXACT, found, ERROR)

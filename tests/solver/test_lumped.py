"""One value a wall: exact form factors and the shipped linear solver, against the published solutions by LU."""

from __future__ import annotations

import numpy as np
import pytest
from radiosity.benchmarks.form_factors.cases import facing_down, level
from radiosity.solver import form_factor
from radiosity.solver.linear import solve_linear
from radiosity.tests.solver.rooms import box

# Residual of the linear solver: two digits more than are compared.
TOLERANCE = 1e-12
WALLS = ("floor", "ceiling", "x0", "x1", "y0", "y1")


def _walls(size):
    """Six polygons of a box, in the order of WALLS."""
    return [np.concatenate([wall[0], wall[1, 2:]]) for wall in box((0, 0, 0), size).corners.reshape(6, 2, 3, 3)]


def _irradiance(F, reflectance, emission):
    """H = F B, one value a wall."""
    rho, E = np.asarray(reflectance, float), np.asarray(emission, float)
    answer = solve_linear(lambda H: F @ (rho * H), F @ E, TOLERANCE)
    assert answer.outcome == "converged"
    return answer.value


@pytest.mark.parametrize(("case", "size", "reflectance", "exitance", "exact"), [
    ("P-40", (1, 1, 1), [0.5] * 6, 1, [0.363491652216, 0.181818196215, *[0.363672537892] * 4]),
    ("P-41", (4, 3, 2.5), [0.2, 0.8, 0.5, 0.5, 0.3, 0.7], 10,
     [4.71820310862, 1.68042843704, 3.98533227329, 3.98533227329, 4.16942878287, 3.86540945954]),
])  # fmt: skip
def test_walls_of_a_box_with_one_value_each(case, size, reflectance, exitance, exact, validation):
    # The ceiling emits; published to 12 digits. What is absorbed is what is emitted: 120 W in P-41.
    walls = _walls(size)
    F = np.array([[form_factor(wall, other).value for other in walls] for wall in walls])
    H = _irradiance(F, reflectance, exitance * np.eye(6)[1])
    for wall, right, ours in zip(WALLS, exact, H, strict=True):
        validation(case, f"H, one value a wall, {wall}", right, ours, relative=1e-11)
    area = np.array([np.linalg.norm(np.cross(wall[1] - wall[0], wall[2] - wall[1])) for wall in walls])
    absorbed = area @ ((1 - np.array(reflectance)) * H)
    validation(case, "absorbed, W", exitance * area[1], absorbed, relative=1e-11)


def test_endless_plates_with_one_value_each(validation):
    # P-42: E 1 and 0, rho .8 and .5: B 5/3 and 5/6. Plates of a and 2 a gaps, F12 = 1 less what leaves at the edges, in
    # proportion to 1 / a: from a = 100,000 the limit is 4e-10 off.
    side, wide = (form_factor(level(0, a, 0, a, 0), facing_down(0, a, 0, a, 1)).value for a in (1e5, 2e5))
    F = (2 * wide - side) * np.array([[0, 1], [1, 0]])
    B = np.array([1, 0]) + np.array([0.8, 0.5]) * _irradiance(F, [0.8, 0.5], [1, 0])
    for name, exact, ours in zip(("B1", "B2"), (5 / 3, 5 / 6), B, strict=True):
        validation("P-42", f"{name}, one value a plate", exact, ours, relative=2e-9)

"""Spheres: their form factors in closed form, and light between concentric ones.

Nothing round is a polygon. Each test says which theorem makes polygons give a sphere's own answer.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from radiosity.benchmarks.form_factors.cases import disc
from radiosity.solver import Settings, form_factor, irradiance
from radiosity.solver.linear import solve_linear
from radiosity.solver.polygon import polygon_form_factor
from radiosity.tests.solver.light import SOME
from radiosity.tests.solver.nystroem import gauss
from radiosity.tests.solver.rooms import Shape, box, sphere_cap
from radiosity.tests.solver.test_radiosity_cases import RINGS, SEGMENTS, TESSELLATION

PI = np.pi


def _limit(coarse, fine):
    """Of an error that falls as n^-4, as that of n-gons of a disc's area does, from n and 2 n corners."""
    return fine + (fine - coarse) / 15


@pytest.mark.parametrize("radius", [0.25, 0.75])
def test_a_sphere_of_any_size_lights_a_disc_alike(radius, validation):
    # P-13: disc r 1, its centre 1 from the sphere's: (1 - 1 / sqrt 2) / 2, whatever the sphere's radius. The mean over
    # elements of the sphere, clipped at their horizons; Gauss points between where the disc begins to set, and is set.
    half = np.arccos(radius / 2**0.5)
    values = []
    for corners in (100, 200):
        light = disc(1, 1, corners)[::-1]
        total = 0.0
        for low, high in pairwise([0, half - PI / 4, half + PI / 4]):
            # Steps that vanish at both ends: the element's view has a root's slope there.
            step, weight = gauss(0, 1, 40)
            polar, weight = low + (high - low) * step**2 * (3 - 2 * step), weight * (high - low) * 6 * step * (1 - step)
            outward = np.stack([np.sin(polar), 0 * polar, np.cos(polar)], axis=1)
            total += weight * np.sin(polar) @ polygon_form_factor(radius * outward, outward, light) / 2
        values.append(total)
    validation("P-13", f"sphere of radius {radius} to a disc; 100- and 200-gons", 0.1464466094067, _limit(*values),
               relative=1e-10)


def _cap_rim(axis, angle, corners):
    """The rim of a cap of the unit sphere, `angle` about an axis, as a polygon that faces the centre."""
    axis = np.asarray(axis, float) / np.linalg.norm(axis)
    tangent = np.cross(axis, [0.3, 0.5, 0.8])
    tangent /= np.linalg.norm(tangent)
    return (disc(np.sin(angle), np.cos(angle), corners) @ np.stack([tangent, np.cross(axis, tangent), axis]))[::-1]


@pytest.mark.parametrize(("axis", "first", "second"), [((0, 0, -1), 0.6, 0.9), ((1, 0, 0.2), 0.5, 0.7),
                                                       ((1, 1, -1), 0.5, 0.3)])
def test_patches_of_a_sphere_see_one_another_by_area_alone(axis, first, second, validation):
    # P-24: F_ij = A_j / (4 pi R^2). Every line between two caps goes through both of their rims' discs, so that these
    # exchange what the caps do: A_disc F = A_cap1 A_cap2 / (4 pi), with caps of 2 pi (1 - cos a), discs of pi sin^2 a.
    discs = [form_factor(_cap_rim((0, 0, 1), first, n), _cap_rim(axis, second, n)).value for n in (48, 96)]
    on_sphere = _limit(*discs) * np.sin(first) ** 2 / (2 * (1 - np.cos(first)))
    validation("P-24", f"cap of {second} rad from one of {first}, about {axis}; 48- and 96-gons",
               (1 - np.cos(second)) / 2, on_sphere, relative=1e-8)


# --- one sphere around another ---------------------------------------------------------------------------------------
def _cube(half, inward):
    """Six polygons of a cube about the origin: floor, ceiling, four sides."""
    room = box([-half] * 3, [half] * 3, inward=inward)
    return [np.concatenate([wall[0], wall[1, 2:]]) for wall in room.corners.reshape(6, 2, 3, 3)]


@pytest.fixture(scope="module")
def concentric():
    """F12, F21, F22 and the standard error of F22, of cubes of 2 m and 4 m, the first looking out and the second in."""
    inner, outer = _cube(1, inward=False), _cube(2, inward=True)
    f12 = sum(form_factor(inner[0], face).value for face in outer)
    f21 = sum(form_factor(outer[0], face).value for face in inner)
    # The four sides are alike.
    opposite, side = (form_factor(outer[0], outer[face], inner) for face in (1, 2))
    error = np.hypot(opposite.standard_error, 4 * side.standard_error)
    return f12, f21, opposite.value + 4 * side.value, error


def test_a_sphere_around_a_sphere_sees_it_and_itself_by_their_areas(concentric, validation):
    # P-25, r 1 and 2: F12 = 1, F21 = 1/4, F22 = 3/4. A convex body sees nothing of itself, and by reciprocity only the
    # areas' ratio matters: the same for any similar bodies, cubes for one.
    f12, f21, f22, error = concentric
    validation("P-25", "F12, cubes of sides 1 and 2", 1, f12, relative=1e-11)
    validation("P-25", "F21, cubes of sides 1 and 2", 1 / 4, f21, relative=1e-11)
    validation("P-25", "F22, cubes of sides 1 and 2", 3 / 4, f22, error, relative=1e-10)


def test_concentric_spheres_lumped(concentric, validation):
    # P-43: r 1 and 2, E 1 and 0, rho .3 and .6: B 1.089108910891 and .2970297029703, by the form factors above and
    # the shipped linear solver. The error of F22 changes B by less than itself.
    f12, f21, f22, error = concentric
    F, rho, E = np.array([[0, f12], [f21, f22]]), np.array([0.3, 0.6]), np.array([1.0, 0])
    B = E + rho * solve_linear(lambda H: F @ (rho * H), F @ E, 1e-12).value
    validation("P-43", "B1, lumped", 1.089108910891, B[0], error)
    validation("P-43", "B2, lumped", 0.2970297029703, B[1], error)


def test_concentric_spheres_baked(judge):
    # P-43 again, through a bake: H1 = B2 = .2970297 and H2 = B2 / .6 = .4950495.
    ball = sphere_cap(PI, RINGS, SEGMENTS)
    count = len(ball.area)
    inner = Shape(ball.corners[:, ::-1], np.full(count, 0.3), np.full(count, 1.0))
    outer = Shape(2 * ball.corners, np.full(count, 0.6), np.zeros(count))
    rows = np.linspace(0, count - 1, SOME).astype(int)
    points, normals = (np.concatenate([getattr(each, name)[rows] for each in (inner, outer)])
                       for name in ("middle", "normal"))
    found = irradiance((inner + outer).scene(), Settings(), points, normals)[:, 0].reshape(2, SOME).T
    judge("P-43", ["H1", "H2"], [0.2970297029703, 0.2970297029703 / 0.6], found, Settings().error, TESSELLATION)

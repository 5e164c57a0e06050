"""A sun in a bowl, and the penumbra of a knife edge, by lone probes."""

from __future__ import annotations

import numpy as np
import pytest
from radiosity.solver import Settings, irradiance
from radiosity.solver.lamps import Sun
from radiosity.tests.solver.rooms import quad, sphere_cap

PI = np.pi
UP = (0, 0, 1)
# Rings and segments of a tessellated sphere. Its triangles are 6.4 degrees wide and lie up to .0016 of the radius
# inside: the answers of the true sphere hold to about this, relative.
SEGMENTS = 56
TESSELLATION = 0.002
# How many times a point is asked for, and how many triangles of a sphere are.
TIMES = 24
SOME = 96


@pytest.fixture
def judge(validation):
    """Hold answers (times, n) to exact values (n,): all to `error` (RMS), the mean of each point's to a third of it."""
    def check(case, quantities, exact, ours, error, tessellation=0.0):
        exact = np.asarray(exact, float)
        level = exact.mean()
        deviation = np.sqrt(np.mean((ours - exact) ** 2)) / level
        assert deviation <= error + tessellation, f"{case}: RMS error {deviation:.4f}, wanted {error}"
        noise = ours.std(axis=0, ddof=1) / np.sqrt(len(ours))
        for quantity, right, found, sigma in zip(quantities, exact, ours.mean(axis=0), noise, strict=True):
            validation(case, quantity, right, found, sigma, relative=(error / 3 + tessellation) * level / right)
    return check


def _at(scene, error, places, **more):
    """(TIMES, n): the first channel of the irradiance at (point, normal) pairs."""
    points, normals = (np.tile(np.array(each, float), (TIMES, 1)) for each in zip(*places, strict=True))
    return irradiance(scene, Settings(error=error, **more), points, normals)[:, 0].reshape(TIMES, -1)


def _over(ball, scene, error, **more):
    """(SOME, 1): the same at the middles of SOME of the triangles of a sphere or bowl."""
    rows = np.linspace(0, len(ball.area) - 1, SOME).astype(int)
    return irradiance(scene, Settings(error=error, **more), ball.middle[rows], ball.normal[rows])[:, :1]


def test_the_shadow_in_a_bowl_gets_the_same_light_everywhere(judge):
    # A cap of 60 degrees, rho .6, a sun of 1000 W/m2 60 degrees from the zenith: H = rho E0 cos z sin^2 a
    # / (4 (1 - rho f)) where the sun does not reach, and as indirect light where it does.
    bowl = sphere_cap(PI / 3, 14, SEGMENTS)
    scene = bowl.scene(reflectance=0.6, lights=(Sun("sun", (np.sin(PI / 3), 0, -0.5), (1000,) * 3),))
    judge("P-31", ["H, sun"], [66.17647058824], _over(bowl, scene, 0.03, passes="indirect"), 0.03, TESSELLATION)


def test_the_penumbra_of_a_knife_edge(judge):
    # Source [-1, 1]^2 at z = 2, black half-plane x < 0 at z = 1: the part of the hemisphere that the lamp fills.
    exact = {-0.75: 0.01318443288285, -0.5: 0.03705534802, 0: 0.1197282352304, 0.25: 0.1611880253512,
             0.5: 0.1859108490138, 1: 0.1803687411231}
    edge = quad((-40, -40, 1), (40, 0, 0), (0, 80, 0), 0.0)
    scene = (quad((-1, -1, 2), (0, 2, 0), (2, 0, 0), 0.0, 1.0) + edge).scene()
    found = _at(scene, 0.01, [((x, 0, 0), UP) for x in exact])
    judge("P-27", [f"H / B, x = {x}" for x in exact], list(exact.values()), found, 0.01)

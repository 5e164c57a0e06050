"""How fast errors fall: quasi-random rays, patches under a final gather, nodes on contours."""

from __future__ import annotations

import importlib
from dataclasses import replace

import numpy as np
import pytest
from radiosity.solver import Settings, Sky, contour, irradiance, solve
from radiosity.solver.lamps import Point
from radiosity.solver.plan import plan
from radiosity.solver.polygon import polygon_form_factor
from radiosity.tests.solver.rooms import CEILING, box, shape, wall_points

# The function `bake` hides its module's name.
module = importlib.import_module("radiosity.solver.bake")
ROOM = box((0, 0, 0), (1, 1, 1))


def _planned(monkeypatch, **words):
    """Let bakes spend what the words say, and next to nothing on the audit."""
    monkeypatch.setattr(module, "plan", lambda *arguments: replace(plan(*arguments), **words))
    monkeypatch.setattr(module, "AUDIT_LUMELS", 2)
    monkeypatch.setattr(module, "audit_paths", lambda error: 8)


def _rate(sizes, errors):
    """The exponent of a power law."""
    return np.polyfit(np.log(sizes), np.log(errors), 1)[0]


def test_gathered_light_falls_faster_than_the_three_quarters_power_of_the_rays(monkeypatch):
    # The floor of a black unit cube without a lid under an even sky, 144 points: H / pi is the form factor to the lid.
    # 64 to 4,096 rays; random ones would fall as N^-.5.
    lid = np.array([[0, 0, 1], [0, 1, 1], [1, 1, 1], [1, 0, 1.0]])
    points, normals = wall_points((0, 0, 0), (1, 1, 1), 0, 12)
    exact = polygon_form_factor(points, normals.astype(float), lid)
    scene = shape(np.delete(ROOM.corners, [2 * CEILING, 2 * CEILING + 1], axis=0), 0.0).scene(sky=Sky((1, 1, 1)))
    rays, errors = (64, 256, 1024, 4096), []
    for count in rays:
        _planned(monkeypatch, gather_rays=count, gather_error=1e9)
        found = irradiance(scene, Settings(error=0.1), points, normals)[:, 0] / np.pi
        errors.append(np.sqrt(np.mean((found - exact) ** 2)) / exact.mean())
    assert _rate(rays, errors) < -0.75
    assert errors[-1] < 0.01


def test_irradiance_from_rows_falls_faster_than_random_rays(monkeypatch):
    # Unit cube, glowing dimly all over from .1 to .9 by walls, rho .5: the linear system's rows alone. 16 to 1,024 rays
    # a row against 8,192 on the same patches.
    glow = np.repeat([0.1, 0.9, 0.3, 0.7, 0.2, 0.5], 2)
    scene = ROOM.scene(emission=glow)
    monkeypatch.setattr(module, "MOST_REFINEMENTS", 0)

    def solved(rays, seed):
        _planned(monkeypatch, row_rays=(rays, rays), patches=200, smallest_patch=0.05, cell_size=0.015)
        return solve(scene, Settings(error=0.1, seed=seed)).irradiance[:, 0]

    references = [solved(8192, seed) for seed in range(3)]
    rays = (16, 64, 256, 1024)
    errors = [np.sqrt(np.mean([(solved(count, seed) - right) ** 2 for seed, right in enumerate(references)]))
              for count in rays]
    assert _rate(rays, errors) < -0.75


@pytest.mark.slow
def test_what_patches_leave_after_the_gather_falls_with_the_square_of_their_size(monkeypatch):
    # A corridor of 6 m with a lamp at one end, rho .8: indirect light at 150 points from about 120, 250 and 900
    # patches, against 3,000. Rays enough to be no matter; n = h^-2 patches, so that h^2 is n^-1.
    high = (6, 1, 1)
    scene = box((0, 0, 0), high, 0.8).scene(lights=(Point("lamp", (0.5, 0.45, 0.55), (10,) * 3),))
    points, normals = (np.concatenate(each) for each in
                       zip(*(wall_points((0, 0, 0), high, side, 5) for side in range(6)), strict=True))
    monkeypatch.setattr(module, "MOST_REFINEMENTS", 0)
    found, counts = [], []
    for patches in (24, 96, 384, 1500):
        _planned(monkeypatch, gather_rays=1024, gather_error=1e9, patches=patches, row_rays=(512, 512),
                 smallest_patch=1e-3, cell_size=0.05)
        found.append(np.mean([irradiance(scene, Settings(error=0.1, passes="indirect", seed=seed), points,
                                         normals)[:, 0] for seed in range(2)], axis=0))
        counts.append(solve(scene, Settings(error=0.1)).statistics["patches"])
    errors = [np.sqrt(np.mean((light - found[-1]) ** 2)) / found[-1].mean() for light in found[:-1]]
    assert _rate(counts[:-1], errors) < -0.85
    assert errors[-1] < 0.01


def test_nodes_on_contours_converge_spectrally(monkeypatch):
    # P-05, unit squares that share an edge at right angles: .2000437760754. Every halving of the double-exponential
    # rule's step about doubles the digits, down to rounding; a rule of any order would add as many each time.
    a = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
    b = np.array([[0, 0, 0], [0, 1, 0], [0, 1, 1], [0, 0, 1]], float)
    digits = []
    for step in (1.0, 0.5, 0.25, 0.125):
        monkeypatch.setattr(contour, "STEP", step)
        error = abs(contour.convex_form_factor(a, b) / 0.2000437760754 - 1)
        digits.append(-np.log10(max(error, 1e-13)))
    assert digits[1] > 1.5 * digits[0]
    assert digits[2] > 1.5 * digits[1]
    assert digits[3] > 11

"""S-21: the error bar of whole bakes holds their exact error, over 50 seeds, and is not much wider than it must be."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from radiosity.benchmarks.linear.systems import cube
from radiosity.solver import Settings, bake
from radiosity.solver.area_lamp import Area
from radiosity.solver.audit import GROUPS, error_bar
from radiosity.solver.lumels import lumels
from radiosity.solver.neighbours import LumelNeighbours
from radiosity.solver.polygon import polygon_form_factor
from radiosity.solver.scene import Surface
from radiosity.solver.visible_part import visible_form_factor
from radiosity.tests.solver.rooms import box, quad
from radiosity.tests.solver.test_radiosity_cases import UNIT, _manufactured

SEEDS = 50
HELD = 45


def _indirect():
    """P-44, a cube made for an even radiosity: the scene, and its exact irradiance at points and normals."""
    walls = box(*UNIT).corners.reshape(6, 2, 3, 3)

    def exact(points, normals):
        seen = [np.maximum(polygon_form_factor(points, normals, np.concatenate([wall[0], wall[1, 2:]])), 0)
                for wall in walls]
        return np.array([2.0, 3.0, 2.5, 2.5, 2.5, 2.5]) @ seen

    return _manufactured()[0], exact


def _direct():
    """A black floor, an area lamp of 100 W beside its axis, a board between: umbra, penumbra, light."""
    lamp = Area("lamp", (0.2, 0, 1.5), (0, 0.4, 0), (0.4, 0, 0), (100,) * 3)
    board = quad((-0.3, -0.3, 0.5), (0.6, 0, 0), (0, 0.6, 0), 0.0)
    whole = quad((-1, -1, 0), (2, 0, 0), (0, 2, 0), 0.0) + board
    scene = whole.scene(lights=(lamp,), surfaces=(Surface("floor", 0, 2), Surface("board", 2, 2, receives=False)))
    source = np.array([[0, -0.2, 1.5], [0, 0.2, 1.5], [0.4, 0.2, 1.5], [0.4, -0.2, 1.5]])
    outline = np.array([[-0.3, -0.3, 0.5], [0.3, -0.3, 0.5], [0.3, 0.3, 0.5], [-0.3, 0.3, 0.5]])
    return scene, lambda points, normals: 100 / 0.16 * visible_form_factor(points, normals, source, [outline])


@pytest.mark.slow
@pytest.mark.parametrize(("build", "density"), [(_indirect, 12.0), (_direct, 18.0)], ids=["indirect", "direct"])
def test_the_error_bar_holds_the_exact_error_in_45_of_50_bakes(build, density):
    # Two scenes whose irradiance is known at every lumel, baked with 50 seeds at .1: the audit's interval holds the
    # RMS error over the inner lit lumels, and the bias lies within 1.96 of its standard errors, 45 times at least; on
    # average the bar is at most twice the error, and half of it at least.
    scene, exact_at = build()
    settings = Settings(error=0.1, texel_density=density, footprint=0.0, quantity="irradiance", margin=0)
    laid = lumels(scene, settings, [])
    points, normals = (each.astype(float) for each in (laid.receivers.position, laid.receivers.normal))
    exact = exact_at(points + scene.origin, normals)
    count = (exact > 0) & (LumelNeighbours(laid).at(1) >= 0).all(axis=1)
    assert count.sum() > 500
    held = biases = 0
    errors, bars = [], []
    for seed in range(SEEDS):
        baked = bake(scene, replace(settings, seed=seed))
        found = np.zeros(len(exact))
        for page, image in enumerate(baked.lightmaps):
            here = laid.page == page
            found[here] = np.asarray(image.pixels).reshape(-1, 3)[laid.pixel[here], 0]
        deviation = (found - exact)[count] / exact[count].mean()
        kept = np.sort(np.abs(deviation))[: -max(1, len(deviation) // 1000)]
        bar = baked.report["error"]["estimated"]
        errors.append(np.sqrt(np.mean(kept**2)))
        bars.append(bar["rms"])
        held += bar["rms_low"] <= errors[-1] <= bar["rms_high"]
        biases += abs(bar["bias"] - deviation.mean()) <= 1.96 * bar["bias_standard_error"]
    assert held >= HELD
    assert biases >= HELD
    ratio = np.sqrt(np.mean(np.square(bars)) / np.mean(np.square(errors)))
    assert 0.5 < ratio < 2


def test_a_bound_from_the_residual_is_many_times_the_error(stability):
    # S-21: a cube at rho .95, solved with 2 x 2 patches a wall, against 8 x 8. |r| / (1 - rho) holds the error, and is
    # more than five times it; the audit, with noise of its own as large as the error, is within a tenth.
    fine = cube(8, 0.95)
    coarse = cube(2, 0.95).radiosity().reshape(6, 2, 2)
    found = np.repeat(np.repeat(coarse, 4, axis=1), 4, axis=2).reshape(-1)
    residual = fine.emission - found + 0.95 * fine.F @ found
    exact = fine.radiosity()
    error = np.sqrt(np.mean((found - exact) ** 2))
    noise = error * GROUPS**0.5 * np.random.default_rng(0).normal(size=(len(exact), GROUPS, 3))
    bar = error_bar(np.repeat(found[:, None], 3, axis=1), exact[:, None, None] + noise)
    audited = bar.rms / (error / exact.mean())
    assert audited == pytest.approx(1, abs=0.1)
    bound = np.abs(residual).max() / (1 - 0.95) / np.abs(found - exact).max()
    assert bound > 5
    stability("S-21", "bound from the residual at rho .95, over the true error, less 1", bound - 1, audited - 1)

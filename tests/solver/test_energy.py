"""The energy balance: what is emitted is absorbed or escapes, in closed and in open boxes."""

from __future__ import annotations

import numpy as np
import pytest
from radiosity.solver import Settings, Sky, bake
from radiosity.solver.energy import EnergyBalance
from radiosity.solver.lamps import Point, Sun
from radiosity.tests.solver.rooms import CEILING, box, quad, shape

LOW, HIGH = (0.0, 0.0, 0.0), (2.0, 2.0, 2.0)
RHO = (0.2, 0.7, 0.5, 0.5, 0.3, 0.8)
SETTINGS = Settings(error=0.1, target="vertex", threads=1)
LAMP = Point("lamp", (0.7, 0.9, 1.2), (12, 24, 36))


def _lidless():
    room = box(LOW, HIGH, RHO)
    keep = np.delete(np.arange(12), (2 * CEILING, 2 * CEILING + 1))
    return shape(room.corners[keep], room.reflectance[keep])


def _balance(scene):
    return bake(scene, SETTINGS).report["energy"]


def test_a_closed_box_absorbs_what_its_lamp_sends():
    # A lamp of 24 W (mean of the channels) in a closed box: 24 W emitted, 24 absorbed, none escapes, to half a percent.
    energy = _balance(box(LOW, HIGH, RHO).scene(lights=(LAMP,)))
    assert energy["emitted"] == pytest.approx(24, rel=0.005)
    assert energy["absorbed"] == pytest.approx(24, rel=0.005)
    assert energy["escaped"] == 0
    assert abs(energy["imbalance"]) < 0.005


def test_a_closed_box_whose_walls_all_glow_absorbs_their_light():
    # Exitance 3 W/m2 on 24 m2 of walls: 72 W, all absorbed.
    energy = _balance(box(LOW, HIGH, RHO, 3.0).scene())
    assert energy["emitted"] == pytest.approx(72, rel=0.005)
    assert energy["absorbed"] == pytest.approx(72, rel=0.005)
    assert energy["escaped"] == 0
    assert abs(energy["imbalance"]) < 0.005


def test_an_open_box_under_a_lamp_balances():
    # A lamp inside a box without a lid: part is absorbed, part escapes after a bounce.
    energy = _balance(_lidless().scene(lights=(LAMP,)))
    assert 0 < energy["escaped"] < energy["absorbed"] < energy["emitted"] < 24
    assert abs(energy["imbalance"]) < 0.005


def test_an_open_box_under_an_even_sky_takes_what_comes_through_its_mouth():
    # L = 1: pi W/m2 through 4 m2 reach the inside; black walls absorb it all. Mean of white walls' balance as well.
    black = _lidless()
    black.reflectance[:] = 0
    energy = _balance(black.scene(sky=Sky((1, 1, 1))))
    assert energy["escaped"] == 0
    assert abs(energy["imbalance"]) < 0.005
    energy = _balance(_lidless().scene(sky=Sky((1, 1, 1))))
    assert energy["escaped"] > 0
    assert abs(energy["imbalance"]) < 0.005


@pytest.mark.parametrize("target", ["lightmap", "vertex"])
def test_what_no_surface_sees_keeps_and_sends_out_its_light_too(target):
    # A sun of 10 W/m2 straight down on a floor of 20 m2 (rho .3) that glows with 1 W/m2, and high above it a black
    # plate of 4 m2 that nothing sees from above: 200 + 20 + 40 W are emitted, less the 40 W in the plate's shadow.
    scene = (quad((0, 0, 0), (5, 0, 0), (0, 4, 0), 0.3, 1.0) + quad((1, 1, 300), (2, 0, 0), (0, 2, 0), 0.0)
             ).scene(lights=(Sun("sun", (0, 0, -1), (10, 10, 10)),))
    energy = bake(scene, Settings(error=0.1, resolution=64, target=target)).report["energy"]
    assert energy["emitted"] == pytest.approx(220, rel=0.02)
    assert energy["absorbed"] == pytest.approx(0.7 * 160 + 40, rel=0.02)
    assert energy["escaped"] == pytest.approx(0.3 * 160 + 20, rel=0.02)


def test_imbalance_is_the_part_that_is_missing():
    # 10 W emitted, 6 absorbed, 3 escaped: a tenth is missing. Where nothing is emitted nothing is.
    assert EnergyBalance(10, 6, 3).imbalance == pytest.approx(0.1)
    assert EnergyBalance(0, 0, 0).imbalance == 0

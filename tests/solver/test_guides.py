"""Guided rays: densities over the hemisphere that are exact whatever was learnt, and pay where light comes from few
directions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from radiosity import solver
from radiosity.solver import Settings, guides
from radiosity.solver.lumels import lumels
from radiosity.solver.polygon import polygon_form_factor
from radiosity.solver.sampling import kronecker
from radiosity.solver.scene import Sky, Surface
from radiosity.tests.solver.rooms import NORTH, Shape, box, quad

POINTS = kronecker(2**16, 2)
# Light from a spot: heights and azimuths of its corners.
SPOT = (0.55, 0.6), (0.7, 0.74)
SETTINGS = Settings(resolution=48, only=("floor",))


def _in_spot(height, azimuth):
    return ((height > SPOT[0][0]) & (height < SPOT[0][1]) & (azimuth > SPOT[1][0])
            & (azimuth < SPOT[1][1])).astype(np.float32)


def _even(height, azimuth):
    return np.ones_like(height)


def _none(height, azimuth):
    return np.zeros_like(height)


def _learnt(light, rays=2**14, least=0):
    """Guides of one receiver, in a block of its own, from what some rays brought."""
    height, azimuth = kronecker(rays, 2).T[:, None]
    tally = guides.Tally(np.zeros(1, np.int32), 1, 1.0)
    tally.add(*tally.of(np.zeros(1, int), height, azimuth, light(height, azimuth).reshape(-1)))
    return tally.guides(least)


def _aimed(found):
    """Heights, azimuths and weights of many rays of that receiver."""
    return (each[0] for each in found.aim(np.zeros(1, int), POINTS[None, :, 0], POINTS[None, :, 1]))


@pytest.mark.parametrize("light", [_in_spot, _even, _none])
def test_guided_rays_are_without_bias(light):
    # Exact answers of a uniform density: 1, the means of u, v and u v (1/2, 1/2, 1/4), and the spot's area.
    height, azimuth, weight = _aimed(_learnt(light))
    for place in (height, azimuth):
        assert ((place >= 0) & (place < 1)).all()
    spot = (SPOT[0][1] - SPOT[0][0]) * (SPOT[1][1] - SPOT[1][0])
    for value, exact in ((1, 1), (height, 0.5), (azimuth, 0.5), (height * azimuth, 0.25)):
        assert (value * weight).mean(dtype=np.float64) == pytest.approx(exact, rel=2e-3)
    assert (_in_spot(height, azimuth) * weight).mean(dtype=np.float64) == pytest.approx(spot, rel=0.02)


def test_no_guided_ray_stands_for_many():
    # What was never seen keeps UNGUIDED of the rays; steps of equal probability may double what one stands for.
    *_, weight = _aimed(_learnt(_in_spot))
    assert weight.min() > 0
    assert weight.max() < 2 / guides.UNGUIDED


def test_guides_pay_where_light_comes_from_few_directions_and_nowhere_else():
    # A spot of .2 % of the hemisphere takes a good part of the rays; even light, and none, are not worth it.
    found = _learnt(_in_spot)
    height, azimuth, _ = _aimed(found)
    assert found.pays.all()
    assert _in_spot(height, azimuth).mean() > 0.05
    assert not _learnt(_even).pays.any()
    assert not _learnt(_none).pays.any()


def test_few_rays_that_found_light_do_not_guide_others_where_that_is_not_enough():
    # Some 4 of 2,048 rays meet the spot, and 32 of 16,384: most of what shines may lie where those few did not.
    assert not _learnt(_in_spot, 2048, least=24).pays.any()
    assert _learnt(_in_spot, 2**14, least=24).pays.all()


def test_blocks_are_told_apart():
    # Two receivers, two blocks, of which one sees the spot.
    tally = guides.Tally(np.array([1, 0]), 2, 1.0)
    height, azimuth = np.tile(POINTS[:2**14, 0], (2, 1)), np.tile(POINTS[:2**14, 1], (2, 1))
    light = np.concatenate([_in_spot(height[0], azimuth[0]), np.ones(2**14, np.float32)])
    tally.add(*tally.of(np.arange(2), height, azimuth, light))
    assert tally.guides().pays.tolist() == [True, False]


def _room() -> Shape:
    """A black room of 4 x 4 x 3 metres whose wall at y = 4 has a window of .5 x .4 metres."""
    walls = box((0, 0, 0), (4, 4, 3), 0.0)
    keep = np.arange(12) // 2 != NORTH
    whole = Shape(walls.corners[keep], walls.reflectance[keep], walls.emission[keep])
    around = (((0, 0), (4, 1.5)), ((0, 1.9), (4, 3)), ((0, 1.5), (1, 1.9)), ((1.5, 1.5), (4, 1.9)))
    for (left, low), (right, high) in around:
        whole = whole + quad((left, 4, low), (right - left, 0, 0), (0, 0, high - low), 0.0)
    return whole


def _floor_light(error):
    """Rays that a bake of the floor took, and over its inner lumels relative RMS error and bias against the closed
    form."""
    scene = _room().scene(sky=Sky(np.ones(3)), surfaces=(Surface("floor", 0, 2), Surface("walls", 2, 16)))
    settings = replace(SETTINGS, error=error)
    bake, laid = solver.bake(scene, settings), lumels(scene, settings, [])
    found = np.pi * np.asarray(bake.lightmaps[0].pixels).reshape(-1, 3)[laid.pixel, 0].astype(np.float64)
    window = np.array([[1, 4, 1.5], [1.5, 4, 1.5], [1.5, 4, 1.9], [1, 4, 1.9]])
    place = laid.receivers.position + scene.origin
    exact = np.pi * polygon_form_factor(place, laid.receivers.normal.astype(np.float64), window[::-1], "both")
    inner = ((place[:, :2] > 0.1) & (place[:, :2] < 3.9)).all(axis=1)
    away = ((found - exact) / exact.mean())[inner]
    return bake.report["rays"], float(np.sqrt((away**2).mean())), float(away.mean())


def test_a_floor_lit_through_a_small_window_takes_fewer_rays_and_is_right(monkeypatch):
    # Exact answer: pi F of the window, from each lumel. Without guides it takes more than twice the rays.
    rays, rms, bias = _floor_light(0.04)
    monkeypatch.setattr(guides, "LEAST_GAIN", 1e30)
    unguided, before, _ = _floor_light(0.04)
    assert rms < 0.04
    assert rms < before
    assert abs(bias) < 0.015
    assert unguided > 2 * rays

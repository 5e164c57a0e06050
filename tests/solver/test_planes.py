"""Many points of a footprint at once lie where single points do."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from radiosity.solver.direct import DirectLight
from radiosity.solver.footprints import ReceiverFootprints
from radiosity.solver.geometry import Geometry
from radiosity.solver.lamps import Sun
from radiosity.solver.parallel import Run
from radiosity.solver.probes import probes
from radiosity.solver.receivers import Receivers
from radiosity.tests.solver.rooms import quad

COUNT = 64


def _places(step, centre=(0.3, 0.3), count=5):
    """The same footprint on the first triangle of a square of 1 m, some times."""
    scene = quad((0, 0, 0), (1, 0, 0), (0, 1, 0)).scene()
    geometry = Geometry(scene)
    middle = np.tile(np.array(centre, np.float32), (count, 1))
    points = geometry.point(np.zeros(count, int), *middle.T)
    receivers = Receivers(points, np.tile(np.float32((0, 0, 1)), (count, 1)), np.zeros(count, np.int32), middle,
                          np.tile(np.float32(step), (count, 1, 1)))
    return ReceiverFootprints(geometry, receivers, 1.0, 0)


def _fan(places):
    x, y = np.random.default_rng(3).random((2, len(places), COUNT), np.float32)
    return x, y, *places.fan(np.arange(len(places)), x, y)


def test_a_fan_of_a_whole_footprint_is_its_single_points():
    # A footprint of 10 cm in the middle of a triangle: the same points and normals, one by one and all together.
    places = _places([[0.1, 0], [0, 0.1]])
    x, y, points, normals = _fan(places)
    single = places.sample(np.repeat(np.arange(len(places)), COUNT), x.reshape(-1), y.reshape(-1))
    assert points == pytest.approx(single[0], abs=1e-6)
    assert normals == pytest.approx(single[1], abs=1e-6)


def test_a_fan_of_a_footprint_astride_stays_on_its_triangle():
    # Half of the footprint lies beyond the triangle's third side; its points are spread over the other half.
    places = _places([[0.4, 0], [0, 0.4]], centre=(0.45, 0.45))
    geometry = places.geometry
    _, _, points, _ = _fan(places)
    base = geometry.corners[0, 0]
    weights = np.linalg.lstsq((geometry.corners[0, 1:] - base).T, (points - base).T, rcond=None)[0]
    assert weights.min() > 0.2
    assert weights.sum(axis=0).max() < 1 + 1e-5
    assert len(np.unique(np.round(weights, 5), axis=1).T) > len(points) / 4


def test_a_probe_has_one_point():
    # Receivers on no surface have no extent.
    scene = quad((0, 0, 0), (1, 0, 0), (0, 1, 0)).scene()
    points = np.array([(0.5, 0.5, 1.0), (0.2, 0.2, 2.0)])
    places = ReceiverFootprints(Geometry(scene), probes(scene, points, np.array([(0, 0, 1.0)] * 2)), 0.5, 0)
    _, _, found, normals = _fan(places)
    assert found + scene.origin == pytest.approx(np.repeat(points, COUNT, axis=0), abs=1e-4)
    assert normals == pytest.approx(np.tile((0, 0, 1.0), (2 * COUNT, 1)))


def _on_a_hill(step, centre, normals):
    """The footprint of `_places` on a triangle with smooth normals."""
    flat = _places(step, centre, 64)
    corner = np.float32(normals)
    corner /= np.linalg.norm(corner, axis=1, keepdims=True)
    scene = replace(flat.geometry.scene, corner_normals=np.stack([corner, corner]))
    return ReceiverFootprints(Geometry(scene), flat.receivers, 1.0, 0)


def test_a_fan_on_a_smooth_surface_has_the_normals_of_its_single_points():
    places = _on_a_hill([[0.2, 0], [0, 0.2]], (0.3, 0.3), [(-0.3, 0, 1), (0.4, 0.1, 1), (0, 0.5, 1)])
    x, y, _, normals = _fan(places)
    single = places.sample(np.repeat(np.arange(len(places)), COUNT), x.reshape(-1), y.reshape(-1))
    assert places.planes.turning.all()
    assert normals == pytest.approx(single[1], abs=1e-6)


def test_a_lamp_finds_the_slope_of_the_part_that_lies_on_the_triangle():
    # A lumel of which only one side lies on its triangle, on a surface that turns by two degrees from its middle to
    # there: a sun that shines nearly along it gives two fifths more than at the middle. Exact: the mean over points
    # drawn one by one.
    places = _on_a_hill([[0.4, 0], [0, 0.4]], (0.02, 0.4), [(0.0, 0, 1), (0.2, 0, 1), (0.0, 0, 1)])
    sun = Sun("sun", (-1.0, 0, -0.04), np.full(3, 10.0))
    direct = DirectLight(places.geometry, [sun], 0)
    points = np.random.default_rng(2).random((2, 4096), np.float32)
    _, normals = places.sample(np.zeros(4096, int), *points)
    towards = -np.asarray(sun.direction) / np.linalg.norm(sun.direction)
    exact = 10 * np.maximum(normals @ towards, 0).mean()
    middle = 10 * places.geometry.shading_normal(np.zeros(1, int), *places.receivers.barycentric[:1].T)[0] @ towards
    assert middle < 0.72 * exact
    found = direct.irradiance(places, Run(1), 0.01, 64)[:, 0]
    assert found == pytest.approx(exact, rel=0.1)
    assert found.mean() == pytest.approx(exact, rel=0.01)


def test_rays_of_a_footprint_astride_start_about_the_slope_of_its_part():
    places = _on_a_hill([[0.4, 0], [0, 0.4]], (0.02, 0.4), [(0.0, 0, 1), (0.2, 0, 1), (0.0, 0, 1)])
    _, _, _, normals = _fan(places)
    mean = normals.mean(axis=0)
    assert places.planes.normal[0] == pytest.approx(mean, abs=4e-3)
    middle = places.geometry.shading_normal(np.zeros(1, int), *places.receivers.barycentric[:1].T)[0]
    assert np.abs(middle - mean).max() > 0.015

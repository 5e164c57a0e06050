"""Emissive triangles as lamps: grouped by colour and place, from one side or both, exact and sampled."""

import numpy as np
import pytest
from radiosity.solver.mesh_emitter import MeshEmitter, group_emitters
from radiosity.solver.polygon import polygons_form_factor
from radiosity.tests.solver.lit_points import arrays, sampled

PI = np.pi
UP, DOWN = (0.0, 0.0, 1.0), (0.0, 0.0, -1.0)


def _random_triangles(count, seed=5):
    rng = np.random.default_rng(seed)
    return rng.uniform(-4, 4, (count, 1, 3)) + rng.normal(0, 0.2, (count, 3, 3)) + (0, 0, 8)


def _group_irradiance(groups, points, normals):
    return sum(group.irradiance(points, normals) for group in groups)


@pytest.mark.parametrize("exitance", [
    np.tile([3.0, 2, 1], (300, 1)), np.linspace(0, 2, 300)[:, None] * [3.0, 2, 1],
    np.random.default_rng(1).uniform(0, 2, (300, 3)),
], ids=["one colour", "one chromaticity", "a colour each"])
def test_groups_of_emitters_give_what_their_triangles_give(exitance):
    # 300 triangles: the sum over the groups is the sum of all form factors times exitance, channel by channel.
    corners = _random_triangles(300)
    groups = group_emitters(corners, exitance, most_triangles=32)
    points, normals = arrays(np.random.default_rng(2).uniform(-3, 3, (50, 3)), UP)
    exact = polygons_form_factor(points, normals, corners, exitance, "both")
    assert _group_irradiance(groups, points, normals) == pytest.approx(exact, rel=2e-3)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    assert sum(group.power() for group in groups) == pytest.approx(2 * area @ exitance, rel=1e-5)
    assert max(len(group.corners) for group in groups) <= 32
    assert len(groups) <= 48


def test_groups_of_emitters_are_close_together():
    # 1,024 triangles in a cube of 8 m: groups of 64 keep to boxes of about a sixteenth of its volume.
    corners = _random_triangles(1024)
    groups = group_emitters(corners, np.ones((1024, 3)), most_triangles=64)
    volume = [np.prod(np.ptp(group.corners.mean(axis=1), axis=0)) for group in groups]
    assert len(groups) == 16
    assert sum(volume) < 1.05 * 8**3


def test_dark_triangles_are_no_emitters():
    exitance = np.zeros((4, 3))
    assert group_emitters(_random_triangles(4), exitance) == ()
    exitance[2] = 1
    assert [len(group.corners) for group in group_emitters(_random_triangles(4), exitance)] == [1]


def test_many_triangles_have_no_closed_form_but_samples():
    # 65 triangles in one lamp: irradiance() is None, and samples agree with the form factors.
    corners = _random_triangles(65)
    light = MeshEmitter("many", corners, np.ones((65, 3)))
    points, normals = arrays([(0, 0, 0), (2, 1, 0)], UP)
    assert light.irradiance(points, normals) is None
    exact = PI * polygons_form_factor(points, normals, corners, sides="both")
    assert sampled(light, points, normals, 2**16)[:, 0] == pytest.approx(exact, rel=2e-3)


def _cube(centre, side, inverted=False):
    """Twelve triangles that face outward (or inward)."""
    quads = np.array([[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]])
    vertices = centre + side * (np.array([[i & 1, i >> 1 & 1, i >> 2] for i in range(8)]) - 0.5)
    triangles = vertices[np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])]
    return triangles[:, ::-1] if inverted else triangles


@pytest.mark.parametrize("inverted", [False, True])
def test_only_the_fronts_of_a_closed_emitter_light_what_is_outside(inverted):
    # A unit cube of radiance 1: beside it, the form factor of the faces that look there; from inside, pi L all around.
    (light,) = group_emitters(_cube((0, 0, 2), 1.0, inverted), np.full((12, 3), PI))
    outside, inside = arrays([(0.2, 0.1, 0), (3, 2, 1)], [UP, (-1, 0, 0)]), arrays([(0.1, 0.2, 1.9)], UP)
    exact = PI * polygons_form_factor(*outside, _cube((0, 0, 2), 1.0), sides="front")
    assert light.irradiance(*outside)[:, 0] == pytest.approx(exact, rel=1e-5)
    assert sampled(light, *outside, 2**16)[:, 0] == pytest.approx(exact, rel=2e-3)
    assert light.irradiance(*inside) == pytest.approx(PI, rel=1e-5)
    assert light.power() == pytest.approx(2 * 6 * PI)


def test_an_open_emitter_lights_with_both_sides():
    # The same cube without its lid is open: the backs of its walls can be seen from outside, through the hole.
    (light,) = group_emitters(_cube((0, 0, 2), 1.0)[[0, 2, 3, 4, 5, 6, 8, 9, 10, 11]], np.full((10, 3), PI))
    assert light.closed_box is None
    points, normals = arrays([(0, 0, 4)], DOWN)
    assert light.irradiance(points, normals).min() > 0


def test_a_moved_closed_emitter_keeps_its_box():
    (light,) = group_emitters(_cube((0, 0, 2), 1.0), np.full((12, 3), PI))
    points, normals = arrays([(10.2, 0.1, 0)], UP)
    exact = PI * polygons_form_factor(points, normals, _cube((10, 0, 2), 1.0), sides="front")
    assert light.translated(np.array([10.0, 0, 0])).irradiance(points, normals)[:, 0] == pytest.approx(exact, rel=1e-4)


def test_a_few_emitters_that_stand_apart_are_lamps_of_their_own():
    # Four cubes of two colours, 10 m apart: four lamps of twelve triangles, not two of twenty-four.
    corners = np.concatenate([_cube((10 * i, 0, 2), 1.0) for i in range(4)])
    exitance = np.repeat([[1.0, 1, 1], [2, 1, 0], [1, 1, 1], [4, 2, 0]], 12, axis=0)
    groups = group_emitters(corners, exitance)
    assert sorted(float(group.corners[..., 0].mean().round()) for group in groups) == [0, 10, 20, 30]
    assert all(len(group.corners) == 12 and np.ptp(group.corners[..., 0]) == 1 for group in groups)


def test_ten_thousand_colours_are_grouped_without_a_group_each():
    # Three channels of 10,000 triangles in groups of up to 64: fewer than 3 * 256.
    corners = _random_triangles(10_000)
    groups = group_emitters(corners, np.random.default_rng(0).uniform(0.1, 2, (10_000, 3)))
    assert len(groups) == 3 * 256

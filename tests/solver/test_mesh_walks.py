"""Samples side by side on a mesh: places by arithmetic, ways that go straight on, and what smoothing gains by them."""

from __future__ import annotations

import numpy as np
import pytest
from radiosity.solver.across import WAYS
from radiosity.solver.corner_samples import MOST_CUTS, CornerSamples
from radiosity.solver.kernels import kernels
from radiosity.solver.parallel import Run
from radiosity.solver.scene import Scene, Surface
from radiosity.solver.settings import Settings
from radiosity.solver.smooth import smooth
from radiosity.solver.vertices import corner_receivers
from radiosity.tests.solver.test_vertices import grid

VERTEX = Settings(target="vertex")


def _beside(scene, step=1):
    """Receivers on a scene's meshes, a sample for 25 cm2, and their neighbours."""
    receivers, near, _ = corner_receivers(scene, Settings(target="vertex", texel_density=20.0), Run(2))
    return receivers, near.at(step)


@pytest.mark.parametrize("cuts", [2, 3, 7, MOST_CUTS])
def test_a_point_belongs_to_the_sample_that_is_nearest_to_it(cuts):
    # On an equilateral triangle cut into k x k parts, each part holds what is nearest to its own middle.
    samples = CornerSamples.of(np.array([1.0]), Settings(target="vertex", texel_density=cuts - 0.1))
    assert samples.cuts[0] == cuts
    drawn = np.random.default_rng(1).random((3000, 2))
    drawn[drawn.sum(axis=1) > 1] = 1 - drawn[drawn.sum(axis=1) > 1]
    flat = np.array([[1, 0], [0.5, 0.75**0.5]])
    distance = np.linalg.norm((drawn @ flat)[:, None] - samples.weight @ flat, axis=2)
    nearest = np.sort(distance, axis=1)
    clear = nearest[:, 1] - nearest[:, 0] > 1e-9
    found = samples.at(np.zeros(len(drawn), int), drawn)
    assert np.array_equal(found[clear], distance.argmin(axis=1)[clear])


def test_a_point_outside_counts_for_its_triangles_border():
    # Beyond corner 1 and beyond the longest side of a triangle in 4 parts: the part in that corner, the middle one's
    # neighbours along the side; a triangle without samples has none.
    samples = CornerSamples.of(np.array([1.0, 0.0]), Settings(target="vertex", texel_density=1.0))
    found = samples.at(np.array([0, 0, 1]), np.array([[1.5, -0.2], [0.9, 0.8], [0.3, 0.3]]))
    assert samples.weight[found[0]] == pytest.approx([2 / 3, 1 / 6])
    assert samples.weight[found[1]].sum() > 0.8
    assert found[2] == -1


@pytest.mark.parametrize("step", [1, 2, 4])
def test_what_lies_beside_is_as_far_as_the_step_is_long_and_in_the_ways_direction(step):
    # A square of 8 x 8 squares, each triangle with four samples: away from its border all eight ways lead somewhere,
    # about a spacing or the diagonal's length away (samples lie on no square lattice), and opposite ways to opposite
    # sides.
    receivers, found = _beside(Scene(*grid(8)), step)
    position = receivers.position
    inner = np.flatnonzero((np.abs(position[:, :2]) < 0.2).all(axis=1))
    assert (found[inner] >= 0).mean() > 0.99
    assert (found != np.arange(len(found))[:, None]).all()
    spacing = np.sqrt(1 / len(position))
    ways = np.where((found >= 0)[:, :, None], position[found] - position[:, None], np.nan)[inner]
    length = np.linalg.norm(ways, axis=2)
    wanted = step * spacing * np.linalg.norm(WAYS, axis=1)
    assert (np.abs(np.log2(np.nanmedian(length, axis=0) / wanted)) < 0.6).all()
    assert np.nanmax(length / wanted) < 2.2
    opposite = np.einsum("nkc,nkc->nk", ways, ways[:, ::-1]) / (length * length[:, ::-1])
    assert np.nanmean(opposite) < -0.9


def _folded(angle):
    """A strip of 2 x 1 m in 16 x 8 squares, folded in its middle by an angle, its normals the same everywhere; and
    where each of its points lies unfolded."""
    flat, triangles = grid(8)
    flat = np.vstack([flat, np.add(flat, [1, 0, 0])])
    triangles = np.vstack([triangles, triangles + 81])
    beyond = np.maximum(flat[:, 0] - 1, 0)
    vertices = np.column_stack([np.minimum(flat[:, 0], 1) + beyond * np.cos(angle), flat[:, 1], beyond * np.sin(angle)])
    normals = np.tile(np.float32([0, 0, 1]), (len(triangles), 3, 1))
    return flat, vertices, triangles, normals


@pytest.mark.parametrize("flip", [False, True])
def test_ways_go_straight_on_over_a_fold(flip):
    # The same strip flat and folded by 80 degrees: the same samples lie beside each other, also where every other
    # triangle is wound the other way.
    flat, vertices, triangles, normals = _folded(np.radians(80))
    if flip:
        triangles[::2] = triangles[::2, ::-1]
    for step in (1, 4):
        (_, folded), (_, plain) = (_beside(Scene(points, triangles, corner_normals=normals), step)
                                   for points in (vertices, flat))
        assert (folded == plain).mean() > 0.999


def test_no_way_leads_over_a_crease_or_to_another_object():
    # The fold of 80 degrees with normals of its own is a crease; two squares in one plane are two objects.
    flat, vertices, triangles, _ = _folded(np.radians(80))
    objects = (Surface("left", 0, 128), Surface("right", 128, 128))
    for scene in (Scene(vertices, triangles), Scene(flat, triangles, surfaces=objects)):
        receivers, found = _beside(scene)
        half = receivers.triangle >= 128
        assert (found >= 0).sum() > 0.9 * found.size
        assert not ((found >= 0) & (half[found] != half[:, None])).any()


def test_smoothing_takes_the_noise_of_even_light_away():
    # Two looks at light of 1 with noise of 10 %: on a plane of 200 triangles with four samples each the noise falls by
    # more than 4.
    receivers, near, _ = corner_receivers(Scene(*grid(10)), Settings(target="vertex", texel_density=1.0), Run())
    assert len(receivers) == 800
    random = np.random.default_rng(4)
    looks = [np.float32(np.concatenate([0 * light, light], axis=1)) for light in random.normal(1, 0.1, (2, 800, 3))]
    before = np.sqrt(np.mean(((looks[0] + looks[1])[:, 3:] / 2 - 1) ** 2))
    first, second = smooth(*looks, kernels(receivers, near, Run()), Run())
    assert np.sqrt(np.mean(((first + second)[:, 3:] / 2 - 1) ** 2)) < before / 4


def test_a_mesh_of_needles_and_of_triangles_without_area_has_ways_that_end():
    # A fan of needles about one point, one of them flat: no way leads to itself or out of the samples.
    angle = np.linspace(0, 0.2, 40)
    rim = np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    vertices = np.vstack([[[0, 0, 0]], rim, rim[:1]])
    triangles = np.array([[0, i, i + 1] for i in range(1, 40)] + [[0, 1, 41]])
    receivers, found = _beside(Scene(vertices, triangles))
    assert found.max() < len(receivers)
    assert (found != np.arange(len(found))[:, None]).all()
    assert (found >= 0).any(axis=1).mean() > 0.9


def test_the_same_neighbours_for_any_number_of_threads():
    scene = Scene(*grid(40))
    one, two = (corner_receivers(scene, VERTEX, Run(threads))[1].at(2) for threads in (1, 2))
    assert np.array_equal(one, two)

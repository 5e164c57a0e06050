"""What rays meet: Embree and its NumPy twin agree on everything, and the twin says that it is slow."""

from __future__ import annotations

import numpy as np
import pytest
from radiosity.solver.visibility import SLOW_NOTICE, Visibility
from radiosity.tests.solver.rooms import box, quad

RAYS = 20_000


def _unit(vectors):
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True), np.float32)


@pytest.fixture(scope="module")
def cloud():
    """200 random triangles in a cube of 2 m: Embree's caster, NumPy's, and rays from all over (n, 3) twice."""
    rng = np.random.default_rng(11)
    corners = (rng.uniform(-1, 1, (200, 1, 3)) + rng.uniform(-0.4, 0.4, (200, 3, 3))).astype(np.float32)
    origins = rng.uniform(-1.5, 1.5, (RAYS, 3)).astype(np.float32)
    return Visibility(corners), Visibility(corners, embree=False), origins, _unit(rng.normal(size=(RAYS, 3)))


def test_both_casters_meet_the_same_triangles_at_the_same_places(cloud):
    # Two programs, float32 and float64: they may differ where a ray passes within rounding of an edge, 1 in 2,000.
    fast, slow, origins, directions = cloud
    one, other = fast.hits(origins, directions), slow.hits(origins, directions)
    same = one.triangle == other.triangle
    assert same.mean() > 0.9995
    met = same & (other.triangle >= 0)
    assert 0.2 < met.mean() < 0.9
    assert one.distance[met] == pytest.approx(other.distance[met], abs=2e-4)
    # Rays that graze turn a unit in the last place into more: the weights by the cosine are not asked of them.
    corners = fast._corners[other.triangle[met]].astype(float)
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    steep = np.abs(np.einsum("ij,ij->i", _unit(cross), directions[met])) > 0.05
    assert one.u[met][steep] == pytest.approx(other.u[met][steep], abs=2e-3)
    assert one.v[met][steep] == pytest.approx(other.v[met][steep], abs=2e-3)
    assert np.array_equal(one.front[met], other.front[met])


@pytest.mark.parametrize("at_once", [1, 7, 199, 200, 4096])
def test_what_rays_meet_is_the_same_however_many_triangles_embree_is_given_at_once(cloud, at_once):
    # One tree over all of them: equal to the bit, numbers of the triangles included.
    whole, _, origins, directions = cloud
    parts = Visibility(whole._corners, at_once=at_once)
    one, other = parts.hits(origins, directions), whole.hits(origins, directions)
    for name in ("triangle", "u", "v", "distance", "front"):
        assert np.array_equal(getattr(one, name), getattr(other, name)), name
    near = np.full(RAYS, 0.5, np.float32)
    assert np.array_equal(parts.occluded(origins, directions, near), whole.occluded(origins, directions, near))


def test_both_casters_miss_with_the_same_words(cloud):
    # A missed ray has triangle -1 in either.
    for caster in cloud[:2]:
        away = np.array([[0, 0, 5]], np.float32)
        hits = caster.hits(away, np.array([[0, 0, 1]], np.float32))
        assert hits.triangle.tolist() == [-1]


@pytest.mark.parametrize("reach", [0.1, 0.5, 2.0, np.inf])
def test_both_casters_find_the_same_shadow_rays_blocked(cloud, reach):
    # Anything nearer than the reach blocks: the nearest hit tells.
    fast, slow, origins, directions = cloud
    distances = np.full(RAYS, reach, np.float32)
    one, other = (caster.occluded(origins, directions, distances) for caster in (fast, slow))
    assert (one == other).mean() > 0.9995
    assert other.any()
    assert not other.all()


@pytest.mark.parametrize("embree", [True, False])
def test_a_hit_says_where_and_on_which_side(embree):
    # A triangle (0,0,0) (1,0,0) (0,1,0) facing +z, met at (.2, .3) from 2 m above and 1 m below.
    caster = Visibility(np.array([[[0, 0, 0], [1, 0, 0], [0, 1, 0]]], np.float32), embree)
    origins = np.array([[0.2, 0.3, 2], [0.2, 0.3, -1]], np.float32)
    hits = caster.hits(origins, np.array([[0, 0, -1], [0, 0, 1]], np.float32))
    assert hits.triangle.tolist() == [0, 0]
    assert hits.front.tolist() == [True, False]
    assert hits.distance == pytest.approx([2, 1])
    assert hits.u == pytest.approx([0.2, 0.2])
    assert hits.v == pytest.approx([0.3, 0.3])


@pytest.mark.parametrize("embree", [True, False])
def test_what_lies_beyond_the_lamp_blocks_nothing(embree):
    # A wall at 1 m: a lamp at .999 m is seen, one at 1.001 m is not; what lies behind the start doesn't count.
    caster = Visibility(quad((-1, -1, 1), (2, 0, 0), (0, 2, 0)).corners.astype(np.float32), embree)
    origin, up = np.full((3, 3), 0.1, np.float32) * [1, 1, 0], np.array([[0, 0, 1], [0, 0, 1], [0, 0, -1]])
    blocked = caster.occluded(origin.astype(np.float32), up.astype(np.float32), np.array([0.999, 1.001, 9], np.float32))
    assert blocked.tolist() == [False, True, False]


@pytest.mark.parametrize("embree", [True, False])
def test_no_ray_escapes_a_closed_box(embree):
    # 5,000 rays from inside in all directions, through edges and corners too: every one meets a wall's front.
    caster = Visibility(box((-1, -1, -1), (1, 1, 1)).corners.astype(np.float32), embree)
    rng = np.random.default_rng(4)
    directions = _unit(np.concatenate([rng.normal(size=(5000, 3)), rng.choice([-1.0, 1.0], (100, 3))]))
    origins = np.zeros_like(directions)
    origins[:5000] = rng.uniform(-0.9, 0.9, (5000, 3))
    hits = caster.hits(origins, directions)
    assert (hits.triangle[:5000] >= 0).all()
    assert hits.front[hits.triangle >= 0].all()


def test_the_notice_is_there_only_where_rays_are_slow():
    # With Embree: nothing to say. Without: what is missing, and what it costs.
    corners = np.zeros((1, 3, 3), np.float32)
    assert Visibility(corners).notice == ""
    notice = Visibility(corners, embree=False).notice
    assert notice == SLOW_NOTICE
    assert "embreex" in notice
    assert "slower" in notice


@pytest.mark.parametrize("embree", [True, False])
def test_an_empty_scene_stops_no_ray(embree):
    # No triangle.
    caster = Visibility(np.empty((0, 3, 3), np.float32), embree)
    ray = np.zeros((2, 3), np.float32), np.array([[0, 0, 1]] * 2, np.float32)
    assert (caster.hits(*ray).triangle == -1).all()
    assert not caster.occluded(*ray, np.full(2, np.inf, np.float32)).any()

"""Shadow rays to flat emitters from nearer than these are wide."""

import numpy as np
import pytest
from radiosity.solver.area_lamp import Area
from radiosity.solver.banks import banks
from radiosity.solver.mesh_emitter import MeshEmitter
from radiosity.solver.panel_draw import NEAR, PanelDraw
from radiosity.solver.polygon import polygon_form_factor
from radiosity.solver.sampling import kronecker
from radiosity.tests.solver.lit_points import arrays, sampled

SKEW = np.array([[0, 0, 0], [1.2, 0.1, 0], [1.5, 1.7, 0], [0.3, 1.6, 0]])
HALVES = SKEW[[[0, 1, 2], [0, 2, 3]]]
LAMPS = {
    "parallelogram": MeshEmitter("a", HALVES, np.ones((2, 3))),
    "triangle": MeshEmitter("b", HALVES[:1], np.ones((1, 3))),
    "two triangles": MeshEmitter("c", HALVES * [[[1, 1, 1]], [[1.3, 1.1, 1]]], np.ones((2, 3))),
    "area lamp": Area("d", np.array([0.5, 0.8, 0]), np.array([1.0, 0.1, 0]), np.array([0.2, 1.5, 0]), np.ones(3)),
    "ellipse": Area("e", np.array([0.5, 0.8, 0]), np.array([1.0, 0, 0]), np.array([0, 1.5, 0]), np.ones(3), round=True),
}
# Before the middle, the rim and a corner, beside it, and on both sides of where near begins.
PLACES = [(0.5, 0.6, 0.02), (0.5, 0.5, 1e-3), (0.2, 0.9, 0.05), (0.05, 0.06, 0.03), (-0.3, 0.2, 0.05), (0.7, 0.8, 0.8),
          (0.7, 0.8, 0.9), (0.5, 0.5, 3.0)]


@pytest.mark.parametrize("place", PLACES, ids=str)
@pytest.mark.parametrize("lamp", LAMPS)
def test_samples_give_the_closed_form_from_near_and_far(lamp, place):
    # 65,536 quasi-random points of the lamp, receivers that face it and that look askew, from both sides of a panel.
    light = LAMPS[lamp]
    side = np.array([1, 1, float(light.normal[2]) if isinstance(light, Area) else 1])
    points, normals = arrays([place * side] * 2, [(0, 0, -side[2]), (0.6, 0, -0.8 * side[2])])
    exact = light.irradiance(points, normals)
    assert sampled(light, points, normals, 2**16) == pytest.approx(exact, rel=0.01, abs=1e-4 * np.pi)


def test_a_bank_of_lamps_draws_as_each_alone():
    # Lamps in one bank, the same numbers: the same rays and weights.
    lamps = [LAMPS["triangle"], LAMPS["parallelogram"]]
    [bank], number, place, _ = banks(lamps)
    assert (number == 0).all()
    points, normals = arrays(PLACES, (0, 0, -1))
    uv = kronecker(len(points), 2)
    for lamp, light in enumerate(lamps):
        alone = light.sample(points, normals, uv)
        among = bank.sample(points, normals, uv, np.full(len(points), place[lamp]))
        assert among.direction == pytest.approx(alone.direction, abs=1e-5)
        assert among.weight == pytest.approx(alone.weight, rel=1e-4)


def _part_that_is_seen(light, start):
    """Of the light at the origin, the part that comes from beyond x = -.2, as some points of the lamp tell."""
    points, normals = arrays(np.zeros((16, 3)), (0, 0, 1))
    rays = light.sample(points, normals, kronecker(16, 2, start))
    beyond = rays.direction[:, 0] * rays.distance < -0.2
    return rays.weight[beyond].sum() / rays.weight.sum()


def test_few_rays_know_that_the_near_part_of_a_lamp_is_hidden():
    # A lamp of a square metre 2 cm above a point, hidden but for its far end, x < -.2: 30 % of its area, but .2 % of
    # its light. 16 rays of a hundred sets tell that; had they ended evenly over the lamp, they would have told of 30 %.
    corner, first, second = np.array([[-0.5, -0.5, 0.02], [0, 1, 0], [1, 0, 0]])
    outline = np.array([corner, corner + first, corner + first + second, corner + second])
    light = MeshEmitter("lamp", outline[[[0, 1, 2], [0, 2, 3]]], np.ones((2, 3)))
    far = np.where(outline[..., :1] > 0, [-0.2, 0, 0], outline * [1, 0, 0]) + outline * [0, 1, 1]
    points, normals = arrays([(0, 0, 0)], (0, 0, 1))
    exact = float(polygon_form_factor(points, normals, far)[0] / polygon_form_factor(points, normals, outline)[0])
    assert 0.0005 < exact < 0.005
    found = np.array([_part_that_is_seen(light, 16 * number) for number in range(100)])
    assert found.max() < 0.05
    assert found.mean() == pytest.approx(exact, rel=0.5)


def test_few_rays_know_that_the_near_part_of_a_round_lamp_is_hidden():
    # A disc of a square metre instead of the square: its part beyond x = -.2 has about .2 % of its light, too.
    side = np.pi**-0.5
    light = Area("disc", np.array([0, 0, 0.02]), np.array([0, 2 * side, 0]), np.array([2 * side, 0, 0]), np.ones(3),
                 round=True)
    outline = light.outline(1024)
    points, normals = arrays([(0, 0, 0)], (0, 0, 1))
    beyond = np.where(outline[:, :1] > -0.2, outline * [0, 1, 1] + [-0.2, 0, 0], outline)
    within = np.abs(outline[:, 1]) <= (side**2 - 0.2**2) ** 0.5
    far = polygon_form_factor(points, normals, beyond[within | (outline[:, 0] < -0.2)])
    exact = float(far[0] / polygon_form_factor(points, normals, outline)[0])
    assert 0.0005 < exact < 0.005
    found = np.array([_part_that_is_seen(light, 16 * number) for number in range(100)])
    assert found.max() < 0.05
    assert found.mean() == pytest.approx(exact, rel=0.5)


def test_points_that_are_far_away_see_evenly_spread_samples():
    # From further than NEAR diagonals: u and v are the way along the sides, and weights are not touched.
    draw = PanelDraw(np.zeros((1, 3)), np.array([[1.0, 0, 0]]), np.array([[0, 1.0, 0]]), np.ones(1, bool))
    uv = kronecker(64, 2)
    for height, even in ((1.05 * NEAR * 2**0.5, True), (0.95 * NEAR * 2**0.5, False)):
        target, scale = draw.targets(np.float32([[0.5, 0.5, height]]).repeat(64, 0), np.zeros(64, int), *uv.T)
        assert bool((target[:, :2] == uv).all() and (scale == 1).all()) == even

"""Direct light: an exact penumbra through the lamps' own door, and the ratio that makes it unbiased."""

from __future__ import annotations

import numpy as np
import pytest
from radiosity.solver.area_lamp import Area
from radiosity.solver.direct import DirectLight
from radiosity.solver.footprints import ReceiverFootprints
from radiosity.solver.geometry import Geometry
from radiosity.solver.lamps import Point
from radiosity.solver.lumels import lumels
from radiosity.solver.mesh_emitter import MeshEmitter
from radiosity.solver.neighbours import LumelNeighbours
from radiosity.solver.parallel import Run
from radiosity.solver.polygon import polygon_form_factor
from radiosity.solver.probes import probes
from radiosity.solver.settings import Settings
from radiosity.tests.solver.rooms import quad

# P-27: a source over [-1, 1]^2 at z = 2, an opaque half-plane x < 0 at z = 1, receivers (x, 0, 0) facing up.
KNIFE_EDGE = {-0.75: 0.01318443288285, -0.5: 0.03705534802, 0.0: 0.1197282352304, 0.25: 0.1611880253512,
              0.5: 0.1859108490138, 1.0: 0.1803687411231}
SOURCE = np.array([[-1, -1, 2], [-1, 1, 2], [1, 1, 2], [1, -1, 2]], float)  # facing down
# Wide enough to stand for the half-plane: it covers all that these receivers see of the source behind it.
BLADE = quad((-2, -2, 1), (2, 0, 0), (0, 4, 0))
# Exitance 1 W/m2: what arrives is the form factor.
LAMPS = {
    "area": Area("lamp", (0, 0, 2), (0, 2, 0), (2, 0, 0), (4, 4, 4)),
    "mesh": MeshEmitter("lamp", SOURCE[[[0, 1, 2], [0, 2, 3]]], np.full((2, 3), 1 / np.pi), two_sided=False),
}


def _lit(scene, lamp, points, normals, seed=0, **more):
    """(n,) irradiance at probes, first channel; the scene's own lamps don't count."""
    geometry = Geometry(scene)
    direct = DirectLight(geometry, (lamp.translated(-scene.origin),), seed)
    receivers = probes(scene, np.array(points, float), np.array(normals, float))
    return direct.irradiance(ReceiverFootprints(geometry, receivers, 0.5, seed), Run(2), **more)[:, 0]


def _edge_points(times=1):
    points = np.tile([(x, 0, 0) for x in KNIFE_EDGE], (times, 1))
    return points, np.broadcast_to((0, 0, 1), points.shape)


@pytest.mark.parametrize("lamp", LAMPS)
def test_without_the_blade_the_closed_form_stands(lamp):
    # No occluder: what arrives is the differential form factor, at every receiver, to float32's rounding.
    scene = quad((-2, -2, -1), (4, 0, 0), (0, 4, 0)).scene()
    points, normals = _edge_points()
    exact = polygon_form_factor(points.astype(float), normals.astype(float), SOURCE)
    assert _lit(scene, LAMPS[lamp], points, normals) == pytest.approx(exact, rel=1e-4)


@pytest.mark.parametrize("lamp", LAMPS)
def test_the_knife_edges_penumbra_is_exact(lamp, validation):
    # P-27, 64 shifts of 1,024 shadow rays: within 1 % of the open value (two deviations), their mean within its noise.
    points, normals = _edge_points(64)
    found = _lit(BLADE.scene(), LAMPS[lamp], points, normals, pilot=1024).reshape(64, -1)
    exact = np.array(list(KNIFE_EDGE.values()))
    open_value = polygon_form_factor(*(each.astype(float) for each in _edge_points()), SOURCE)
    assert (2 * np.sqrt(np.mean((found - exact) ** 2, axis=0)) < 0.01 * open_value).all()
    for x, right, here in zip(KNIFE_EDGE, exact, found.T, strict=True):
        validation("P-27", f"knife edge, {lamp} lamp, x = {x}", right, here.mean(), here.std(ddof=1) / 8, relative=1e-4)


@pytest.mark.parametrize("tolerance", [0.006, 0.002, 0.0007])
def test_rays_are_added_in_the_penumbra_until_the_error_is_met(tolerance):
    # P-27, 64 receivers at each place, wanted .7 to 6 thousandths of a W/m2 (.2 is the open value): no more is found.
    points, normals = _edge_points(64)
    found = _lit(BLADE.scene(), LAMPS["area"], points, normals, tolerance=tolerance).reshape(64, -1)
    error = np.sqrt(np.mean((found - list(KNIFE_EDGE.values())) ** 2, axis=0))
    assert (error < tolerance).all()


@pytest.mark.parametrize("lamp", LAMPS)
def test_rays_are_added_for_a_mesh_lamp_too_until_the_error_is_met(lamp):
    # P-27, 64 receivers at each place, wanted .002 W/m2 (1 % of the open value): no more is found.
    points, normals = _edge_points(64)
    found = _lit(BLADE.scene(), LAMPS[lamp], points, normals, tolerance=0.002).reshape(64, -1)
    error = np.sqrt(np.mean((found - list(KNIFE_EDGE.values())) ** 2, axis=0))
    assert (error < 0.002).all()


def test_the_weighted_part_is_unbiased_where_the_uniform_part_is_not():
    # A wide lamp just above a receiver at its rim, half of it hidden: near parts count for more. The closed form of
    # the visible half is the truth; the share of free rays alone is off by more than a tenth of the open value.
    lamp = Area("lamp", (0, 0, 0.5), (0, 2, 0), (2, 0, 0), (4, 4, 4))
    blade = quad((-9, -9, 0.499), (9, 0, 0), (0, 18, 0))
    source = np.array([[-1, -1, 0.5], [-1, 1, 0.5], [1, 1, 0.5], [1, -1, 0.5]])
    visible = source.copy()
    # From (.9, 0, 0) the edge x = 0 at z = .499 is seen before x = -.0018 of the lamp.
    visible[:2, 0] = 0.9 - 0.9 * 0.5 / 0.499
    point, normal = np.array([[0.9, 0.0, 0.0]]), np.array([[0.0, 0.0, 1.0]])
    exact, whole = (polygon_form_factor(point, normal, polygon)[0] for polygon in (visible, source))
    found = _lit(blade.scene(), lamp, np.tile(point, (500, 1)), np.tile(normal, (500, 1)), pilot=64)
    assert found.mean() == pytest.approx(exact, abs=4 * found.std() / 500**0.5 + 1e-3 * whole)
    uniform = whole * (1 - visible[0, 0]) / 2
    assert abs(uniform - exact) > 0.1 * whole


def test_few_rays_are_right_on_the_average():
    # P-27 with 16 rays, 4,000 shifts: the mean of the ratio's estimates is off by less than 1 % of the open value.
    points, normals = _edge_points(4000)
    found = _lit(BLADE.scene(), LAMPS["area"], points, normals, pilot=16).reshape(4000, -1).mean(axis=0)
    assert found == pytest.approx(list(KNIFE_EDGE.values()), abs=0.002)


def test_where_nothing_is_in_doubt_no_ray_is_added():
    # Open and far in the shadow: the pilot's rays and no more.
    scene = BLADE.scene()
    geometry = Geometry(scene)
    direct = DirectLight(geometry, (LAMPS["area"].translated(-scene.origin),), 0)
    receivers = probes(scene, np.array([(3.0, 0, 0), (-1.5, 0, 0)]), np.array([(0, 0, 1.0)] * 2))
    run = Run(1)
    light = direct.irradiance(ReceiverFootprints(geometry, receivers, 0.5, 0), run, tolerance=1e-6)[:, 0]
    assert light[0] > 0
    assert light[1] == 0
    assert sum(run.rays.values()) <= 32


def test_many_lamps_drawn_by_chance_give_the_sum_of_all_on_the_average():
    # 40 bare points of 1 to 100 W above 4,000 receivers at one place: the mean is the sum of closed forms.
    rng = np.random.default_rng(6)
    lamps = tuple(Point(f"lamp {n}", (*rng.uniform(-5, 5, 2), 2), (float(10 ** rng.uniform(0, 2)),) * 3)
                  for n in range(40))
    scene = quad((-2, -2, -1), (4, 0, 0), (0, 4, 0)).scene()
    geometry = Geometry(scene)
    moved = tuple(lamp.translated(-scene.origin) for lamp in lamps)
    points = np.zeros((4000, 3))
    receivers = probes(scene, points, np.broadcast_to((0, 0, 1.0), points.shape))
    run = Run(2)
    places = ReceiverFootprints(geometry, receivers, 0.5, 0)
    found = DirectLight(geometry, moved, 0).irradiance(places, run, small_share=0.1)[:, 0]
    up = np.array([[0, 0, 1]], np.float32)
    exact = sum(float(lamp.irradiance(points[:1].astype(np.float32), up)[0, 0]) for lamp in lamps)
    allowed = 4 * float(found.std()) / len(found) ** 0.5 + 1e-4 * exact
    assert found.mean() == pytest.approx(exact, abs=allowed)
    assert sum(run.rays.values()) < 0.7 * 40 * 4000 * 16


def test_lumels_right_beside_lamps_are_the_mean_of_all_their_light():
    # Five lamps of 20 cm hang 4 cm over a floor of 12 cm lumels: light falls by a hundredth within one. Exact answer:
    # the form factor's mean over each lumel's middle half (48 x 48 points); lumels on the floor's diagonal, which two
    # triangles share, are left out. Wanted: .4 % of the mean a lumel, of each of five lamps.
    middles = [(0.93, 1.07), (2.41, 0.83), (3.1, 2.2), (1.3, 2.7), (2.2, 3.3)]
    lamps = tuple(Area(f"lamp {x}", (x, y, 0.04), (0, 0.2, 0), (0.2, 0, 0), (0.04,) * 3) for x, y in middles)
    scene = quad((0, 0, 0), (4, 0, 0), (0, 4, 0)).scene()
    found = lumels(scene, Settings(resolution=32), [], Run(1).step, None)
    geometry = Geometry(scene)
    places = ReceiverFootprints(geometry, found.receivers, 0.5, 0)
    inside = (np.arange(48, dtype=np.float32) + 0.5) / 48
    x, y = (np.tile(axis.reshape(-1), len(found)) for axis in np.meshgrid(inside, inside))
    points, normals = (each.astype(float) for each in places.sample(np.repeat(np.arange(len(found)), 48**2), x, y))
    corners = np.array([[-0.1, -0.1, 0.04], [-0.1, 0.1, 0.04], [0.1, 0.1, 0.04], [0.1, -0.1, 0.04]])
    shifts = np.pad(np.array(middles), ((0, 0), (0, 1)))
    exact = sum(polygon_form_factor(points + scene.origin, normals, corners + shift) for shift in shifts)
    exact = exact.reshape(len(found), -1).mean(axis=1)
    direct = DirectLight(geometry, tuple(lamp.translated(-scene.origin) for lamp in lamps), 0)
    light = direct.irradiance(places, Run(2), 0.004 * exact.mean(), neighbours=LumelNeighbours(found).at(1))[:, 0]
    place = found.receivers.position + scene.origin
    apart = np.abs(place[:, 0] - place[:, 1]) > 0.1
    assert exact.max() > 50 * exact.mean()
    assert np.sqrt(np.mean((light - exact)[apart] ** 2)) < 0.01 * exact.mean()


def _summed(lamp, places):
    """(n,) light of footprints from a lamp with a spread: the mean over 6 x 6 places of the sum over some 3,000 points
    of it."""
    sides = np.linalg.norm([lamp.axis_u, lamp.axis_v], axis=1)
    cuts = (round(float(side)) for side in sides * np.sqrt(3000 / sides.prod()))
    inside, along, across = (((np.arange(count) + 0.5) / count).astype(np.float32) for count in (6, *cuts))
    x, y = np.meshgrid(inside, inside)
    u, v = (axis.reshape(-1, 1) - 0.5 for axis in np.meshgrid(along, across))
    on_lamp = (u**2 + v**2 < 0.25)[:, 0] | (not lamp.round)
    target = (lamp.centre + u * lamp.axis_u + v * lamp.axis_v)[on_lamp]
    tangent = np.tan(lamp.spread / 2)
    light = np.empty(len(places))
    for row in range(len(places)):
        points, normals = places.sample(np.full(x.size, row), x.reshape(-1), y.reshape(-1))
        way = points[:, None].astype(float) - target
        leaving = way @ lamp.normal
        squared = (way**2).sum(axis=2)
        slope = np.sqrt(np.maximum(squared - leaving**2, 0)) / np.maximum(leaving, 1e-9)
        slats = np.maximum(tangent - slope, 0) / (tangent - lamp.spread / 2)
        arriving = np.maximum(-np.einsum("plk,pk->pl", way, normals), 0)
        light[row] = np.mean(slats * np.maximum(leaving, 0) * arriving / squared**2) * lamp.flux[0] / np.pi
    return light


@pytest.mark.parametrize(("sides", "is_round", "degrees"),
                         [((0.5, 0.5), False, 10), ((1.0, 0.1), False, 20), ((1.0, 0.1), True, 20)])
def test_beams_narrower_than_their_lamp_reach_all_that_they_light(sides, is_round, degrees):
    # A tilted lamp of a narrow spread over a floor of 24 x 24 lumels, those on the diagonal left out: no lumel stays
    # black that is lit, and the RMS error is less than a hundredth of the lit lumels' mean.
    u, v = np.array([0.86, 0.47, -0.2]), np.array([0.42, -0.88, -0.26])
    v -= u * (u @ v) / (u @ u)
    u, v = (axis / np.linalg.norm(axis) * side for axis, side in zip((u, v), sides, strict=True))
    lamp = Area("beam", (1.2, 1.1, 0.6), u, v, 100, round=is_round, spread=np.radians(degrees))
    scene = quad((0, 0, 0), (2, 0, 0), (0, 2, 0)).scene()
    found = lumels(scene, Settings(resolution=24), [], Run(1).step, None)
    places = ReceiverFootprints(Geometry(scene), found.receivers, 0.5, 0)
    lamp = lamp.translated(-scene.origin)
    exact = _summed(lamp, places)
    direct = DirectLight(places.geometry, (lamp,), 0)
    light = direct.irradiance(places, Run(2), 0.01 * exact.mean(), neighbours=LumelNeighbours(found).at(1))[:, 0]
    apart = np.abs(found.receivers.position[:, 0] - found.receivers.position[:, 1]) > 0.05
    lit = apart & (exact > 1e-2 * exact.max())
    assert (light[lit] > 0).all()
    assert np.sqrt(np.mean((light - exact)[lit] ** 2)) < 0.01 * exact[lit].mean()


def test_no_lamp_gives_no_light():
    # None in the scene.
    scene = BLADE.scene()
    geometry = Geometry(scene)
    receivers = probes(scene, np.zeros((3, 3)), np.broadcast_to((0, 0, 1.0), (3, 3)))
    places = ReceiverFootprints(geometry, receivers, 0.5, 0)
    assert not DirectLight(geometry, (), 0).irradiance(places, Run(1)).any()

"""Radiosity where it breaks easily: size, place, endless light, narrow doors, extremes, symmetry, sums, seeds.

Where no exact answer is known, the same light is asked for in two ways that must agree to the error asked for.
"""

from __future__ import annotations

import numpy as np
import pytest
from radiosity.solver import Scene, SceneError, Settings, Sky, Texture, bake, irradiance, solve
from radiosity.solver.area_lamp import Area
from radiosity.solver.audit import Auditor
from radiosity.solver.footprints import ReceiverFootprints
from radiosity.solver.geometry import Geometry
from radiosity.solver.lamps import Point
from radiosity.solver.parallel import Run
from radiosity.solver.probes import probes
from radiosity.solver.sources import light_sources
from radiosity.tests.solver.rooms import box, quad, shape, wall_points

UP, DOWN = (0, 0, 1), (0, 0, -1)
ERROR = 0.03
LOW, HIGH = (0.0, 0.0, 0.0), (4.0, 3.0, 2.5)


def _furnished(rho=0.6, exitance=1.0):
    """A room with a glowing ceiling and a block on the floor: a shape."""
    return (box(LOW, HIGH, rho, (0, exitance, 0, 0, 0, 0))
            + box((1, 1, 0), (1.8, 2.1, 1.2), rho, inward=False))


def _places(number=5, sides=(0, 2)):
    """Points over the floor and a wall of that room, off the block, and their normals."""
    points, normals = (np.concatenate(each) for each in
                       zip(*(wall_points(LOW, HIGH, side, number) for side in sides), strict=True))
    free = ~((points[:, 2] < 1.2) & (points[:, 0] > 0.9) & (points[:, 0] < 1.9) & (points[:, 1] > 0.9)
             & (points[:, 1] < 2.2))
    return points[free], normals[free]


def _light(scene, points, normals, **more):
    """(n,): the first channel."""
    return irradiance(scene, Settings(error=ERROR, **more), points, normals)[:, 0]


def _differ(first, second):
    """RMS difference of two answers, over the mean of the second."""
    return np.sqrt(np.mean((np.asarray(first) - second) ** 2)) / np.mean(second)


def _turn(axis, degrees):
    """(3, 3): a rotation about an axis (Rodrigues)."""
    x, y, z = np.asarray(axis, float) / np.linalg.norm(axis)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    angle = np.radians(degrees)
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


@pytest.fixture(scope="module")
def as_it_is():
    """The furnished room's light where it is built, at `_places`, by two threads."""
    return _light(_furnished().scene(), *_places(), threads=2)


@pytest.mark.parametrize(("scale", "offset"), [(1e-3, 0.0), (1e3, 0.0), (1.0, (3e4, -2e4, 1e4))])
def test_a_room_of_any_size_and_place_gets_the_same_light(scale, offset, as_it_is):
    # The furnished room, 4 mm to 4 km wide, or 37 km off: irradiance does not change.
    points, normals = _places()
    scene = _furnished().moved(scale, np.asarray(offset)).scene()
    found = _light(scene, points * scale + np.asarray(offset), normals)
    assert _differ(found, as_it_is) < 2**0.5 * ERROR


def test_a_turned_room_gets_the_same_light(as_it_is):
    # Turned by 37 degrees about a skew axis: no axis of the world matters.
    turn = _turn((1, 2, 3), 37)
    points, normals = _places()
    found = _light(_furnished().moved(turn).scene(), points @ turn.T, normals @ turn.T)
    assert _differ(found, as_it_is) < 2**0.5 * ERROR


def test_one_thread_and_two_give_the_same_bits(as_it_is):
    # Same input and seed.
    assert np.array_equal(_light(_furnished().scene(), *_places(), threads=1), as_it_is)


def test_another_seed_gives_other_bits_of_the_same_light(as_it_is):
    # Two bakes of independent errors differ by the root of two times as much.
    found = _light(_furnished().scene(), *_places(), seed=5)
    assert not np.array_equal(found, as_it_is)
    assert _differ(found, as_it_is) < 2**0.5 * ERROR


@pytest.mark.parametrize("lost", [1e-3, 1e-4])
def test_a_closed_room_that_absorbs_next_to_nothing_is_solved(lost, validation):
    # Rho .999 and .9999: mean H = flux / (area (1 - rho)), a thousand or ten thousand times the direct light.
    room = box(LOW, HIGH, 1 - lost)
    scene = room.scene(lights=(Point("lamp", (1, 1, 1), (59,) * 3),))
    assert room.area.sum() == pytest.approx(59)
    found = np.average(solve(scene, Settings(error=0.1)).irradiance[:, 0], weights=room.area)
    validation("S-10", f"mean H in a closed room, rho {1 - lost:g}", 1 / lost, found, relative=0.01)


def test_a_closed_room_that_absorbs_nothing_is_refused_by_its_materials_name():
    # Rho 1: the light never ends, no solution exists. Outside lies a dark carpet, whose colour is its image's.
    room = quad((9, 0, 0), (1, 0, 0), (0, 1, 0), 1.0) + box(LOW, HIGH, 1.0)
    scene = room.scene(lights=(Point("lamp", (1, 1, 1), (59,) * 3),), material=np.repeat([1, 0], [2, 12]),
                       material_names=("Perfect white", "Carpet"), uv=np.zeros((14, 3, 2)),
                       textures=(Texture(np.full((1, 1, 3), 0.1)),), reflectance_texture=np.repeat([0, -1], [2, 12]))
    with pytest.raises(SceneError, match="material 'Perfect white'"):
        solve(scene, Settings(error=0.1))


def test_an_open_room_that_absorbs_nothing_is_solved(validation):
    # A furnace again: rho 1 and an even sky L = 1 in the opening gives H = pi L everywhere.
    room = box(LOW, HIGH, 1.0)
    lidless = shape(np.delete(room.corners, (2, 3), axis=0), 1.0)
    found = _light(lidless.scene(sky=Sky((1, 1, 1))), *_places())
    for name, value in (("lowest", found.min()), ("highest", found.max())):
        validation("S-10", f"{name} H in an open room, rho 1", np.pi, value, relative=1e-3)


def test_a_dark_room_is_lit_through_its_door_as_path_tracing_says():
    # Two rooms of 3 m, a wall with a door of .9 x 2 m between, a lamp in the first; the second gets what comes
    # through. The answer: the audit's path tracer, independent of patches, with its standard error.
    rho = 0.6
    rooms = (box((0, 0, 0), (6, 3, 2.5), rho) + quad((3, 0, 0), (0, 1.05, 0), (0, 0, 2.5), rho)
             + quad((3, 1.95, 0), (0, 1.05, 0), (0, 0, 2.5), rho) + quad((3, 1.05, 2), (0, 0.9, 0), (0, 0, 0.5), rho))
    scene = rooms.scene(lights=(Point("lamp", (0.8, 0.6, 1.5), (100,) * 3),))
    x, y = (each.reshape(-1) for each in np.meshgrid([3.3, 4.2, 5, 5.8], [0.2, 1, 1.5, 2.2, 2.8]))
    points = np.stack([x, y, 0 * x], axis=1)
    normals = np.broadcast_to(UP, points.shape)
    found = _light(scene, points, normals)
    geometry = Geometry(scene)
    auditor = Auditor(geometry, *light_sources(geometry), 77)
    places = ReceiverFootprints(geometry, probes(scene, points, normals), 0.5, 0)
    groups = auditor.truth(places, np.arange(len(points)), 2**16, Run(2)).groups("both")[..., 0]
    truth = groups.mean(axis=1)
    noise = (groups.var(axis=1, ddof=1) / groups.shape[1]).mean()
    assert np.sqrt(max(np.mean((found - truth) ** 2) - noise, 0)) / truth.mean() < ERROR
    allowed = float(ERROR * truth.mean() + 4 * (noise / len(truth)) ** 0.5)
    assert found.mean() == pytest.approx(truth.mean(), abs=allowed)


@pytest.mark.parametrize("strength", [1e-6, 1e6])
def test_light_of_any_strength_scales(strength, as_it_is):
    # Emission 1e-6 and 1e+6 instead of 1: the same rays, the same light times the factor.
    found = _light(_furnished(exitance=strength).scene(), *_places())
    assert found / strength == pytest.approx(as_it_is, rel=1e-3)


@pytest.mark.parametrize(("word", "value"), [("emission", -1.0), ("emission", np.nan), ("emission", np.inf),
                                             ("reflectance", -0.1), ("reflectance", 1.01), ("reflectance", np.nan)])
def test_light_that_cannot_be_is_refused(word, value):
    # Negative, infinite, not a number, more reflected than came.
    with pytest.raises(SceneError, match=word):
        Scene(np.eye(3), [[0, 1, 2]], **{word: value})


def test_a_symmetric_room_gets_symmetric_light(validation):
    # A lamp in the middle of a 4 x 4 x 2.5 room: eight points of the floor that mirrors and turns carry into another.
    room = box((-2, -2, 0), (2, 2, 2.5), 0.7)
    scene = room.scene(lights=(Point("lamp", (0, 0, 1.5), (100,) * 3),))
    eighth = np.array([1.7, 0.6])
    orbit = np.concatenate([(eighth, eighth[::-1]) * np.array(signs) for signs in ((1, 1), (1, -1), (-1, 1), (-1, -1))])
    points = np.concatenate([np.tile(orbit, (4, 1)), np.zeros((32, 1))], axis=1)
    found = _light(scene, points, np.broadcast_to(UP, points.shape), passes="indirect")
    assert np.std(found) / np.mean(found) < ERROR
    images = found.reshape(4, 8).mean(axis=0) / found.mean()
    for name, value in (("darkest", images.min()), ("brightest", images.max())):
        validation("S-17", f"{name} of eight mirror images over their mean", 1, value, relative=ERROR)


def test_the_light_of_two_lamps_is_the_sum_of_each(as_it_is, validation):
    # A glowing ceiling and a point lamp, together and alone, with equal seeds.
    lamp = Point("lamp", (3, 0.7, 1.5), (30,) * 3)
    both = _light(_furnished().scene(lights=(lamp,)), *_places())
    ceiling = as_it_is
    point = _light(_furnished(exitance=0.0).scene(lights=(lamp,)), *_places())
    assert _differ(ceiling + point, both) < 2**0.5 * ERROR
    validation("S-18", "light of two lamps over the sum of each", 1, both.mean() / (ceiling + point).mean(),
               relative=ERROR / 3)


def test_a_floor_twice_over_is_lit_and_reflects_as_one(as_it_is):
    # Two coplanar floors of the same paint fight for every ray: whoever wins, the light is the same.
    room = _furnished()
    again = quad(LOW, (HIGH[0], 0, 0), (0, HIGH[1], 0), 0.6)
    found = _light((room + again).scene(), *_places())
    assert _differ(found, as_it_is) < 2**0.5 * ERROR


def test_energy_is_kept_where_one_sided_lamps_meet_two_sided_meshes(validation):
    # A closed room with an area lamp (one side), a glowing board (two sides) and a floating board (two sides):
    # what is emitted is absorbed, nothing escapes.
    room = (box(LOW, HIGH, 0.6) + quad((0.5, 0.5, 1.2), (0.8, 0, 0), (0, 0.8, 0), 0.3, 2.0)
            + quad((2.2, 1, 0.9), (1, 0, 0), (0, 1, 0.3), 0.8))
    lamp = Area("lamp", (2, 1.5, 2.2), (0, 0.7, 0), (0.7, 0, 0), (20, 20, 20))
    energy = bake(room.scene(lights=(lamp,)), Settings(error=ERROR, target="vertex")).report["energy"]
    assert energy["escaped"] == 0
    # Both sides of the board: 2 x .64 m2 x 2 W/m2, and the lamp's 20 W.
    validation("S-22", "emitted by an area lamp and a board, W", 20 + 2.56, energy["emitted"], relative=0.01)
    validation("S-22", "absorbed of that, W", 20 + 2.56, energy["absorbed"], relative=0.02)
    assert abs(energy["imbalance"]) < 0.01


def test_a_scene_that_lets_everything_out_keeps_its_energy():
    # Two plates under an even sky: what they get is absorbed or escapes.
    plates = quad((0, 0, 0), (1, 0, 0), (0, 1, 0), 0.8, 1.0) + quad((0, 0, 1), (0, 1, 0), (1, 0, 0), 0.8)
    energy = bake(plates.scene(sky=Sky((0.2, 0.2, 0.2))), Settings(error=ERROR, target="vertex")).report["energy"]
    assert energy["escaped"] > energy["absorbed"] > 0
    assert abs(energy["imbalance"]) < 0.01

"""What a scene and settings take and refuse, and that neither the caller's arrays nor theirs change."""

from __future__ import annotations

import json

import numpy as np
import pytest
from radiosity.solver import (
    NothingToBake,
    Scene,
    SceneError,
    Settings,
    SettingsError,
    Sky,
    Surface,
    Texture,
    bake,
    irradiance,
    solve,
)
from radiosity.solver.lamps import Point
from radiosity.tests.solver.rooms import box

VERTICES = [(0.0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
TRIANGLES = [(0, 1, 2), (0, 2, 3)]
LAMP = Point("lamp", (0.5, 0.5, 0.6), (10, 10, 10))


@pytest.mark.parametrize(("given", "told"), [
    ({"vertices": [(0, 0, 0), (1, 0)]}, "vertices: not an array of numbers"),
    ({"triangles": [(0, 1, 4)]}, "triangles run from 0 to 4: give numbers from 0 to 3"),
    ({"triangles": np.array(TRIANGLES) + 2**32}, "triangles run from 4294967296"),
    ({"triangles": np.array(TRIANGLES) + 0.5}, "give whole numbers"),
    ({"triangles": [(0, 1, 2, 3)]}, r"triangles are int64 \(1, 4\): give whole numbers \(t, 3\)"),
    ({"reflectance": "white"}, "reflectance: not an array of numbers"),
    ({"opacity": (1, 1, 1)}, "opacity has shape"),
    ({"seen": (True,) * 5}, "seen has shape"),
    ({"material": (0, 0, 0), "material_names": ("wall",)}, "material are int64"),
    ({"material": (0, 0), "material_names": (), "reflectance": 1.2}, "material run from 0 to 0"),
    ({"sky": (1, 1, 1)}, "give a Sky"),
    ({"surfaces": (Surface("far", 5, 2),)}, "object 'far' has 2 triangles from 5"),
    ({"surfaces": (Surface("one", 0, 1), Surface("other", 0, 1))}, "object 'other' has 1 triangles from 0"),
    ({"surfaces": (Surface("one", 0, 1),)}, "the surfaces cover 1 of 2 triangles"),
])
def test_what_no_scene_can_be_made_of_is_told(given, told):
    with pytest.raises(SceneError, match=told):
        Scene(**{"vertices": VERTICES, "triangles": TRIANGLES, **given})


@pytest.mark.parametrize("given", [{"density": 0.0}, {"density": np.nan}, {"corner_ids": np.zeros((5, 3), int)}])
def test_what_no_surface_can_be_made_of_is_told(given):
    with pytest.raises(SceneError, match="object 'wall'"):
        Surface("wall", 0, 2, **given)


def test_neither_the_callers_arrays_nor_the_scenes_change():
    # Arrays of just the type that is kept: the caller may write into his all the same, and the scene stays as it was.
    given = {"uv": np.zeros((2, 3, 2), np.float32), "corner_normals": np.ones((2, 3, 3), np.float32),
             "material": np.zeros(2, np.int32)}
    scene = Scene(VERTICES, TRIANGLES, material_names=("wall",), **given)
    texture = Texture(pixels := np.ones((2, 2, 3), np.float32))
    pixels[:] = 1
    for name, array in given.items():
        before = getattr(scene, name).copy()
        array[:] = -1
        assert np.array_equal(getattr(scene, name), before)
    for kept in (*(getattr(scene, name) for name in given), texture.pixels):
        with pytest.raises(ValueError, match="read-only"):
            kept[:] = 0


@pytest.mark.parametrize("given", [{"resolution": 64.5}, {"seed": 1.5}, {"margin": True}, {"error": "low"},
                                   {"only": "Room"}, {"threads": None}])
def test_settings_that_make_no_sense_are_told(given):
    with pytest.raises(SettingsError, match=next(iter(given))):
        Settings(**given)


def test_numbers_of_numpy_are_numbers():
    # As Python's own, in the report too.
    settings = Settings(resolution=np.int64(64), error=np.float32(0.25), seed=np.uint8(3))
    assert settings == Settings(resolution=64, error=0.25, seed=3)
    assert json.loads(json.dumps(settings.as_dict()))["resolution"] == 64


def test_no_points_get_no_light():
    for points in ([], np.zeros((0, 3))):
        assert irradiance(box((0, 0, 0), (1, 1, 1)).scene(lights=(LAMP,)), Settings(), points, points).shape == (0, 3)


@pytest.mark.parametrize("corners", [np.zeros((0, 3)), np.zeros((3, 3))])
def test_a_scene_without_area_is_told(corners):
    scene = Scene(corners, np.arange(len(corners)).reshape(-1, 3), lights=(LAMP,), sky=Sky((1, 1, 1)))
    for work in (lambda: solve(scene, Settings()), lambda: bake(scene, Settings()),
                 lambda: irradiance(scene, Settings(), [(0, 0, 1)], [(0, 0, 1)])):
        with pytest.raises(NothingToBake):
            work()


@pytest.mark.parametrize("far", [1e5, 1e7])
def test_an_object_far_away_takes_no_digits_from_the_others(far):
    # A room of three objects, of 1 m, and a cube so many metres away: the same light without it, to the wanted error.
    room, cube = box((0, 0, 0), (1, 1, 1)), box((far, 0, 0), (far + 1, 1, 1), inward=False)
    surfaces = tuple(Surface(f"walls {number}", 4 * number, 4) for number in range(3))
    both = (room + cube).scene(lights=(LAMP,), surfaces=(*surfaces, Surface("far", 12, 12, receives=False)))
    alone = room.scene(lights=(LAMP,), surfaces=surfaces)
    settings = Settings(error=0.03, resolution=48)
    found, right = (bake(scene, settings).lightmaps[0].pixels for scene in (both, alone))
    assert found.shape == right.shape
    assert np.sqrt(np.mean((found - right) ** 2)) < 0.03 * right.mean()


@pytest.mark.parametrize("far", [1e3, 1e5, 1e7])
def test_an_object_far_away_moves_no_probe(far):
    # A lamp in a black room, and a cube so many metres away. Exact answer: probes on the floor, on a wall and in the
    # air get flux / (4 pi distance^2), which shows a millimetre in 20 cm as 1 %.
    room = box((0, 0, 0), (1, 1, 1), reflectance=0.0)
    away = box((far, 0, 0), (far + 1, 1, 1), inward=False)
    lamp = Point("lamp", (0.5, 0.5, 0.2), (1, 1, 1))
    points, normals = [(0.5, 0.5, 0.0), (0.0, 0.5, 0.2), (0.5, 0.5, 0.1)], [(0, 0, 1), (1, 0, 0), (0, 0, 1)]
    both = (room + away).scene(lights=(lamp,), surfaces=(Surface("room", 0, 12), Surface("far", 12, 12)))
    found = irradiance(both, Settings(), points, normals)
    right = [1 / (4 * np.pi * distance**2) for distance in (0.2, 0.5, 0.1)]
    assert found[:, 0] == pytest.approx(right, rel=1e-3)

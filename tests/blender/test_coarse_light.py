"""The light of a first look: all bounces, on fronts and backs, against exact answers and the bake's own way."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import reduce

import numpy as np
import pytest
from radiosity import solver
from radiosity.radiosity_addon.first_look import Shapes, first_look
from radiosity.radiosity_addon.look import look_at as look_at_bake
from radiosity.solver.area_lamp import Area
from radiosity.solver.bake import bake, irradiance
from radiosity.solver.scene import Scene, Surface
from radiosity.solver.settings import Settings
from radiosity.tests.solver.rooms import Shape, quad
from radiosity.tests.solver.rooms import box as room_box

# A box of 2 m, two triangles a wall, whose fronts face inwards.
CORNERS = 2.0 * np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)])
WALLS = [[0, 1, 2, 3], [4, 5, 6, 7], [0, 1, 4, 5], [2, 3, 6, 7], [0, 2, 4, 6], [1, 3, 5, 7]]


def inwards(corners: np.ndarray) -> np.ndarray:
    """(t,) whether triangles (t, 3, 3) face the middle of the box."""
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return np.asarray(np.einsum("ij,ij->i", normals, 1.0 - corners.mean(axis=1)) > 0)


BOX = [corners for wall in WALLS for corners in ([wall[0], wall[1], wall[2]], [wall[1], wall[3], wall[2]])]
BOX = [corners if facing else corners[::-1] for corners, facing in zip(BOX, inwards(CORNERS[BOX]), strict=True)]


def box(triangles: list[list[int]] = BOX, **more: object) -> Scene:
    return Scene(vertices=CORNERS, triangles=np.array(triangles), **more)


def look_at(scene: Scene, settings: Settings | None = None):
    return first_look(Shapes(scene), (scene.sky, ()), settings or Settings(), lambda: False)


@pytest.mark.parametrize(("passes", "exact"), [("both", 5.0), ("direct", 1.0), ("indirect", 4.0)])
def test_a_furnace_has_the_same_light_everywhere(passes, exact):
    # A closed box, every wall of reflectance .8 and exitance 1, which is shown too. Exact answer: H = 1 / (1 - .8)
    # everywhere; of that 1 comes straight.
    look = look_at(box(reflectance=0.8, emission=1.0), Settings(passes=passes))
    assert (look.colour * math.pi - 1) / 0.8 == pytest.approx(exact, rel=2e-3)


def test_backs_reflect_too():
    # The furnace with every other wall turned round: fronts that face outwards see a black sky. Exact answer: as in the
    # furnace on the fronts that face inwards, nothing on the others.
    turned = [corners if index % 4 < 2 else corners[::-1] for index, corners in enumerate(BOX)]
    look = look_at(box(turned, reflectance=0.5, emission=1.0))
    facing = inwards(look.corners)
    reflected = look.colour * math.pi - 1
    assert reflected[facing] / 0.5 == pytest.approx(2.0, rel=2e-3)
    assert reflected[~facing] == pytest.approx(0.0, abs=1e-6)


def test_a_room_with_a_lamp_looks_as_it_will_be_baked():
    # A box with a lamp of .5 m under its ceiling. No closed form; against the bake's own way at the same places: the
    # mean to 3 %, each place to 10 % of it (RMS).
    lamp = Area("lamp", np.array([1.0, 1.0, 1.9]), np.array([0.5, 0, 0]), np.array([0, -0.5, 0]), np.full(3, 10.0))
    room = box(reflectance=0.6, lights=(lamp,))
    look = look_at(room)
    points = look.corners.mean(axis=1)
    normals = np.cross(look.corners[:, 1] - look.corners[:, 0], look.corners[:, 2] - look.corners[:, 0])
    expected = irradiance(room, Settings(error=0.03), points, normals)[:, 0]
    found = look.colour.mean(axis=(1, 2)) * math.pi / 0.6
    assert found.mean() == pytest.approx(expected.mean(), rel=0.03)
    assert np.sqrt(((found - expected) ** 2).mean()) < 0.1 * expected.mean()


def test_what_is_not_baked_reflects_but_is_not_shown():
    # The furnace of which one wall alone is baked. Exact answer: its light is that of the whole furnace.
    walls = (Surface("wall", 0, 2), Surface("others", 2, 10, receives=False))
    look = look_at(box(reflectance=0.5, emission=1.0, surfaces=walls))
    assert (look.corners[:, :, 2] == 0).all()
    assert (look.colour * math.pi - 1) / 0.5 == pytest.approx(2.0, rel=2e-3)


def test_a_ceiling_whose_corners_stick_into_walls_is_lit_up_to_them():
    # A room of 4 m x 4 m x 3 m: a floor of exitance 1, four solid walls of .5 m, and a ceiling of two triangles over
    # all of it, so that its corners lie inside the walls. Exact: straight from the floor comes least into the room's
    # upper corners, the form factor of a 4 m square seen from 3 m above its corner. To 10 %, as the rays are few.
    blocks = [((-2.5, -2.5), (-2, 2.5)), ((2, -2.5), (2.5, 2.5)), ((-2, -2.5), (2, -2)), ((-2, 2), (2, 2.5))]
    walls = reduce(Shape.__add__, (room_box((*low, 0), (*high, 3.1), inward=False) for low, high in blocks))
    ceiling = quad((-2.5, -2.5, 3), (0, 5, 0), (5, 0, 0), reflectance=0.5)
    room = (ceiling + quad((-2, -2, 0), (4, 0, 0), (0, 4, 0), emission=1.0) + walls).scene()
    look = look_at(room)
    shown = np.isclose(look.corners[:, :, 2], 3).all(axis=1)
    ratio = 4 / 3
    corner = ratio / math.hypot(1, ratio) * math.atan(ratio / math.hypot(1, ratio)) / math.pi
    assert shown.sum() > 100
    assert (look.colour[shown] * math.pi / 0.5).min() > 0.9 * corner


def test_a_scene_without_light_is_refused():
    with pytest.raises(solver.errors.NothingToBake, match="no light"):
        look_at(box())


def test_a_draft_of_what_glows_has_its_light_at_the_corners():
    # A furnace of reflectance .5 and exitance 1 but for one wall, which is black and dark. Exact: what glows has no
    # page and is 1 / pi brighter than what it reflects of the light that was baked there; the dark wall has its page.
    emission = np.where(np.arange(12) < 2, 0.0, 1.0)[:, None] * np.ones(3)
    room = box(reflectance=0.5, emission=1.0)
    room = replace(room, emission=np.asarray(emission, np.float32))
    baked = bake(room, Settings(error=0.1, resolution=64))
    look = look_at_bake(room, baked, "irradiance", "draft")
    assert sorted(look.page) == [-1] * 10 + [0] * 2
    assert (np.diff(look.page) >= 0).all()
    glowing = look.page < 0
    light = (look.colour[glowing] * math.pi - 1) / 0.5
    assert light.mean() == pytest.approx(baked.lightmaps[0].pixels[baked.lightmaps[0].pixels > 0].mean(), rel=0.1)
    assert look.colour[~glowing] == pytest.approx(0.5 / math.pi)

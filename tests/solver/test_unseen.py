"""Lumels inside other solids and under touching faces show what is beside them, and nothing shines through."""

from __future__ import annotations

import numpy as np
import pytest
from radiosity.solver import Settings, Sky, Surface, bake
from radiosity.solver.unseen import stand_ins
from radiosity.tests.solver.rooms import box, quad, shape

SIDE, RINGS = 64, 4


def _floor_with(solid, margin):
    """The light (64, 64) on a floor of 4 x 4 m about the origin, with a box, under an even sky."""
    return _lightmap(solid, margin).pixels.mean(axis=2)


def _lightmap(solid, margin):
    floor = quad((-2, -2, 0), (4, 0, 0), (0, 4, 0))
    uv = (floor.corners[:, :, :2] + 2) / 4
    count = len(solid.corners)
    surfaces = (Surface("floor", 0, 2, lightmap_uv=uv), Surface("box", 2, count, receives=False))
    scene = (floor + solid).scene(sky=Sky((1, 1, 1)), surfaces=surfaces)
    made = bake(scene, Settings(error=0.1, resolution=SIDE, margin=margin, uv_layer="UV", quantity="irradiance"))
    return made.lightmaps[0]


@pytest.mark.parametrize("depth", [0.0, 0.7])
def test_the_floor_inside_a_solid_shows_the_light_beside_it(depth):
    # A box of 1 x 1 m stands on the floor, or sticks in it: 16 x 16 texels that nobody sees, dark without a margin. A
    # margin grows over four rings of them, and changes no other texel.
    solid = box((-0.5, -0.5, -depth), (0.5, 0.5, 1), inward=False)
    bare, grown = _floor_with(solid, 0), _lightmap(solid, RINGS)
    hidden, grown = grown.hidden, grown.pixels.mean(axis=2)
    inside = slice(SIDE // 2 - 8, SIDE // 2 + 8)
    assert bare[inside, inside].max() <= 0.01 * bare.mean()
    changed = np.zeros((SIDE, SIDE), bool)
    changed[inside, inside] = True
    core = slice(SIDE // 2 - 8 + RINGS, SIDE // 2 + 8 - RINGS)
    changed[core, core] = False
    assert np.array_equal(hidden, changed)
    assert np.array_equal(bare[~changed], grown[~changed])
    beside = bare[SIDE // 2, SIDE // 2 - 9]
    assert np.abs(grown[SIDE // 2, SIDE // 2 - 8:SIDE // 2 - 8 + RINGS] - beside).max() < 0.15 * beside
    # Half of the sky at the foot of a wall, and what the wall sends back.
    assert beside == pytest.approx(np.pi * (0.5 + 0.25), rel=0.25)


def test_a_room_whose_walls_face_outward_is_baked_as_it_is():
    # Rays of its floor meet backs alone, but a lamp's worth of light is there: nothing is filled.
    room = box((-1.9, -1.9, -0.1), (1.9, 1.9, 2), emission=(0, 1, 0, 0, 0, 0), inward=False)
    lit_from_behind = room + quad((-1, -1, 1.5), (0, 2, 0), (2, 0, 0), emission=3.0)
    assert np.array_equal(_floor_with(lit_from_behind, 0), _floor_with(lit_from_behind, RINGS))


def test_what_an_open_surface_shuts_off_keeps_its_dim_light():
    # A box without a bottom hangs two centimetres above the floor: all rays from under it meet backs, but for one in
    # thousands, and what comes through the gap is a hundredth or two of the mean. It is light all the same: a renderer
    # shows it, so that filling it would be an error of the whole mean.
    hood = shape(box((-0.5, -0.5, 0.02), (0.5, 0.5, 1), inward=False).corners[2:])
    bare, grown = (_floor_with(hood, margin) for margin in (0, RINGS))
    inside = slice(SIDE // 2 - 6, SIDE // 2 + 6)
    assert bare[inside, inside].max() > 0
    assert bare[inside, inside].mean() < 0.02 * bare.mean()
    assert np.array_equal(bare, grown)


def test_stand_ins_are_the_darkest_beside_and_reach_so_many_rings():
    # Lumels in a row: bright, three unseen, dark. One ring: the outer two show their neighbours; two: the middle one
    # shows the dark side, though the bright one is as near.
    light = np.repeat(np.float32([9, 0, 0, 0, 1])[:, None], 3, axis=1)
    seen = np.array([True, False, False, False, True])
    around = np.full((5, 8), -1, np.int32)
    around[1:, 0], around[:-1, 1] = np.arange(4), np.arange(1, 5)
    assert stand_ins(seen, light, around, 0).tolist() == [0, 1, 2, 3, 4]
    assert stand_ins(seen, light, around, 1).tolist() == [0, 0, 2, 4, 4]
    assert stand_ins(seen, light, around, 2).tolist() == [0, 0, 4, 4, 4]


def test_where_nothing_is_seen_nothing_is_filled():
    around = np.array([[1] + [-1] * 7, [0] + [-1] * 7], np.int32)
    assert stand_ins(np.zeros(2, bool), np.ones((2, 3), np.float32), around, 8).tolist() == [0, 1]

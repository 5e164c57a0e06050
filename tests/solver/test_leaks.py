"""No light gets where it can't: closed boxes, rooms side by side, walls without thickness, faces on faces."""

from __future__ import annotations

from dataclasses import replace
from functools import reduce

import numpy as np
import pytest
from radiosity import solver
from radiosity.solver import Settings
from radiosity.solver.lamps import Sun
from radiosity.solver.lumels import lumels
from radiosity.solver.scene import Sky, Surface
from radiosity.tests.solver.rooms import EAST, FLOOR, WEST, Shape, box, quad

SETTINGS = Settings(error=0.1, resolution=96, margin=2)
LEAK = 1e-4
BRIGHT = Sky(np.full(3, 1000.0))
# Turned so that nothing lies along an axis: boxes of the octree then cross every wall.
ANGLE, TILT = 0.37, 1.1
TURN = (np.array([[np.cos(ANGLE), -np.sin(ANGLE), 0], [np.sin(ANGLE), np.cos(ANGLE), 0], [0, 0, 1]])
        @ np.array([[1, 0, 0], [0, np.cos(TILT), -np.sin(TILT)], [0, np.sin(TILT), np.cos(TILT)]]))
SUN = Sun("sun", np.array([0, 0, -1.0]), np.ones(3), 0.01)
LAMP = quad((-2, 0.5, 1.9), (0, 1, 0), (1, 0, 0), 0.5, 20.0)


def _without(room: Shape, wall: int) -> Shape:
    keep = np.arange(12) // 2 != wall
    return Shape(room.corners[keep], room.reflectance[keep], room.emission[keep])


def _baked(scene, settings=SETTINGS):
    """Where the lumels lie (n, 3), the way they face, and their red channel."""
    bake, laid = solver.bake(scene, settings), lumels(scene, settings, [])
    values = np.concatenate([np.asarray(image.pixels).reshape(-1, 3)[laid.pixel[laid.page == page], 0]
                             for page, image in enumerate(bake.lightmaps)])
    order = np.argsort(laid.page, kind="stable")
    return (laid.receivers.position + scene.origin)[order], laid.receivers.normal[order], values


@pytest.mark.parametrize("place", [(0, 0, 0), (800, -300, 50)])
def test_a_closed_box_in_a_bright_world_is_exactly_black_inside(place):
    # A box that faces inward under a sky of 1,000 W/(m2 sr), turned, and far from the origin. Exact answer: 0.
    room = box((0, 0, 0), (3, 2, 2.5)).moved(TURN, place)
    _, _, values = _baked(room.scene(sky=BRIGHT))
    assert len(values) > 1000
    assert not values.any()


def test_the_inside_of_a_box_with_thick_walls_is_exactly_black_and_its_outside_bright():
    # The same in a box 10 cm larger that faces outward, two objects. Exact answer: 0 inside, 1,000 outside.
    both = (box((0, 0, 0), (3, 2, 2.5)) + box((-.1, -.1, -.1), (3.1, 2.1, 2.6), inward=False)).moved(TURN)
    scene = both.scene(sky=BRIGHT, surfaces=(Surface("inside", 0, 12), Surface("outside", 12, 12)))
    places, _, values = _baked(scene)
    own = places @ TURN
    inside = ((own > -.05) & (own < (3.05, 2.05, 2.55))).all(axis=1)
    assert inside.any()
    assert not values[inside].any()
    assert values[~inside] == pytest.approx(1000, rel=1e-3)


def _two_rooms(kind: str) -> Shape:
    """A lit room at x < 0 and a dark one at x > 0."""
    left, right = box((-3, 0, 0), (0, 2, 2)), box((0, 0, 0), (3, 2, 2))
    wall = quad((0, 0, 0), (0, 2, 0), (0, 0, 2))
    return {
        "one plane": _without(left, EAST) + _without(right, WEST) + wall,
        "back to back": left + right,
        "a thick wall": left + box((.2, 0, 0), (3, 2, 2)),
    }[kind] + LAMP


@pytest.mark.parametrize(("kind", "objects"), [
    ("one plane", False), ("one plane", True), ("back to back", True), ("a thick wall", True)])
def test_nothing_gets_from_a_lit_room_into_the_dark_one_beside_it(kind, objects):
    # Two rooms with a wall between them, as one mesh or as one object a wall, turned. Exact answer: 0 in the dark one,
    # its side of the wall included.
    rooms = _two_rooms(kind).moved(TURN)
    parts = tuple(Surface(f"part {k}", 2 * k, 2) for k in range(len(rooms.corners) // 2)) if objects else ()
    places, normals, values = _baked(rooms.scene(surfaces=parts))
    own, facing = places @ TURN, (normals @ TURN)[:, 0]
    on_the_wall = np.abs(own[:, 0]) < 1e-3
    dark = (own[:, 0] > 1e-3) | (on_the_wall & (facing > .5))
    assert dark.sum() > 500
    assert values[dark].max() < LEAK * values[~dark].mean()
    if kind == "back to back":  # faces that touch back to back hide nothing from each other's rooms
        assert values[on_the_wall & (facing < -.5)].min() > .05


def test_no_chart_goes_on_under_a_wall():
    # The two rooms with one plane between them as one mesh, and the same without the plane. Exact answer: no chart has
    # lumels in both rooms; without the wall the floors are one chart.
    for wall, spans in ((True, False), (False, True)):
        rooms = _without(box((-3, 0, 0), (0, 2, 2)), EAST) + _without(box((0, 0, 0), (3, 2, 2)), WEST)
        rooms = rooms + quad((0, 0, 0), (0, 2, 0), (0, 0, 2)) if wall else rooms
        scene = rooms.scene()
        laid = lumels(scene, SETTINGS, [])
        x = laid.receivers.position[:, 0] + scene.origin[0]
        left, right = set(laid.chart[x < -1e-3].tolist()), set(laid.chart[x > 1e-3].tolist())
        assert bool(left & right) == spans


def test_a_wall_without_thickness_is_lit_on_the_side_that_is_lit():
    # Two squares back to back under a sun that shines straight down with 1 W/m2. Exact answer: 1 / pi on the one that
    # faces up, 0 on the one that faces down.
    floor = quad((-1, -1, 0), (2, 0, 0), (0, 2, 0))
    under = quad((-1, -1, 0), (0, 2, 0), (2, 0, 0))
    scene = (floor + under).scene(surfaces=(Surface("up", 0, 2), Surface("down", 2, 2)), lights=(SUN,))
    places, normals, values = _baked(scene)
    on_it = np.abs(places[:, 2]) < 1e-3
    up, down = on_it & (normals[:, 2] > .5), on_it & (normals[:, 2] < -.5)
    assert values[up] == pytest.approx(1 / np.pi, rel=1e-3)
    assert not values[down].any()


def test_a_second_copy_of_a_floor_changes_nothing():
    # A floor under the same sun, once and twice in the same place, as one object. Exact answer: 1 / pi everywhere.
    floor = quad((-1, -1, 0), (2, 0, 0), (0, 2, 0))
    for copies in (1, 2):
        shapes = reduce(Shape.__add__, [floor] * copies)
        count = len(shapes.corners)
        _, _, values = _baked(shapes.scene(surfaces=(Surface("floor", 0, count),), lights=(SUN,)))
        assert values == pytest.approx(1 / np.pi, rel=1e-3)


def test_lumels_under_a_box_are_black_and_do_not_darken_those_beside_it():
    # A box of 1 m stands on a floor of 4 m under a sky of 1. Exact answer under it: 0 (a margin would grow over it).
    # Beside the box, half a texel away, half the sky is seen; in the open, far from it, nearly all.
    scene = (quad((-2, -2, 0), (4, 0, 0), (0, 4, 0)) + box((-.5, -.5, 0), (.5, .5, 1), 0.0, inward=False)).scene(
        sky=Sky(np.ones(3)), surfaces=(Surface("floor", 0, 2), Surface("box", 2, 12, receives=False)))
    places, _, values = _baked(scene, replace(SETTINGS, margin=0))
    texel = 4 / np.sqrt(len(values))
    distance = np.maximum(np.abs(places[:, 0]), np.abs(places[:, 1])) - .5
    assert not values[distance < -texel].any()
    beside = (distance > texel / 2) & (distance < 2 * texel) & (np.abs(places[:, :2]).min(axis=1) < .3)
    assert values[beside].min() > 0.4
    assert values[distance > 1.4].min() > 0.9


def test_a_smooth_ball_has_no_stripes_at_its_terminator():
    # A coarse ball, smooth shading, lit by a sun from one side: along a meridian the light falls from 1 to 0 without
    # ever rising by more than the error asked for. (Rays that start on flat faces shade themselves there in stripes.)
    segments, rings = 16, 8
    polar, azimuth = np.linspace(0, np.pi, rings + 1), np.linspace(0, 2 * np.pi, segments + 1)
    point = np.stack([np.outer(np.cos(polar), np.ones(segments + 1)), np.outer(np.sin(polar), np.cos(azimuth)),
                      np.outer(np.sin(polar), np.sin(azimuth))], axis=-1)
    a, b, c, d = point[:-1, :-1], point[1:, :-1], point[1:, 1:], point[:-1, 1:]
    corners = np.concatenate([np.stack([a, b, c], axis=2)[:-1].reshape(-1, 3, 3),
                              np.stack([a, c, d], axis=2)[1:].reshape(-1, 3, 3)])
    normals = corners / np.linalg.norm(corners, axis=2, keepdims=True)
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert ((cross * corners.mean(axis=1)).sum(axis=1) > 0).all()
    ball = Shape(corners, np.zeros(len(corners)), np.zeros(len(corners)))
    scene = ball.scene(corner_normals=normals.astype(np.float32),
                       lights=(Sun("sun", np.array([-1.0, 0, 0]), np.ones(3), 0.01),))
    _, shading, values = _baked(scene)
    lit = np.pi * values
    # The exact answer of a smooth ball is the cosine to the sun; near the terminator facets of 22 degrees may cut off
    # what is below half a facet's turn.
    expected = np.maximum(shading[:, 0], 0)
    steep = np.sin(np.pi / rings / 2)
    assert lit[expected > steep] == pytest.approx(expected[expected > steep], abs=0.05)
    assert (lit <= expected + 0.05).all()


def test_a_lit_floor_is_black_inside_the_hollow_legs_that_stand_on_it():
    # Legs of 30 cm, open below, on a floor of 2 m in the sun: cells of the floor, of about 10 cm, go on under them.
    # Exact answer inside a leg: 0 (the filter's seven texels beside lumels that are half outside left out).
    def leg(x, y):
        return _without(box((x, y, 0), (x + 0.3, y + 0.3, 0.9), 0.8, inward=False), FLOOR)

    floor = quad((0, 0, 0), (2, 0, 0), (0, 2, 0), 0.8)
    wall = quad((2, 0, 0), (0, 0, 2), (0, 2, 0), 0.8)
    legs = [leg(x, y) for x in (0.33, 1.31) for y in (0.27, 1.37)]
    shapes = reduce(Shape.__add__, legs, floor + wall)
    sun = Sun("sun", np.array([1, 0.2, -2.0]) / np.sqrt(5.04), np.ones(3), 0.01)
    scene = shapes.scene(lights=(sun,), surfaces=(Surface("floor", 0, 2),
                                                  Surface("rest", 2, len(shapes.corners) - 2, receives=False)))
    places, _, values = _baked(scene, replace(SETTINGS, margin=0, resolution=192))
    texel = 2 / np.sqrt(len(values))
    middles = np.array([one.corners.reshape(-1, 3).min(axis=0)[:2] + 0.15 for one in legs])
    distance = np.abs(places[:, None, :2] - middles).max(axis=2).min(axis=1) - 0.15
    inside = distance < -8 * texel
    assert inside.sum() > 200
    assert values[inside].max() <= LEAK * values.max()
    assert values[distance > texel].min() > 0.01

"""Faults of meshes: each is found where it is, and nothing is found where it is not."""

from __future__ import annotations

import numpy as np
import pytest
from radiosity.solver.geometry import Geometry
from radiosity.solver.mesh_faults import ALIKE, find_faults, inward, lying_on
from radiosity.solver.scene import Surface
from radiosity.tests.solver.rooms import box, quad, sphere_cap

BOX = box((0, 0, 0), (1, 1, 1), inward=False)


def faults(shape):
    return find_faults(shape.scene())


@pytest.mark.parametrize("shape", [BOX, quad((0, 0, 0), (1, 0, 0), (0, 1, 0)), sphere_cap(2.0, 6, 12)])
def test_a_clean_mesh_has_no_faults(shape):
    # A box, a square, a bowl. Exact answer: nothing.
    found = faults(shape)
    assert (found.turned[0], found.crowded[0], found.doubled[0], found.partner[0]) == (0, 0, 0, -1)


def test_a_face_that_is_turned_over_is_found_by_its_edges():
    # One of the box's twelve triangles runs the other way round. Exact answer: its three edges.
    corners = BOX.corners.copy()
    corners[3] = corners[3, ::-1]
    turned = type(BOX)(corners, BOX.reflectance, BOX.emission)
    assert faults(turned).turned[0] == 3


def test_a_wall_inside_a_box_has_edges_of_three_faces():
    # A square on the diagonal of a box, whose two long edges are edges of the box, and the short ones not.
    # Exact answer: the edges x = y = 0 and x = y = 1 of the box have three faces each.
    wall = quad((0, 0, 0), (1, 1, 0), (0, 0, 1))
    assert faults(BOX + wall).crowded[0] >= 2
    assert faults(BOX + wall.moved(1.0, (5, 0, 0))).crowded[0] == 0


def test_faces_in_one_place_are_found_with_their_partner():
    # A floor, the same again as another object, and a floor below. Exact answer: two triangles each of the first two.
    floor = quad((0, 0, 0), (1, 0, 0), (0, 1, 0))
    three = floor + floor + floor.moved(1.0, (0, 0, -1))
    scene = three.scene(surfaces=tuple(Surface(name, 2 * k, 2) for k, name in enumerate("abc")))
    found = find_faults(scene)
    assert found.doubled.tolist() == [2, 2, 0]
    assert found.partner.tolist() == [1, 0, -1]


def test_a_box_on_a_floor_is_no_doubled_face():
    # Its bottom lies on the floor and faces it. Exact answer: nothing.
    floor = quad((-1, -1, 0), (3, 0, 0), (0, 3, 0))
    assert not faults(floor + BOX).doubled.any()


def test_a_two_sided_wall_is_no_doubled_face():
    # Two squares back to back. Exact answer: nothing, as each faces its own side.
    wall = quad((0, 0, 0), (1, 0, 0), (0, 1, 0)) + quad((0, 0, 0), (0, 1, 0), (1, 0, 0))
    assert not faults(wall).doubled.any()


def test_places_that_a_part_of_another_face_lies_on_are_told():
    # A floor of a square metre, on it a strip from x = .6 on that faces as it does, and one up to x = .3 that faces the
    # other way. Exact answer: the strip's triangles, and how they face; nothing between the two.
    shapes = quad((0, 0, 0), (1, 0, 0), (0, 1, 0)) + quad((0.6, 0.1, 0), (0.3, 0, 0), (0, 0.8, 0)) + quad(
        (0.05, 0.1, 0), (0, 0.8, 0), (0.25, 0, 0))
    geometry = Geometry(shapes.scene())
    places = np.array([(x, y, 0) for x in (0.1, 0.2, 0.45, 0.7, 0.8) for y in (0.15, 0.4, 0.85)])
    triangle = np.where(places[:, 0] > places[:, 1], 0, 1)
    places = (places - geometry.scene.origin).astype(np.float32)
    on_it, facing = lying_on(geometry, triangle, places, np.arange(6))
    kind = np.repeat([2, 2, 0, 1, 1], 3)
    assert (np.where(on_it < 0, 0, on_it // 2) == kind).all()
    assert (facing[kind == 1] > ALIKE).all()
    assert (facing[kind == 2] < -ALIKE).all()
    assert (lying_on(geometry, triangle, places, np.array([0, 1, 4, 5]))[0][kind == 1] == -1).all()


def test_what_faces_the_wrong_way_is_told_by_what_is_inside():
    # Boxes: outward and empty, inward and empty, inward with a lamp, outward with a lamp.
    # Exact answer: the second is hollow, the lamp of the fourth is inside a box that faces outward.
    room = box((0, 0, 0), (1, 1, 1))
    boxes = BOX + room.moved(1.0, (2, 0, 0)) + room.moved(1.0, (4, 0, 0)) + BOX.moved(1.0, (6, 0, 0))
    scene = boxes.scene(surfaces=tuple(Surface(f"box {k}", 12 * k, 12) for k in range(4)))
    hollow, around = inward(scene, np.array([[4.3, 0.4, 0.6], [6.3, 0.4, 0.6], [0.5, 0.5, 7.0]]))
    assert hollow.tolist() == [False, True, False, False]
    assert around.tolist() == [-1, 3, -1]

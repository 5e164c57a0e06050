"""Points under a face that lies on theirs."""

from __future__ import annotations

import numpy as np
import pytest
from radiosity.solver.buried import Buried
from radiosity.solver.geometry import Geometry
from radiosity.tests.solver.rooms import box, quad

FLOOR = quad((-2, -2, 0), (4, 0, 0), (0, 4, 0))
X = np.array([-1.5, -0.6, -0.4, 0.0, 0.4, 0.6, 1.5], np.float32)


def _hidden_on_the_floor(scene, height=0.0):
    """Which of the points (X, .1, height) of the floor's first two triangles are hidden."""
    points = np.stack([X, np.full_like(X, 0.1), np.full_like(X, height)], axis=1)
    triangle = np.where(points[:, 0] > points[:, 1], 0, 1)
    return Buried(Geometry(scene)).find(points, triangle)


@pytest.mark.parametrize("scale", [1e-2, 1.0, 1e2])
def test_the_floor_under_a_box_is_hidden_and_beside_it_is_not(scale):
    # A box of 1 m stands exactly on the floor z = 0, over |x| < .5.
    scene = (FLOOR + box((-0.5, -0.5, 0), (0.5, 0.5, 1), inward=False)).moved(scale).scene()
    geometry = Geometry(scene)
    points = np.stack([X, np.full_like(X, 0.1), np.full_like(X, 0)], axis=1) * np.float32(scale)
    points = points - scene.origin.astype(np.float32)
    hidden = Buried(geometry).find(points, np.where(X > 0.1, 0, 1))
    assert hidden.tolist() == (np.abs(X) < 0.5).tolist()


def test_a_box_that_hovers_by_a_millimetre_hides_nothing():
    # Light can reach the floor through the gap.
    scene = (FLOOR + box((-0.5, -0.5, 1e-3), (0.5, 0.5, 1), inward=False)).scene()
    middle = scene.origin[2]
    assert not _hidden_on_the_floor(scene, -middle).any()


def test_a_face_that_looks_the_same_way_hides_nothing():
    # Two floors in one plane, both facing up: either sees the sky.
    scene = (FLOOR + quad((-0.5, -0.5, 0), (1, 0, 0), (0, 1, 0))).scene()
    assert not _hidden_on_the_floor(scene).any()


def test_a_face_on_the_back_hides_nothing():
    # A slab hangs under the floor: its top faces up like the floor, its bottom is far away.
    scene = (FLOOR + box((-0.5, -0.5, -1), (0.5, 0.5, 0), inward=False)).scene()
    assert not _hidden_on_the_floor(scene, -scene.origin[2]).any()


def test_a_face_that_leans_hides_nothing():
    # A plate that rises from the floor at 5 degrees faces down, but lets light in.
    lean = np.radians(5)
    plate = quad((-0.5, -0.5, 0), (0, 1, 0), (np.cos(lean), 0, np.sin(lean)))
    scene = (FLOOR + plate).scene()
    assert plate.normal[0, 2] < 0
    assert not _hidden_on_the_floor(scene, -scene.origin[2]).any()


def test_faces_back_to_back_hide_nothing():
    # A floor and the same square facing down in the same place, as the two sides of one plate: above either is open.
    scene = (FLOOR + quad((-2, -2, 0), (0, 4, 0), (4, 0, 0))).scene()
    assert not _hidden_on_the_floor(scene).any()


def test_rooms_back_to_back_hide_nothing_from_each_other():
    # Two boxes that face inward share the plane z = 0, which is the floor of the upper one: it is lit from there.
    scene = (box((-2, -2, 0), (2, 2, 2)) + box((-2, -2, -2), (2, 2, 0))).scene()
    assert not _hidden_on_the_floor(scene).any()

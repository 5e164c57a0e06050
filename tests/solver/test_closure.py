"""Figures of patches: row sums, back faces, energy, owners; and which points lie inside a closed object."""

from __future__ import annotations

import numpy as np
import pytest
from radiosity.solver import Settings, Surface, bake
from radiosity.solver.inside import sees_backs
from radiosity.solver.lamps import Point
from radiosity.tests.solver.rooms import CEILING, box, shape

LOW, HIGH = (10.0, 0.0, 0.0), (11.0, 1.0, 1.0)
SETTINGS = Settings(error=0.1, target="vertex", threads=1)
LAMP = Point("lamp", (10.4, 0.5, 0.6), (12, 24, 36))
# Form factor between opposite squares of a cube, and between adjacent ones (Howell, A Catalog of Radiation Heat
# Transfer Configuration Factors, C-11 and C-14).
OPPOSITE, ADJACENT = 0.199825, 0.200044


def _table(room, **more):
    made = bake(room.scene(lights=(LAMP,), **more), SETTINGS)
    assert made.patches is not None
    return made.patches, made.report


def _mean(table, values, rows):
    return np.average(values[rows], weights=table.area[rows])


def test_rows_of_a_closed_box_sum_to_one_and_its_patches_keep_what_the_lamp_sends():
    # A closed unit cube about (10.5, .5, .5), walls of .5, a lamp of 24 W. Exact answers: every row sum 1, no back,
    # 6 m2 of patches, all 24 W absorbed, and as the walls keep half of what they get, as much leaves them.
    table, report = _table(box(LOW, HIGH))
    assert table.row_sum.min() == 1
    assert table.back_faces.max() == 0
    assert table.area.sum() == pytest.approx(6, rel=1e-4)
    absorbed = float((table.absorbed * table.area).sum())
    assert absorbed == pytest.approx(24, rel=0.005)
    assert report["energy"]["absorbed"] == pytest.approx(24, rel=0.005)
    assert float((table.leaving * table.area).sum()) == pytest.approx(24, rel=0.005)


def test_patches_lie_on_their_walls_and_know_them():
    # The same cube, its walls in two objects. Exact answers: middles on the faces, normals inward, owners as they are.
    surfaces = (Surface("floor", 0, 2), Surface("rest", 2, 10))
    table, _ = _table(box(LOW, HIGH), surfaces=surfaces)
    distance = np.abs(table.middle - (10.5, 0.5, 0.5)).max(axis=1)
    assert distance == pytest.approx(0.5, abs=1e-4)
    inward = ((np.array((10.5, 0.5, 0.5)) - table.middle) * table.normal).sum(axis=1)
    assert inward == pytest.approx(0.5, abs=1e-3)
    assert ((table.surface == 0) == (table.normal[:, 2] > 0.9)).all()


def test_an_open_lid_lets_its_form_factor_out():
    # The cube without its ceiling under a black sky. Exact answers: 1 - F to the missing ceiling, .1998 from the floor,
    # .2000 from the walls.
    room = box(LOW, HIGH)
    keep = np.delete(np.arange(12), (2 * CEILING, 2 * CEILING + 1))
    table, _ = _table(shape(room.corners[keep], room.reflectance[keep]))
    inside = ((np.array((10.5, 0.5, 0.5)) - table.middle) * table.normal).sum(axis=1) > 0
    floor = inside & (table.normal[:, 2] > 0.9)
    walls = inside & (np.abs(table.normal[:, 2]) < 0.1)
    assert 1 - _mean(table, table.row_sum, floor) == pytest.approx(OPPOSITE, rel=0.03)
    assert 1 - _mean(table, table.row_sum, walls) == pytest.approx(ADJACENT, rel=0.03)


def test_a_flipped_wall_shows_in_the_share_of_back_faces():
    # The cube with its ceiling turned outward. Exact answers: as above, of rays that meet its back.
    room = box(LOW, HIGH)
    corners = room.corners.copy()
    corners[2 * CEILING:2 * CEILING + 2] = corners[2 * CEILING:2 * CEILING + 2, ::-1]
    table, _ = _table(shape(corners, room.reflectance))
    floor, walls = table.normal[:, 2] > 0.9, np.abs(table.normal[:, 2]) < 0.1
    assert table.row_sum.min() == 1
    assert _mean(table, table.back_faces, floor) == pytest.approx(OPPOSITE, rel=0.03)
    assert _mean(table, table.back_faces, walls) == pytest.approx(ADJACENT, rel=0.03)
    assert table.back_faces[table.normal[:, 2] < -0.9].max() == 0


def test_points_inside_a_closed_object_see_backs_alone():
    # A cube facing outward. Exact answers: 1 inside; 0 above it, where rays meet its front or nothing.
    room = box(LOW, HIGH, inward=False).scene()
    assert sees_backs(room, np.array([(10.5, 0.5, 0.5), (10.1, 0.9, 0.2), (10.5, 0.5, 1.5)])).tolist() == [1, 1, 0]

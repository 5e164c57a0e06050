"""Connected pieces of a mesh."""

from __future__ import annotations

import numpy as np
import pytest
from radiosity.solver.shells import Shells
from radiosity.tests.solver.rooms import box, quad


def _shells(*shapes):
    return Shells.of(sum(shapes[1:], shapes[0]).corners.astype(np.float32))


def test_a_quad_that_crosses_another_without_a_common_corner_is_a_shell_of_its_own():
    # Two unit squares through one another.
    shells = _shells(quad((0, 0, 0), (1, 0, 0), (0, 1, 0)), quad((0.5, 0.2, -0.5), (0, 0, 1), (0, 0.5, 0)))
    assert shells.of_triangle[0] == shells.of_triangle[1] != shells.of_triangle[2] == shells.of_triangle[3]


def test_zero_and_minus_zero_are_the_same_place():
    # Two triangles that meet at (0, 0, 0) and (-0, 0, -0).
    corners = np.array([[[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[-0.0, 0, -0.0], [-1, 0, 0], [0, -1, 0]]], np.float32)
    assert Shells.of(corners).of_triangle.tolist() == [0, 0]


def test_the_order_of_triangles_does_not_matter():
    # Fifty boxes along a line, their triangles shuffled: fifty shells, each of one box's twelve.
    corners = np.concatenate([box((3 * n, 0, 0), (3 * n + 1 + n / 50, 1, 1)).corners for n in range(50)])
    order = np.random.default_rng(0).permutation(len(corners))
    shells = Shells.of(corners[order].astype(np.float32))
    number = order // 12
    assert len(shells.extent) == 50
    assert all(len(set(shells.of_triangle[number == n])) == 1 for n in range(50))
    assert shells.extent[shells.of_triangle] == pytest.approx(1 + number / 50, rel=1e-5)


def test_a_strip_of_a_thousand_quads_is_one_shell():
    # The label has to travel its whole length.
    corners = np.concatenate([quad((n, 0, 0), (1, 0, 0), (0, 1, 0)).corners for n in range(1000)]).astype(np.float32)
    shells = Shells.of(corners)
    assert set(shells.of_triangle) == {0}
    assert shells.extent == pytest.approx([1000])


def test_no_triangle_makes_no_shell():
    # An empty mesh.
    shells = Shells.of(np.empty((0, 3, 3), np.float32))
    assert (len(shells.of_triangle), len(shells.extent)) == (0, 0)


def test_a_box_is_one_shell_as_long_as_its_longest_edge():
    # Twelve triangles of a 1 x 3 x 2 m box.
    shells = _shells(box((0, 0, 0), (1, 3, 2)))
    assert shells.of_triangle.tolist() == [0] * 12
    assert shells.extent == pytest.approx([3])


def test_boxes_a_hair_apart_are_two_shells_and_boxes_that_share_a_corner_are_one():
    # The second box begins at the first one's corner (1, 1, 1), or 1e-6 m beyond.
    one = box((0, 0, 0), (1, 1, 1))
    assert len(_shells(one, box((1, 1, 1), (2, 2, 2))).extent) == 1
    assert len(_shells(one, box((1 + 1e-6, 1, 1), (2, 2, 2))).extent) == 2



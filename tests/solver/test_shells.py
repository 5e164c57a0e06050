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

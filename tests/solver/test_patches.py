"""Patches: what sees different light is told apart, and boxes are split where they are asked to be."""

from __future__ import annotations

import numpy as np
import pytest
from radiosity.solver.geometry import Geometry
from radiosity.solver.patches import Patches, Spots, eighths
from radiosity.solver.shells import Shells
from radiosity.tests.solver.rooms import EAST, WEST, box, quad

VIEW = 2.0


def _patches(shape, smallest=0.01):
    geometry = Geometry(shape.scene())
    corners = geometry.corners.reshape(-1, 3)
    return geometry, Patches(Shells.of(geometry.corners), corners.min(axis=0), corners.max(axis=0), smallest, VIEW)


def _spots(geometry, triangle, front=True, number=400, seed=0):
    """Random points on one side of triangles."""
    rng = np.random.default_rng(seed)
    u, v = rng.random((2, number)).astype(np.float32)
    over = u + v > 1
    u[over], v[over] = 1 - u[over], 1 - v[over]
    return Spots.at(geometry, rng.choice(triangle, number), u, v, np.full(number, front))


def test_a_board_its_back_and_the_wall_behind_it_are_three_patches():
    # A board of 1 m, 1 cm in front of a wall, in a room of 2 m: front, back, and the wall in its shadow.
    wall = quad((0, 0, 0), (0, 2, 0), (0, 0, 2))
    board = quad((0.01, 0.5, 0.5), (0, 1, 0), (0, 0, 1))
    far = quad((2, 0, 0), (0, 0, 2), (0, 2, 0))
    geometry, patches = _patches(wall + board + far)
    behind = _spots(geometry, [0, 1])
    middle = np.abs(behind.points[:, 1:]).max(axis=1) < 0.45  # about the scene's middle, (1, 1, 1)
    seen = [patches.of(each) for each in (_spots(geometry, [2, 3]), _spots(geometry, [2, 3], front=False),
                                          behind.take(middle))]
    front, back, shadowed = (set(each.tolist()) for each in seen)
    assert not front & back
    assert not front & shadowed
    assert not back & shadowed


def test_the_inside_of_a_pipe_is_another_patch_than_the_pipe_beside_it():
    # Two square pipes of 10 cm, 10 cm apart: inside the first and between the two there is the same room in front of
    # surfaces that face the same way, in one box of the octree, but the first are backs.
    pipes = box((0, 0, 0), (0.1, 0.1, 2), inward=False) + box((0.2, 0, 0), (0.3, 0.1, 2), inward=False)
    geometry, patches = _patches(pipes + quad((0, 9, 0), (9, 0, 0), (0, 0, 9)), smallest=9.0)
    east, other = [2 * EAST, 2 * EAST + 1], [12 + 2 * WEST, 12 + 2 * WEST + 1]
    inside, beside = _spots(geometry, east, front=False), _spots(geometry, other)
    assert np.array_equal(np.unique(np.round(inside.gap, 3)), np.unique(np.round(beside.gap, 3)))
    assert (np.sign(inside.normals[:, 0]) == np.sign(beside.normals[:, 0])).all()
    assert not set(patches.of(inside).tolist()) & set(patches.of(beside).tolist())


def test_the_wall_beside_a_board_is_another_patch_than_the_wall_behind_it():
    # The same wall: 1 cm of free room behind the board, 2 m beside it.
    wall = quad((0, 0, 0), (0, 2, 0), (0, 0, 2))
    board, far = quad((0.01, 0.5, 0.5), (0, 1, 0), (0, 0, 1)), quad((2, 0, 0), (0, 0, 2), (0, 2, 0))
    geometry, patches = _patches(wall + board + far)
    spots = _spots(geometry, [0, 1])
    number = patches.of(spots)
    hidden = np.abs(spots.points[:, 1:]).max(axis=1) < 0.5
    assert not set(number[hidden].tolist()) & set(number[~hidden].tolist())


def test_the_six_walls_of_a_room_are_patches_of_their_own():
    # A cube of 2 m: no patch faces two ways.
    geometry, patches = _patches(box((0, 0, 0), (2, 2, 2)))
    wall = [set(patches.of(_spots(geometry, [2 * side, 2 * side + 1])).tolist()) for side in range(6)]
    assert sum(len(each) for each in wall) == len(set().union(*wall)) == len(patches)


def test_two_boards_in_one_plane_are_two_patches_and_gravel_is_one():
    # Two boards of 1 x 2 m side by side, 1 cm apart (as long as the box that holds both), and 200 flakes of 5 mm.
    boards = quad((0, 0, 0), (1, 0, 0), (0, 2, 0)) + quad((1.01, 0, 0), (1, 0, 0), (0, 2, 0))
    geometry, patches = _patches(boards)
    numbers = [set(patches.of(_spots(geometry, [2 * n, 2 * n + 1])).tolist()) for n in (0, 1)]
    assert not numbers[0] & numbers[1]
    rng = np.random.default_rng(1)
    flakes = [quad((*place, 0), (0.005, 0, 0), (0, 0.005, 0)) for place in rng.uniform(0, 1, (200, 2))]
    geometry, patches = _patches(sum(flakes[1:], flakes[0]) + quad((0, 0, 1), (1, 0, 0), (0, 1, 0)))
    # All in one box, but for flakes that stick out from under the lid and see the open.
    assert len(set(patches.of(_spots(geometry, np.arange(400))).tolist())) <= 2


def test_growing_leaves_no_box_that_holds_more_than_its_share():
    # Weight 1 a spot on a floor, most 20: no patch above the smallest holds more.
    geometry, patches = _patches(quad((0, 0, 0), (2, 0, 0), (0, 2, 0)))
    spots = _spots(geometry, [0, 1], number=5000)
    weight = np.ones(5000, np.float32)
    patches.grow(spots, weight, np.full(5000, 100, np.float32), 20)
    held = np.bincount(patches.of(spots))
    assert held.max() <= 20
    # A split of four can leave as little as one; on the average patches hold a quarter of what is allowed at least.
    assert held.mean() > 20 / 4


def test_what_is_looked_at_from_near_is_split_further():
    # The same spots, looked at from 1 cm: a quarter of the weight suffices.
    floor = quad((0, 0, 0), (2, 0, 0), (0, 2, 0))
    counts = []
    for distance in (100.0, 0.01):
        geometry, patches = _patches(floor, smallest=0.001)
        spots = _spots(geometry, [0, 1], number=5000)
        patches.grow(spots, np.ones(5000, np.float32), np.full(5000, distance, np.float32), 40)
        counts.append(len(set(patches.of(spots).tolist())))
    assert counts[1] > 2 * counts[0]


def test_splitting_one_patch_makes_children_of_half_its_size_and_leaves_the_others():
    # A floor in boxes of 1 m, one of them split: its spots go to new patches, all others stay.
    geometry, patches = _patches(quad((0, 0, 0), (2, 0, 0), (0, 2, 0)))
    spots = _spots(geometry, [0, 1], number=2000)
    patches.grow(spots, np.ones(2000, np.float32), np.full(2000, 100, np.float32), 600)
    before = patches.of(spots)
    chosen = before[0]
    inside = before == chosen
    patches.split(spots.take(np.flatnonzero(inside)), before[inside], patches.size())
    after = patches.of(spots)
    assert np.array_equal(after[~inside], before[~inside])
    assert not set(after[inside].tolist()) & set(before.tolist())
    assert 2 <= len(set(after[inside].tolist())) <= 4
    assert patches.size()[after[inside]] == pytest.approx(patches.size()[chosen] / 2)


def test_nothing_is_split_below_the_smallest_size():
    # Smallest .4 m in a scene of 2 m: edges of 2.002, 1.001 and .5005 m, and no less.
    geometry, patches = _patches(quad((0, 0, 0), (2, 0, 0), (0, 2, 0)), smallest=0.4)
    spots = _spots(geometry, [0, 1], number=2000)
    patches.grow(spots, np.ones(2000, np.float32), np.full(2000, 100, np.float32), 1)
    patches.split(spots, patches.of(spots), patches.size())
    number = patches.of(spots)
    assert patches.size()[number] == pytest.approx(2.002 / 4)


def test_a_patch_in_a_corner_of_its_box_is_split_at_once():
    # Spots on 10 cm of a floor of 2 m, in one box. Exact answer: one split leaves less than half of them together, as
    # it would of spots all over the floor; halving the box would leave all of them so.
    geometry, patches = _patches(quad((0, 0, 0), (2, 0, 0), (0, 2, 0)))
    spots = _spots(geometry, [0, 1], number=200000)
    corner = spots.take(np.flatnonzero((spots.points[:, :2] < -0.9).all(axis=1)))
    before = patches.of(corner)
    assert len(set(before.tolist())) == 1
    patches.split(corner, before, np.full(len(patches), 0.1, np.float32))
    assert np.bincount(patches.of(corner)).max() < 0.5 * len(corner)


def test_eighths_are_told_apart_by_the_mean_of_what_lies_there():
    # Points on a floor in the corner of anything: eighths by the sign of x and y about their mean; none lies above
    # another, though the last digits of their heights differ.
    rng = np.random.default_rng(0)
    points = np.float32([70, 30, 5]) + rng.random((3, 500, 3)).astype(np.float32) * np.float32([0.1, 0.1, 1e-5])
    sign = points > points.mean(axis=1, keepdims=True)
    part = eighths(points)
    far = (np.abs(points - points.mean(axis=1, keepdims=True))[..., :2] > 0.005).all(axis=2)
    assert np.array_equal((part & 1)[far], sign[..., 0][far])
    assert np.array_equal((part >> 1 & 1)[far], sign[..., 1][far])
    assert not (part >> 2).any()


def test_the_free_room_in_front_of_a_spot_is_what_a_ray_finds():
    # A floor under a ceiling at 1.5 m: 1.5 m up; nothing below.
    geometry, _ = _patches(quad((0, 0, 0), (2, 0, 0), (0, 2, 0)) + quad((-5, -5, 1.5), (0, 10, 0), (10, 0, 0)))
    assert _spots(geometry, [0, 1]).gap == pytest.approx(1.5, abs=1e-3)
    assert np.isinf(_spots(geometry, [0, 1], front=False).gap).all()


def test_patches_keep_their_numbers_when_asked_again():
    # The same spots, and in another order.
    geometry, patches = _patches(box((0, 0, 0), (2, 2, 2)))
    spots = _spots(geometry, np.arange(12))
    first = patches.of(spots)
    order = np.random.default_rng(3).permutation(len(first))
    assert np.array_equal(patches.of(spots.take(order)), first[order])
    assert len(patches) == len(set(first.tolist()))

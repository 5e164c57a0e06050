"""Neighbours beyond seams: two squares in one plane, apart and turned in the layout (see test_seams)."""

from dataclasses import replace

import numpy as np
import pytest
from radiosity.solver.across import WAYS, links
from radiosity.solver.kernels import kernels
from radiosity.solver.lumels import lumels
from radiosity.solver.neighbours import LumelNeighbours
from radiosity.solver.parallel import Run
from radiosity.solver.seam_samples import seam_samples
from radiosity.solver.smooth import smooth
from radiosity.tests.solver.test_seams import SETTINGS, SIDE, VERTICES, two_squares

# Metres of a texel of the left square, which is .4 of the image wide; the right one's are .4 / .35 times as wide.
TEXEL = 1 / (.4 * SIDE)


def linked(scene):
    laid = lumels(scene, SETTINGS, [])
    return laid, LumelNeighbours(laid, links(seam_samples(laid, scene), laid, scene))


def test_what_follows_beyond_a_seam_lies_where_the_way_leads():
    # Way (1, 0) of the left square leads to x + 1 texel: within one texel of it, sideways as well, lies what follows.
    laid, near = linked(two_squares())
    found, inside = near.at(1), near.in_chart(1)
    position = laid.receivers.position
    row = np.flatnonzero((found[:, 4] >= 0) & (inside[:, 4] < 0) & (position[:, 0] < 0))
    assert len(row) >= 17  # of the nineteen lumels in the left square's last column
    astray = position[found[row, 4]] - position[row] - TEXEL * np.array([1, 0, 0])
    assert np.linalg.norm(astray, axis=1).max() < TEXEL
    assert (position[found[row, 4], 0] > 0).all()


@pytest.mark.parametrize("step", [2, 4])
def test_ways_go_on_straight_beyond_a_seam(step):
    # Several steps over the seam: the direction in space stays within 45 degrees (one step may land half a texel
    # aside), and on the mean within 10; so does the distance, within 1.5 texels of `step` of them.
    laid, near = linked(two_squares())
    found, inside = near.at(step), near.in_chart(step)
    position = laid.receivers.position
    row, way = np.nonzero((found >= 0) & (inside < 0) & (position[:, :1] < 0))
    offset = position[found[row, way]][:, :2] - position[row][:, :2]
    led = WAYS[way] * step * TEXEL
    cosine = (offset * led).sum(axis=1) / np.linalg.norm(offset, axis=1) / np.linalg.norm(led, axis=1)
    assert len(row) > 45 * step
    assert cosine.min() > np.cos(np.pi / 4)
    assert cosine.mean() > np.cos(np.pi / 18)
    assert np.linalg.norm(offset - led, axis=1).max() < 1.5 * TEXEL * step


def test_neighbours_of_a_chart_of_its_own_stay():
    # Whatever had a neighbour in its chart keeps it; in_chart knows of no other.
    laid, near = linked(two_squares())
    alone = LumelNeighbours(laid)
    for step in (1, 2, 4):
        assert np.array_equal(near.in_chart(step), alone.at(step))
        inside = alone.at(step) >= 0
        assert np.array_equal(near.at(step)[inside], alone.at(step)[inside])


def test_no_neighbour_lies_round_a_crease():
    # The right square folded up by 90 degrees: nothing follows.
    folded = VERTICES.copy()
    folded[4:, 0], folded[4:, 2] = 1, 1
    _, near = linked(two_squares(folded))
    assert np.array_equal(near.at(1), near.in_chart(1))


def test_smoothing_goes_on_beyond_a_seam():
    # Noise of 10 %, even light: beside the seam the values of the two charts are off by less together than apart,
    # since they share what they average. The difference of lumels across it falls by a third at least.
    laid, near = linked(two_squares())
    looks = [np.zeros((len(laid), 6), np.float32) for _ in range(2)]
    for number, look in enumerate(looks):
        look[:, 3:] = 1 + np.random.default_rng(number).normal(0, .1, (len(laid), 1))
    receivers = replace(laid.receivers, normal=np.tile(np.array([[0, 0, 1]], np.float32), (len(laid), 1)))
    found, inside = near.at(1), near.in_chart(1)
    row, way = np.nonzero((found >= 0) & (inside < 0))
    steps = []
    for neighbours in (LumelNeighbours(laid), near):
        value = sum(smooth(*looks, kernels(receivers, neighbours, Run(1)), Run(1)))[:, 3] / 2
        steps.append(np.abs(value[found[row, way]] - value[row]).mean())
    assert steps[1] < steps[0] * 2 / 3

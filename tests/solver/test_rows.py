"""Rows as ray hits: what they bring, and how sure that is."""

from __future__ import annotations

import numpy as np
import pytest
from radiosity.solver.cells import NOTHING, Cells
from radiosity.solver.direct import DirectLight
from radiosity.solver.geometry import Geometry
from radiosity.solver.parallel import Run
from radiosity.solver.patches import Patches
from radiosity.solver.rows import Rows
from radiosity.solver.shells import Shells
from radiosity.solver.transport import Transport
from radiosity.tests.solver.rooms import quad


def test_a_row_brings_the_mean_of_its_rays_and_errs_by_their_spread():
    # Cells of radiosity 1 and 3 and a sky of 5 (channels 3, 5, 7): rows (1, 3, 1, 3) and (1, 1, 1, sky). Means 2 and 2,
    # variances 1 and 3 over four rays.
    hits = np.array([[0, 1, 0, 1], [0, 0, 0, -1]], np.int32)
    sky = np.zeros((2, 4, 3), np.float32)
    sky[1, 3] = (3, 5, 7)
    rows = Rows(np.array([4, 7], np.int32), hits, np.zeros((2, 4), np.uint8), sky)
    irradiance, variance = rows.sums(np.array([1, 3, 0], np.float32))
    assert irradiance == pytest.approx([2, 2])
    assert variance == pytest.approx([0.25, 0.75])
    assert rows.mean_sky() == pytest.approx(np.array([[0, 0, 0], [0.75, 1.25, 1.75]]))


@pytest.mark.parametrize(("height", "ways_out"), [(1e-4, 1), (0.5, 0)])
def test_a_gap_is_given_one_way_out_where_no_ray_finds_any(height, ways_out):
    # Two boards a metre wide and closed at the rim by walls, .1 mm apart or half a metre: no ray of any row gets out.
    # Of a gap, one of 64 does; of a room that is as closed none.
    wall = quad((0, 0, 0), (1, 0, 0), (0, 0, height)) + quad((0, 1, 0), (0, 0, height), (1, 0, 0))
    ends = quad((0, 0, 0), (0, 0, height), (0, 1, 0)) + quad((1, 0, 0), (0, 1, 0), (0, 0, height))
    boards = quad((0, 0, 0), (0, 1, 0), (1, 0, 0)) + quad((0, 0, height), (1, 0, 0), (0, 1, 0))
    geometry = Geometry((boards + wall + ends).scene())
    cells, none = Cells(geometry, 1.0), np.zeros(len(geometry.area), bool)
    corners = geometry.corners.reshape(-1, 3)
    patches = Patches(Shells.of(geometry.corners), corners.min(axis=0), corners.max(axis=0), 1.0, 1.0)
    transport = Transport(geometry, DirectLight(geometry, (), 0), none, cells, patches, 0, Run())
    directions = np.random.default_rng(2).normal(size=(500, 3)).astype(np.float32)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    middle = np.array([0.5, 0.5, height / 2]) - geometry.scene.origin
    met = transport.trace(np.tile(middle.astype(np.float32), (500, 1)), directions)
    transport.meet([met.fresh(directions, geometry.normal)])
    boards_met = np.flatnonzero(transport.met.spots.triangle < 4)
    [rows] = transport.trace_rows(np.unique(transport.cell_patch[boards_met]).astype(np.int32), 64)
    assert len(rows.patch)
    assert ((rows.hits == NOTHING).sum(axis=1) == ways_out).all()

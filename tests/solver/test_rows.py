"""Rows as ray hits: what they bring, and how sure that is."""

from __future__ import annotations

import numpy as np
import pytest
from radiosity.solver.cells import NOTHING, Cells
from radiosity.solver.direct import DirectLight
from radiosity.solver.geometry import Geometry
from radiosity.solver.lamps import Point
from radiosity.solver.parallel import Run
from radiosity.solver.patches import Patches
from radiosity.solver.rows import Rows
from radiosity.solver.shells import Shells
from radiosity.solver.transport import PEAK_WIDTH, Transport
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


@pytest.mark.parametrize(("height", "rho", "ways_out"), [(1e-4, 0.999, 1), (0.5, 0.999, 0), (1e-4, 0.7, 0)])
def test_a_white_gap_is_given_one_way_out_where_no_ray_finds_any(height, rho, ways_out):
    # Two boards a metre wide and closed at the rim by walls, .1 mm apart or half a metre: no ray of any row gets out.
    # Of a gap, one of 64 does; of a room that is as closed none, nor of a gap whose walls take more than that.
    wall = quad((0, 0, 0), (1, 0, 0), (0, 0, height), rho) + quad((0, 1, 0), (0, 0, height), (1, 0, 0), rho)
    ends = quad((0, 0, 0), (0, 0, height), (0, 1, 0), rho) + quad((1, 0, 0), (0, 1, 0), (0, 0, height), rho)
    boards = quad((0, 0, 0), (0, 1, 0), (1, 0, 0), rho) + quad((0, 0, height), (1, 0, 0), (0, 1, 0), rho)
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


@pytest.fixture
def lit_end():
    """A floor of 100 m with a lamp over one end, two metres of view, known at both ends: Transport, and its cells of
    either."""
    geometry = Geometry(quad((0, 0, 0), (100, 0, 0), (0, 100, 0)).scene())
    cells, none = Cells(geometry, 1.0), np.zeros(len(geometry.area), bool)
    corners = geometry.corners.reshape(-1, 3)
    patches = Patches(Shells.of(geometry.corners), corners.min(axis=0), corners.max(axis=0), 0.1, 2.0)
    lamp = Point("lamp", np.float64([1, 1, 1]) - geometry.scene.origin, (100, 100, 100))
    transport = Transport(geometry, DirectLight(geometry, (lamp,), 0), none, cells, patches, 0, Run())
    starts = np.random.default_rng(1).random((200, 3)) * [2, 2, 0] + [0, 0, 1]
    starts[100:, :2] += 97
    down = np.tile(np.float32([0, 0, -1]), (200, 1))
    met = transport.trace((starts - geometry.scene.origin).astype(np.float32), down)
    transport.meet([met.fresh(down, geometry.normal)])
    rows = met.rows(cells)
    transport.discover(16)
    transport.solve(1e-3)
    return transport, np.unique(rows[:100]), np.unique(rows[100:])


def test_a_wide_patch_that_is_bright_at_one_end_is_split(lit_end):
    # Both ends in one patch, of which rays that start in one of them tell nothing. Exact answer: told apart at once,
    # but not where nothing counts as a peak, nor more patches than are allowed.
    transport, bright, dark = lit_end
    assert set(transport.cell_patch[bright]) & set(transport.cell_patch[dark])
    assert len(transport.wide(8)) == 0
    transport.peak = 1.0
    assert transport.cell_direct[bright].max() > 1 > transport.cell_direct[dark].max()
    assert len(transport.wide(0)) == 0
    wide = transport.wide(8)
    assert transport.refine(np.inf, np.zeros(len(transport.patches)), wide) == len(wide) == 1
    assert not set(transport.cell_patch[bright]) & set(transport.cell_patch[dark])


def test_peaks_count_as_wider_than_their_patches(lit_end):
    # The same floor: the width of cells brighter than 1 W/m2 is four times that of others of their patch.
    transport, _, _ = lit_end
    plain = transport.table()[:-1].copy()
    transport.peak = 1.0
    transport.solve(1e-3)
    found = transport.table()[:-1]
    peaks = found[:, :3].mean(axis=1) > 1
    assert 0 < peaks.sum() < len(peaks)
    assert np.array_equal(found[:, 3], np.where(peaks, PEAK_WIDTH, 1) * plain[:, 3])

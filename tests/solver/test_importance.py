"""What patches matter to the receivers: where their rows start, and how many rays they get."""

from __future__ import annotations

import numpy as np
import pytest
from radiosity.solver.cells import Cells
from radiosity.solver.direct import DirectLight
from radiosity.solver.fans import Fans
from radiosity.solver.footprints import ReceiverFootprints
from radiosity.solver.gather import Gather, Look
from radiosity.solver.geometry import Geometry
from radiosity.solver.lamps import Point
from radiosity.solver.parallel import Run
from radiosity.solver.patches import Patches
from radiosity.solver.probes import free_receivers
from radiosity.solver.row_starts import LESS, MORE, REFLECTIONS
from radiosity.solver.shells import Shells
from radiosity.solver.sources import light_sources
from radiosity.solver.transport import Transport
from radiosity.tests.solver.rooms import box

RAYS = 64
LAMP = Point("lamp", (1, 1, 1.7), (9, 9, 9), 0.05)


def _met(reflectance):
    """A transport of which receivers in one corner of a room's floor have met the room."""
    scene = box((0, 0, 0), (2, 2, 2), reflectance).scene(lights=(LAMP,))
    geometry, run = Geometry(scene), Run()
    lights, sampled = light_sources(geometry)
    corners = geometry.corners.reshape(-1, 3)
    patches = Patches(Shells.of(geometry.corners), corners.min(axis=0), corners.max(axis=0), 0.4, 1.0)
    cells = Cells(geometry, 0.1)
    transport = Transport(geometry, DirectLight(geometry, lights, 0), sampled, cells, patches, 0, run)
    points = np.random.default_rng(4).uniform((0.05, 0.05, 0), (0.35, 0.35, 0), (50, 3)) - scene.origin
    receivers = free_receivers(points, np.tile([0.0, 0.0, 1.0], (50, 1)), np.full(50, -1, np.int32))
    fans = Fans(ReceiverFootprints(geometry, receivers, 0.0, 0))
    seen = Gather(transport).meet(fans, Look(np.arange(50), 64, 0, 1), run)
    transport.starts.see(seen)
    return transport


@pytest.mark.parametrize("reflectance", [0.0, 0.5, 0.8])
def test_in_a_closed_room_importance_adds_up_to_a_geometric_series(reflectance):
    # Every ray meets a wall, and each wall passes on rho of what it matters: 1 + rho + rho^2 ... as often as
    # reflections are followed, however the rays fell; and no more often where rows are traced anew once more.
    transport = _met(reflectance)
    first = transport.starts.matters.sum()
    transport.discover(RAYS)
    series = sum(reflectance**power for power in range(REFLECTIONS + 1))
    for rays in (RAYS, 2 * RAYS):
        transport.retrace(rays)
        assert transport.starts.matters.sum() / first == pytest.approx(series, rel=1e-6)
        assert transport.starts.matters.min() >= 0


def test_rows_of_patches_that_receivers_see_much_of_have_more_rays():
    # From a corner of the floor the walls beside it are seen most, the floor itself not at all.
    transport = _met(0.5)
    transport.discover(RAYS)
    rays = np.zeros(len(transport.patches))
    for rows in transport.rows:
        rays[rows.patch] = rows.hits.shape[1]
    seen = np.pad(transport.starts.straight, (0, len(transport.cells) - len(transport.starts.straight)))
    matters = np.bincount(transport.cell_patch, seen, len(transport.patches))
    floor = np.unique(transport.cell_patch[transport.met.spots.points[:, 2] < -0.999])
    assert (rays[floor] == RAYS * 2.0**LESS).all()
    assert RAYS < rays[np.argmax(matters)] <= RAYS * 2**MORE
    assert rays[matters > np.median(matters)].mean() > 2 * rays[floor].mean()


def test_where_receivers_saw_nothing_that_reflects_all_rows_have_the_usual_rays():
    transport = _met(0.0)
    transport.discover(RAYS)
    assert {rows.hits.shape[1] for rows in transport.rows} == {RAYS}

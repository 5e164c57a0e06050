"""The light of cells that are half in the dark, or right beside a lamp."""

from __future__ import annotations

import numpy as np
import pytest
from radiosity.solver.cells import NOTHING, Cells
from radiosity.solver.direct import DirectLight
from radiosity.solver.geometry import Geometry
from radiosity.solver.parallel import Run
from radiosity.solver.patches import Patches
from radiosity.solver.seen import PLACES, Seen, SeenFootprints
from radiosity.solver.shells import Shells
from radiosity.solver.sources import light_sources
from radiosity.solver.transport import AGAIN, Transport
from radiosity.tests.solver.rooms import quad

# A floor of a square metre, one cell a triangle.
FLOOR = quad((0, 0, 0), (1, 0, 0), (0, 1, 0), 0.5)


def _transport(shapes, size=10.0):
    geometry = Geometry(shapes.scene())
    lights, sampled = light_sources(geometry)
    corners = geometry.corners.reshape(-1, 3)
    patches = Patches(Shells.of(geometry.corners), corners.min(axis=0), corners.max(axis=0), 0.4, 1.0)
    return Transport(geometry, DirectLight(geometry, lights, 0), sampled, Cells(geometry, size), patches, 0, Run())


def _down_at(transport, x, y):
    """Rays straight down on the floor."""
    points = np.stack([x, y, np.full(len(x), 0.05)], axis=1).astype(np.float32) - transport.geometry.scene.origin
    return transport.trace(np.asarray(points, np.float32), _down(len(x)))


def _down(count):
    return np.tile(np.float32([0, 0, -1]), (count, 1))


def _meet_at(transport, x, y):
    """Let rays straight down meet the floor."""
    met = _down_at(transport, x, y)
    transport.meet([met.fresh(_down(len(x)), transport.geometry.normal)])


def test_a_cell_first_met_in_its_shadow_is_asked_again_where_many_rays_meet_it():
    # A board stands on the floor between a lamp on the left and the right half. One ray meets the floor's lower right
    # triangle behind the board: dark. Then AGAIN rays meet it before the board; then it has their light.
    lamp = quad((-0.6, 0, 0.6), (0, 1, 0), (0, 0, 0.2), 0.0, 100.0)
    board = quad((0.5, -0.1, 0), (0, 1.2, 0), (0, 0, 2.0), 0.0)
    transport = _transport(FLOOR + lamp + board)
    _meet_at(transport, np.array([0.7]), np.array([0.2]))
    assert not transport.met.incident[0].any()
    spots = np.random.default_rng(3).uniform((0.2, 0.0), (0.45, 0.2), (AGAIN, 2))
    before = _down_at(transport, *spots.T)
    assert (transport.cells.rows(before.sides) == 0).all()
    transport.look_again([_down_at(transport, *spots[1:].T)])
    assert not transport.met.incident[0].any()
    transport.look_again([before])
    own = _transport(FLOOR + lamp + board)
    _meet_at(own, *spots.T)
    assert transport.met.incident[0].min() > 0
    assert transport.met.incident[0] == pytest.approx(own.met.incident[0])
    assert transport.met.places[0] == 4


def test_a_cell_right_under_a_lamp_is_divided_and_one_far_off_is_not():
    # A lamp of 10 cm hangs 30 cm over one corner of the lower triangle, where its light varies most: with a limit
    # between the two, that one is divided, and rays that meet it now meet smaller cells.
    lamp = quad((0.85, 0.05, 0.3), (0, 0.1, 0), (0.1, 0, 0), 0.0, 1000.0)
    transport = _transport(FLOOR + lamp)
    first = np.array([[0.9, 0.1], [0.3, 0.1], [0.1, 0.9], [0.15, 0.85]])
    transport.met.steep = 2.0
    _meet_at(transport, *first.T)
    assert len(transport.cells) == 2
    rays = np.random.default_rng(5).uniform(0.02, 0.98, (400, 2))
    lower = rays[:, 0] > rays[:, 1]
    met = _down_at(transport, *rays.T)
    assert (transport.cells.rows(met.sides)[~lower] == 1).all()
    assert (transport.cells.rows(met.sides)[lower] == NOTHING).all()
    assert len(np.unique(met.sides[lower])) == 10  # the other 6 of 16 lie beyond the triangle's third side
    _meet_at(transport, *rays.T)
    light = transport.met.incident.mean(axis=1)
    under = transport.cells.rows(_down_at(transport, *first[:1].T).sides)
    assert light[2:].min() < 0.1 * light[0] < light[under]
    assert light[2:].max() == light[under]


def test_more_shadow_rays_tell_the_light_of_cells_in_a_penumbra_better():
    # A board of many cells under a wide lamp that another board hides in part; the truth is what 1,024 rays to each
    # cell tell. Quasi-random rays: sixteen for four take the error to less than half of it.
    floor = quad((0, 0, 0), (1, 0, 0), (0, 1, 0), 0.5)
    lamp = quad((0.2, 0.2, 1.0), (0, 0.6, 0), (0.6, 0, 0), 0.0, 100.0)
    board = quad((0.5, -1, 0.5), (1, 0, 0), (0, 3, 0), 0.0)
    spots = np.random.default_rng(7).uniform(0.02, 0.98, (4000, 2))

    def light(samples):
        transport = _transport(floor + lamp + board, 0.05)
        transport.met.samples = samples
        _meet_at(transport, *spots.T)
        return transport.met.incident.mean(axis=1)

    truth = light(1024)
    errors = [np.sqrt(np.mean((light(samples) - truth) ** 2)) for samples in (4, 16)]
    assert errors[1] < 0.5 * errors[0]
    assert errors[0] > 0


def test_the_same_points_of_a_cell_are_kept_in_whatever_order_rays_met_it():
    # 2^17 points of one cell, among which some agree in all random bits of the key that they are sorted by (27): as
    # they come, shuffled, and as the few of the few of two halves.
    random = np.random.default_rng(6)
    u, v, height = random.random((3, 2**17), np.float32)
    seen = Seen(np.full(len(u), 5), u, v, height)
    kept = seen.few()
    halves = [seen.take(half).few() for half in np.split(random.permutation(len(u)), 2)]
    for other in (seen.take(random.permutation(len(u))).few(), Seen.join(halves).few()):
        assert len(other.side) == PLACES
        assert all(np.array_equal(getattr(other, name), getattr(kept, name)) for name in ("side", "u", "v", "height"))
        assert other.height[0] == other.height.max()


def test_a_cell_in_a_gap_is_known_by_the_place_seen_from_the_highest_alone():
    # Rays from a hundredth of a cell's width and less above four places of it: the highest stands for it, for its light
    # as for the rays of its row. From a tenth, all four count, and it is the first of them.
    geometry = Geometry(FLOOR.scene())
    cells = Cells(geometry, 2.0)
    u, v = np.float32([0.1, 0.3, 0.2, 0.5]), np.float32([0.1, 0.2, 0.5, 0.1])
    for scale, count in ((0.01, 1), (0.1, 4)):
        height = np.float32([0.5, 1.0, 0.8, 0.2]) * np.float32(scale)
        places = SeenFootprints(geometry, cells, Seen(np.full(4, 1), u, v, height).few(), Run(1))
        assert places.count.tolist() == [count]
        triangle, first_u, first_v = places.first_places(slice(None))
        assert (triangle[0], first_u[0], first_v[0]) == (0, u[1], v[1])
        assert len(places.start) == len(places.normal) == count

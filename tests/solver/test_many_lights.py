"""Many lamps: bounds that hold, sums that are right on the average, and work that does not grow with the lamps."""

from __future__ import annotations

import numpy as np
import pytest
from radiosity.solver import many_lights
from radiosity.solver.area_lamp import Area
from radiosity.solver.banks import banks
from radiosity.solver.blocks import Blocks
from radiosity.solver.direct import DirectLight
from radiosity.solver.footprints import ReceiverFootprints
from radiosity.solver.geometry import Geometry
from radiosity.solver.lamp_draw import LampDraw
from radiosity.solver.lamps import Point, Sun
from radiosity.solver.light_bounds import LightBounds
from radiosity.solver.linking import Reach, links_of
from radiosity.solver.mesh_emitter import MeshEmitter
from radiosity.solver.parallel import SHARES, Run
from radiosity.solver.probes import probes
from radiosity.solver.spot import Spot
from radiosity.tests.solver.rooms import quad

UP = (0.0, 0.0, 1.0)


def _zoo(count, seed=0):
    """`count` lamps of each kind within 3 m."""
    rng = np.random.default_rng(seed)
    lamps = []
    for number in range(count):
        at, a, b = rng.uniform(-3, 3, 3), rng.normal(size=3), rng.normal(size=3)
        one, several = at + rng.normal(size=(1, 3, 3)) / 2, at + rng.normal(size=(5, 3, 3)) / 2
        lamps += [Point(f"bare {number}", at, (1, 2, 3)), Point(f"soft {number}", at, 1, rng.uniform(0, 1)),
                  Point(f"ball {number}", at, 1, rng.uniform(0, 1), True),
                  Sun(f"sun {number}", a, 1, rng.uniform(0, 3)),
                  Area(f"area {number}", at, a, b, (3, 2, 1)), Area(f"disc {number}", at, a, (0, 0, 1), 1, True),
                  Spot(f"spot {number}", at, 1, rng.uniform(0, 0.5), direction=b),
                  MeshEmitter(f"mesh {number}", several, rng.uniform(0, 1, (5, 1)) * [1.0, 2, 3]),
                  MeshEmitter(f"front {number}", one, np.ones((1, 3)), two_sided=False)]
    return lamps


def _probes(scene, points, normals):
    geometry = Geometry(scene)
    receivers = probes(scene, np.array(points, float), np.broadcast_to(np.array(normals, float), np.shape(points)))
    return geometry, ReceiverFootprints(geometry, receivers, 0.5, 0)


def _cloud(count, seed=1, far=0.0):
    """Probes within 4 m, half of them along an axis; the last one is moved so many metres away."""
    rng = np.random.default_rng(seed)
    normals = rng.normal(size=(count, 3))
    normals[: count // 2] = np.eye(3)[rng.integers(0, 3, count // 2)]
    scene = quad((-9, -9, -9), (1, 0, 0), (0, 1, 0)).scene()
    points = rng.uniform(-4, 4, (count, 3))
    points[-1, 0] += far
    return _probes(scene, points, normals / np.linalg.norm(normals, axis=1)[:, None])


@pytest.mark.parametrize("far", [0, 1e5, 1e9])
def test_blocks_hold_every_receiver_once_and_nest(far):
    # 5,000 probes in blocks of 200 and of 20, one of them far from the rest: each in one of either, inside its sphere;
    # no small one lies in two large.
    _, places = _cloud(5000, far=far)
    large, small, single = Blocks.nested(places, (200, 20), Run(2))
    assert np.array_equal(np.sort(large.order), np.arange(5000))
    assert np.isin(large.begin, small.begin).all()
    assert large.size.max() <= 200
    assert small.size.max() <= 20
    away = np.linalg.norm(single.centre - small.centre[np.repeat(np.arange(len(small)), small.size)], axis=1)
    assert (away <= np.repeat(small.radius, small.size) + 1e-5).all()


def test_no_lamp_gives_more_than_its_bound():
    # 90 lamps of nine kinds, blocks of 1 to 30 probes: no closed form exceeds the bound, where the lamp isn't near.
    _, places = _cloud(4000)
    lamps = _zoo(10)
    half = np.full(len(places), 0.5, np.float32)
    points, normals = places.sample(np.arange(len(places)), half, half)
    for blocks in Blocks.nested(places, (30,), Run(2)):
        _, most, near = LightBounds.of(lamps).of_all(blocks)
        assert near.mean() < 0.2
        block = np.repeat(np.arange(len(blocks)), blocks.size)
        for number, lamp in enumerate(lamps):
            given = lamp.irradiance(points, normals).mean(axis=1)[blocks.order]
            allowed = np.where(near[block, number], np.inf, most[block, number])
            assert (given <= 1.0001 * allowed + 1e-9).all(), lamp.name


def test_a_bank_answers_as_its_lamps_do():
    # 90 lamps, 9,000 points: the same shadow rays and closed forms as from each lamp alone, but for rounding.
    lamps = _zoo(10)
    whole, bank, place, _ = banks(lamps)
    assert len(whole) == 2 + 3 * 10
    _, places = _cloud(9000)
    half = np.full(len(places), 0.5, np.float32)
    points, normals = places.sample(np.arange(len(places)), half, half)
    rng = np.random.default_rng(3)
    uv, lamp = rng.random((len(points), 2), np.float32), rng.integers(0, len(lamps), len(points))
    for number, light in enumerate(lamps):
        rows = np.flatnonzero(lamp == number)
        own = light.sample(points[rows], normals[rows], uv[rows])
        one = np.full(len(rows), place[number])
        found = whole[bank[number]].sample(points[rows], normals[rows], uv[rows], one)
        assert found.weight == pytest.approx(own.weight, rel=1e-3, abs=1e-3 * float(own.weight.max()))
        assert found.direction == pytest.approx(own.direction, abs=1e-3)
        closed = light.irradiance(points[rows], normals[rows])[:, np.argmax(light.colour)] / light.colour.max()
        assert whole[bank[number]].irradiance(points[rows], normals[rows], one) == pytest.approx(
            closed, rel=1e-3, abs=1e-4 * float(closed.max()) + 1e-6)


def _lattice(count, power=1.0):
    """`count`^2 bare points 2 m above a floor of 40 m, evenly spread."""
    across = (np.arange(count) + 0.5) / count * 40 - 20
    return tuple(Point(f"lamp {x} {y}", (x, y, 2), power) for x in across for y in across)


def _floor(lamps, count, **more):
    """Irradiance found and exact (count,) at places on an empty floor under bare points, and the rays it took."""
    scene = quad((-20, -20, 0), (40, 0, 0), (0, 40, 0)).scene()
    rng = np.random.default_rng(5)
    points = np.append(rng.uniform(-20, 20, (count, 2)), np.full((count, 1), 0.01), axis=1)
    geometry, places = _probes(scene, points, UP)
    run = Run(2)
    moved = tuple(lamp.translated(-scene.origin) for lamp in lamps)
    found = DirectLight(geometry, moved, 0).irradiance(places, run, **more)[:, 0]
    points = (points - scene.origin).astype(np.float32)
    position = np.array([lamp.position for lamp in moved], np.float32)
    flux = np.array([lamp.flux[0] for lamp in moved])
    exact = np.empty(count)
    for row, point in enumerate(points):
        away = position - point
        exact[row] = (flux * away[:, 2] / (away**2).sum(axis=1) ** 1.5).sum() / (4 * np.pi)
    return found, exact, sum(run.rays.values())


@pytest.mark.parametrize("error", [0.1, 0.03])
def test_a_thousand_lamps_are_summed_to_the_wanted_error(error):
    # 1,024 bare points over an empty floor: each receiver's light is the sum of the closed forms within the tolerance.
    lamps = _lattice(32)
    level = _floor(lamps, 500, small_share=0.5)[1].mean()
    found, exact, _ = _floor(lamps, 4000, tolerance=error * level)
    assert np.sqrt(np.mean((found - exact) ** 2)) < error * level
    assert abs(np.mean(found - exact)) < 4 * np.std(found - exact) / len(found) ** 0.5 + 1e-4 * level


def test_how_many_looks_are_worked_on_at_once_changes_no_bit(monkeypatch):
    # 256 lamps over 3,000 receivers without neighbours: batches of 2,000 looks, and of 50 pairs of block and lamp.
    lamps = _lattice(16)
    usual = _floor(lamps, 3000, tolerance=0.02)
    for constant, value in (("BATCH_LOOKS", 2000), ("BATCH_PAIRS", 50), ("LEAST_RECEIVERS", 1)):
        monkeypatch.setattr(many_lights, constant, value)
        other = _floor(lamps, 3000, tolerance=0.02)
        assert np.array_equal(other[0], usual[0])
        assert other[2] == usual[2]


def test_batches_are_whole_blocks_that_together_are_all():
    # 5,000 receivers and 300 lamps: every block once and in order, few enough receivers in each batch.
    _, places = _cloud(5000)
    blocks = Blocks.nested(places, (64,), Run(2))[0]
    lights = tuple(Point(f"lamp {x}", (x / 10, 0, 2), 1.0) for x in range(300))
    batches = many_lights.Chooser(LightBounds.of(lights), 0).batches(blocks)
    assert [block for part in batches for block in range(part.start, part.stop)] == list(range(len(blocks)))
    most = max(many_lights.LEAST_RECEIVERS, 5000 // SHARES)
    assert max(blocks.take(part).size.sum() for part in batches) <= most + 64 + 1
    assert len(batches) >= SHARES / 2


def test_rays_hardly_grow_with_the_number_of_lamps():
    # The same light from 256, 1,024 and 4,096 lamps: 16 times the lamps take less than 3 times the rays.
    counts = []
    for side in (16, 32, 64):
        lamps = _lattice(side, 1024 / side**2)
        counts.append(_floor(lamps, 1500, small_share=0.05, pilot=4)[2] / 1500)
    assert counts[2] < 3 * counts[0]
    assert counts[2] < 64


def test_lamps_behind_a_wall_are_left_alone():
    # A wall hides half of 1,024 lamps from half of the floor: right within the tolerance, on both sides of it.
    lamps = _lattice(32)
    walled = quad((-20, -20, 0), (40, 0, 0), (0, 40, 0)) + quad((0, -20, 0), (0, 40, 0), (0, 0, 5))
    geometry = Geometry(walled.scene())
    origin = geometry.scene.origin
    level = _floor(lamps, 500, small_share=0.5)[1].mean()
    points = np.array([(x, y, 0.01) for x in (-0.5, 0.5, 6.0) for y in np.linspace(-9, 9, 200)])
    geometry, places = _probes(walled.scene(), points, UP)
    moved = tuple(lamp.translated(-origin) for lamp in lamps)
    found = DirectLight(geometry, moved, 0).irradiance(places, Run(2), tolerance=0.03 * level)[:, 0]
    there, up = points.astype(np.float32), np.broadcast_to(np.array(UP, np.float32), points.shape)
    exact = sum(np.where((lamp.position[0] > 0) == (points[:, 0] > 0), lamp.irradiance(there, up)[:, 0], 0)
                for lamp in lamps)
    assert np.sqrt(np.mean((found - exact) ** 2)) < 0.03 * level


def test_one_strong_lamp_far_off_is_found_among_many():
    # 1,023 weak points overhead and one of ten million times their power, 300 m away: it gives nine tenths of all.
    lamps = (*_lattice(32, 1e-4)[1:], Point("far", (0, 300, 100), 1e3))
    found, exact, _ = _floor(lamps, 2000, small_share=0.05, pilot=4)
    assert found.mean() == pytest.approx(exact.mean(), rel=0.01)
    assert np.sqrt(np.mean((found - exact) ** 2)) < 0.1 * exact.mean()


def test_an_occluder_of_a_thousandth_of_the_light_is_found():
    # S-8: 1,000 equal lamps, a coaster hides one of them from the receivers under it: they lose a thousandth, on the
    # average over 2,000 shifts, and nobody else does.
    rng = np.random.default_rng(2)
    angle = rng.uniform(0, 2 * np.pi, 1000)
    lamps = tuple(Point(f"lamp {n}", (50 * np.cos(a), 50 * np.sin(a), 40), 1.0) for n, a in enumerate(angle))
    # Half way to the first lamp.
    middle = lamps[0].position / 2
    bare = quad((-1, -1, -1), (2, 0, 0), (0, 2, 0))
    coaster = bare + quad(middle - (0.05, 0.05, 0), (0.1, 0, 0), (0, 0.1, 0))
    lit = []
    for shape in (bare, coaster):
        scene = shape.scene()
        geometry, places = _probes(scene, np.zeros((2000, 3)), UP)
        moved = tuple(lamp.translated(-scene.origin) for lamp in lamps)
        lit.append(DirectLight(geometry, moved, 0).irradiance(places, Run(2), small_share=5e-3, pilot=1)[:, 0])
    lost = (lit[0] - lit[1]).mean() / lit[0].mean()
    # All lamps are alike as seen from the origin: the draw's noise is the only one.
    assert lost == pytest.approx(1e-3, abs=float(4 * np.std(lit[0] - lit[1]) / 2000**0.5 / lit[0].mean()))
    assert lost > 0


def test_lamps_amid_few_receivers_are_summed_to_the_wanted_error():
    # Eight small spots among 300 probes in 12 x 12 x 7 m, as an audit draws them: many blocks are close to all lamps.
    # Their bound, that of a receiver which touches a lamp, is thousands of times what it gives. Nothing stands between,
    # so the sums of closed forms are exact. Where no error is given, it is less than half of the mean.
    rng = np.random.default_rng(3)
    aims = np.column_stack([rng.uniform(-4, 4, (8, 2)), np.full(8, -6.0)])
    lamps = [Spot(f"spot {number}", (number - 3.5, 0, 0), 800, 0.05, direction=aim - (number - 3.5, 0, 0),
                  spot_size=0.6, blend=0.5) for number, aim in enumerate(aims)]
    geometry, places = _probes(quad((-9, -9, -9), (1, 0, 0), (0, 1, 0)).scene(),
                               rng.uniform((-6, -6, -6), (6, 6, 1), (300, 3)), UP)
    middle = np.full(300, 0.5, np.float32)
    given = [lamp.translated(-geometry.scene.origin) for lamp in lamps]
    exact = sum(lamp.irradiance(*places.sample(np.arange(300), middle, middle)) for lamp in given)
    wanted = 0.1 * float(exact.mean())
    for tolerance, most in ((wanted, wanted), (0.0, 5 * wanted)):
        found = DirectLight(geometry, given, 5).irradiance(places, Run(1), tolerance, 32)
        assert np.sqrt(np.mean((found - exact) ** 2)) < most


def test_draws_for_paths_are_unbiased_wherever_a_point_lies():
    # 90 lamps: one over the probability, summed over draws, is the number of lamps; chances are those of the draws.
    scene = quad((-4, -4, -4), (8, 0, 0), (0, 8, 8)).scene()
    lamps = [lamp.translated(-scene.origin) for lamp in _zoo(10)]
    draw = LampDraw(lamps, Geometry(scene), Reach.of([links_of(lamp) for lamp in lamps], 1))
    point = np.tile(np.array([[0.3, -0.2, 0.1]], np.float32), (200_000, 1))
    lamp, chance = draw.draw(point, np.zeros(len(point), np.int64), (np.arange(len(point)) + 0.5) / len(point))
    counts = np.bincount(lamp, minlength=len(lamps)) / len(point)
    assert np.array_equal(np.unique(lamp), np.arange(len(lamps)))
    assert np.allclose(counts[lamp], chance, atol=2e-5)

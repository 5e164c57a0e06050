"""Other reflectances after a bake: one solve and no ray, and what comes of it is a fresh bake."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from radiosity import solver
from radiosity.solver.cells import Cells
from radiosity.solver.direct import DirectLight
from radiosity.solver.errors import SceneError, SettingsError
from radiosity.solver.fans import Fans
from radiosity.solver.footprints import ReceiverFootprints
from radiosity.solver.gather import Gather, Look
from radiosity.solver.geometry import Geometry
from radiosity.solver.lamps import Point
from radiosity.solver.parallel import Run
from radiosity.solver.patches import Patches
from radiosity.solver.path_keeper import LEAST_RAYS, MOST_BYTES, PathKeeper, rays_kept
from radiosity.solver.paths import Paths
from radiosity.solver.probes import free_receivers
from radiosity.solver.recolour import _gathered, _Light
from radiosity.solver.shells import Shells
from radiosity.solver.sources import light_sources
from radiosity.solver.transport import Transport
from radiosity.tests.solver.rooms import EAST, FLOOR, box, quad, wall_points
from radiosity.tests.solver.test_groups import apart, room

QUICK = {"error": 0.1, "resolution": 32, "threads": 1}
LAMP = Point("lamp", (1, 1, 1.7), (9, 9, 9), 0.05)
PAINTED = np.array([1.6, 0.5, 1.0])


def painted(scene):
    """The same room in other colours."""
    return replace(scene, reflectance=np.minimum(np.asarray(scene.reflectance) * PAINTED, 0.95))


def rms(first, second):
    """Relative to the second's mean, over what light falls on in both."""
    lit = first.any(axis=-1) & second.any(axis=-1)
    return float(np.sqrt(np.mean((first[lit] - second[lit]) ** 2)) / second[lit].mean())


@pytest.fixture(scope="module")
def kept():
    """The room of four lights, baked with groups and paths."""
    return solver.bake(room(), solver.Settings(**QUICK), groups=apart(room()), keep_paths=True)


def test_a_bake_that_keeps_paths_is_the_bake_without_them(kept):
    # Exact answer: the same light to the bit.
    assert np.array_equal(kept.lightmaps[0].pixels, solver.bake(room(), solver.Settings(**QUICK)).lightmaps[0].pixels)


@pytest.mark.parametrize(("before", "after"), [(0.5, 0.8), (0.8, 0.0), (0.0, 0.9)])
def test_a_closed_furnace_has_the_light_of_its_new_reflectance(before, after):
    # A closed box that emits 1 W/m2 everywhere. Exact answer: H = 1 / (1 - rho), here for the new rho.
    settings = solver.Settings(**QUICK, quantity="irradiance")
    bake = solver.bake(box((0, 0, 0), (1, 2, 1), before, 1.0).scene(), settings, keep_paths=True)
    relit = solver.relight(bake, settings, scene=box((0, 0, 0), (1, 2, 1), after, 1.0).scene())
    pixels = relit.lightmaps[0].pixels
    assert pixels[pixels.any(axis=-1)] == pytest.approx(1 / (1 - after), rel=5e-4)
    assert relit.report["recoloured"]["noise"] < 1e-4


def test_what_did_not_change_stays_as_it_was(kept):
    # The same reflectances. Exact answer: the same image, but for rounding and seams that are stitched once more.
    relit = solver.relight(kept, solver.Settings(**QUICK), scene=room())
    assert relit.lightmaps[0].pixels == pytest.approx(kept.lightmaps[0].pixels, rel=1e-3, abs=1e-4)
    assert relit.report["recoloured"]["noise"] == 0


def test_a_painted_room_is_lit_as_by_a_fresh_bake(kept):
    # More red, half the green. Exact answer: a fresh bake. With its seed most of the noise is the same; a bake of
    # another seed is as far from the relit room as two bakes are from each other.
    settings = solver.Settings(**QUICK)
    relit = solver.relight(kept, settings, scene=painted(room())).lightmaps[0].pixels
    fresh, other = (solver.bake(painted(room()), replace(settings, seed=seed)).lightmaps[0].pixels for seed in (0, 5))
    assert rms(kept.lightmaps[0].pixels, fresh) > 0.2
    assert rms(relit, fresh) < 0.02
    assert relit.mean(axis=(0, 1)) == pytest.approx(fresh.mean(axis=(0, 1)), abs=5e-3 * float(fresh.mean()))
    assert rms(relit, other) < 1.1 * rms(fresh, other)


def test_lamps_and_colours_change_together():
    # Every light another strength, one off, one another colour, in the painted room. Exact answer: a fresh bake, both
    # of an error of 3 % (at 10 % the two are half a per cent apart, whatever the seed).
    finer = solver.Settings(**{**QUICK, "error": 0.03})
    kept = solver.bake(room(), finer, groups=apart(room()), keep_paths=True)
    fresh = painted(room((0.0, 3.0, 24.0), (1.0, 0.5, 0.0), 0.0, (0.3, 0.0, 0.1)))
    expected = solver.bake(fresh, finer).lightmaps[0].pixels
    strengths = {"a": (0, 0.25, 2), "b": (1 / 6, 0.5 / 6, 0), "glow": 0, "sky": (1.5, 0, 0.5)}
    relit = solver.relight(kept, finer, strengths, painted(room())).lightmaps[0].pixels
    assert relit.mean(axis=(0, 1)) == pytest.approx(expected.mean(axis=(0, 1)), abs=5e-3 * float(expected.mean()))
    assert rms(relit, expected) < 0.03


def test_a_new_texture_is_looked_up_where_rays_met_it():
    # A closed box under a lamp, its floor white, then with a texture: red in one half, green in the other. Exact
    # answer: a fresh bake; the wall beside the red half is reddened, the other is not.
    shape = box((0, 0, 0), (2, 2, 2), 0.5)
    count = len(shape.corners)
    uv = np.zeros((count, 3, 2), np.float32)
    uv[2 * FLOOR:2 * FLOOR + 2] = shape.corners[2 * FLOOR:2 * FLOOR + 2, :, :2] / 2
    pixels = np.zeros((1, 2, 3), np.float32)
    pixels[0, 0, 0] = pixels[0, 1, 1] = 1
    number = np.full(count, -1, np.int32)
    number[2 * FLOOR:2 * FLOOR + 2] = 0
    plain = shape.scene(lights=(LAMP,))
    textured = replace(plain, uv=uv, textures=(solver.Texture(pixels),), reflectance_texture=number)
    settings = solver.Settings(**QUICK)
    relit = solver.relight(solver.bake(plain, settings, keep_paths=True), settings, scene=textured)
    fresh = solver.bake(textured, settings)
    assert rms(relit.lightmaps[0].pixels, fresh.lightmaps[0].pixels) < 0.03


def test_colours_reach_what_lies_behind_a_narrow_gap():
    # A board five millimetres before the east wall of a closed box: rays of its back go on, bounce by bounce. The
    # wall becomes red. Exact answer: a fresh bake.
    def scene(wall):
        walls = box((0, 0, 0), (2, 2, 2), 0.6)
        shape = walls + quad((1.995, 0.2, 0.2), (0, 1.6, 0), (0, 0, 1.6), 0.6)
        rho = np.repeat(shape.reflectance[:, None], 3, axis=1)
        rho[2 * EAST:2 * EAST + 2] = wall
        return replace(shape.scene(lights=(LAMP,)), reflectance=rho)

    settings = solver.Settings(**{**QUICK, "error": 0.05})
    bake = solver.bake(scene(0.6), settings, keep_paths=True)
    assert sum(len(level.cell) for level in bake.paths.looks[0].levels[1:]) > 0
    relit = solver.relight(bake, settings, scene=scene((0.9, 0.1, 0.1)))
    fresh = solver.bake(scene((0.9, 0.1, 0.1)), settings)
    assert rms(relit.lightmaps[0].pixels, fresh.lightmaps[0].pixels) < 0.02


def test_kept_rays_bring_what_the_gather_found():
    # A room with a shelf near its floor, under a lamp and a sky through a window; no light groups. Exact answer: what
    # the gather's own rays brought, ray by ray the same sum, to half floats' rounding.
    transport, fans, run = _solved(room())
    transport.keeper = keeper = PathKeeper(len(fans), 32)
    bounced = Gather(transport).light(fans, [Look(np.arange(len(fans)), 32, 0, 7)], run)[0].sum(axis=1)[:, 3:6]
    paths = keeper.paths(transport)
    light = _Light.of(paths, np.ones((1, 3)), paths.reflectance, run)
    brought = _gathered(paths.looks[0], light, run)
    emission = transport.emission()
    seen = np.take(emission, paths.looks[0].hits, axis=0)[..., :3].mean(axis=1) if emission is not None else 0
    assert brought - seen == pytest.approx(bounced, rel=2e-3, abs=2e-3 * float(bounced.mean()))
    assert len(paths.looks[0].levels) > 1


def test_vertex_colours_are_recoloured():
    # The closed furnace on its corners. Exact answer: 1 / (1 - rho) on each.
    settings = solver.Settings(**QUICK, quantity="irradiance", target="vertex")
    bake = solver.bake(box((0, 0, 0), (1, 2, 1), 0.5, 1.0).scene(), settings, keep_paths=True)
    relit = solver.relight(bake, settings, scene=box((0, 0, 0), (1, 2, 1), 0.8, 1.0).scene())
    assert relit.corner_colours[0] == pytest.approx(5, rel=5e-4)


def test_illuminance_is_recoloured_after_its_channels_are_mixed():
    # The closed furnace. Exact answer: 683 lux from 1 W/m2 of white, times 1 / (1 - rho); with groups, and without.
    settings = solver.Settings(**QUICK, quantity="illuminance")
    scene, after = (box((0, 0, 0), (1, 2, 1), rho, 1.0).scene() for rho in (0.5, 0.8))
    every = np.ones(len(scene.triangles), bool)
    for groups in ((), (solver.LightGroup("glow", emission=every),)):
        bake = solver.bake(scene, settings, groups=groups, keep_paths=True)
        pixels = solver.relight(bake, settings, scene=after).lightmaps[0].pixels
        assert pixels[pixels.any(axis=-1)] == pytest.approx(683 * 5, rel=1e-3)


def test_direct_light_has_no_colour_of_its_own():
    # Direct light alone. Exact answer: the same image, whatever the reflectance.
    settings = solver.Settings(**QUICK, passes="direct")
    bake = solver.bake(room(), settings, keep_paths=True)
    assert bake.paths is None
    assert solver.relight(bake, settings, scene=painted(room())) is bake


def test_a_floor_that_sees_no_surface_keeps_its_light():
    # A floor alone under a lamp. Exact answer: what it reflects comes back to nobody.
    floor = quad((0, 0, 0), (1, 0, 0), (0, 1, 0)).scene(lights=(LAMP,))
    settings = solver.Settings(**QUICK)
    bake = solver.bake(floor, settings, keep_paths=True)
    relit = solver.relight(bake, settings, scene=replace(floor, reflectance=0.1))
    assert np.array_equal(relit.lightmaps[0].pixels, bake.lightmaps[0].pixels)


def test_paths_are_the_same_from_arrays(kept):
    # Put down as arrays and taken up again. Exact answer: the same relit image to the bit.
    again = replace(kept, paths=Paths.of_arrays(kept.paths.as_arrays()))
    settings = solver.Settings(**QUICK)
    first, second = (solver.relight(bake, settings, scene=painted(room())) for bake in (kept, again))
    assert np.array_equal(first.lightmaps[0].pixels, second.lightmaps[0].pixels)


def test_the_most_bytes_decide_how_many_rays_are_kept():
    # Two looks of four bytes a ray. Exact answer: all of 64 while 512 bytes a receiver fit, then fewer, then none.
    assert rays_kept(1000, 64) == 64
    assert rays_kept(MOST_BYTES // (8 * 64), 64) == 64
    assert rays_kept(MOST_BYTES // (8 * 64) + 1, 64) == 32
    assert rays_kept(MOST_BYTES // (8 * LEAST_RAYS), 64) == LEAST_RAYS
    assert rays_kept(MOST_BYTES // (8 * LEAST_RAYS) + 1, 64) == 0


def test_half_of_the_rays_serve_with_more_noise(kept, monkeypatch):
    # As many bytes as half of the rays take. Exact answer: a fresh bake, to twice the error that all rays leave.
    lumels = len(kept.paths.looks[0].hits)
    monkeypatch.setattr("radiosity.solver.path_keeper.MOST_BYTES", 8 * lumels * 8)
    settings = solver.Settings(**QUICK)
    few = solver.bake(room(), settings, groups=apart(room()), keep_paths=True)
    assert few.paths.rays == kept.paths.rays // 2
    fresh = solver.bake(painted(room()), settings).lightmaps[0].pixels
    assert rms(solver.relight(few, settings, scene=painted(room())).lightmaps[0].pixels, fresh) < 0.04


def moved(scene):
    vertices = np.array(scene.vertices)
    vertices[0] += 0.1
    return replace(scene, vertices=vertices)


@pytest.mark.parametrize("change", [moved, lambda scene: replace(scene, opacity=0.5),
                                    lambda scene: replace(scene, casts_shadow=False)])
def test_what_lets_rays_go_other_ways_needs_a_bake(kept, change):
    with pytest.raises(SceneError, match="what rays can meet has changed since the bake"):
        solver.relight(kept, solver.Settings(**QUICK), scene=change(room()))


def test_what_can_not_be_recoloured_is_told(kept):
    settings = solver.Settings(**QUICK)
    with pytest.raises(SettingsError, match="keep its paths"):
        solver.relight(replace(kept, paths=None), settings, scene=room())
    with pytest.raises(SettingsError, match="radiosity holds the colours"):
        solver.relight(kept, replace(settings, quantity="radiosity"), scene=room())
    with pytest.raises(SettingsError, match="give one for each group"):
        solver.relight(kept, settings, {"a": 1})
    closed = box((0, 0, 0), (1, 1, 1), 0.5, 1.0)
    bake = solver.bake(closed.scene(), settings, keep_paths=True)
    with pytest.raises(SceneError, match="lower the reflectance"):
        solver.relight(bake, settings, scene=replace(closed.scene(), reflectance=1.0))


def test_peaks_and_the_rest_add_up_to_what_all_rays_bring():
    # The same rays with no peak, and with one that a part of the rays passes: the same sums, and both parts lit.
    transport, fans, run = _solved(room())
    look = [Look(np.arange(len(fans)), 32, 0, 7)]
    whole = Gather(transport).light(fans, look, run)[0]
    split = Gather(transport, peak=float(whole.sum(axis=1).mean())).light(fans, look, run)[0]
    assert not whole[:, 1].any()
    assert split.min() > -1e-6
    assert 0.1 < split[:, 1].sum() / whole.sum() < 0.9
    assert split.sum(axis=1) == pytest.approx(whole.sum(axis=1), rel=1e-5, abs=1e-6)


def _solved(scene):
    """A solved transport, and fans over the room's floor."""
    geometry, run = Geometry(scene), Run()
    lights, sampled = light_sources(geometry)
    corners = geometry.corners.reshape(-1, 3)
    patches = Patches(Shells.of(geometry.corners), corners.min(axis=0), corners.max(axis=0), 0.4, 1.0)
    transport = Transport(geometry, DirectLight(geometry, lights, 0), sampled, Cells(geometry, 0.1), patches, 0, run)
    points, normals = wall_points((0, 0, 0), (2, 2, 2), FLOOR, 9)
    receivers = free_receivers(points - scene.origin, normals, np.full(len(points), -1, np.int32))
    fans = Fans(ReceiverFootprints(geometry, receivers, 0.0, 0))
    Gather(transport).meet(fans, Look(np.arange(len(fans)), 16, 0, 1), run)
    transport.discover(64)
    transport.solve(1e-6)
    return transport, fans, run

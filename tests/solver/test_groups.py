"""Light groups: what is baked apart adds up to the whole, and follows every change of power and colour."""

from __future__ import annotations

import time

import numpy as np
import pytest
from radiosity import solver
from radiosity.solver.area_lamp import Area
from radiosity.solver.errors import SceneError
from radiosity.solver.groups import check_groups, tint
from radiosity.solver.lamps import Point, Sun
from radiosity.solver.mixing import Layer, mix
from radiosity.tests.solver.rooms import CEILING, box, quad

QUICK = {"error": 0.1, "resolution": 32, "threads": 1}
RED, SEA, DIM = (12.0, 0.0, 0.0), (0.0, 2.0, 6.0), (0.1, 0.1, 0.2)


def room(flux_a=RED, flux_b=SEA, glow=3.0, sky=DIM):
    """A box with a window: an area lamp, a point lamp, a glowing quad, and the sky outside. Four groups."""
    walls = box((0, 0, 0), (2, 2, 2), (0.5, 0.6, 0.7, 0.2, 0.5, 0.5))
    walls = type(walls)(*(np.delete(part, 2 * CEILING, axis=0) for part in (
        walls.corners, walls.reflectance, walls.emission)))
    shape = walls + quad((1.2, 1.2, 0.3), (0.3, 0, 0), (0, 0.3, 0), 0.1, glow)
    lights = (Area("a", (1, 1, 1.8), (0.5, 0, 0), (0, -0.5, 0), flux_a), Point("b", (0.4, 0.4, 1), flux_b, 0.05))
    return shape.scene(lights=lights, sky=solver.Sky(sky))


def apart(scene):
    """A group for each light of the room."""
    glow = np.asarray(scene.emission).any(axis=1)
    return (solver.LightGroup("a", (0,)), solver.LightGroup("b", (1,)), solver.LightGroup("glow", emission=glow),
            solver.LightGroup("sky", sky=True))


@pytest.fixture(scope="module")
def kept():
    """The room, baked in groups."""
    scene = room()
    return solver.bake(scene, solver.Settings(**QUICK), groups=apart(scene))


def mixed(bake, factors):
    """The first lightmap with other factors."""
    return sum(bake.groups.layers[name][0] * np.float32(factor) for name, factor in factors.items())


def test_groups_times_their_tints_are_the_lightmap(kept):
    # Four groups. Exact answer: the sum of the layers, each in its colour, is the lightmap, to rounding.
    whole = kept.lightmaps[0].pixels
    assert mixed(kept, kept.groups.tints) == pytest.approx(whole, rel=1e-4, abs=1e-4 * float(whole.mean()))
    assert kept.groups.tints["a"].tolist() == [1, 0, 0]


@pytest.mark.parametrize("passes", ["direct", "indirect"])
def test_groups_add_up_for_each_of_the_passes(passes):
    # The room's direct or bounced light alone. Exact answer: as for both.
    settings = solver.Settings(**{**QUICK, "passes": passes, "resolution": 16})
    bake = solver.bake(room(), settings, groups=apart(room()))
    whole = bake.lightmaps[0].pixels
    assert mixed(bake, bake.groups.tints) == pytest.approx(whole, rel=1e-4, abs=1e-4 * float(whole.mean()))


def test_a_bake_with_groups_is_the_bake_without_them(kept):
    # The same room without groups. Exact answer: the same light to the bit, for the same rays bring it.
    whole = solver.bake(room(), solver.Settings(**QUICK))
    assert np.array_equal(kept.lightmaps[0].pixels, whole.lightmaps[0].pixels)


def test_other_powers_and_colours_give_the_light_of_a_fresh_bake():
    # Every light changed, the red lamp to blue, a channel that it had nothing of. Exact answer: a fresh bake. The means
    # of two bakes to 10 % are .4 % apart by chance, of two to 2 % .2 %.
    settings = solver.Settings(**{**QUICK, "error": 0.02})
    kept = solver.bake(room(), settings, groups=apart(room()))
    fresh = room((0.0, 3.0, 24.0), (1.0, 0.5, 0.0), 1.0, (0.3, 0.0, 0.1))
    expected = solver.bake(fresh, settings, groups=apart(fresh)).lightmaps[0].pixels
    found = mixed(kept, {"a": (0, 0.25, 2), "b": (1 / 6, 0.5 / 6, 0), "glow": (1 / 3,) * 3, "sky": (1.5, 0, 0.5)})
    assert np.abs(found.mean(axis=(0, 1)) - expected.mean(axis=(0, 1))).max() < 0.005 * expected.mean()
    assert np.sqrt(np.mean((found - expected) ** 2)) < 0.03 * expected.mean()


def test_a_lamp_that_is_off_is_dark(kept):
    # All groups times zero but one. Exact answer: that one's light alone, in its one channel.
    alone = mixed(kept, {"a": (1, 0, 0), "b": (0, 0, 0), "glow": (0, 0, 0), "sky": (0, 0, 0)})
    assert alone[..., 0].max() > 0
    assert not alone[..., 1:].any()


def test_illuminance_mixes_its_channels_after_the_groups():
    # A floor alone, faced by a green sun of 2 W/m2. Exact answer: 683 * .7152 * 2 lux, from a layer in W/m2.
    floor = quad((0, 0, 0), (1, 0, 0), (0, 1, 0)).scene(lights=(Sun("s", (0, 0, -1), (0, 2, 0)),))
    settings = solver.Settings(**{**QUICK, "quantity": "illuminance"})
    bake = solver.bake(floor, settings, groups=(solver.LightGroup("s", (0,)),))
    assert bake.lightmaps[0].pixels.max() == pytest.approx(683 * 0.7152 * 2, rel=1e-3)
    assert bake.groups.layers["s"][0].max(axis=(0, 1)) == pytest.approx([2, 2, 2], rel=1e-3)


def test_vertex_colours_are_kept_by_group():
    # A floor alone under two suns of 1 and 3 W/m2. Exact answer: 1 / pi and 3 / pi on every corner, 4 / pi in all.
    lights = (Sun("one", (0, 0, -1), (1, 1, 1)), Sun("three", (0, 0, -1), (3, 0, 0)))
    floor = quad((0, 0, 0), (1, 0, 0), (0, 1, 0)).scene(lights=lights)
    groups = (solver.LightGroup("one", (0,)), solver.LightGroup("three", (1,)))
    bake = solver.bake(floor, solver.Settings(target="vertex", **QUICK), groups=groups)
    assert bake.groups.layers["one"][0] * np.pi == pytest.approx(1, rel=1e-3)
    assert bake.groups.layers["three"][0] * np.pi == pytest.approx(3, rel=1e-3)
    assert bake.corner_colours[0][..., 0] * np.pi == pytest.approx(4, rel=1e-3)


def test_vertex_colours_of_groups_add_up_where_some_are_held_at_zero(kept):
    # The room on its corners, shadows across its triangles: colours that would fall below zero are held there. Exact
    # answer: the groups' colours add up to the whole's, to the fit's own tolerance.
    bake = solver.bake(room(), solver.Settings(target="vertex", **QUICK), groups=apart(room()))
    whole = bake.corner_colours[0]
    assert (whole == 0).any()
    found = np.maximum(mixed(bake, bake.groups.tints), 0)
    assert np.abs(found - whole).max() < 2e-3 * whole.max()


def test_lamps_of_several_colours_are_baked_in_their_own():
    # A red and a green lamp in one group. Exact answer: no common tint; two reds of unlike power: red.
    floor = quad((0, 0, 0), (1, 0, 0), (0, 1, 0))
    suns = [Sun(str(number), (0, 0, -1), colour) for number, colour in enumerate([(1, 0, 0), (0, 1, 0), (3, 0, 0)])]
    scene = floor.scene(lights=suns)
    assert tint(scene, solver.LightGroup("both", (0, 1))).tolist() == [1, 1, 1]
    assert tint(scene, solver.LightGroup("reds", (0, 2))).tolist() == [1, 0, 0]


@pytest.mark.parametrize(("groups", "message"), [
    ((solver.LightGroup("a", (0,)), solver.LightGroup("a", (1,))), "two light groups are called 'a'"),
    ((solver.LightGroup("a", (0,)),), "lamp 'b' is in 0 light groups"),
    ((solver.LightGroup("a", (0, 1)), solver.LightGroup("b", (1,))), "lamp 'b' is in 2 light groups"),
    ((solver.LightGroup("a", (0, 7)),), "names lamps"),
    ((solver.LightGroup("a", (0, 1)),), "emits and is in 0 light groups"),
    ((solver.LightGroup("a", (0, 1), np.ones(3, bool)),), "give a mask of the triangles"),
    ((solver.LightGroup("a", (0, 1), np.ones(13, bool)),), "the sky is in 0 light groups"),
], ids=["name twice", "lamp left out", "lamp twice", "no such lamp", "emission left out", "mask", "sky left out"])
def test_lights_that_are_in_no_group_or_in_two_are_told(groups, message):
    with pytest.raises(SceneError, match=message):
        check_groups(room(), groups)


def test_a_layer_is_kept_to_a_two_thousandth_over_nine_decades():
    # Light over nine decades of both signs, and darkness. Exact answer: half floats' 2^-11 for each; zero stays zero.
    values = np.append(np.geomspace(1e-9, 1.0, 3000), np.zeros(3)).reshape(-1, 3) * [1234.5, -1234.5, 100.0]
    layer = Layer.of(values)
    lit = np.abs(values) > 2.1e-9 * values.max()
    assert layer.values()[lit] == pytest.approx(values[lit], rel=2.0**-11)
    assert not layer.values()[-1].any()
    assert not Layer.of(np.zeros((2, 3))).values().any()


def test_mixing_is_the_sum_of_layers_times_factors():
    # Five layers of unlike brightness, one of them dark, factors over nine decades. Exact answer: the sum.
    random = np.random.default_rng(1)
    values = [random.random((50, 70, 3)) * scale for scale in (1e-6, 1e-2, 1.0, 300.0, 0.0)]
    values[1][::2] *= -1
    factors = random.random((5, 3)) * np.array([1e6, 1e3, 1.0, 1e-3, 1.0])[:, None]
    factors[1, 2] = 0
    expected = sum(value * factor for value, factor in zip(values, factors, strict=True))
    scale = sum(np.abs(value * factor) for value, factor in zip(values, factors, strict=True))
    assert (np.abs(mix([Layer.of(value) for value in values], factors) - expected) <= 2.0**-10 * scale + 1e-12).all()
    assert not mix([Layer.of(value) for value in values], np.zeros((5, 3))).any()


def test_mixing_costs_no_more_than_the_sum_of_float_images():
    # Eight images of 1,024 x 1,024. Allowed: the time on this core of the sum of the same images kept as float32, in
    # the quickest of a few runs each.
    random = np.random.default_rng(2)
    image = random.random((1024, 1024, 3), np.float32)
    layers = [Layer.of(np.roll(image, number, axis=0)) for number in range(8)]
    factors = random.random((8, 3)).astype(np.float32)
    whole = [layer.values() for layer in layers]

    def seconds(work):
        start = time.thread_time()
        work()
        return time.thread_time() - start

    ours = min(seconds(lambda: mix(layers, factors)) for _ in range(5))
    theirs = min(seconds(lambda: sum(part * factor for part, factor in zip(whole, factors, strict=True)))
                 for _ in range(5))
    assert ours < theirs

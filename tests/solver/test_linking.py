"""Lamps linked to some surfaces: exactly nothing for the others, closed forms for those, and bounces that follow."""

from __future__ import annotations

from functools import reduce
from typing import Any

import numpy as np
import pytest
import radiosity.solver as solver
from radiosity.solver.audit import Auditor
from radiosity.solver.banks import banks
from radiosity.solver.blocks import Blocks
from radiosity.solver.direct import DirectLight
from radiosity.solver.errors import SceneError
from radiosity.solver.footprints import ReceiverFootprints
from radiosity.solver.geometry import Geometry
from radiosity.solver.lamps import Point, Sun
from radiosity.solver.light_bounds import LightBounds
from radiosity.solver.linking import Linked, Links, Reach, links_of
from radiosity.solver.parallel import Run
from radiosity.solver.probes import probes
from radiosity.solver.scene import Scene, Surface
from radiosity.solver.settings import Settings
from radiosity.solver.sources import light_sources
from radiosity.tests.solver.rooms import Shape, quad

UP, DOWN = (0.0, 0.0, 1.0), (0.0, 0.0, -1.0)
BULB = Point("bulb", (0, 0, 2), 4 * np.pi)
DIRECT = Settings(passes="direct", error=0.01)
# Two black floors of 2 m that meet at x = 0, and one black plate of .4 m at z = 1 over the middle of each.
WEST, EAST, WEST_PLATE, EAST_PLATE = range(4)
FLOORS = (quad((-2, -1, 0), (2, 0, 0), (0, 2, 0), 0.0), quad((0, -1, 0), (2, 0, 0), (0, 2, 0), 0.0))
PLATES = tuple(quad((x - 0.2, -0.2, 1), (0.4, 0, 0), (0, 0.4, 0), 0.0) for x in (-0.5, 0.5))
# Under the middle of each plate as the bulb at (0, 0, 2) sees it, and in the open, on both floors.
SHADED, OPEN = np.array([(-1.0, 0, 0), (1.0, 0, 0)]), np.array([(-0.3, 0.8, 0), (0.3, 0.8, 0)])


def _stage(lights: Any, shapes: tuple[Shape, ...] = FLOORS, **more: Any) -> Scene:
    """The shapes as a surface each."""
    counts = [len(shape.corners) for shape in shapes]
    links = more.pop("links", [None] * len(shapes))
    surfaces = tuple(Surface(f"surface {number}", int(first), count, links=one) for number, (first, count, one) in
                     enumerate(zip(np.cumsum(counts) - counts, counts, links, strict=True)))
    return reduce(Shape.__add__, shapes).scene(lights=lights, surfaces=surfaces, **more)


def _to(*surfaces: int, of: int = 2) -> Any:
    """(of,) bool: these surfaces."""
    return np.isin(np.arange(of), surfaces)


def _irradiance(scene: Scene, points: Any, surfaces: Any, settings: Settings = DIRECT, normal: Any = UP) -> Any:
    """(n,) red irradiance at points of surfaces."""
    points = np.asarray(points, float)
    return solver.irradiance(scene, settings, points, np.broadcast_to(np.array(normal), points.shape),
                             surfaces=np.asarray(surfaces))[:, 0]


def _given(lamps: Any, points: Any) -> Any:
    """(n,) closed form of bare points at places that face up: I cos / d^2."""
    total = np.zeros(len(points))
    for lamp in lamps:
        away = lamp.position - points
        total += lamp.colour[0] * away[:, 2] / (away**2).sum(axis=1) ** 1.5
    return total


@pytest.mark.parametrize("linked", [WEST, EAST])
def test_receivers_get_the_closed_form_and_others_exactly_nothing(linked):
    # A bulb of 1 W/sr linked to one of two floors: I cos / d^2 on it, 0 on the other.
    scene = _stage((Linked(BULB, Links(receivers=_to(linked))),))
    found = _irradiance(scene, OPEN, (WEST, EAST))
    assert found[linked] == pytest.approx(_given([BULB], OPEN)[linked], rel=1e-4)
    assert found[1 - linked] == 0


@pytest.mark.parametrize("lit", [True, False])
def test_points_on_no_surface_get_light_if_the_links_say_so(lit):
    # A bulb for probes alone, or for the floors alone, beside a bulb for all: a probe in the air, and one on a floor.
    other = Point("other", (1, 0, 3), 4 * np.pi)
    scene = _stage((Linked(BULB, Links(receivers=_to(*([] if lit else [WEST, EAST])), probes=lit)), other))
    points = np.array([(0.3, 0.2, 1), (0.3, 0.2, 0)])
    exact = _given([other], points) + _given([BULB], points) * (lit, not lit)
    assert _irradiance(scene, points, (-1, EAST)) == pytest.approx(exact, rel=1e-3)


def test_a_lightmap_is_black_up_to_the_seam_with_a_floor_that_is_lit():
    # Two floors that lie flush, a bulb linked to the west one: stitching the seam brings no light to the east one.
    settings = Settings(passes="direct", error=0.05, resolution=32, atlas="object")
    lit, dark = solver.bake(_stage((Linked(BULB, Links(receivers=_to(WEST))),)), settings).lightmaps
    both = solver.bake(_stage((BULB,)), settings).lightmaps
    assert not dark.pixels.any()
    assert lit.pixels == pytest.approx(both[0].pixels, rel=0.05)
    # Without links the seam is stitched: then what is lit alike is alike on both sides.
    assert both[1].pixels.max() == pytest.approx(lit.pixels.max(), rel=0.05)


@pytest.mark.parametrize(("blockers", "free"), [
    (_to(WEST_PLATE, of=4), (0, 1)), (_to(WEST, EAST, EAST_PLATE, of=4), (1, 0)), (_to(of=4), (1, 1)), (False, (1, 1)),
    (_to(WEST_PLATE, EAST_PLATE, of=4), (0, 0)), (True, (0, 0))])
def test_shadow_rays_meet_blockers_alone(blockers, free):
    # Places in the shade of a plate get I cos / d^2 where their plate does not block, else 0; those in the open always.
    scene = _stage((Linked(BULB, Links(blockers=blockers)),), FLOORS + PLATES)
    exact = _given([BULB], SHADED) * free
    assert _irradiance(scene, SHADED, (WEST, EAST)) == pytest.approx(exact, rel=1e-4)
    assert _irradiance(scene, OPEN, (WEST, EAST)) == pytest.approx(_given([BULB], OPEN), rel=1e-4)


def test_a_blocker_that_casts_no_shadow_blocks_nothing():
    # Both plates are blockers; the west one casts no shadows.
    casts = np.repeat([True, True, False, True], 2)
    scene = _stage((Linked(BULB, Links(blockers=_to(WEST_PLATE, EAST_PLATE, of=4))),), FLOORS + PLATES,
                   casts_shadow=casts)
    assert _irradiance(scene, SHADED, (WEST, EAST)) == pytest.approx(_given([BULB], SHADED) * (1, 0), rel=1e-4)


def test_a_blocker_with_holes_stops_its_part():
    # Plates of opacity .25, the west one a blocker: three quarters arrive, and everything under the east one.
    scene = _stage((Linked(BULB, Links(blockers=_to(WEST_PLATE, of=4))),), FLOORS + PLATES,
                   opacity=np.repeat([1, 1, 0.25, 0.25], 2))
    around = (SHADED[:, None] + np.random.default_rng(0).uniform(-0.05, 0.05, (2, 4000, 3)) * (1, 1, 0)).reshape(-1, 3)
    part = _irradiance(scene, around, np.repeat((WEST, EAST), 4000)) / _given([BULB], around)
    # A ray from a bare point to a bare lamp is free or not: four standard deviations of 4,000 such.
    assert part.reshape(2, -1).mean(axis=1) == pytest.approx([0.75, 1], abs=4 * (0.75 * 0.25 / 4000) ** 0.5)


def test_lamps_of_unlike_links_keep_to_their_own():
    # Two bulbs in one place: one for the west floor that no plate stops, one for both floors that the plates stop.
    free = Linked(BULB, Links(receivers=_to(WEST, of=4), blockers=False))
    scene = _stage((free, BULB), FLOORS + PLATES)
    assert _irradiance(scene, SHADED, (WEST, EAST)) == pytest.approx(_given([BULB], SHADED) * (1, 0), rel=1e-4)
    assert _irradiance(scene, OPEN, (WEST, EAST)) == pytest.approx(_given([BULB], OPEN) * (2, 1), rel=1e-4)


# A floor of 1 m and a white wall of 1 m that stands on its edge x = 0. Suns from the floor's side, 45 degrees high.
FLOOR, WALL = 0, 1
CORNER = (quad((0, 0, 0), (1, 0, 0), (0, 1, 0), 0.0), quad((0, 0, 0), (0, 1, 0), (0, 0, 1), 0.8))
AFTERNOON = (-1.0, 0.0, -1.0)


def _corner(number: int) -> Scene:
    """The corner under suns of 1 W/m2 in all, linked to the wall alone, and as many linked to the floor alone."""
    return _stage(tuple(Linked(Sun(f"sun {side} {index}", AFTERNOON, 1 / number), Links(receivers=_to(side)))
                        for index in range(number) for side in (FLOOR, WALL)), CORNER)


# One lamp a surface, and more than are looked at one by one.
@pytest.mark.parametrize("number", [1, 8])
def test_the_bounce_follows_the_links(number):
    # A wall lit with cos 45 gives its form factor times .8 cos 45 to the floor. The floor's suns, which the wall would
    # have thrown back too, leave the wall alone.
    point = np.array([(0.3, 0.5, 0)])
    outline = np.array([(0, 0, 0), (0, 1, 0), (0, 1, 1), (0, 0, 1)], float)
    factor = solver.element_form_factor(point[0], UP, outline).value
    direct, indirect = (_irradiance(_corner(number), point, [FLOOR], Settings(passes=passes, error=0.01))[0]
                        for passes in ("direct", "indirect"))
    assert direct == pytest.approx(np.sqrt(0.5), rel=1e-3)
    assert indirect == pytest.approx(factor * 0.8 * np.sqrt(0.5), rel=0.01)


@pytest.mark.parametrize("number", [1, 8])
def test_the_audit_follows_the_links(number):
    # The same corner by path tracing: exact within four standard errors of 65,536 paths, and those below 1 %.
    scene = _corner(number)
    geometry = Geometry(scene)
    point = np.array([(0.3, 0.5, 0)])
    places = ReceiverFootprints(geometry, probes(scene, point, np.array([UP]), [FLOOR]), 0.5, 0)
    truth = Auditor(geometry, *light_sources(geometry), 77).truth(places, np.zeros(1, int), 1 << 16, Run(1))
    outline = np.array([(0, 0, 0), (0, 1, 0), (0, 1, 1), (0, 0, 1)], float)
    exact = solver.element_form_factor(point[0], UP, outline).value * 0.8 * np.sqrt(0.5)
    groups = truth.indirect[0, :, 0]
    error = float(groups.std(ddof=1)) / len(groups) ** 0.5
    assert error < 0.01 * exact
    assert groups.mean() == pytest.approx(exact, abs=4 * error)
    assert truth.direct[0, :, 0] == pytest.approx(np.sqrt(0.5), rel=1e-3)


def test_the_audit_of_a_room_with_links_finds_no_bias():
    # Four lamps linked in four ways over white floors and plates: the bake's own error bar, no bias beyond it, and all
    # light that lands is accounted for.
    shapes = tuple(Shape(shape.corners, shape.reflectance + 0.7, shape.emission) for shape in FLOORS + PLATES)
    ways = (Links(), Links(receivers=_to(WEST, of=4)), Links(blockers=_to(WEST_PLATE, of=4)), Links(blockers=False))
    lights = tuple(Linked(Point(f"bulb {x}", (x, 0.3, 1.5), 20, 0.1), way)
                   for x, way in zip((-1.5, -0.5, 0.5, 1.5), ways, strict=True))
    report = solver.bake(_stage(lights, shapes), Settings(error=0.03, resolution=48)).report
    estimated = report["error"]["estimated"]
    assert abs(report["energy"]["imbalance"]) < 0.02
    assert abs(estimated["bias"]) < 4 * estimated["bias_standard_error"] + 0.002
    assert estimated["rms"] < 0.03


def _lattice(links: Links, count: int) -> tuple[Linked, ...]:
    """count^2 bulbs 1.5 m over the floors."""
    across = (np.arange(count) + 0.5) / count
    return tuple(Linked(Point(f"bulb {x} {y}", (4 * x - 2, 2 * y - 1, 1.5), 1.0), links)
                 for x in across for y in across)


def _many() -> tuple[Any, Any]:
    """A scene of 288 bulbs, half linked to each floor; 400 places on each floor, and the surface of each."""
    lights = tuple(bulb for side in (WEST, EAST) for bulb in _lattice(Links(receivers=_to(side)), 12))
    scene = _stage(lights)
    rng = np.random.default_rng(3)
    return scene, np.append(rng.uniform((-0.5, -1), (0.5, 1), (800, 2)), np.zeros((800, 1)), axis=1)


def test_many_lamps_are_summed_over_those_that_reach():
    # Places on both sides of the seam, near one another: the sum of the closed forms of the 144 bulbs linked to each.
    scene, points = _many()
    surface = np.where(points[:, 0] < 0, WEST, EAST)
    level = _given([light.lamp for light in scene.lights[:144]], points).mean()
    geometry = Geometry(scene)
    up = np.broadcast_to(np.array(UP), points.shape)
    lamps = tuple(light.translated(-scene.origin) for light in scene.lights)
    for lights, alone in ((lamps, False), (lamps[:144], True)):
        places = ReceiverFootprints(geometry, probes(scene, points, up, surface), 0.5, 0)
        found = DirectLight(geometry, lights, 0).irradiance(places, Run(2), tolerance=0.02 * level)[:, 0]
        exact = _given([light.lamp for light in scene.lights[:144]], points)
        assert not found[alone & (surface == EAST)].any()
        rows = np.flatnonzero((surface == WEST) | (not alone))
        assert np.sqrt(np.mean((found - exact)[rows] ** 2)) < 0.02 * level
        assert abs(np.mean((found - exact)[rows])) < 2e-3 * level


def test_links_to_half_of_the_lamps_take_the_rays_of_half():
    # 288 bulbs of which half reach each place cost about what 144 bulbs without links do.
    scene, points = _many()
    up = np.broadcast_to(np.array(UP), points.shape)
    surface = np.where(points[:, 0] < 0, WEST, EAST)
    rays = []
    for lights in (scene.lights, tuple(light.lamp for light in scene.lights[:144])):
        geometry, run = Geometry(scene), Run(1)
        places = ReceiverFootprints(geometry, probes(scene, points, up, surface), 0.5, 0)
        moved = tuple(light.translated(-scene.origin) for light in lights)
        DirectLight(geometry, moved, 0).irradiance(places, run, tolerance=0.01)
        rays.append(sum(run.rays.values()))
    assert rays[0] < 1.2 * rays[1]


def test_blocks_hold_one_kind_and_bounds_are_nothing_where_a_lamp_does_not_reach():
    scene, points = _many()
    surface, up = np.where(points[:, 0] < 0, WEST, EAST), np.broadcast_to(np.array(UP), points.shape)
    places = ReceiverFootprints(Geometry(scene), probes(scene, points, up, surface), 0.0, 0)
    reach = Reach.of([links_of(light) for light in scene.lights], 2)
    for blocks in Blocks.nested(places, (64,), Run(1), reach.kinds(places)):
        own = reach.kind[surface][blocks.order]
        assert np.array_equal(own, np.repeat(blocks.kind, blocks.size))
        usual, most, near = LightBounds.of(scene.lights, reach).of_all(blocks)
        reached = reach.lamps[:, blocks.kind].T
        assert not (usual + most + near)[~reached].any()
        assert (near | (most > 0))[reached].all()


def test_lamps_share_a_bank_where_the_same_surfaces_stop_them():
    # Three kinds of blockers over 27 bulbs of 3 by 3 places each: three banks of nine.
    ways = (True, False, _to(WEST_PLATE, of=4))
    lamps = [bulb for way in ways for bulb in _lattice(Links(blockers=way), 3)]
    whole, bank, place, blockers = banks(lamps)
    assert len(whole) == len(blockers) == 3
    assert np.array_equal(bank, np.repeat(np.arange(3), 9))
    assert np.array_equal(place, np.tile(np.arange(9), 3))
    assert all(np.array_equal(found, way) for found, way in zip(blockers, ways, strict=True))


def test_links_to_everything_change_no_bit():
    # A lamp that reaches all and that all stop, said with masks, is the lamp without links.
    settings = Settings(error=0.1, resolution=32)
    links = Links(receivers=_to(*range(4), of=4), blockers=_to(*range(4), of=4))
    lamps = [Point(f"bulb {x}", (x, 0, 2), 9, 0.2) for x in np.linspace(-1, 1, 6)]
    one, other = (solver.bake(_stage(lights, FLOORS + PLATES), settings).lightmaps[0].pixels
                  for lights in (lamps, [Linked(lamp, links) for lamp in lamps]))
    assert np.array_equal(one, other)


def test_light_groups_follow_the_links():
    # Two bulbs in groups of their own, one linked to each floor: each layer is black on the other's floor.
    scene = _stage(tuple(Linked(BULB, Links(receivers=_to(side))) for side in (WEST, EAST)))
    groups = (solver.LightGroup("west", (0,)), solver.LightGroup("east", (1,)))
    settings = Settings(error=0.05, resolution=16, atlas="object", passes="direct")
    layers = solver.bake(scene, settings, groups=groups).groups.layers
    for name, side in (("west", WEST), ("east", EAST)):
        assert layers[name][side].any()
        assert not layers[name][1 - side].any()


# A quad of .2 m that glows at z = 1.5, and its outline.
GLOW = quad((-0.1, -0.1, 1.5), (0, 0.2, 0), (0.2, 0, 0), 0.0, 10.0)
GLOW_OUTLINE = np.array([(-0.1, -0.1, 1.5), (-0.1, 0.1, 1.5), (0.1, 0.1, 1.5), (0.1, -0.1, 1.5)])


@pytest.mark.parametrize("linked", [WEST, EAST])
def test_a_surface_that_glows_reaches_its_receivers_alone(linked):
    # Its form factor times its exitance on the floor that it is linked to, nothing on the other.
    scene = _stage((), (*FLOORS, GLOW), links=[None, None, Links(receivers=_to(linked, of=3))])
    found = _irradiance(scene, OPEN, (WEST, EAST))
    exact = 10 * solver.element_form_factor(OPEN[linked], UP, GLOW_OUTLINE).value
    assert found[linked] == pytest.approx(exact, rel=2e-3)
    assert found[1 - linked] == 0


def test_a_surface_that_glows_as_all_do_minds_its_links():
    # Everything glows alike, so that nothing is a lamp but the quad that is linked: the west floor gets it, the east
    # one gets no more than without it.
    glowing = tuple(Shape(shape.corners, shape.reflectance, shape.emission * 0 + 10) for shape in (*FLOORS, GLOW))
    scene = _stage((), glowing, links=[None, None, Links(receivers=_to(WEST, of=3))])
    found = _irradiance(scene, OPEN, (WEST, EAST))
    exact = 10 * solver.element_form_factor(OPEN[WEST], UP, GLOW_OUTLINE).value
    assert found == pytest.approx([exact, 0], rel=2e-3)


@pytest.mark.parametrize(("blocker", "free"), [(2, (0, 1)), (3, (1, 0))])
def test_blockers_alone_stop_a_surface_that_glows(blocker, free):
    # Plates that hide all of the quad from a place on each floor: one of them lets its light through.
    plates = tuple(quad((x - 0.3, -0.3, 0.7), (0.6, 0, 0), (0, 0.6, 0), 0.0) for x in (-0.5, 0.5))
    scene = _stage((), (*FLOORS, *plates, GLOW), links=[*[None] * 4, Links(blockers=_to(blocker, of=5))])
    points = np.array([(-0.95, 0, 0), (0.95, 0, 0)])
    exact = 10 * solver.element_form_factor(points[0], UP, GLOW_OUTLINE).value
    assert _irradiance(scene, points, (WEST, EAST)) == pytest.approx(exact * np.array(free), rel=2e-3)


@pytest.mark.parametrize("make", [
    lambda: Links(receivers=np.ones(2)), lambda: Links(blockers=np.ones((2, 2), bool)), lambda: Links(receivers="all")])
def test_links_that_make_no_sense_are_refused(make):
    with pytest.raises(SceneError, match="lamp"):
        make()


@pytest.mark.parametrize(("links", "of_surface", "name"), [
    (Links(receivers=_to(of=3)), False, "lamp 'bulb'"), (Links(blockers=_to(of=1)), False, "lamp 'bulb'"),
    (Links(blockers=_to(of=3)), True, "object 'surface 1'")])
def test_links_to_another_number_of_surfaces_are_refused_by_name(links, of_surface, name):
    with pytest.raises(SceneError, match=name):
        _stage((BULB if of_surface else Linked(BULB, links),), links=[None, links if of_surface else None])


@pytest.mark.parametrize("surface", [-2, 2])
def test_probes_of_surfaces_that_are_not_there_are_refused(surface):
    with pytest.raises(SceneError, match="-1 is none"):
        _irradiance(_stage((BULB,)), OPEN[:1], [surface])

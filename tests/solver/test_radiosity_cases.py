"""Radiosity with exact answers, through the library's own doors: `irradiance` at points, `solve` on triangles.

H is irradiance and B = E + rho H radiosity, W/m2. `error` is what DESIGN calls so: the RMS deviation over all points
asked, over the mean of their exact values. Points are asked for many times over, each time with rays of its own; the
mean of a point's answers, or of a wall, tells what no rays would mend, and is held to a third of the error asked for.
"""

from __future__ import annotations

import numpy as np
import pytest
from radiosity.solver import Settings, Sky, Texture, element_form_factor, irradiance, solve
from radiosity.solver.lamps import Point, Sun
from radiosity.solver.polygon import polygon_form_factor
from radiosity.tests.solver.light import at, mean, over
from radiosity.tests.solver.rooms import CEILING, FLOOR, box, quad, shape, sphere_cap, wall_points

PI = np.pi
UP, DOWN = (0, 0, 1), (0, 0, -1)
UNIT = ((0, 0, 0), (1, 1, 1))
# Rings and segments of a tessellated sphere. Its triangles are 6.4 degrees wide and lie up to .0016 of the radius
# inside: the answers of the true sphere hold to about this, relative.
RINGS, SEGMENTS = 28, 56
TESSELLATION = 0.002


def test_a_furnace_of_any_walls_glows_evenly_whatever_stands_in_it(validation):
    # A closed room, boxes inside, every triangle another rho, E = (1 - rho) L: B = L and H = L everywhere.
    random = np.random.default_rng(1)
    room = (box((0, 0, 0), (4, 3, 2.5)) + box((0.5, 0.6, 0), (1.4, 1.5, 1.9), inward=False)
            + box((2.2, 1.2, 0.8), (3.1, 2.6, 1.1), inward=False))
    rho = random.uniform(0.05, 0.95, len(room.corners))
    level = 7.0
    scene = room.scene(reflectance=rho, emission=(1 - rho) * level)
    points = random.uniform((0.01, 0.01, 0.01), (3.99, 0.55, 2.49), (40, 3))
    normals = random.normal(size=(40, 3))
    found = irradiance(scene, Settings(), points, normals)
    for name, value in (("lowest H", found.min()), ("highest H", found.max()), ("mean H", found.mean())):
        validation("P-30", name, level, value, relative=1e-3)
    solution = solve(scene, Settings(error=0.03))
    lit = solution.irradiance[:, 0] > 0
    assert lit.sum() >= len(lit) - 2  # the underside of the standing box sees nothing
    assert solution.radiosity[lit] == pytest.approx(level, rel=1e-3)


def test_a_bowl_under_an_even_sky_is_lit_evenly(judge):
    # A hemisphere open upwards, rho .5, L = 1: H = pi L (1 - f) / (1 - rho f), f = (1 - cos a) / 2, everywhere.
    bowl = sphere_cap(PI / 2, RINGS // 2, SEGMENTS)
    scene = bowl.scene(sky=Sky((1, 1, 1)))
    judge("P-31", ["H, sky"], [2.094395102393], over(bowl, scene, 0.03), 0.03, TESSELLATION)


@pytest.mark.parametrize(("name", "exact"), [("E = 1 + cos / 2, rho .8", 5.0),
                                             ("E = 1 in the north, rho .5 + .3 cos", 1.0)])
def test_a_sphere_is_lit_evenly_wherever_it_emits_and_reflects(name, exact, judge):
    # Inside a sphere: H = mean(E) / (1 - mean(rho)), constant; cos is of the polar angle.
    ball = sphere_cap(PI, RINGS, SEGMENTS)
    cosine = ball.middle[:, 2] / np.linalg.norm(ball.middle, axis=1)
    rho, exitance = (0.8, 1 + cosine / 2) if exact == 5 else (0.5 + 0.3 * cosine, (cosine > 0) * 1.0)
    scene = ball.scene(reflectance=rho, emission=exitance)
    judge("P-32", [f"H, {name}"], [exact], over(ball, scene, 0.03), 0.03, TESSELLATION)


def test_a_lamp_anywhere_in_a_sphere_lights_it_indirectly_alike(judge, validation):
    # 100 W at half a radius from the centre, rho .7: indirect H = 18.568 everywhere; direct H 31.831 and 3.5368 at
    # the poles (read a ten thousandth of the radius inside of them, where they are 4e-4 and 1.4e-4 more).
    ball = sphere_cap(PI, RINGS, SEGMENTS)
    scene = ball.scene(reflectance=0.7, lights=(Point("lamp", (0, 0, 0.5), (100,) * 3),))
    judge("P-33", ["indirect H"], [18.56807669405], over(ball, scene, 0.03, passes="indirect"), 0.03, TESSELLATION)
    poles = at(scene, 0.1, [((0, 0, 0.9999), DOWN), ((0, 0, -0.9999), UP)], passes="direct")
    for name, exact, ours in zip(("near pole", "far pole"), (31.83098861838, 3.536776513153), poles[0], strict=True):
        validation("P-33", f"direct H, {name}", exact, ours, relative=1e-3)


def _plates(width, gap, rho, exitance):
    return (quad((0, 0, 0), (width, 0, 0), (0, 1, 0), rho[0], exitance[0]),
            quad((0, 0, gap), (0, 1, 0), (width, 0, 0), rho[1], exitance[1]))


def test_two_plates_one_of_which_glows(judge, validation):
    # Unit squares, gap 1, open, rho .8, E 1 and 0.
    low, high = _plates(1, 1, (0.8, 0.8), (1, 0))
    scene = (low + high).scene()
    places = [((0.5, 0.5, 0), UP), ((0, 0, 0), UP), ((0.5, 0, 0), UP),
              ((0.5, 0.5, 1), DOWN), ((0, 0, 1), DOWN), ((0.5, 0, 1), DOWN)]
    exact = [0.040093848576, 0.022788517776, 0.029895039881, 0.245954160251, 0.142222583176, 0.185211932873]
    names = ["H1 centre", "H1 corner", "H1 edge", "H2 centre", "H2 corner", "H2 edge"]
    found = at(scene, 0.01, places)
    judge("P-34", names, exact, found, 0.01)
    solution = solve(scene, Settings(error=0.03))
    validation("P-34", "mean B1", 1.026587975413, mean(solution.radiosity, low), relative=0.01)
    validation("P-34", "mean B2", 0.164167849583, mean(solution.radiosity[2:], high), relative=0.01)


def test_two_plates_that_glow_alike(judge, validation):
    # As above, with E 1 and 1: both see the same.
    low, high = _plates(1, 1, (0.8, 0.8), (1, 1))
    scene = (low + high).scene()
    places = [((0.5, 0.5, 0), UP), ((0, 0, 0), UP), ((0.5, 0.5, 1), DOWN), ((1, 1, 1), DOWN)]
    found = at(scene, 0.01, places)
    names, exact = ["H1 centre", "H1 corner", "H2 centre", "H2 corner"], [0.286048008827, 0.165011100952] * 2
    judge("P-35", names, exact, found, 0.01)
    solution = solve(scene, Settings(error=0.03))
    validation("P-35", "mean B", 1.190755824995, mean(solution.radiosity, low + high), relative=0.01)


def test_two_long_plates_near_each_other(judge, validation):
    # 2 x 1, gap .5, open, rho .9 and .5, E 1 and 0.
    low, high = _plates(2, 0.5, (0.9, 0.5), (1, 0))
    scene = (low + high).scene()
    found = at(scene, 0.03, [((1, 0.5, 0), UP), ((1, 0.5, 0.5), DOWN), ((0, 0, 0.5), DOWN)])
    exact = [0.22490994674, 0.78147929703, 0.24684420721]
    judge("P-36", ["H1 centre", "H2 centre", "H2 corner"], exact, found, 0.03)
    solution = solve(scene, Settings(error=0.03))
    validation("P-36", "mean B1", 1.13966047939, mean(solution.radiosity, low), relative=0.01)
    validation("P-36", "mean B2", 0.29195769861, mean(solution.radiosity[2:], high), relative=0.01)


@pytest.mark.parametrize(("rho", "exact"), [(0.5, (0.342432, 0.208723, 0.362211)),
                                            (0.8, (0.826224, 0.734382, 0.859849))])
def test_the_walls_of_a_cube_get_the_continuums_means_and_not_the_lumped_ones(rho, exact, validation):
    # A unit cube, E = 1 on the ceiling. One value a wall would be 13 % off on the ceiling at rho .5.
    room = box(*UNIT, rho, (0, 1, 0, 0, 0, 0))
    found = solve(room.scene(), Settings(error=0.01)).irradiance[:, 0].reshape(6, 2).mean(axis=1)
    for name, right, ours in zip(("floor", "ceiling", "sides"), exact, (*found[:2], found[2:].mean()), strict=True):
        validation("P-39", f"mean H, {name}, rho {rho}", right, ours, relative=3e-3)


@pytest.mark.parametrize(("depth", "error"), [(3, 0.1), (10, 0.03)])
def test_the_floor_of_a_shaft_is_lit_by_the_few_rays_that_find_the_sky(depth, error):
    # A black shaft of 1 m x 1 m under an even sky, L = 1: H = pi F of its mouth, of which F = .03 at 3 m and .003 at
    # 10 m: most first looks find nothing. No mean that only follows what was found: it would be a third too dark.
    room = box((0, 0, 0), (1, 1, depth), 0.0)
    shaft = shape(np.delete(room.corners, (2 * CEILING, 2 * CEILING + 1), axis=0), 0.0)
    mouth = [(0, 0, depth), (0, 1, depth), (1, 1, depth), (1, 0, depth)]
    points = np.random.default_rng(1).uniform((0.05, 0.05, 0), (0.95, 0.95, 0), (40, 3))
    exact = PI * np.array([element_form_factor(point, UP, mouth).value for point in points])
    found = irradiance(shaft.scene(sky=Sky((1, 1, 1))), Settings(error=error), points, np.tile(UP, (40, 1)))[:, 0]
    assert found.mean() == pytest.approx(exact.mean(), rel=0.03)
    assert np.sqrt(np.mean((found - exact) ** 2)) < 2 * error * exact.mean()


def test_what_no_surface_sees_is_solved_too():
    # A sun of 1 W/m2 straight down on a square of 100 m2, rho .5: H = 1, B = .5; nothing sees the square.
    solution = solve(quad((-5, -5, 0), (10, 0, 0), (0, 10, 0)).scene(lights=(Sun("sun", DOWN, (1, 1, 1)),)), Settings())
    assert solution.irradiance == pytest.approx(1.0, rel=1e-5)
    assert solution.radiosity == pytest.approx(0.5, rel=1e-5)


@pytest.mark.parametrize("error", [0.1, 0.015])
def test_a_triangle_has_its_mean_light_however_small_its_cells(error):
    # A cube of 2 m floats over that square, all black: H = 1 on its top, and .96 on the floor, of which it shades 4 m2.
    floor = quad((-5, -5, 0), (10, 0, 0), (0, 10, 0), 0.0)
    cube = box((-1, -1, 0.5), (1, 1, 2.5), 0.0, inward=False)
    light = solve((floor + cube).scene(lights=(Sun("sun", DOWN, (1, 1, 1)),)), Settings(error=error)).irradiance[:, 0]
    assert light[:2] == pytest.approx(0.96, rel=2e-3)
    assert light[2:][cube.normal[:, 2] > 0.5] == pytest.approx(1.0, rel=1e-5)


@pytest.mark.parametrize("exitance", [0.5, 100.0])
def test_radiosity_counts_a_lamps_own_light(exitance):
    # A board that glows faintly (rays find it) or brightly (a lamp) in a room, rho .5: B = E + rho H on every triangle.
    room = box((0, 0, 0), (4, 4, 3), emission=0.1) + quad((1.8, 1.8, 2.9), (0, 0.4, 0), (0.4, 0, 0), 0.5, exitance)
    solution = solve(room.scene(), Settings(error=0.1))
    assert solution.radiosity[:, 0] == pytest.approx(room.emission + 0.5 * solution.irradiance[:, 0], rel=1e-4)


# --- manufactured ----------------------------------------------------------------------------------------------------
MANUFACTURED = {FLOOR: 2.0, CEILING: 3.0}
SIDES = 2.5
NODES = 33


def _manufactured():
    """A unit cube, rho .5, with textures of E = B - H / 2 for B = 2 floor, 3 ceiling, 2.5 sides."""
    room = box(*UNIT)
    walls = room.corners.reshape(6, 2, 3, 3)
    wanted = np.array([MANUFACTURED.get(side, SIDES) for side in range(6)])
    # The walls' edges are approached, not met: there the light of the wall next to it jumps to a half.
    step = np.clip(np.linspace(0, 1, NODES), 1e-6, 1 - 1e-6)
    textures = []
    for side in range(6):
        a, u, v = walls[side, 0, 0], walls[side, 0, 1] - walls[side, 0, 0], walls[side, 0, 2] - walls[side, 0, 1]
        points = a + step[None, :, None] * u + step[:, None, None] * v
        normals = np.broadcast_to(np.cross(u, v), points.shape)
        light = np.zeros((NODES, NODES))
        for other in np.setdiff1d(np.arange(6), side):
            corners = np.concatenate([walls[other, 0], walls[other, 1, 2:]])
            seen = polygon_form_factor(points.reshape(-1, 3), normals.reshape(-1, 3), corners)
            light += wanted[other] * np.abs(seen).reshape(light.shape)
        textures.append(Texture(np.repeat((wanted[side] - light / 2)[..., None], 3, axis=2)))
    # Texels stand on the walls' edges.
    low, high = 0.5 / NODES, 1 - 0.5 / NODES
    corner = np.array([[low, low], [high, low], [high, high], [low, high]])
    uv = np.tile(corner[[[0, 1, 2], [0, 2, 3]]], (6, 1, 1))
    side = np.repeat(np.arange(6), 2)
    return room.scene(emission=1.0, uv=uv, textures=tuple(textures), emission_texture=side), wanted[side]


def test_a_cube_that_is_made_for_an_even_radiosity_has_it(judge, validation):
    # E is set so that B is 2 on the floor, 3 on the ceiling and 2.5 on the sides.
    scene, wanted = _manufactured()
    found = at(scene, 0.03, [((0.5, 0.5, 0), UP), ((0.1, 0.1, 0), UP), ((0.02, 0.5, 0), UP),
                              ((0, 0.5, 0.25), (1, 0, 0)), ((0.5, 0.5, 1), DOWN)])
    names = ["H floor centre", "H floor (.1, .1)", "H floor (.02, .5)", "H side (0, .5, .25)", "H ceiling centre"]
    exact = [2.61972823523, 2.583809227557, 2.592182266324, 2.398473033914, 2.38027176477]
    judge("P-44", names, exact, found, 0.03)
    radiosity = solve(scene, Settings(error=0.01)).radiosity[:, 0]
    for side, name in enumerate(("floor", "ceiling", "west", "east", "south", "north")):
        validation("P-44", f"B {name}", wanted[2 * side], radiosity[2 * side:2 * side + 2].mean(), relative=3e-3)


# --- after CIE 171, case 5.8 -----------------------------------------------------------------------------------------
@pytest.mark.parametrize("reflectances", [(0.05, 0.1, 0.2), (0.3, 0.4, 0.5), (0.6, 0.7, 0.8), (0.85, 0.9, 0.95)])
def test_a_cubes_mean_indirect_light_grows_with_its_reflectance(reflectances, validation):
    # A cube of 4 m, 10,000 lm in it: mean indirect E = flux rho / (96 (1 - rho)), whatever the lamp: 5.482456 at rho
    # .05 to 1979.166667 at .95. Three reflectances at a time, as red, green and blue.
    room = box((0, 0, 0), (4, 4, 4))
    scene = room.scene(reflectance=np.tile(reflectances, (12, 1)), lights=(Point("lamp", (2, 2, 2), (10_000,) * 3),))
    irradiance_means = np.average(solve(scene, Settings(error=0.03)).irradiance, weights=room.area, axis=0)
    for rho, found in zip(reflectances, irradiance_means - 10_000 / 96, strict=True):
        exact = 10_000 / 96 * rho / (1 - rho)
        # The direct mean, 104.17, has its own sampling error, and is taken away: at rho .05 it is nineteen times the
        # rest.
        validation("P-45", f"mean indirect E, rho {rho}", exact, found, relative=0.01 + 2e-3 * 10_000 / 96 / exact)


def test_a_cubes_indirect_light_at_points_has_the_exact_mean(validation):
    # The same with rho .8 and the lamp off the middle, over 8 x 8 points of every wall.
    points, normals = (np.concatenate(each) for each in
                       zip(*(wall_points((0, 0, 0), (4, 4, 4), side, 8) for side in range(6)), strict=True))
    scene = box((0, 0, 0), (4, 4, 4), 0.8).scene(lights=(Point("lamp", (1, 2.5, 2), (10_000,) * 3),))
    found = irradiance(scene, Settings(passes="indirect"), points, normals).mean()
    validation("P-45", "mean indirect E at points, rho 0.8", 416.666667, found, relative=0.01)


# --- skies -----------------------------------------------------------------------------------------------------------
SPECK = shape([[[0, 0, -100], [0.01, 0, -100], [0, 0.01, -100]]])


def _sky(radiance_of_height, height=256):
    """An equirectangular map of a radiance that depends on z = sin(elevation) alone."""
    z = -np.cos((np.arange(height) + 0.5) / height * PI)
    return Sky(np.broadcast_to(radiance_of_height(z)[:, None, None], (height, 2 * height, 3)))


def test_an_overcast_sky_lights_floors_and_walls_as_the_cie_says(judge):
    # L = Lz (1 + 2 sin) / 3 above the horizon, black below: 2.4435 Lz on a floor, .96804 Lz on a wall.
    scene = SPECK.scene(sky=_sky(lambda z: np.where(z > 0, (1 + 2 * z) / 3, 0)))
    found = at(scene, 0.01, [((0, 0, 0), UP), ((0, 0, 0), (1, 0, 0)), ((0, 0, 0), (0.6, -0.8, 0))])
    judge("P-48", ["E horizontal", "E vertical", "E vertical, turned"],
          [2.443460952792, 0.9680432200427, 0.9680432200427], found, 0.01)


def test_an_environment_that_rises_with_height_lights_any_normal_as_it_should(judge):
    # L = 1 + z: E = pi + 2 pi / 3 n_z.
    scene = SPECK.scene(sky=_sky(lambda z: 1 + z))
    normals = [UP, DOWN, (1, 0, 0), (0.6, 0, 0.8), (0, 0.8, -0.6)]
    found = at(scene, 0.01, [((0, 0, 0), normal) for normal in normals])
    judge("P-49", [f"E, normal {normal}" for normal in normals], [PI + 2 * PI / 3 * n[2] for n in normals], found, 0.01)


def test_an_open_cube_lets_its_sky_factor_in(judge):
    # A black unit cube without a lid: the middle of its floor sees .23946 of the sky.
    room = box(*UNIT, 0.0)
    corners = np.delete(room.corners, [2 * CEILING, 2 * CEILING + 1], axis=0)
    found = at(shape(corners, 0.0).scene(sky=Sky((1, 1, 1))), 0.01, [((0.5, 0.5, 0), UP)])
    judge("P-50", ["sky factor"], [0.2394564704608], found / PI, 0.01)


def test_the_shadow_in_a_bowl_gets_the_same_light_everywhere(judge):
    # A cap of 60 degrees, rho .6, a sun of 1000 W/m2 60 degrees from the zenith: H = rho E0 cos z sin^2 a
    # / (4 (1 - rho f)) where the sun does not reach, and as indirect light where it does.
    bowl = sphere_cap(PI / 3, 14, SEGMENTS)
    scene = bowl.scene(reflectance=0.6, lights=(Sun("sun", (np.sin(PI / 3), 0, -0.5), (1000,) * 3),))
    judge("P-31", ["H, sun"], [66.17647058824], over(bowl, scene, 0.03, passes="indirect"), 0.03, TESSELLATION)


def test_the_penumbra_of_a_knife_edge(judge):
    # Source [-1, 1]^2 at z = 2, black half-plane x < 0 at z = 1: the part of the hemisphere that the lamp fills.
    exact = {-0.75: 0.01318443288285, -0.5: 0.03705534802, 0: 0.1197282352304, 0.25: 0.1611880253512,
             0.5: 0.1859108490138, 1: 0.1803687411231}
    edge = quad((-40, -40, 1), (40, 0, 0), (0, 80, 0), 0.0)
    scene = (quad((-1, -1, 2), (0, 2, 0), (2, 0, 0), 0.0, 1.0) + edge).scene()
    found = at(scene, 0.01, [((x, 0, 0), UP) for x in exact])
    judge("P-27", [f"H / B, x = {x}" for x in exact], list(exact.values()), found, 0.01)

"""Bright spots of a sky's map made lamps: no light is lost, none is counted twice, and nothing is left to chance."""

import numpy as np
import pytest
import radiosity.solver as solver
from radiosity.solver.errors import SceneError
from radiosity.solver.lamps import Sun
from radiosity.solver.lights import Light
from radiosity.solver.sampling import kronecker
from radiosity.solver.scene import Scene, Sky
from radiosity.solver.settings import Settings
from radiosity.solver.sky_lamps import CONTRAST, peel
from radiosity.solver.sky_patch import SkyPatch
from radiosity.solver.sky_picture import SkyMap, Window
from radiosity.tests.solver.lit_points import arrays, sampled, scattered

HEIGHT, WIDTH = 64, 128
ROW, COLUMN = (index.ravel() for index in np.indices((HEIGHT, WIDTH)))
UP = (0.0, 0.0, 1.0)


def _map():
    """A sky of 1 / 3 / 5 over a dark ground, a little uneven."""
    uneven = np.random.default_rng(1).uniform(0.8, 1.2, (HEIGHT, WIDTH, 1))
    return np.where(np.arange(HEIGHT)[:, None, None] < HEIGHT // 2, 0.2, (1.0, 3.0, 5.0)) * uneven


def _sunny():
    radiance = _map()
    radiance[50:52, 30:32] = (9000, 8000, 7000)
    return radiance


def _windows():
    """Two windows of many texels of uneven colour, one across the seam of the map; and bright specks and poles."""
    radiance = _map() * 0.02
    radiance[40:50, 60:75] = (20, 30, 50) * np.random.default_rng(2).uniform(0.3, 1, (10, 15, 3))
    radiance[30:35, :4] = radiance[30:35, -5:] = (40, 30, 20)
    radiance[20, 10:90:10] = (300, 20, 5)
    radiance[-1] = radiance[0] = 30
    return radiance


MAPS = {"sun": _sunny(), "windows": _windows()}


def _exact(radiance, normal):
    """(3,) irradiance of a map: the sum over its texels."""
    texels = SkyMap(radiance).texels(ROW, COLUMN)
    weight = np.maximum(texels.direction @ normal, 0) * texels.solid_angle
    return weight @ radiance.reshape(-1, 3).astype(np.float64)


@pytest.mark.parametrize("name", MAPS)
def test_lamps_and_rest_give_the_maps_irradiance(name):
    # Surfaces of any orientation: sum over the texels of the map.
    lamps, rest = peel(Sky(MAPS[name]))
    assert lamps
    points, normals = scattered(50)
    given = np.array([_exact(rest.radiance, normal) for normal in normals])
    given += sum(lamp.irradiance(points, normals) for lamp in lamps)
    exact = np.array([_exact(MAPS[name], normal) for normal in normals])
    assert given == pytest.approx(exact, rel=1e-2)
    assert np.abs(given / exact - 1).mean() < 1e-3


@pytest.mark.parametrize("name", MAPS)
def test_what_is_left_has_no_bright_spot(name):
    # Nothing above twice CONTRAST times the mean of what is left: once for spots that became lamps, and as much again
    # for what of their light has other colours.
    _, rest = peel(Sky(MAPS[name]))
    sky = SkyMap(rest.radiance)
    mean = float((sky.radiance.mean(axis=2) * sky.solid_angle()).sum()) / (4 * np.pi)
    assert rest.radiance.min() >= 0
    assert rest.radiance.mean(axis=2).max() <= 2 * CONTRAST * mean


@pytest.mark.parametrize("name", MAPS)
def test_its_lamps_samples_converge_to_their_closed_form(name):
    points, normals = scattered()
    for lamp in peel(Sky(MAPS[name]))[0]:
        assert isinstance(lamp, Light)
        exact = lamp.irradiance(points, normals)
        counts = np.array([64, 256, 1024, 4096])
        errors = [np.sqrt(((sampled(lamp, points, normals, count) - exact) ** 2).mean()) for count in counts]
        errors = np.array(errors) / exact.mean()
        assert errors[-1] < 3e-3
        rays = lamp.sample(points, normals, kronecker(len(points), 2))
        assert np.linalg.norm(rays.direction, axis=1) == pytest.approx(1, abs=1e-5)
        assert np.isinf(rays.distance).all()


@pytest.mark.parametrize("radiance", [np.ones(3), np.ones((8, 16, 3)), np.zeros((8, 16, 3)), _map()],
                         ids=["constant", "even", "black", "uneven"])
def test_a_sky_without_bright_spots_stays_as_it_is(radiance):
    sky = Sky(radiance)
    assert peel(sky) == ((), sky)


def _looked_closely(half_angle_of_sun, axis):
    """A map with a sun between its texels, and a close look that knows where it is: radiance 1000, exactly."""
    sky = SkyMap(np.full((HEIGHT, WIDTH, 3), 0.5))
    many = kronecker(4096, 2) * 2 - 1
    inside = many[(many**2).sum(axis=1) < 1] * np.tan(half_angle_of_sun)
    right, up = Window.sides(axis)
    towards = axis + inside[:, :1] * right + inside[:, 1:] * up
    row, column = sky.place(towards / np.linalg.norm(towards, axis=1)[:, None])
    light = 1000 * np.pi * np.sin(half_angle_of_sun) ** 2 / len(inside)
    radiance = sky.radiance
    np.add.at(radiance, (row, column), np.broadcast_to((light / sky.solid_angle()[row, 0])[:, None], (len(row), 3)))

    def look(axis_of_look, half_angle):
        right, up = Window.sides(axis_of_look)
        half = np.tan(half_angle)
        window = Window(axis_of_look, right, up, half, np.zeros((256, 256, 3)))
        direction = window.texels(*(index.ravel() for index in np.indices((256, 256)))).direction
        lit = direction @ axis > np.cos(half_angle_of_sun)
        seen = np.where(lit[:, None], 1000.0, 0.5) * np.ones(3)
        return Window(axis_of_look, right, up, half, seen.reshape(256, 256, 3))

    return Sky(radiance), look


def test_a_close_look_finds_the_sun_where_and_as_large_as_it_is():
    # 1 degree wide, radiance 1000, between texels of 2.8 degrees: direction to .02 degrees, diameter to 3 %.
    axis = np.array([0.36, -0.48, 0.8])
    sky, look = _looked_closely(np.radians(0.5), axis)
    (sun,), _ = peel(sky, look)
    assert isinstance(sun, Sun)
    assert np.degrees(np.arccos(min(-sun.direction @ axis, 1))) < 0.02
    assert np.degrees(sun.angle) == pytest.approx(1.0, rel=0.03)
    assert sun.colour == pytest.approx(1000 * np.pi * np.sin(np.radians(0.5)) ** 2, rel=0.02)


def test_a_sun_that_the_map_misses_in_a_texel_keeps_its_light():
    # The same sun in the corner of four texels; the map's samples have missed it in the one that has least of it.
    axis = SkyMap(np.zeros((HEIGHT, WIDTH, 3))).texels(np.array([50]), np.array([30])).direction[0]
    axis = axis + 0.8 * np.radians(1.4) * np.array([0.3, 0.5, 0.8])
    axis = axis / np.linalg.norm(axis)
    sky, look = _looked_closely(np.radians(0.7), axis)
    bright = np.argwhere(sky.radiance[..., 0] > 2 * CONTRAST * 0.5)
    missed = tuple(min(bright, key=lambda at: sky.radiance[tuple(at)][0]))
    assert len(bright) > 1
    radiance = np.array(sky.radiance)
    radiance[missed] = 0.5
    (sun,), _ = peel(Sky(radiance), look)
    assert isinstance(sun, Sun)
    assert np.degrees(sun.angle) == pytest.approx(1.4, rel=0.03)
    assert sun.colour == pytest.approx(1000 * np.pi * np.sin(np.radians(0.7)) ** 2, rel=0.02)


def test_a_floor_under_a_sunny_map_has_no_fireflies():
    # A sun of 8 square degrees gives 99 % of the light: every point of the open floor gets the same to .5 %.
    quad = np.array([(-9, -9, 0), (9, -9, 0), (9, 9, 0), (-9, 9, 0)], float)
    radiance = _sunny()
    radiance[50:52, 30:32] *= 5
    lamps, rest = peel(Sky(radiance))
    scene = Scene(quad, [(0, 1, 2), (0, 2, 3)], reflectance=0.5, lights=lamps, sky=rest)
    points, normals = arrays(np.random.default_rng(0).uniform(-1, 1, (200, 3)) * (1, 1, 0), UP)
    value = solver.irradiance(scene, Settings(error=0.02), points, normals)
    exact = _exact(radiance, np.array(UP))
    assert value.mean(axis=0) == pytest.approx(exact, rel=3e-3)
    assert np.abs(value / exact - 1).max() < 0.005


@pytest.mark.parametrize("make", [
    lambda: SkyPatch("spot", np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0), np.zeros(0), 1),
    lambda: SkyPatch("spot", [UP], [UP], [UP], [0], [-1.0], 1),
    lambda: SkyPatch("spot", [UP], [UP], [UP], [0], [1.0, 2.0], 1),
    lambda: SkyPatch("spot", [UP], [UP], [UP], [0], [1.0], -1),
])
def test_a_patch_that_makes_no_sense_is_refused_by_name(make):
    with pytest.raises(SceneError, match="spot"):
        make()

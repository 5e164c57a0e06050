"""Lamps with a pattern, with a falloff of their own, and without shadows: closed answers."""

import numpy as np
import pytest
import radiosity.solver as solver
from radiosity.solver.area_lamp import Area
from radiosity.solver.errors import SceneError
from radiosity.solver.geometry import Geometry
from radiosity.solver.lamps import Point, Sun
from radiosity.solver.light_bounds import LightBounds
from radiosity.solver.lights import Light
from radiosity.solver.linking import Linked, Links
from radiosity.solver.luminaire import Falloff, Luminaire
from radiosity.solver.sampling import kronecker
from radiosity.solver.scene import Scene
from radiosity.solver.settings import Settings
from radiosity.solver.sky_picture import SkyMap
from radiosity.solver.spot import Spot
from radiosity.tests.solver.lit_points import arrays, sampled, scattered, shell

UP, DOWN = (0.0, 0.0, 1.0), (0.0, 0.0, -1.0)
BULB = Point("lamp", (0, 0, 2), (10, 20, 30))


def _pattern(function, height=256, width=512):
    """(h, w) of a function of unit directions (k, 3)."""
    row, column = (index.ravel() for index in np.indices((height, width)))
    direction = SkyMap(np.zeros((height, width, 3))).texels(row, column).direction
    return function(direction).reshape(height, width)


def _downward(direction):
    """cos^2 of the angle to -z; 0 above the horizon."""
    return np.maximum(-direction[:, 2], 0) ** 2


LAMPS = {
    "pattern": Luminaire(BULB, _pattern(_downward)),
    "pattern on a disc": Luminaire(Point("lamp", (0, 0, 2), 10, 0.5), _pattern(_downward)),
    "pattern on a spot": Luminaire(Spot("lamp", (0, 0, 2), 10, 0.1, direction=DOWN, spot_size=1.2),
                                   _pattern(_downward)),
    "linear": Luminaire(BULB, falloff=Falloff("linear")),
    "smooth area": Luminaire(Area("lamp", (0, 0, 2), (0, 1, 0), (0.5, 0, 0), 10), falloff=Falloff("quadratic", 2)),
    "without shadow": Linked(BULB, Links(blockers=False)),
    "sun without shadow": Linked(Sun("lamp", DOWN, 1, 0.1), Links(blockers=False)),
}


@pytest.mark.parametrize("light", LAMPS.values(), ids=LAMPS)
def test_they_are_lamps_like_others(light):
    points, normals = scattered()
    rays = light.sample(points, normals, kronecker(len(points), 2))
    assert isinstance(light, Light)
    assert rays.direction.dtype == rays.distance.dtype == rays.weight.dtype == light.colour.dtype == np.float32
    assert np.isfinite(rays.weight).all()
    assert (rays.weight >= 0).all()
    moved = light.translated(np.array([8.0, -4, 2]))
    again = moved.sample(points + np.float32([8, -4, 2]), normals, kronecker(len(points), 2))
    assert again.weight == pytest.approx(rays.weight, rel=1e-3, abs=2e-3 * float(rays.weight.max()))


def test_a_pattern_multiplies_the_intensity_in_its_direction():
    # cos^2 t below a lamp at 2 m: E = I cos^2 t cos t / d^2, at 0, 1 and 2 m aside.
    aside = np.array([0.0, 1, 2])
    points, normals = arrays(np.stack([aside, 0 * aside, 0 * aside], axis=1), UP)
    distance = np.sqrt(4 + aside**2)
    exact = 10 / (4 * np.pi) * (2 / distance) ** 3 / distance**2
    assert sampled(LAMPS["pattern"], points, normals, 1)[:, 0] == pytest.approx(exact, rel=1e-4)


def test_a_pattern_turns_with_the_lamp():
    # Bright along the lamp's +x alone (cos^2); its frame turns +x to -z: the point below gets I / d^2, one aside none.
    pattern = _pattern(lambda direction: np.maximum(direction[:, 0], 0) ** 2)
    frame = np.array([[0, 0, 1.0], [0, 1, 0], [-1, 0, 0]])
    light = Luminaire(BULB, pattern, frame)
    points, normals = arrays([(0, 0, 0), (2, 0, 2)], [UP, (-1, 0, 0)])
    assert sampled(light, points, normals, 1)[:, 0] == pytest.approx([10 / (4 * np.pi) / 4, 0], rel=1e-4, abs=1e-5)


@pytest.mark.parametrize("name", ["pattern", "pattern on a spot"])
def test_its_flux_arrives_on_a_sphere_around_it(name):
    # The pattern's flux is a sixth of the bulb's: the mean of cos^2 over half of the sphere.
    light = LAMPS[name]
    points, normals, area = shell()
    arrived = sampled(light, points, normals, 1).mean(axis=0) * area
    assert arrived == pytest.approx(light.power(), rel=5e-3)
    if name == "pattern":
        assert light.power() == pytest.approx(BULB.power() / 6, rel=1e-3)


@pytest.mark.parametrize(("fade", "smooth", "slope"), [("quadratic", 0.0, -2), ("linear", 0.0, -1),
                                                      ("constant", 0.0, 0), ("quadratic", 1e-3, -2)])
def test_a_falloff_is_a_power_of_the_distance(fade, smooth, slope):
    distance = np.array([1.0, 2, 4, 8])
    points, normals = arrays(np.stack([0 * distance, 0 * distance, 2 - distance], axis=1), UP)
    value = sampled(Luminaire(BULB, falloff=Falloff(fade, smooth)), points, normals, 1)[:, 0]
    assert np.polyfit(np.log(distance), np.log(value), 1)[0] == pytest.approx(slope, abs=1e-3)
    assert value[0] == pytest.approx(10 / (4 * np.pi) / (1 + smooth), rel=1e-5)


def test_a_smooth_falloff_stays_finite_at_the_lamp():
    # d^2 / (s + d^2) / d^2 = 1 / (s + d^2): 1 / s at the lamp itself.
    points, normals = arrays([(0, 0, 2 - 1e-3)], UP)
    value = sampled(Luminaire(BULB, falloff=Falloff("quadratic", 0.5)), points, normals, 1)[0, 0]
    assert value == pytest.approx(10 / (4 * np.pi) / 0.5, rel=1e-4)


def test_a_lamp_without_shadow_is_stopped_by_nothing():
    # A point under a plate that hides the lamp from it: the same irradiance as without the plate, I / d^2.
    plate = np.array([(-1, -1, 1), (1, -1, 1), (1, 1, 1), (-1, 1, 1)], float)
    floor = plate * (1, 1, 0)
    triangles = [(0, 1, 2), (0, 2, 3), (4, 5, 6), (4, 6, 7)]
    point, normal = np.zeros((1, 3)), np.float32([UP])
    for light, factor in ((LAMPS["without shadow"], 1.0), (BULB, 0.0)):
        scene = Scene(np.concatenate([floor, plate]), triangles, reflectance=0.0, lights=(light,))
        assert len(Geometry(scene).area) == 4
        value = solver.irradiance(scene, Settings(), point, normal)[0, 0]
        assert value == pytest.approx(factor * 10 / (4 * np.pi) / 4, rel=1e-4)


@pytest.mark.parametrize(("name", "known"), [("pattern", True), ("pattern on a spot", True), ("without shadow", True),
                                             ("smooth area", True), ("linear", False)])
def test_one_among_many_is_bounded_by_its_lamp(name, known):
    # With a factor of 1 at most the lamp's own bound holds; light that falls off more slowly has none.
    assert LightBounds.of([LAMPS[name]]).unknown[0] == (not known)


@pytest.mark.parametrize("make", [
    lambda: Luminaire(BULB, np.full((4, 8), np.nan)),
    lambda: Luminaire(BULB, -np.ones((4, 8))),
    lambda: Luminaire(BULB, np.ones((4, 8, 3))),
    lambda: Luminaire(Area("lamp", (0, 0, 2), (0, 1, 0), (0.5, 0, 0), 10), np.ones((4, 8))),
    lambda: Luminaire(BULB, frame=np.ones((2, 2))),
])
def test_a_luminaire_that_makes_no_sense_is_refused_by_name(make):
    with pytest.raises(SceneError, match="lamp"):
        make()

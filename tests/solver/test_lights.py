"""Lamps without occluders: exact irradiance, samples that agree with it, and flux that is all accounted for."""

import numpy as np
import pytest
from radiosity.solver import cap
from radiosity.solver.area_lamp import Area
from radiosity.solver.errors import SceneError
from radiosity.solver.lamps import Point, Sun
from radiosity.solver.lights import Light
from radiosity.solver.mesh_emitter import MeshEmitter
from radiosity.solver.sampling import kronecker
from radiosity.solver.spot import Spot
from radiosity.tests.solver.lit_points import arrays, sampled, scattered, shell

PI = np.pi
UP, DOWN = (0.0, 0.0, 1.0), (0.0, 0.0, -1.0)
TRIANGLES = np.array([[[0, 0, 1], [1, 0, 1], [0, 1, 1.2]], [[-1, 0, 1], [0, 0, 1.5], [-1, 1, 1]]])

LAMPS = {
    "sun without angle": Sun("lamp", (0.3, 0.2, -1), (1, 2, 3)),
    "sun": Sun("lamp", (0.3, 0.2, -1), (1, 2, 3), 0.5),
    "sun of half the sky": Sun("lamp", (0.3, 0.2, -1), (1, 2, 3), PI),
    "point without radius": Point("lamp", (0, 0, 2), (10, 20, 30)),
    "point": Point("lamp", (0, 0, 2), (10, 20, 30), 0.6),
    "sphere": Point("lamp", (0, 0, 2), (10, 20, 30), 0.6, sphere=True),
    "spot": Spot("lamp", (0, 0, 2), (10, 20, 30), 0.0, direction=(0.2, 0, -1), spot_size=1.2, blend=0.5),
    "wide spot": Spot("lamp", (0, 0, 2), (10, 20, 30), 0.4, direction=(0.2, 0, -1), spot_size=1.2, blend=0.5),
    "spherical spot": Spot("lamp", (0, 0, 2), (10, 20, 30), 0.4, True, direction=(0.2, 0, -1), spot_size=1.2, blend=1),
    "scaled spot": Spot("lamp", (0, 0, 2), (10, 20, 30), 0.3, spot_size=1, blend=0.5, frame=np.diag([2, 1, 0.8])),
    "rectangle": Area("lamp", (0, 0, 2), (0, 1, 0), (0.5, 0, 0.1), (10, 20, 30)),
    "ellipse": Area("lamp", (0, 0, 2), (0, 1, 0), (0.5, 0, 0.1), (10, 20, 30), round=True),
    "mesh": MeshEmitter("lamp", TRIANGLES, [[1, 2, 3], [2, 4, 6]]),
    "mesh of one side": MeshEmitter("lamp", TRIANGLES[:, ::-1], [[1, 2, 3], [2, 4, 6]], two_sided=False),
}
SPREAD_LAMPS = {
    "slats": Area("lamp", (0, 0, 2), (0, 2, 0), (1, 0, 0), (10, 20, 30), spread=2.0),
    "narrow slats": Area("lamp", (0, 0, 2), (0, 2, 0), (1, 0, 0), (10, 20, 30), round=True, spread=0.4),
    "beam": Area("lamp", (0, 0, 2), (0, 2, 0), (1, 0, 0), (10, 20, 30), spread=0.0),
}


@pytest.mark.parametrize("light", [*LAMPS.values(), *SPREAD_LAMPS.values()], ids=[*LAMPS, *SPREAD_LAMPS])
def test_every_lamp_keeps_the_contract(light):
    # float32, unit directions, weights and distances from 0, nothing that is not finite but a sun's distance.
    points, normals = scattered()
    rays = light.sample(points, normals, kronecker(len(points), 2))
    assert isinstance(light, Light)
    assert rays.direction.dtype == rays.distance.dtype == rays.weight.dtype == light.colour.dtype == np.float32
    assert np.linalg.norm(rays.direction, axis=1) == pytest.approx(1, abs=1e-5)
    assert (rays.weight >= 0).all()
    assert np.isfinite(rays.weight).all()
    assert (rays.distance >= 0).all()
    assert np.isfinite(rays.distance).all() or isinstance(light, Sun)
    assert (rays.weight[(rays.direction * normals).sum(axis=1) <= 0] == 0).all()


@pytest.mark.parametrize("light", LAMPS.values(), ids=LAMPS)
def test_samples_converge_to_the_closed_form(light):
    # 200 points around the lamp with normals every way, so that many a horizon cuts it: the error of n points falls
    # faster than n^-.7 (random points: n^-.5) and ends within .2 % of the mean.
    points, normals = scattered()
    exact = light.irradiance(points, normals)
    assert exact.dtype == np.float32
    counts = np.array([64, 256, 1024, 4096])
    errors = np.array([np.sqrt(((sampled(light, points, normals, count) - exact) ** 2).mean()) for count in counts])
    errors /= exact.mean()
    assert errors[-1] < 2e-3
    if errors[0] > 1e-4:  # lamps without size are exact with any number of rays
        assert np.polyfit(np.log(counts), np.log(errors), 1)[0] < -0.7


def test_area_lamps_with_a_spread_have_no_closed_form():
    points, normals = scattered()
    assert all(light.irradiance(points, normals) is None for light in SPREAD_LAMPS.values())


@pytest.mark.parametrize(("radius", "height", "offset", "exact"), [(1, 1, 1, 0.2763932022500),
                                                                  (0.5, 0.75, 2, 0.007394122590163)])
def test_a_disc_lamp_has_the_form_factor_of_a_disc(radius, height, offset, exact):
    # Element facing a parallel disc whose axis is offset; radiance 1 gives E = pi F.
    light = Area("disc", (offset, 0, height), (0, 2 * radius, 0), (2 * radius, 0, 0), PI * PI * radius**2, round=True)
    points, normals = arrays([(0, 0, 0)], UP)
    assert light.irradiance(points, normals) / PI == pytest.approx(exact, rel=3e-5)
    assert sampled(light, points, normals, 2**16) / PI == pytest.approx(exact, rel=1e-4)


def test_a_square_lamp_has_the_form_factor_of_a_square():
    # A 1 m square at z = 3 in the middle of a 4 m room, four places on the floor and one on the wall (Lambert).
    light = Area("square", (0, 0, 3), (0, 1, 0), (1, 0, 0), PI)
    points, normals = arrays([(0, 0, 0), (1, 0, 0), (1, 1, 0), (1.5, 1.5, 0), (2, 0, 1.5)], [UP] * 4 + [(-1, 0, 0)])
    exact = [0.03410679489971, 0.02798915630256, 0.02334826258771, 0.01571496642135, 0.02428514065092]
    assert light.irradiance(points, normals)[:, 0] / PI == pytest.approx(exact, rel=2e-6)
    assert sampled(light, points, normals, 2**14)[:, 1] / PI == pytest.approx(exact, rel=1e-4)


def test_a_point_lamp_in_a_sphere_lights_its_poles():
    # 100 W at half the radius of a unit sphere: E = 100 / (4 pi d^2) with d = 1/2 and 3/2 at the two poles.
    points, normals = arrays([(0, 0, 1), (0, 0, -1)], [DOWN, UP])
    for light in (Point("lamp", (0, 0, 0.5), 100), Point("ball", (0, 0, 0.5), 100, 0.3, sphere=True)):
        assert light.irradiance(points, normals)[:, 0] == pytest.approx([31.83098861838, 3.536776513153], rel=1e-6)


def test_a_sun_at_the_horizon_shows_half_of_its_disc():
    # E = S (alpha - sin alpha cos alpha) / (pi sin^2 alpha) for the half of a disc of half angle alpha above it.
    angles = np.array([0.01, 0.1, 0.5, 1.5, 3.0])
    points, normals = arrays([(0, 0, 0)], UP)
    got = [float(Sun("sun", (1, 0, 0), 1.0, angle).irradiance(points, normals)[0, 0]) for angle in angles]
    half = angles / 2
    assert got == pytest.approx((half - np.sin(half) * np.cos(half)) / (PI * np.sin(half) ** 2), rel=1e-5)


def test_the_cut_at_the_horizon_sets_in_without_a_jump():
    # Irradiance of a sun of 30 degrees across its set: falls steadily, from the full cosine to nothing.
    height = np.linspace(-0.3, 0.3, 2001)
    suns = [Sun("sun", (np.cos(angle), 0, -np.sin(angle)), 1.0, np.radians(30)) for angle in height]
    points, normals = arrays([(0, 0, 0)], UP)
    irradiance = np.array([float(sun.irradiance(points, normals)[0, 0]) for sun in suns])
    assert (np.diff(irradiance) >= 0).all()
    assert np.diff(irradiance).max() < 4e-4
    assert irradiance[0] == 0
    assert irradiance[-1] == pytest.approx(np.sin(0.3), rel=1e-6)


@pytest.mark.parametrize("name", ["point", "sphere", "spot", "wide spot", "rectangle", "ellipse", "mesh", "slats"])
def test_far_away_light_falls_off_with_the_squared_distance(name):
    # Straight below at 200 ... 1600 m: slope -2 of log E against log d.
    light = {**LAMPS, **SPREAD_LAMPS}[name]
    distance = np.array([200.0, 400, 800, 1600])
    points, normals = arrays(np.stack([0 * distance, 0 * distance, -distance], axis=1), UP)
    value = sampled(light, points, normals, 1024)[:, 0]
    closed = light.irradiance(points, normals)
    # the lamp hangs 1 to 2 m above zero
    assert np.polyfit(np.log(distance + 1.5), np.log(value), 1)[0] == pytest.approx(-2, abs=0.003)
    if closed is not None:
        assert value == pytest.approx(closed[:, 0], rel=1e-3)


@pytest.mark.parametrize("name", [name for name in LAMPS if "sun" not in name])
def test_all_flux_arrives_on_a_sphere_around_the_lamp(name):
    # Irradiance integrated over a closed sphere of 5 m is the power that left. (A disc that faces each receiver sends
    # r^2 / (r^2 + d^2) less than its power: a near receiver sees it as a disc in front of the lamp's centre.)
    light = LAMPS[name]
    points, normals, area = shell()
    arrived = light.irradiance(points, normals).mean(axis=0, dtype=np.float64) * area
    disc = getattr(light, "radius", 0) and not light.sphere
    assert arrived == pytest.approx(light.power() * (25 / (25 + light.radius**2) if disc else 1), rel=2e-3)


@pytest.mark.parametrize("name", SPREAD_LAMPS)
def test_a_spread_keeps_the_flux(name):
    # The lamp hangs 2 m above a floor of 10 m, and spreads over less than 4.2 m each way: all of its flux arrives.
    light = SPREAD_LAMPS[name]
    middle = (np.arange(100) - 49.5) / 10
    floor = np.stack([*np.meshgrid(middle, middle), np.zeros((100, 100))], axis=-1)
    points, normals = arrays(floor.reshape(-1, 3), UP)
    arrived = sampled(light, points, normals, 256).mean(axis=0) * 100
    assert arrived == pytest.approx(light.power(), rel=5e-3)


def test_a_spread_leaves_the_light_outside_of_it_dark():
    # A cone of 60 degrees (half angle 30) below a lamp of 10 cm at 2 m: the floor is dark beyond 2 tan 30 + .08 m.
    light = Area("lamp", (0, 0, 2), (0, 0.1, 0), (0.1, 0, 0), 10, spread=np.radians(60))
    points, normals = arrays([(0, 0, 0), (1.0, 0, 0), (1.24, 0, 0), (0, 0, 3)], UP)
    value = sampled(light, points, normals, 256)[:, 0]
    assert value[0] > value[1] > 0
    assert value[2] == value[3] == 0


def test_a_scaled_spot_has_an_elliptic_cone():
    # tan(half angle) = .5 at 2 m: a circle of 1 m, stretched to 3 m along x and shrunk to 1/2 m along y.
    light = Spot("spot", (0, 0, 2), 1, spot_size=2 * np.arctan(0.5), frame=np.diag([3, 0.5, 1]))
    edge = np.array([(3, 0), (0, 0.5), (3 / np.sqrt(2), 0.5 / np.sqrt(2))])
    for factor, lit in ((0.99, True), (1.01, False)):
        points, normals = arrays(np.column_stack([edge * factor, [0, 0, 0]]), UP)
        assert ((light.irradiance(points, normals)[:, 0] > 0) == lit).all()


def test_all_points_at_a_spots_edge_are_worked_on_together(monkeypatch):
    # 8 x 32 places of a lamp with a sharp cone for each of 500 points: in two chunks, not place by place; its axes are
    # inverted once. The light of each point is what it is alone.
    light = Spot("spot", (0, 0, 2), 1, 0.3, spot_size=1.0, frame=np.diag([1, 0.9, 1]))
    across = np.linspace(1.05, 1.13, 500)
    points, normals = arrays(np.column_stack([across, 0 * across, 0 * across]), UP)
    done = {"towards": 0, "inv": 0}

    def count(module, name):
        plain = getattr(module, name)

        def counted(*given):
            done[name] += 1
            return plain(*given)

        monkeypatch.setattr(module, name, counted)

    count(cap, "towards")
    count(np.linalg, "inv")
    together = light.irradiance(points, normals)[:, 0]
    assert done["towards"] <= 2
    assert together[0] > together[-1] > 0
    apart = [light.irradiance(points[[row]], normals[[row]])[0, 0] for row in (0, 256, 499)]
    assert together[[0, 256, 499]] == pytest.approx(apart, rel=1e-5)
    assert done["inv"] <= 1


def test_a_spots_blend_is_a_smooth_step_of_the_cosine():
    # Size 2 acos(.5), blend .5: 0 at cosine .5, a half at .625, full from .75; E = I fade cos / d^2 = I fade cos^3 / 4.
    light = Spot("spot", (0, 0, 2), 4 * PI, direction=DOWN, spot_size=2 * np.arccos(0.5), blend=0.5)
    cosine = np.array([0.45, 0.5625, 0.625, 0.6875, 0.75, 0.9])
    points, normals = arrays(np.stack([2 * np.tan(np.arccos(cosine)), 0 * cosine, 0 * cosine], axis=1), UP)
    fade = light.irradiance(points, normals)[:, 0] / (cosine**3 / 4)
    assert fade == pytest.approx([0, 0.15625, 0.5, 0.84375, 1, 1], abs=1e-5)


def test_inside_a_sphere_lamp_light_comes_from_everywhere():
    # Radiance 100 / (4 pi^2 R^2) all around, so E = pi L for every point and normal inside.
    light = Point("ball", (0, 0, 0), 100, 2.0, sphere=True)
    points, normals = scattered()
    exact = PI * 100 / (4 * PI**2 * 4)
    assert light.irradiance(points, normals) == pytest.approx(exact, rel=1e-6)
    rays = light.sample(points, normals, kronecker(len(points), 2))
    assert rays.weight * light.colour[0] == pytest.approx(exact, rel=1e-6)
    assert np.linalg.norm(points + rays.direction * rays.distance[:, None], axis=1) == pytest.approx(2, rel=1e-5)


def test_shadow_rays_end_on_the_lamp():
    # On the sphere's near side, on the disc's plane, within the rectangle.
    points, normals = arrays(np.random.default_rng(3).uniform(-1, 1, (500, 3)), UP)
    uv = kronecker(500, 2)

    def ends(light):
        rays = light.sample(points, normals, uv)
        return points + rays.direction * rays.distance[:, None]

    centre = np.array([0, 0, 2])
    assert np.linalg.norm(ends(LAMPS["sphere"]) - centre, axis=1) == pytest.approx(0.6, abs=1e-4)
    assert ((ends(LAMPS["sphere"]) - centre) * (points - centre)).sum(axis=1).min() > 0
    across = ends(LAMPS["point"]) - centre
    assert (across * (points - centre)).sum(axis=1) == pytest.approx(0, abs=1e-5)
    assert np.linalg.norm(across, axis=1).max() < 0.6001
    inside = (ends(LAMPS["rectangle"]) - centre) @ np.linalg.pinv([(0, 1, 0), (0.5, 0, 0.1)])
    assert np.abs(inside).max() < 0.5001


def test_an_area_lamp_shines_from_one_side_and_a_mesh_from_both():
    above, below = arrays([(0.2, 0.2, 3)], DOWN), arrays([(0.2, 0.2, 0)], UP)
    assert LAMPS["rectangle"].irradiance(*above).max() == 0
    assert LAMPS["rectangle"].irradiance(*below).min() > 0
    assert LAMPS["mesh"].irradiance(*above).min() > 0
    assert LAMPS["mesh"].irradiance(*below).min() > 0
    assert LAMPS["mesh of one side"].irradiance(*above).max() == 0
    assert sampled(LAMPS["mesh of one side"], *above, 64).max() == 0


@pytest.mark.parametrize("light", [*LAMPS.values(), *SPREAD_LAMPS.values()], ids=[*LAMPS, *SPREAD_LAMPS])
def test_moving_lamp_and_receiver_together_changes_nothing(light):
    # A shift by (8, -4, 2) m, exact in binary, moves float32 positions by whole bits: the irradiance stays to 1e-4.
    offset = np.array([8.0, -4, 2])
    points, normals = scattered()
    uv = kronecker(len(points), 2)
    moved = light.translated(offset).sample(points + offset.astype(np.float32), normals, uv)
    weight = light.sample(points, normals, uv).weight
    assert moved.weight == pytest.approx(weight, rel=1e-3, abs=2e-3 * float(weight.max()))


@pytest.mark.parametrize("light", [
    Point("at the receiver", (0, 0, 0), 5), Point("disc around the receiver", (0, 0, 0), 5, 1.0),
    Point("ball around the receiver", (0, 0, 0), 5, 1.0, sphere=True), Point("dark", (0, 0, 1), 0),
    Spot("spot at the receiver", (0, 0, 0), 5, 0.0, direction=DOWN),
    Spot("dark spot", (0, 0, 1), 0, 0.1, direction=DOWN),
    Spot("narrow", (0, 0, 1), 5, 0.1, direction=DOWN, spot_size=1e-6),
    Area("in the receiver's plane", (1, 0, 0), (0, 1, 0), (1, 0, 0), 5),
    Area("dark area", (0, 0, 1), (0, 1, 0), (1, 0, 0), 0),
    Area("through the receiver", (0, 0, 0), (0, 1, 0), (1, 0, 0), 5),
    Area("line", (0, 0, 1), (0, 1, 0), (0, 2, 0), 5),
    Area("dot", (0, 0, 1), (0, 0, 0), (0, 0, 0), 5, round=True),
    Area("beam of a line", (0, 0, 1), (0, 1, 0), (0, 0, 0), 5, spread=0),
    Sun("in the plane", (1, 0, 0), 5), Sun("dark sun", DOWN, 0, 0.1),
    MeshEmitter("needle", [[[0, 0, 1], [1, 0, 1], [2, 0, 1]]], [[1, 1, 1]]),
    MeshEmitter("dark mesh", TRIANGLES, np.zeros((2, 3))),
    MeshEmitter("around the receiver", [[[-1, -1, 0], [1, -1, 0], [0, 1, 0]]], [[1, 1, 1]]),
], ids=lambda light: light.name)
def test_degenerate_lamps_are_defined(light):
    # A receiver at the origin that faces up, and one turned aside: finite, from 0, and no floating-point warning.
    points, normals = arrays([(0, 0, 0), (0, 0, 0)], [UP, (1, 0, 0)])
    with np.errstate(divide="raise", invalid="raise", over="raise"):
        rays = light.sample(points, normals, np.float32([[0.5, 0.5], [0.1, 0.9]]))
        closed = light.irradiance(points, normals)
        power = light.power()
    assert np.isfinite(rays.weight).all()
    assert (rays.weight >= 0).all()
    assert not np.isnan(rays.distance).any()
    assert closed is None or (np.isfinite(closed).all() and (closed >= 0).all())
    assert isinstance(light, Sun) or np.isfinite(power).all()


@pytest.mark.parametrize("make", [
    lambda: Point("bulb", (0, 0, np.nan), 1),
    lambda: Point("bulb", (0, 0, 0), -1),
    lambda: Point("bulb", (0, 0, 0), 1, -1),
    lambda: Point("bulb", (0, 0, 0), (1, 2)),
    lambda: Point("bulb", "above", 1),
    lambda: Point("bulb", (0, 0, 0), 1, "wide"),
    lambda: Sun("bulb", (0, 0, 0), 1),
    lambda: Sun("bulb", DOWN, np.inf),
    lambda: Sun("bulb", DOWN, 1, 4.0),
    lambda: Spot("bulb", (0, 0, 0), 1, frame=np.diag([1, 0, 1])),
    lambda: Spot("bulb", (0, 0, 0), 1, direction=DOWN, blend=2),
    lambda: Area("bulb", (0, 0), (1, 0, 0), (0, 1, 0), 1),
    lambda: MeshEmitter("bulb", np.zeros((1, 4, 3)), np.ones((1, 3))),
    lambda: MeshEmitter("bulb", TRIANGLES, [[1, 0, 0], [0, 1, 0]]),
])
def test_a_lamp_that_makes_no_sense_is_refused_by_name(make):
    with pytest.raises(SceneError, match="bulb"):
        make()

"""Scenes built to break a bake: needles, pin-holes, touching lamps, turned faces, bands, tolerances below noise."""

from __future__ import annotations

import importlib
from dataclasses import replace

import numpy as np
import pytest
from radiosity.solver import Settings, Sky, bake, irradiance, rows
from radiosity.solver.adaptive import MOST_FACTOR
from radiosity.solver.area_lamp import Area
from radiosity.solver.direct import MOST_RAYS
from radiosity.solver.form_factor import element_form_factor
from radiosity.solver.lumels import lumels
from radiosity.solver.plan import plan
from radiosity.solver.polygon import polygon_form_factor
from radiosity.solver.rows import Rows
from radiosity.solver.sampling import cosine_directions, kronecker
from radiosity.solver.scene import Surface
from radiosity.tests.solver.rooms import CEILING, FLOOR, Shape, box, quad, shape
from radiosity.tests.solver.test_leaks import TURN
from radiosity.tests.solver.test_radiosity_stability import HIGH, LOW, _differ, _furnished, _light, _places

ERROR = 0.03
# The function `bake` hides its module's name.
module = importlib.import_module("radiosity.solver.bake")


@pytest.fixture(scope="module")
def as_it_is():
    """The furnished room's light, at `_places`."""
    return _light(_furnished().scene(), *_places())


def _without(room, wall):
    keep = np.arange(12) // 2 != wall
    return Shape(room.corners[keep], room.reflectance[keep], room.emission[keep])


# --- S-6: needles ----------------------------------------------------------------------------------------------------
def test_walls_of_needles_reflect_as_whole_ones(as_it_is):
    # The furnished room, its floor of 4 x 3 m cut into 15,000 needles of 4 m x .4 mm: 1 : 10,000. The same light.
    edges = np.linspace(0, 3, 7501)[:, None] * [0, 1, 0]
    near, far = edges[:-1], edges[1:]
    along = np.array([4.0, 0, 0])
    needles = np.concatenate([np.stack([near, near + along, far + along], axis=1),
                              np.stack([near, far + along, far], axis=1)])
    room = _without(box(LOW, HIGH, 0.6, (0, 1, 0, 0, 0, 0)), FLOOR)
    whole = room + shape(needles, 0.6) + box((1, 1, 0), (1.8, 2.1, 1.2), 0.6, inward=False)
    assert _differ(_light(whole.scene(), *_places()), as_it_is) < 2**0.5 * ERROR


# --- S-9: a pin-hole -------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("side", [0.0177, 0.1])
def test_a_pin_hole_that_a_bake_misses_is_in_its_error_bar(side):
    # A black floor of 1 m2 in a closed black box, a hole of 1.8 or 10 cm in its lid 1 m above, and behind that a
    # glowing ceiling of 36 m2, B = 1: H is the form factor to the hole, 1e-4 or .003. A lumel's 256 rays to the ceiling
    # find the hole once in a hundred tries, or in three. Whatever the bake then says, its interval holds its error.
    half, wide = side / 2, 1.5
    floor = quad((-0.5, -0.5, 0), (1, 0, 0), (0, 1, 0), 0.0)
    lid = (quad((-wide, -wide, 1), (0, 2 * wide, 0), (wide - half, 0, 0), 0.0)
           + quad((half, -wide, 1), (0, 2 * wide, 0), (wide - half, 0, 0), 0.0)
           + quad((-half, -wide, 1), (0, wide - half, 0), (side, 0, 0), 0.0)
           + quad((-half, half, 1), (0, wide - half, 0), (side, 0, 0), 0.0))
    rest = (lid + _without(box((-wide, -wide, -0.2), (wide, wide, 1), 0.0), CEILING)
            + quad((-3, -3, 2), (0, 6, 0), (6, 0, 0), 0.0, 1.0))
    scene = (floor + rest).scene(surfaces=(Surface("floor", 0, 2),
                                           Surface("rest", 2, len(rest.corners), receives=False)))
    settings = Settings(error=ERROR, texel_density=16, footprint=0, quantity="irradiance", margin=0)
    laid, baked = lumels(scene, settings, []), bake(scene, settings)
    hole = np.array([[-half, -half, 1], [-half, half, 1], [half, half, 1], [half, -half, 1]])
    points = laid.receivers.position.astype(float) + scene.origin
    exact = polygon_form_factor(points, laid.receivers.normal.astype(float), hole)
    assert exact.max() == pytest.approx(side**2 / np.pi, rel=0.01)
    found = np.asarray(baked.lightmaps[0].pixels).reshape(-1, 3)[laid.pixel, 0]
    bar = baked.report["error"]["estimated"]
    error, bias = (value / exact.mean() for value in (np.sqrt(np.mean((found - exact) ** 2)), np.mean(found - exact)))
    assert bar["rms_low"] <= error <= bar["rms_high"]
    assert bar["rms_high"] > 0.3
    assert abs(bar["bias"] - bias) < 3 * bar["bias_standard_error"]


# --- S-12: a lamp that touches ---------------------------------------------------------------------------------------
@pytest.mark.parametrize("kind", ["area lamp", "bright mesh", "dim mesh"])
def test_a_wall_that_a_lamp_touches_is_lit_up_to_the_edge_in_a_scene(kind, validation):
    # A lamp of 1 m2 in the ceiling of a black room of 2 m touches the wall x = 0: 1 mm below, half of what the wall
    # sees is lamp. Exact: Lambert's sum. In the lamp's own plane, beside it: nothing.
    room = box((0, 0, 0), (2, 2, 2), 0.0)
    lamp = np.array([[0, 0.5, 2], [0, 1.5, 2], [1, 1.5, 2], [1, 0.5, 2]])
    strength = {"area lamp": 1.0, "bright mesh": 50.0, "dim mesh": 1.0}[kind]
    if kind == "area lamp":
        scene = room.scene(lights=(Area("lamp", (0.5, 1, 2), (0, 1, 0), (1, 0, 0), (1, 1, 1)),))
    else:
        scene = (_without(room, CEILING) + quad((0, 0.5, 2), (0, 1, 0), (1, 0, 0), 0.0, strength)
                 + quad((1, 0, 2), (0, 2, 0), (1, 0, 0), 0.0) + quad((0, 0, 2), (0, 0.5, 0), (1, 0, 0), 0.0)
                 + quad((0, 1.5, 2), (0, 0.5, 0), (1, 0, 0), 0.0)).scene()
    points = np.array([[0, 1, z] for z in (1.999, 1.99, 1.9, 1.5, 1)] + [[1.5, 1, 2]])
    normals = np.array([[1.0, 0, 0]] * 5 + [[0, 0, -1]])
    exact = [element_form_factor(point, normal, lamp).value for point, normal in zip(points, normals, strict=True)]
    assert exact[0] == pytest.approx(0.5, abs=0.001)
    found = irradiance(scene, Settings(error=ERROR), points, normals)[:, 0] / strength
    assert found[-1] == pytest.approx(0, abs=float(ERROR * np.mean(exact)))
    for point, right, ours in zip(points[:-1], exact, found, strict=False):
        validation("S-12", f"form factor {2 - point[2]:.3g} m below a touching {kind}", right, ours,
                   relative=ERROR * np.mean(exact) / right)


# --- S-13: meshes as people make them --------------------------------------------------------------------------------
@pytest.mark.parametrize("which", ["all", "half"])
def test_a_room_of_turned_over_faces_gets_the_same_light(which, as_it_is):
    # The furnished room with all faces turned over, or every other one at random: both sides reflect and emit alike.
    room = _furnished()
    turned = np.random.default_rng(0).random(len(room.corners)) < (1.0 if which == "all" else 0.5)
    assert turned.any()
    corners = room.corners.copy()
    corners[turned] = corners[turned][:, [0, 2, 1]]
    found = _light(Shape(corners, room.reflectance, room.emission).scene(), *_places())
    assert _differ(found, as_it_is) < 2**0.5 * ERROR


def _with_t_junctions(low, high, seed):
    """A closed room whose walls are cut into strips, and the strips into quads, at random: no corner meets another."""
    random = np.random.default_rng(seed)

    def cuts():
        return np.concatenate([[0], np.sort(random.random(random.integers(1, 4))), [1]])

    parts = []
    for wall in box(low, high).corners.reshape(6, 2, 3, 3):
        origin, u, v = wall[0, 0], wall[0, 1] - wall[0, 0], wall[0, 2] - wall[0, 1]
        across = cuts()
        for left, right in zip(across[:-1], across[1:], strict=True):
            along = cuts()
            parts += [quad(origin + left * u + begin * v, (right - left) * u, (end - begin) * v).corners
                      for begin, end in zip(along[:-1], along[1:], strict=True)]
    return shape(np.concatenate(parts))


@pytest.mark.parametrize("place", [(0, 0, 0), (800, -300, 50)])
def test_walls_with_t_junctions_let_no_light_in(place):
    # A turned closed room whose faces share no corners, in a world of 1,000 W/(m2 sr): 0 at 200 points inside, although
    # edges of float32 corners no longer lie on one another exactly.
    room = _with_t_junctions((0, 0, 0), (3, 2, 2.5), 3).moved(TURN, place)
    random = np.random.default_rng(9)
    points = random.uniform((0.01, 0.01, 0.01), (2.99, 1.99, 2.49), (200, 3)) @ TURN.T + place
    found = irradiance(room.scene(sky=Sky((1000,) * 3)), Settings(error=0.1), points, random.normal(size=(200, 3)))
    assert found.max() < 1e-4 * 1000 * np.pi


# --- S-15: bands -----------------------------------------------------------------------------------------------------
SIDE = 48


def _correlation(error):
    """Of an error map (SIDE, SIDE) with itself one lumel further along both axes, a smooth part taken out."""
    block = error.reshape(SIDE // 6, 6, SIDE // 6, 6).mean(axis=(1, 3))
    rough = error - np.repeat(np.repeat(block, 6, axis=0), 6, axis=1)
    # Taking out means of 36 leaves independent errors with -1/35 or so.
    return np.mean([np.mean(rough[1:] * rough[:-1]), np.mean(rough[:, 1:] * rough[:, :-1])]) / np.mean(rough**2)


def test_errors_of_neighbours_make_no_bands(stability, validation):
    # The floor of a black unit cube without a lid, under an even sky, 64 rays a lumel. With the same rays from every
    # lumel, neighbours err alike: the map has bands. With shifts of their own they don't: what is left is chance.
    lid = np.array([[0, 0, 1], [0, 1, 1], [1, 1, 1], [1, 0, 1.0]])
    step = (np.arange(SIDE) + 0.5) / SIDE
    points = np.stack([*(each.ravel() for each in np.meshgrid(step, step)), np.zeros(SIDE**2)], axis=1)
    normals = np.broadcast_to((0.0, 0, 1), points.shape)
    exact = polygon_form_factor(points, normals, lid)
    rays = kronecker(64, 2)
    up = cosine_directions(np.array([[0, 0, 1]], np.float32), rays[None, :, 0], rays[None, :, 1])[0]
    landed = points[:, None, :2] + (up[:, :2] / up[:, 2:])[None]
    same = ((landed > 0) & (landed < 1)).all(axis=2).mean(axis=1) - exact
    scene = _without(box((0, 0, 0), (1, 1, 1), 0.0), CEILING).scene(sky=Sky((1, 1, 1)))
    found = irradiance(scene, Settings(error=0.1, footprint=0), points, normals)[:, 0] / np.pi - exact
    bands = [_correlation(error.reshape(SIDE, SIDE)) for error in (same, found)]
    assert bands[0] > 0.3
    # Of 2,304 lumels along two axes, one deviation of chance is .0147.
    validation("S-15", "correlation of neighbouring lumels' errors", 0, bands[1], 1 / np.sqrt(2 * SIDE**2))
    stability("S-15", "the same 64 rays from all lumels: correlation of neighbours' errors", bands[0], bands[1])


# --- S-16: tolerances below noise ------------------------------------------------------------------------------------
def test_patches_are_not_split_for_their_noise(monkeypatch, stability):
    # 2,000 patches, 256 rays each, that meet light or dark at random, nothing else: whatever varies inside a patch is
    # noise. Without a margin over the noise half of all patches would be split for it, and their parts again.
    random = np.random.default_rng(1)
    row = Rows(np.arange(2000, dtype=np.int32), random.integers(0, 2, (2000, 256)).astype(np.int32),
               random.integers(0, 8, (2000, 256)).astype(np.uint8), None)
    parts = []
    for margin in (1.0, rows.NOISE_LEVEL):
        monkeypatch.setattr(rows, "NOISE_LEVEL", margin)
        parts.append((row.deviation(np.array([0.0, 1.0, 0.0], np.float32)) > 0).mean())
    assert parts[0] > 0.3
    assert parts[1] < 0.01
    stability("S-16", "splitting without a margin over the noise: part of the patches split", parts[0], parts[1])


def test_a_tolerance_below_the_noise_does_not_explode(monkeypatch, validation):
    # The furnished room at .1, then with a millionth of that asked of gather and direct light, which no count of rays
    # of a bake reaches: every lumel gets the most rays that it may, no more, and it ends; patches stay as they are.
    settings = Settings(error=0.1, texel_density=3)
    usual = bake(_furnished().scene(), settings).report
    monkeypatch.setattr(module, "plan", lambda *arguments: replace(plan(*arguments), gather_error=1e-7,
                                                                   direct_error=1e-7))
    strict = bake(_furnished().scene(), settings).report
    rays = [{stage["name"]: stage["rays"] for stage in report["stages"]} for report in (usual, strict)]
    first_look = plan(0.1, 1.0, 1.0, usual["lumels"]).gather_rays * usual["lumels"]
    assert rays[0]["gather"] < rays[1]["gather"] < (1 + MOST_FACTOR) * 2 * first_look
    assert rays[1]["direct"] < 2 * MOST_RAYS * usual["lumels"]
    assert strict["patches"] < 1.2 * usual["patches"]
    energy = strict["energy"]
    validation("S-16", "absorbed over emitted, tolerance of 1e-7", 1, energy["absorbed"] / energy["emitted"],
               relative=0.01)

"""Each kind of light against Cycles: the same lumels, once in the open and once half in the shade.

The receivers are two squares of 1 m at z = 0 with 8 x 8 lumels each, in one image. A black plate of 1 m at z = .5 m
hovers over the second one, a quarter of a metre aside, so that the shade's edges cross it. Cycles bakes the direct
diffuse light without colour, radiance = irradiance / pi. Ours comes twice: as the mean of the lamp's weights over
shadow rays that miss the plate, over the same central half of each lumel; and from the solver's direct light.
"""

import math
import os
import tempfile

import numpy as np
import pytest

os.environ.setdefault("BLENDER_USER_RESOURCES", tempfile.mkdtemp())
bpy = pytest.importorskip("bpy", reason="the bpy wheel is not installed")

from radiosity.radiosity_addon.lights import export_lights  # noqa: E402
from radiosity.solver.direct import DirectLight  # noqa: E402
from radiosity.solver.footprints import ReceiverFootprints  # noqa: E402
from radiosity.solver.geometry import Geometry  # noqa: E402
from radiosity.solver.mesh_emitter import group_emitters  # noqa: E402
from radiosity.solver.parallel import Run  # noqa: E402
from radiosity.solver.receivers import Receivers  # noqa: E402
from radiosity.solver.sampling import cosine_directions, kronecker, shifts  # noqa: E402
from radiosity.solver.scene import Scene  # noqa: E402

SIDE = 8
# Cycles' mean over a receiver's lumels is then within .1 % in the open and .4 % in the shade.
SAMPLES = 1024
RAYS = 1024
TOLERANCE = 0.005
OPEN_X, SHADED_X = -1.5, 0.5
# Lumels on the squares' diagonals are left out: two triangles share them, and Cycles samples one of the two.
LUMELS = np.flatnonzero(np.arange(SIDE * SIDE) // SIDE != np.arange(SIDE * SIDE) % SIDE)
PLATE = ((0.75, 1.75), (-0.25, 0.75), 0.5)


@pytest.fixture
def stage():
    """An empty scene with the receivers and the plate; the world is black."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.world = bpy.data.worlds.new("World")
    _set_world((0, 0, 0))
    x, y, z = PLATE
    corners = [(OPEN_X, -0.5, 0), (OPEN_X + 1, -0.5, 0), (OPEN_X + 1, 0.5, 0), (OPEN_X, 0.5, 0),
               (SHADED_X, -0.5, 0), (SHADED_X + 1, -0.5, 0), (SHADED_X + 1, 0.5, 0), (SHADED_X, 0.5, 0)]
    receiver = _mesh("Receiver", corners, [(0, 1, 2, 3), (4, 5, 6, 7)], _material("White", "ShaderNodeBsdfDiffuse"))
    uv = receiver.data.uv_layers.new(name="UVMap")
    places = [(0, 0), (0.5, 0), (0.5, 1), (0, 1), (0.5, 0), (1, 0), (1, 1), (0.5, 1)]
    uv.data.foreach_set("uv", np.ravel(places))
    _mesh("Plate", [(x[0], y[0], z), (x[1], y[0], z), (x[1], y[1], z), (x[0], y[1], z)], [(0, 1, 2, 3)],
          _material("Black", "ShaderNodeBsdfDiffuse", Color=(0, 0, 0, 1)))
    return scene


def _mesh(name, corners, faces, material):
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(corners, [], faces)
    mesh.materials.append(material)
    thing = bpy.data.objects.new(name, mesh)
    bpy.context.collection.objects.link(thing)
    return thing


def _empty_tree(data):
    """The node tree of a material, world or lamp, without nodes."""
    if data.node_tree is None:  # Blender 5 gives materials and worlds a tree from the start
        data.use_nodes = True
    data.node_tree.nodes.clear()
    return data.node_tree


def _material(name, shader, **values):
    material = bpy.data.materials.new(name)
    tree = _empty_tree(material)
    node, output = tree.nodes.new(shader), tree.nodes.new("ShaderNodeOutputMaterial")
    for socket, value in values.items():
        node.inputs[socket].default_value = value
    tree.links.new(node.outputs[0], output.inputs["Surface"])
    return material


def _set_world(colour):
    tree = _empty_tree(bpy.context.scene.world)
    background, output = (tree.nodes.new(f"ShaderNode{kind}") for kind in ("Background", "OutputWorld"))
    background.inputs["Color"].default_value = (*colour, 1)
    tree.links.new(background.outputs[0], output.inputs["Surface"])


def _lamp(kind, location=(0, 0.3, 2), rotation=(0, 0, 0), scale=(1, 1, 1), **settings):
    data = bpy.data.lights.new("Lamp", kind)
    for name, value in settings.items():
        setattr(data, name, value)
    lamp = bpy.data.objects.new("Lamp", data)
    lamp.location, lamp.rotation_euler, lamp.scale = location, rotation, scale
    bpy.context.collection.objects.link(lamp)
    return lamp


def _cycles_irradiance():
    """(2, 56, 3): irradiance of the open and the shaded lumels by Cycles."""
    scene, receiver = bpy.context.scene, bpy.data.objects["Receiver"]
    scene.render.engine = "CYCLES"
    scene.cycles.device = "CPU"
    scene.cycles.samples = SAMPLES
    scene.cycles.use_adaptive_sampling = scene.cycles.use_denoising = False
    scene.cycles.sample_clamp_direct = scene.cycles.sample_clamp_indirect = 0
    image = bpy.data.images.new("Baked", 2 * SIDE, SIDE, float_buffer=True)
    image.colorspace_settings.name = "Non-Color"
    tree = receiver.data.materials[0].node_tree
    tree.nodes.active = tree.nodes.new("ShaderNodeTexImage")
    tree.nodes.active.image = image
    bpy.context.view_layer.objects.active = receiver
    receiver.select_set(True)
    bpy.ops.object.bake(type="DIFFUSE", pass_filter={"DIRECT"}, margin=0)
    pixels = np.array(image.pixels[:], np.float64).reshape(SIDE, 2, SIDE, 4)[..., :3]
    return pixels.transpose(1, 0, 2, 3).reshape(2, SIDE * SIDE, 3)[:, LUMELS] * np.pi


def _footprint_points(left):
    """(56, RAYS, 3): points over the central half of each lumel of the receiver whose left edge is at x."""
    index = LUMELS[:, None]
    jitter = _random_numbers()[..., 2:] / 2 + 0.25
    points = np.zeros((len(LUMELS), RAYS, 3), np.float32)
    points[..., 0] = left + (index % SIDE + jitter[..., 0]) / SIDE
    points[..., 1] = -0.5 + (index // SIDE + jitter[..., 1]) / SIDE
    return points


def _random_numbers():
    """(56, RAYS, 4): quasi-random points over light and footprint, moved at random for each lumel."""
    return (kronecker(RAYS, 4) + shifts(LUMELS, 4, seed=0)[:, None]) % np.float32(1)


def _hits_plate(points, directions, distances):
    x, y, z = PLATE
    t = (z - points[:, 2]) / np.where(directions[:, 2] > 1e-6, directions[:, 2], 1e-6)
    at = points + t[:, None] * directions
    inside = (at[:, 0] > x[0]) & (at[:, 0] < x[1]) & (at[:, 1] > y[0]) & (at[:, 1] < y[1])
    return inside & (directions[:, 2] > 1e-6) & (t < distances)


def _our_irradiance(lights):
    """(2, 56, 3): the same by our lamps' samples; (56, 3): closed form of the open ones, nan if there is none."""
    uv = _random_numbers()[..., :2].reshape(-1, 2)
    result, closed = np.zeros((2, len(LUMELS), 3)), np.zeros((len(LUMELS), 3))
    for row, left in enumerate((OPEN_X, SHADED_X)):
        points = _footprint_points(left).reshape(-1, 3)
        normals = np.tile(np.float32([0, 0, 1]), (len(points), 1))
        for light in lights:
            rays = light.sample(points, normals, uv)
            free = ~_hits_plate(points, rays.direction, rays.distance)
            result[row] += (rays.weight * free).reshape(len(LUMELS), -1).mean(axis=1)[:, None] * light.colour
            if row == 0:
                formula = light.irradiance(points, normals)
                closed += np.nan if formula is None else formula.reshape(len(LUMELS), -1, 3).mean(axis=1)
    return result, closed


def _solver_irradiance(lights, tolerance):
    """(2, 56, 3): the same by the solver's direct light, to a standard deviation of `tolerance` W/m2 a lumel."""
    x, y, z = PLATE
    squares = [[(left + i, j - 0.5, 0) for i, j in ((0, 0), (1, 0), (1, 1), (0, 1))] for left in (OPEN_X, SHADED_X)]
    plate = [(x[i], y[j], z) for i, j in ((0, 0), (1, 0), (1, 1), (0, 1))]
    vertices = np.array([*squares, plate], float).reshape(-1, 3)
    scene = Scene(vertices, np.array([(4 * k, 4 * k + i, 4 * k + i + 1) for k in range(3) for i in (1, 2)]))
    geometry = Geometry(scene)
    across, up = (LUMELS % SIDE + 0.5) / SIDE, (LUMELS // SIDE + 0.5) / SIDE
    lower = up < across  # the triangle of corners 0, 1, 2
    barycentric = np.where(lower, (across - up, up), (across, up - across)).T
    step = np.where(lower[:, None, None], [[1, 0], [-1, 1]], [[1, -1], [0, 1]]) / SIDE
    triangle = np.concatenate([np.where(lower, 2 * square, 2 * square + 1) for square in (0, 1)]).astype(np.int32)
    both = [np.tile(array, (2, *[1] * (array.ndim - 1))).astype(np.float32) for array in (barycentric, step)]
    receivers = Receivers(geometry.point(triangle, *both[0].T), np.tile(np.float32([0, 0, 1]), (len(triangle), 1)),
                          triangle, *both)
    direct = DirectLight(geometry, [light.translated(-scene.origin) for light in lights], seed=0)
    places = ReceiverFootprints(geometry, receivers, 0.5, seed=0)
    irradiance = direct.irradiance(places, Run(threads=1), tolerance, neighbours=_neighbours())
    return irradiance.reshape(2, len(LUMELS), 3)


def _neighbours():
    """(112, 8) rows of the lumels around each; -1 where there is none."""
    row_of = np.full((SIDE + 2, SIDE + 2), -1)
    row_of[1 + LUMELS // SIDE, 1 + LUMELS % SIDE] = np.arange(len(LUMELS))
    around = [row_of[1 + j + LUMELS // SIDE, 1 + i + LUMELS % SIDE] for j in (-1, 0, 1) for i in (-1, 0, 1) if i or j]
    one = np.stack(around, axis=1)
    return np.concatenate([one, np.where(one >= 0, one + len(LUMELS), -1)])


def _assert_agree(lights):
    """Means of the open and of the shaded lumels as Cycles' to .5 %, each lumel to 3 % of the mean (RMS)."""
    cycles, (ours, closed) = _cycles_irradiance(), _our_irradiance(lights)
    mean = cycles.mean(axis=1)
    assert mean.min() > 0
    for irradiance in (ours, _solver_irradiance(lights, 0.001 * mean.min())):
        assert irradiance.mean(axis=1) == pytest.approx(mean, rel=TOLERANCE)
        deviation = np.sqrt(((irradiance - cycles) ** 2).mean(axis=(1, 2))) / mean.mean(axis=1)
        assert deviation.max() < 0.03
    if not np.isnan(closed).any():
        assert closed.mean(axis=0) == pytest.approx(mean[0], rel=TOLERANCE)


def _exported():
    """The scene's lamps, which export without a warning."""
    warnings = []
    lights = export_lights(bpy.context.evaluated_depsgraph_get(), warnings)
    assert warnings == []
    return lights


def _warned():
    """The scene's lamps, and the one warning that exporting them gave."""
    warnings = []
    lights = export_lights(bpy.context.evaluated_depsgraph_get(), warnings)
    (warning,) = warnings
    assert (warning["object"], warning["code"]) == ("Lamp", "lamp")
    return lights, warning["message"]


LAMPS = {
    "area square": ("AREA", {"energy": 50, "size": 0.8, "color": (1, 0.5, 0.25)}),
    "area rectangle": ("AREA", {"energy": 50, "shape": "RECTANGLE", "size": 0.4, "size_y": 1.2,
                                "rotation": (0.2, 0.3, 0.5)}),
    "area disc": ("AREA", {"energy": 50, "shape": "DISK", "size": 0.8}),
    "area ellipse, scaled": ("AREA", {"energy": 50, "shape": "ELLIPSE", "size": 0.4, "size_y": 0.6,
                                      "scale": (1.5, 2, 1)}),
    "area mirrored": ("AREA", {"energy": 50, "size": 0.6, "scale": (-1, 2, 1), "rotation": (0, 0, 0.4)}),
    "area with spread": ("AREA", {"energy": 50, "size": 1.0, "spread": 2.0, "location": (0.3, 0, 2)}),
    "area disc with a narrow spread": ("AREA", {"energy": 50, "shape": "DISK", "size": 4.0, "spread": 0.35}),
    "point without radius": ("POINT", {"energy": 100, "shadow_soft_size": 0}),
    "point": ("POINT", {"energy": 100, "shadow_soft_size": 0.4}),
    "point as a sphere": ("POINT", {"energy": 100, "shadow_soft_size": 0.6, "use_soft_falloff": False}),
    "point scaled": ("POINT", {"energy": 100, "shadow_soft_size": 0.2, "scale": (2, 3, 0.5)}),
    "spot without radius": ("SPOT", {"energy": 100, "shadow_soft_size": 0, "spot_size": 1.6, "spot_blend": 0.5}),
    "spot": ("SPOT", {"energy": 100, "shadow_soft_size": 0.3, "spot_size": 1.4, "spot_blend": 0.3}),
    "spot as a sphere": ("SPOT", {"energy": 100, "shadow_soft_size": 0.5, "spot_size": 1.4, "spot_blend": 0.6,
                                  "use_soft_falloff": False}),
    "spot scaled": ("SPOT", {"energy": 100, "shadow_soft_size": 0.1, "spot_size": 1.0, "spot_blend": 0.4,
                             "scale": (2, 1, 0.8), "rotation": (0.1, 0.2, 0.3)}),
    "sun without angle": ("SUN", {"energy": 3, "angle": 0, "rotation": (0.5, 0.2, 0)}),
    "sun": ("SUN", {"energy": 3, "angle": 0.6, "rotation": (0.5, 0.2, 0)}),
    "sun scaled and mirrored": ("SUN", {"energy": 3, "angle": 0.3, "rotation": (0.5, 0.2, 0), "scale": (-1, 1, 2)}),
}
# Exposure, temperature and "normalize" came with Blender 4.5.
NEWER_LAMPS = {
    "exposure": ("POINT", {"energy": 100, "shadow_soft_size": 0, "exposure": 1.5}),
    "temperature": ("POINT", {"energy": 100, "shadow_soft_size": 0, "use_temperature": True, "temperature": 3000,
                              "color": (0.5, 1, 1)}),
    "area per square metre": ("AREA", {"energy": 5, "shape": "ELLIPSE", "size": 0.8, "size_y": 0.5,
                                       "normalize": False}),
    "sphere per square metre": ("POINT", {"energy": 5, "shadow_soft_size": 0.3, "normalize": False}),
    "point per nothing": ("POINT", {"energy": 5, "shadow_soft_size": 0, "normalize": False}),
    "sun per steradian": ("SUN", {"energy": 50, "angle": 0.3, "rotation": (0.5, 0.2, 0), "normalize": False}),
}


@pytest.mark.parametrize("kind", LAMPS)
def test_a_lamp_gives_what_cycles_bakes(stage, kind):
    lamp_type, settings = LAMPS[kind]
    _lamp(lamp_type, **settings)
    lights = _exported()
    assert len(lights) == 1
    _assert_agree(lights)


@pytest.mark.skipif("normalize" not in bpy.types.Light.bl_rna.properties, reason="came with Blender 4.5")
@pytest.mark.parametrize("kind", NEWER_LAMPS)
def test_what_multiplies_a_lamps_power_counts_as_in_cycles(stage, kind):
    lamp_type, settings = NEWER_LAMPS[kind]
    _lamp(lamp_type, **settings)
    _assert_agree(_exported())


def test_a_setting_sun_lights_what_stands_above_the_horizon(stage):
    # 46 degrees wide and 10 degrees high: its lower part is cut off. The plate's shade falls beside the receivers.
    _lamp("SUN", energy=3, angle=0.8, rotation=(0, -1.4, 0))
    _, closed = _our_irradiance(_exported())
    assert closed.mean(axis=0) == pytest.approx(_cycles_irradiance()[0].mean(axis=0), rel=TOLERANCE)


def _emission_nodes(lamp, colour, strength):
    tree = _empty_tree(lamp.data)
    lamp.data.use_nodes = True
    emission, output = tree.nodes.new("ShaderNodeEmission"), tree.nodes.new("ShaderNodeOutputLight")
    emission.inputs["Color"].default_value = (*colour, 1)
    emission.inputs["Strength"].default_value = strength
    tree.links.new(emission.outputs[0], output.inputs["Surface"])
    return emission


def test_a_lamps_emission_node_multiplies_its_power(stage):
    lamp = _lamp("POINT", energy=100, shadow_soft_size=0, color=(1, 0.5, 1))
    _emission_nodes(lamp, (0.5, 1, 0.25), 3)
    lights = _exported()
    assert lights[0].power() == pytest.approx(100 * 3 * np.array([0.5, 0.5, 0.25]))
    _assert_agree(lights)


def test_a_quadratic_falloff_is_what_light_does_anyway(stage):
    emission = _emission_nodes(_lamp("POINT", energy=100, shadow_soft_size=0), (1, 1, 1), 1)
    tree = emission.id_data
    falloff = tree.nodes.new("ShaderNodeLightFalloff")
    falloff.inputs["Strength"].default_value = 2
    tree.links.new(falloff.outputs["Quadratic"], emission.inputs["Strength"])
    _assert_agree(_exported())
    tree.links.new(falloff.outputs["Linear"], emission.inputs["Strength"])
    lights, message = _warned()
    assert "Linear" in message
    assert lights[0].power() == pytest.approx(200)


def test_nodes_that_are_switched_off_count_for_nothing(stage):
    lamp = _lamp("POINT", energy=100, shadow_soft_size=0)
    _emission_nodes(lamp, (0.5, 1, 0.25), 3)
    lamp.data.use_nodes = False
    _assert_agree(_exported())


def test_instances_of_a_lamp_shine_where_they_stand(stage):
    # Two instances of a collection with one area lamp, turned and scaled, and none where the collection itself is.
    lamp = _lamp("AREA", location=(0, 0, 0.2), energy=30, size=0.5)
    bpy.context.collection.objects.unlink(lamp)
    collection = bpy.data.collections.new("Lamps")
    collection.objects.link(lamp)
    for x, turn, scale in ((-0.5, 0.3, 1), (1.0, -0.4, 2)):
        instancer = bpy.data.objects.new("Instancer", None)
        instancer.instance_type, instancer.instance_collection = "COLLECTION", collection
        instancer.location, instancer.rotation_euler, instancer.scale = (x, 0.2, 1.8), (0, turn, 0), [scale] * 3
        bpy.context.collection.objects.link(instancer)
    lights = _exported()
    assert len(lights) == 2
    _assert_agree(lights)


def test_a_lamp_hidden_from_diffuse_rays_gives_no_light(stage):
    _lamp("POINT", energy=100).visible_diffuse = False
    lights, message = _warned()
    assert lights == ()
    assert "Ray Visibility" in message
    assert _cycles_irradiance().max() == 0


def test_lamps_that_send_nothing_are_left_out(stage):
    _lamp("POINT", energy=0)
    _lamp("SUN", color=(0, 0, 0))
    _lamp("AREA").data.cycles.is_portal = True
    _lamp("POINT", energy=10).hide_render = True
    assert _exported() == ()


@pytest.mark.parametrize(("settings", "word"), [
    ({"kind": "POINT", "energy": -5}, "negative"),
    ({"kind": "AREA", "energy": 5, "size": 0}, "area is 0"),
    ({"kind": "SPOT", "energy": 5, "scale": (1, 0, 1)}, "scale is 0"),
])
def test_lamps_that_cannot_shine_are_told_of_and_left_out(stage, settings, word):
    _lamp(**settings)
    lights, message = _warned()
    assert lights == ()
    assert word in message


def _shear(lamp):
    """Stretch a lamp along x from outside."""
    lamp.parent = bpy.data.objects.new("Parent", None)
    lamp.parent.scale = (2, 1, 1)
    bpy.context.collection.objects.link(lamp.parent)


def test_a_sheared_disc_is_an_ellipse_as_in_cycles(stage):
    _shear(_lamp("AREA", energy=50, shape="DISK", size=0.8, rotation=(0, 0, math.pi / 4)))
    _assert_agree(_exported())


def test_a_sheared_square_is_told_of(stage):
    # Turned by 45 degrees it becomes a rhombus, which Cycles renders up to 30 % too bright or too dark.
    _shear(_lamp("AREA", energy=5, rotation=(0, 0, math.pi / 4)))
    lights, message = _warned()
    assert "right angles" in message
    assert lights[0].power() == pytest.approx(5)


def test_what_the_bake_does_not_follow_is_told_of(stage):
    lamp = _lamp("POINT", energy=5)
    lamp.data.use_shadow = False
    assert "no shadow" in _warned()[1]
    lamp.data.use_shadow = True
    lamp.light_linking.receiver_collection = bpy.data.collections.new("Some")
    assert "Light Linking" in _warned()[1]


def test_an_emissive_mesh_shines_from_its_back_too(stage):
    # A quad of 3 W/(m2 sr), 1.5 m above the receivers, whose front looks up, away from them.
    corners = np.array([(-0.5, -0.4, 1.5), (0.7, -0.4, 1.5), (0.7, 0.6, 1.7), (-0.5, 0.6, 1.7)])
    _mesh("Emitter", corners.tolist(), [(0, 1, 2, 3)], _material("Glow", "ShaderNodeEmission", Color=(1, 0.5, 0.2, 1),
                                                                 Strength=3))
    triangles = corners[[[0, 1, 2], [0, 2, 3]]]
    exitance = np.pi * 3 * np.tile([1, 0.5, 0.2], (2, 1))
    _assert_agree(group_emitters(triangles, exitance))


def test_a_constant_world_gives_pi_times_its_colour(stage):
    # Nothing in the way: E = pi L. Under the plate: pi L times the cosine-weighted part of the sky that is seen. The
    # open lumels lie 2.25 m aside of the plate, which hides less than 1.5 % of their sky but is counted too.
    colour = np.array([0.2, 0.5, 1.0])
    _set_world(colour)
    cycles = _cycles_irradiance()
    uv = _random_numbers().reshape(-1, 4)
    for row, left in enumerate((OPEN_X, SHADED_X)):
        points = _footprint_points(left).reshape(-1, 3)
        up = np.tile(np.float32([0, 0, 1]), (len(points), 1))
        directions = cosine_directions(up, uv[:, :1], uv[:, 1:2])[:, 0]
        free = ~_hits_plate(points, directions, np.full(len(points), np.inf))
        seen = free.mean()
        assert 0.98 < seen <= 1 if row == 0 else 0.2 < seen < 0.8
        assert cycles[row].mean(axis=0) == pytest.approx(math.pi * colour * seen, rel=TOLERANCE)

"""Worlds against Cycles: their sun and other bright spots as lamps, the rest of them as the sky (see `stage`)."""

import math

import bpy
import numpy as np
import pytest
from radiosity.radiosity_addon import world_render
from radiosity.radiosity_addon.export import export_scene
from radiosity.solver import sky as skies
from radiosity.solver.lamps import Sun
from radiosity.solver.sampling import cosine_directions
from radiosity.solver.settings import Settings
from radiosity.tests.blender.stage import (
    LUMELS,
    OPEN_X,
    SHADED_X,
    TOLERANCE,
    cycles_irradiance,
    footprint_points,
    hits_plate,
    lamp,
    our_irradiance,
    random_numbers,
    read_world,
    set_stage,
    set_world,
)

# Enough of Cycles' samples for a noise in the shade that is small against the tolerance.
SAMPLES = 4096


def _sky_irradiance(sky):
    """(2, 56, 3): irradiance of the open and the shaded lumels from the sky, past the plate."""
    result = np.zeros((2, len(LUMELS), 3))
    uv = random_numbers().reshape(-1, 4)
    for row, left in enumerate((OPEN_X, SHADED_X)):
        points = footprint_points(left).reshape(-1, 3)
        up = np.tile(np.float32([0, 0, 1]), (len(points), 1))
        directions = cosine_directions(up, uv[:, :1], uv[:, 1:2])[:, 0]
        free = ~hits_plate(points, directions, np.full(len(points), np.inf))
        light = skies.radiance(sky, directions) * free[:, None]
        result[row] = math.pi * light.reshape(len(LUMELS), -1, 3).mean(axis=1)
    return result


def _read():
    """What is left of the sky, and the lamps; no warning."""
    warnings = []
    sky, lamps = read_world(bpy.context.scene.world, warnings)
    assert warnings == []
    return sky, lamps


def _assert_agrees(sky, lamps, tolerance=TOLERANCE):
    """Means of the open and the shaded lumels, each channel, as Cycles'."""
    ours = _sky_irradiance(sky) + our_irradiance(lamps)[0]
    assert ours.mean(axis=1) == pytest.approx(cycles_irradiance(samples=SAMPLES).mean(axis=1), rel=tolerance)


def _image(radiance):
    """A world whose background is an equirectangular map (h, w, 3), row 0 down; returns its image node."""
    background = set_world((0, 0, 0))
    height, width = radiance.shape[:2]
    image = bpy.data.images.new("Map", width, height, float_buffer=True)
    image.pixels.foreach_set(np.concatenate([radiance, np.ones((height, width, 1))], axis=2).astype(np.float32).ravel())
    image.pack()
    tree = background.id_data
    node = tree.nodes.new("ShaderNodeTexEnvironment")
    node.image = image
    tree.links.new(node.outputs["Color"], background.inputs["Color"])
    return node


def _sunny_map():
    """128 x 256: a blue sky over a dark ground, with a sun of 3 x 3 texels that gives most of the light."""
    radiance = np.full((128, 256, 3), 0.05)
    radiance[64:] = (0.2, 0.4, 0.9)
    radiance[105:108, 150:153] = (900, 800, 600)
    return radiance


def test_a_constant_world_gives_pi_times_its_colour(stage):
    # E = pi L; under the plate, pi L times the part of the sky that is seen. No lamp comes of it.
    set_world((0.2, 0.5, 1.0))
    sky, lamps = _read()
    assert (sky.radiance.shape, lamps) == ((3,), ())
    _assert_agrees(sky, lamps)


def test_the_sun_of_a_map_becomes_a_lamp(stage):
    # The lamp takes the sun's light, and what is left of the map is nowhere brighter than six times its mean.
    _image(_sunny_map())
    sky, lamps = _read()
    assert len(lamps) == 1
    assert sky.radiance.max() < 6
    _assert_agrees(sky, lamps)


def test_a_maps_rotation_and_strength_count(stage):
    # Turned by 40 degrees about z and tilted by 10, three times as bright.
    node = _image(_sunny_map())
    tree = node.id_data
    coordinates, mapping = tree.nodes.new("ShaderNodeTexCoord"), tree.nodes.new("ShaderNodeMapping")
    mapping.inputs["Rotation"].default_value = (math.radians(10), 0, math.radians(40))
    tree.links.new(coordinates.outputs["Generated"], mapping.inputs["Vector"])
    tree.links.new(mapping.outputs["Vector"], node.inputs["Vector"])
    background = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeBackground")
    background.inputs["Strength"].default_value = 3
    _assert_agrees(*_read())


def test_bright_windows_of_a_map_become_lamps_of_their_own(stage):
    # A room at night with a window of 17 x 20 degrees and a red and a blue lamp of 3 degrees.
    radiance = np.full((128, 256, 3), 0.02)
    radiance[90:102, 20:34] = (30, 35, 40)
    radiance[80:82, 120:122] = (200, 20, 10)
    radiance[110:112, 200:203] = (5, 20, 150)
    _image(radiance)
    sky, lamps = _read()
    assert len(lamps) == 3
    _assert_agrees(sky, lamps, 0.01)


SUNLESS = {"HOSEK_WILKIE", "PREETHAM"}
SKIES = {
    "SINGLE_SCATTERING": {"sun_elevation": 0.6}, "MULTIPLE_SCATTERING": {"sun_elevation": 0.35},
    "NISHITA": {"sun_elevation": 0.6}, "HOSEK_WILKIE": {"sun_direction": (0.5, 0.4, 0.76)},
    "PREETHAM": {"sun_direction": (-0.5, 0.4, 0.76)},
}


@pytest.mark.parametrize("kind", SKIES)
def test_a_sky_texture_lights_as_in_cycles(stage, kind):
    background = set_world((0, 0, 0))
    tree = background.id_data
    node = tree.nodes.new("ShaderNodeTexSky")
    if kind not in node.bl_rna.properties["sky_type"].enum_items:
        pytest.skip(f"this Blender has no {kind}")
    node.sky_type = kind
    for name, value in {"sun_rotation": 0.9, **SKIES[kind]}.items():
        setattr(node, name, value)
    tree.links.new(node.outputs["Color"], background.inputs["Color"])
    sky, lamps = _read()
    has_disc = kind not in SUNLESS
    if has_disc:
        assert isinstance(lamps[0], Sun)
        elevation, turn = node.sun_elevation, node.sun_rotation
        sun = np.array([math.cos(elevation) * math.sin(turn), math.cos(elevation) * math.cos(turn),
                        math.sin(elevation)])
        assert -lamps[0].direction == pytest.approx(sun, abs=0.001)
        assert lamps[0].angle == pytest.approx(node.sun_size, rel=0.1)  # darker at the limb
    _assert_agrees(sky, lamps, 0.01)


def test_a_sun_in_a_bright_haze_keeps_its_light(stage):
    # The four samples of a texel that the sun only touches may all miss it; a haze of 3 hides the sky's own glow there.
    background = set_world((3, 3, 3))
    tree = background.id_data
    sky, add = tree.nodes.new("ShaderNodeTexSky"), tree.nodes.new("ShaderNodeAddShader")
    kinds = sky.bl_rna.properties["sky_type"].enum_items.keys()
    sky.sky_type = next(kind for kind in ("SINGLE_SCATTERING", "NISHITA") if kind in kinds)
    sky.sun_elevation, sky.sun_rotation = 0.274, 2.499
    other = tree.nodes.new("ShaderNodeBackground")
    for source, socket in ((sky.outputs[0], other.inputs["Color"]), (background.outputs[0], add.inputs[0]),
                           (other.outputs[0], add.inputs[1]),
                           (add.outputs[0], tree.get_output_node("CYCLES").inputs["Surface"])):
        tree.links.new(source, socket)
    _assert_agrees(*_read(), 0.01)


def test_a_worlds_volume_is_told(stage):
    tree = set_world((1, 1, 1)).id_data
    fog = tree.nodes.new("ShaderNodeVolumeScatter")
    tree.links.new(fog.outputs[0], tree.get_output_node("CYCLES").inputs["Volume"])
    warnings = []
    assert np.allclose(read_world(bpy.context.scene.world, warnings)[0].radiance, 1)
    (told,) = warnings
    assert told["object"] == "World"
    assert "volume" in told["message"]


def test_a_world_is_looked_at_as_closely_as_it_needs(stage):
    # A sky without a sun: a coarse map. Something small may be in all others.
    background = set_world((0, 0, 0))
    tree = background.id_data
    world, node = bpy.context.scene.world, tree.nodes.new("ShaderNodeTexSky")
    for kind in [item.identifier for item in node.bl_rna.properties["sky_type"].enum_items]:
        node.sky_type = kind
        assert world_render.fine_map(world) is (world_render.SMOOTH if kind in SUNLESS else world_render.FINE)
        node.sun_disc = False
        assert world_render.fine_map(world) is world_render.SMOOTH
        node.sun_disc = True
    tree.nodes.new("ShaderNodeTexVoronoi")
    assert world_render.fine_map(world) is world_render.FINE


def test_the_world_is_the_view_layers(build):
    # A sun of 1 W/m2 under a world of radiance 1, and a view layer without Environment. Exact answer: the sun alone, as
    # Cycles has it. With a world of its own, where Blender has that: that world's radiance, 3.
    stage, layer = set_stage(), bpy.context.view_layer
    set_world((1, 1, 1))
    lamp("SUN", energy=1)
    layer.use_sky = False
    without = export_scene(stage, layer, Settings(), []).scene
    assert without.sky.is_black
    assert [light.name for light in without.lights] == ["Lamp"]
    assert cycles_irradiance(samples=1)[0] == pytest.approx(1, rel=TOLERANCE)
    layer.use_sky = True
    if hasattr(layer, "world_override"):
        layer.world_override = stage.world.copy()
        layer.world_override.node_tree.nodes["Background"].inputs["Strength"].default_value = 3
        assert export_scene(stage, layer, Settings(), []).scene.sky.radiance == pytest.approx([3, 3, 3])


def test_a_backdrop_for_the_camera_gives_no_light(stage):
    # White for light, a bright blue for camera rays, mixed inside of a group. Exact answer: 1, and nothing is left.
    background = set_world((1, 1, 1))
    tree = background.id_data
    group = bpy.data.node_groups.new("Backdrop", "ShaderNodeTree")
    for name, way in (("Light", "INPUT"), ("Surface", "OUTPUT")):
        group.interface.new_socket(name, in_out=way, socket_type="NodeSocketShader")
    begin, end, path, mix, blue = (group.nodes.new(kind) for kind in (
        "NodeGroupInput", "NodeGroupOutput", "ShaderNodeLightPath", "ShaderNodeMixShader", "ShaderNodeBackground"))
    blue.inputs["Color"].default_value, blue.inputs["Strength"].default_value = (0, 0, 1, 1), 10
    for source, socket in ((path.outputs["Is Camera Ray"], mix.inputs[0]), (begin.outputs[0], mix.inputs[1]),
                           (blue.outputs[0], mix.inputs[2]), (mix.outputs[0], end.inputs[0])):
        group.links.new(source, socket)
    node = tree.nodes.new("ShaderNodeGroup")
    node.node_tree = group
    tree.links.new(background.outputs[0], node.inputs[0])
    tree.links.new(node.outputs[0], tree.get_output_node("CYCLES").inputs["Surface"])
    sky, lamps = _read()
    assert np.allclose(skies.radiance(sky, np.float32([[0, 0, 1], [1, 0, 0]])), 1)
    assert lamps == ()
    assert list(bpy.data.node_groups) == [group]


def test_a_world_hidden_from_diffuse_rays_gives_no_light(stage):
    set_world((1, 1, 1))
    bpy.context.scene.world.cycles_visibility.diffuse = False
    warnings = []
    sky, lamps = read_world(bpy.context.scene.world, warnings)
    assert (sky.is_black, lamps) == (True, ())
    assert [warning["object"] for warning in warnings] == ["World"]
    assert cycles_irradiance().max() == 0

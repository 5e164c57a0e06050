"""Lamps with nodes against Cycles: colours, falloffs, IES profiles, images (see `stage`)."""

import math

import bpy
import numpy as np
import pytest
from radiosity.radiosity_addon.lights import lamp_data
from radiosity.solver.luminaire import Luminaire
from radiosity.tests.blender.stage import assert_agree, emission_nodes, exported, lamp, warned

# A profile of a downlight: bright about its axis, brighter to one side, and nothing above the horizon.
VERTICAL, HORIZONTAL = np.arange(0, 181, 10), np.arange(0, 361, 45)
CANDELA = 800 * np.maximum(np.cos(np.radians(VERTICAL)), 0) ** 2 * (
    1 + 0.6 * np.cos(np.radians(HORIZONTAL)))[:, None] * (1 + 0.3 * np.cos(np.radians(5 * VERTICAL)))
IES = "\n".join([
    "IESNA:LM-63-2002", "[TEST] made up", "TILT=NONE",
    f"1 1000 1 {len(VERTICAL)} {len(HORIZONTAL)} 1 2 0 0 0", "1 1 50",
    " ".join(map(str, VERTICAL)), " ".join(map(str, HORIZONTAL)),
    *(" ".join(f"{value:.3f}" for value in row) for row in CANDELA)]) + "\n"


def _ies(bulb, source="text", tmp_path=None):
    """Give a lamp the profile, as a text of the file or as a file beside it; returns its node."""
    emission = emission_nodes(bulb, (1, 1, 1), 1)
    node = emission.id_data.nodes.new("ShaderNodeTexIES")
    if source == "text":
        node.mode = "INTERNAL"
        node.ies = bpy.data.texts.new("profile.ies")
        node.ies.write(IES)
    else:
        path = tmp_path / "profile.ies"
        path.write_text(IES)
        node.mode, node.filepath = "EXTERNAL", str(path)
    emission.id_data.links.new(node.outputs[0], emission.inputs["Strength"])
    return node


PROFILED = {
    "point": {"kind": "POINT", "shadow_soft_size": 0, "rotation": (0.3, 0.2, 0.9)},
    "point of a size": {"kind": "POINT", "shadow_soft_size": 0.3, "rotation": (0.3, 0.2, 0.9)},
    "sphere": {"kind": "POINT", "shadow_soft_size": 0.4, "use_soft_falloff": False, "rotation": (0.2, 0.1, 0)},
    "point scaled": {"kind": "POINT", "shadow_soft_size": 0, "rotation": (0.3, 0.2, 0.9), "scale": (2, 1, 0.5)},
    "spot": {"kind": "SPOT", "shadow_soft_size": 0.1, "spot_size": 1.5, "rotation": (0.1, 0.2, 0.4)},
}


@pytest.mark.parametrize("kind", PROFILED)
def test_an_ies_profile_shapes_a_lamp_as_in_cycles(stage, kind):
    _ies(lamp(energy=100, **PROFILED[kind]))
    lights = exported()
    assert isinstance(lights[0], Luminaire)
    assert_agree(lights)


def test_an_ies_file_and_its_strength_are_read(stage, tmp_path):
    node = _ies(lamp("POINT", energy=100, shadow_soft_size=0), "file", tmp_path)
    node.inputs["Strength"].default_value = 2.5
    assert_agree(exported())


def test_a_missing_ies_file_gives_what_cycles_gives(stage, tmp_path):
    # Cycles takes 100 for a profile that it can't read; so do we, all around.
    node = _ies(lamp("POINT", energy=1, shadow_soft_size=0))
    node.mode, node.filepath = "EXTERNAL", str(tmp_path / "gone.ies")
    assert_agree(exported())


@pytest.mark.parametrize("kind", ["POINT", "SUN", "AREA"])
def test_a_blackbody_colours_a_lamp(stage, kind):
    emission = emission_nodes(lamp(kind, energy=20), (1, 1, 1), 1)
    tree = emission.id_data
    body = tree.nodes.new("ShaderNodeBlackbody")
    body.inputs["Temperature"].default_value = 3200
    tree.links.new(body.outputs[0], emission.inputs["Color"])
    assert_agree(exported())


def test_mathematics_and_groups_are_evaluated(stage):
    # Strength (2 + 3) * .25 inside of a group, and a colour by a ramp (of which Cycles keeps 256 steps).
    emission = emission_nodes(lamp("POINT", energy=50, shadow_soft_size=0), (1, 1, 1), 1)
    tree = emission.id_data
    group = bpy.data.node_groups.new("Strength", "ShaderNodeTree")
    group.interface.new_socket("Value", in_out="OUTPUT", socket_type="NodeSocketFloat")
    add, times, out = (group.nodes.new(kind) for kind in ("ShaderNodeMath", "ShaderNodeMath", "NodeGroupOutput"))
    add.operation, times.operation = "ADD", "MULTIPLY"
    add.inputs[0].default_value, add.inputs[1].default_value, times.inputs[1].default_value = 2, 3, 0.25
    group.links.new(add.outputs[0], times.inputs[0])
    group.links.new(times.outputs[0], out.inputs[0])
    node, ramp = tree.nodes.new("ShaderNodeGroup"), tree.nodes.new("ShaderNodeValToRGB")
    node.node_tree = group
    ramp.color_ramp.elements[1].color = (1, 0.5, 0.2, 1)
    ramp.inputs[0].default_value = 0.7
    tree.links.new(node.outputs[0], emission.inputs["Strength"])
    tree.links.new(ramp.outputs[0], emission.inputs["Color"])
    lights = exported()
    assert lights[0].power() == pytest.approx(50 * 1.25 * 0.7 * np.array([1, 0.5, 0.2]), rel=5e-3)
    assert_agree(lights)


def test_a_pattern_of_many_colours_is_kept_channel_by_channel(stage):
    # Colour by direction: red to one side, green to another; three lamps, one a channel. Made green, it is the second.
    shown = lamp("POINT", energy=50, shadow_soft_size=0.1)
    emission = emission_nodes(shown, (1, 1, 1), 1)
    tree = emission.id_data
    place, scale = tree.nodes.new("ShaderNodeTexCoord"), tree.nodes.new("ShaderNodeVectorMath")
    scale.operation = "MULTIPLY_ADD"
    scale.inputs[1].default_value = scale.inputs[2].default_value = (0.5, 0.5, 0.5)
    tree.links.new(place.outputs["Normal"], scale.inputs[0])
    tree.links.new(scale.outputs[0], emission.inputs["Color"])
    lights = exported()
    assert len(lights) == 3
    assert_agree(lights)
    shown.data.color = (0, 1, 0)
    (green,) = exported()
    assert green.pattern == pytest.approx(lights[1].pattern)
    assert green.colour == pytest.approx(lights[1].colour)


FALLOFFS = {
    "smooth point": ("POINT", {"shadow_soft_size": 0}, "Quadratic", 3.0),
    "linear point": ("POINT", {"shadow_soft_size": 0.2}, "Linear", 0.0),
    "constant spot": ("SPOT", {"shadow_soft_size": 0.1, "spot_size": 1.6}, "Constant", 1.0),
    "linear area": ("AREA", {"size": 0.6}, "Linear", 0.0),
}


@pytest.mark.parametrize("kind", FALLOFFS)
def test_a_falloff_is_as_in_cycles(stage, kind):
    lamp_type, settings, output, smooth = FALLOFFS[kind]
    emission = emission_nodes(lamp(lamp_type, energy=40, **settings), (1, 0.8, 0.5), 1)
    tree = emission.id_data
    falloff = tree.nodes.new("ShaderNodeLightFalloff")
    falloff.inputs["Strength"].default_value, falloff.inputs["Smooth"].default_value = 2, smooth
    tree.links.new(falloff.outputs[output], emission.inputs["Strength"])
    assert_agree(exported())


def test_a_falloff_and_a_profile_multiply(stage):
    node = _ies(lamp("POINT", energy=40, shadow_soft_size=0, rotation=(0.3, 0.2, 0)))
    tree = node.id_data
    falloff = tree.nodes.new("ShaderNodeLightFalloff")
    falloff.inputs["Strength"].default_value = 1
    tree.links.new(falloff.outputs["Linear"], node.inputs["Strength"])
    assert_agree(exported())


def test_an_image_on_an_area_lamp_counts_by_its_mean_and_is_told_of(stage):
    # Left half red (1, 0, 0), right half (0, .5, .5): the mean is (.5, .25, .25). Cycles' means agree from afar.
    emission = emission_nodes(lamp("AREA", energy=50, size=0.3, location=(0, 0.3, 4)), (1, 1, 1), 1)
    image = bpy.data.images.new("Halves", 8, 8, float_buffer=True)
    pixels = np.tile(np.float32([1, 0, 0, 1]), (8, 8, 1))
    pixels[:, 4:] = (0, 0.5, 0.5, 1)
    image.pixels.foreach_set(pixels.ravel())
    image.pack()
    tree = emission.id_data
    node = tree.nodes.new("ShaderNodeTexImage")
    node.image, node.interpolation = image, "Closest"
    tree.links.new(node.outputs["Color"], emission.inputs["Color"])
    lights, message = warned()
    assert "mean" in message
    assert lights[0].power() == pytest.approx([25, 12.5, 12.5], rel=1e-3)


def _by_geometry_nodes(scene, collection):
    """Instance a collection by the Collection Info node of an object's modifier."""
    tree = bpy.data.node_groups.new("Instances", "GeometryNodeTree")
    tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    source, output = tree.nodes.new("GeometryNodeCollectionInfo"), tree.nodes.new("NodeGroupOutput")
    source.inputs["Collection"].default_value = collection
    tree.links.new(source.outputs[0], output.inputs[0])
    carrier = bpy.data.objects.new("Carrier", bpy.data.meshes.new("Carrier"))
    carrier.modifiers.new("Nodes", "NODES").node_group = tree
    scene.collection.objects.link(carrier)


def _by_background_set(scene, collection):
    """Show a collection in the scene's background set."""
    scene.background_set = bpy.data.scenes.new("Set")
    scene.background_set.collection.children.link(collection)


@pytest.mark.parametrize("show", [_by_geometry_nodes, _by_background_set])
def test_lamps_that_are_shown_from_elsewhere_have_their_nodes(stage, show):
    # A lamp of 1 W, five times as strong by its nodes, and red. Exact answer: 5 W of red, over all directions.
    bulb = lamp("POINT", energy=1)
    emission_nodes(bulb, (1, 0, 0), 5)
    collection = bpy.data.collections.new("Elsewhere")
    collection.objects.link(bulb)
    stage.collection.objects.unlink(bulb)
    show(stage, collection)
    (light,) = exported()
    assert light.colour == pytest.approx([5 / (4 * math.pi), 0, 0])


def test_lamps_of_other_scenes_are_not_looked_at(stage):
    bpy.data.scenes.new("Other").collection.objects.link(lamp("POINT", energy=1))
    stage.collection.objects.unlink(bpy.data.objects["Lamp"])
    assert lamp_data(stage) == []


def test_reading_nodes_leaves_nothing_behind(stage):
    _ies(lamp("POINT", energy=10))
    kinds = ("objects", "lights", "meshes", "materials", "scenes", "cameras", "images", "worlds", "node_groups")
    before = {kind: [item.name for item in getattr(bpy.data, kind)] for kind in kinds}
    exported()
    assert {kind: [item.name for item in getattr(bpy.data, kind)] for kind in kinds} == before
    assert math.isclose(bpy.data.lights["Lamp"].energy, 10)

"""Lamps whose nodes look at where the lamp stands, at its object or at its picture, against Cycles (see `stage`)."""

import bpy
import numpy as np
import pytest
from radiosity.solver.errors import NothingToBake
from radiosity.tests.blender.stage import assert_agree, emission_nodes, export, exported, lamp, warned

TURNED = {"location": (-0.2, 0.3, 1.8), "rotation": (0.3, 0.2, 0.9)}
SPOT = {"kind": "SPOT", "energy": 100, "shadow_soft_size": 0, "spot_size": 2.0, **TURNED}


def _fed(bulb, kind, output, where="Color"):
    """Feed a lamp's emission with .7 plus a fifth of the output of a new node."""
    emission = emission_nodes(bulb, (1, 1, 1), 1)
    tree = emission.id_data
    node, scale = tree.nodes.new(kind), tree.nodes.new("ShaderNodeVectorMath")
    scale.operation = "MULTIPLY_ADD"
    scale.inputs[1].default_value, scale.inputs[2].default_value = (0.2, 0.2, 0.2), (0.7, 0.7, 0.7)
    tree.links.new(node.outputs[output], scale.inputs[0])
    tree.links.new(scale.outputs[0], emission.inputs[where])


def _picture(bulb, source=None, output="UV"):
    """Feed a lamp's emission with an image: a bright corner, a red one, the rest dim; `source` gives its vectors."""
    image = bpy.data.images.new("Picture", 16, 16, float_buffer=True)
    pixels = np.full((16, 16, 4), 0.1, np.float32)
    pixels[:8, :6, :3], pixels[8:, 8:, 0] = 1, 2
    image.pixels.foreach_set(pixels.ravel())
    image.pack()
    emission = emission_nodes(bulb, (1, 1, 1), 1)
    tree = emission.id_data
    node = tree.nodes.new("ShaderNodeTexImage")
    node.image = image
    tree.links.new(node.outputs["Color"], emission.inputs["Color"])
    if source is not None:
        tree.links.new(tree.nodes.new(source).outputs[output], node.inputs["Vector"])


PICTURES = {
    "its own vectors": ({}, ()),
    "UV coordinates": ({"spot_size": 1.4, "spot_blend": 0.3}, ("ShaderNodeTexCoord",)),
    "parametric": ({}, ("ShaderNodeNewGeometry", "Parametric")),
    "a scaled spot": ({"scale": (1.6, 1, 0.9)}, ()),
}


@pytest.mark.parametrize("kind", PICTURES)
def test_a_spot_throws_its_picture_as_in_cycles(stage, kind):
    settings, source = PICTURES[kind]
    _picture(lamp(**SPOT | {"location": (0, 0, 2), "rotation": (0.1, 0.05, 0.4)} | settings), *source)
    assert_agree(exported())


def test_spots_of_other_angles_throw_pictures_of_their_own(stage):
    # The cone of the wider spot reaches beyond that of the narrow one, from memory or not.
    bulb = lamp(**SPOT | {"location": (0, 0, 2), "rotation": (0, 0, 0)})
    _picture(bulb)
    before = exported()[0].pattern
    bulb.data.spot_size = 1.2
    assert not np.array_equal(exported()[0].pattern, before)


def test_a_flat_light_by_nodes_has_no_pattern_within_a_spots_cone(stage):
    # Red by an image of one colour. Exact answer: a plain spot of that colour.
    bulb = lamp(**SPOT)
    emission = emission_nodes(bulb, (1, 1, 1), 1)
    node = emission.id_data.nodes.new("ShaderNodeTexImage")
    node.image = bpy.data.images.new("Flat", 4, 4, float_buffer=True)
    node.image.pixels.foreach_set(np.tile(np.float32([1, 0.5, 0.25, 1]), 16))
    node.image.pack()
    emission.id_data.links.new(node.outputs["Color"], emission.inputs["Color"])
    (light,) = exported()
    assert type(light).__name__ == "Spot"
    assert light.flux == pytest.approx([100, 50, 25], rel=1e-3)


BULBS = {
    "point": {"kind": "POINT", "energy": 100, "shadow_soft_size": 0, **TURNED},
    "spot scaled": SPOT | {"scale": (1.5, 1, 0.8)},
    "sun": {"kind": "SUN", "energy": 3, "angle": 0, **TURNED, "rotation": (0.3, 0.2, 0.9)},
}
SEEN = {
    "incoming": ("ShaderNodeNewGeometry", "Incoming"),
    "normal": ("ShaderNodeNewGeometry", "Normal"),
    "position": ("ShaderNodeNewGeometry", "Position"),
    "object coordinates": ("ShaderNodeTexCoord", "Object"),
    "location": ("ShaderNodeObjectInfo", "Location"),
    "colour": ("ShaderNodeObjectInfo", "Color"),
    "index": ("ShaderNodeObjectInfo", "Object Index"),
    "random": ("ShaderNodeObjectInfo", "Random"),
}


@pytest.mark.parametrize("kind", BULBS)
@pytest.mark.parametrize("seen", SEEN)
def test_a_lamp_looks_at_where_and_what_it_is_as_in_cycles(stage, kind, seen):
    bulb = lamp(**BULBS[kind])
    bulb.color, bulb.pass_index = (0.2, 0.7, 1, 1), 3
    _fed(bulb, *SEEN[seen])
    assert_agree(exported())


def test_a_sun_with_a_texture_without_vectors_shines_as_in_cycles(stage):
    # A gradient along the sun's own x: black at the origin, where it does not stand.
    emission = emission_nodes(lamp("SUN", energy=3, angle=0, **TURNED), (1, 1, 1), 1)
    gradient = emission.id_data.nodes.new("ShaderNodeTexGradient")
    emission.id_data.links.new(gradient.outputs["Color"], emission.inputs["Color"])
    assert_agree(exported())


def test_an_area_lamp_looks_at_its_place_by_the_mean_over_its_face(stage):
    # Its light is .7 + x / 5 with the place x in the world: .4, .2 and 3 in its middle.
    _fed(lamp("AREA", energy=50, size=0.3, location=(0.4, 0.2, 3)), "ShaderNodeNewGeometry", "Position")
    lights, message = warned()
    assert "mean" in message
    assert lights[0].power() == pytest.approx(50 * np.array([0.78, 0.74, 1.3]), rel=1e-3)


def test_instances_of_a_lamp_look_at_their_own_places(stage):
    # Two instances of one point lamp, turned apart, whose light grows to one side of the world.
    bulb = lamp("POINT", location=(0, 0, 0.2), energy=30, shadow_soft_size=0)
    _fed(bulb, "ShaderNodeNewGeometry", "Position")
    bpy.context.collection.objects.unlink(bulb)
    collection = bpy.data.collections.new("Lamps")
    collection.objects.link(bulb)
    for x, turn in ((-0.5, 0.3), (1.0, -0.4)):
        instancer = bpy.data.objects.new("Instancer", None)
        instancer.instance_type, instancer.instance_collection = "COLLECTION", collection
        instancer.location, instancer.rotation_euler = (x, 0.2, 1.8), (0, turn, 0)
        bpy.context.collection.objects.link(instancer)
    lights = exported()
    assert len(lights) == 2
    assert_agree(lights)


@pytest.mark.parametrize(("settings", "source", "word"), [
    ({"kind": "POINT"}, ("ShaderNodeLightPath", "Ray Length"), "Ray Length"),
    ({"kind": "POINT"}, ("ShaderNodeTexCoord", "Window"), "camera"),
    ({"kind": "POINT", "shadow_soft_size": 0.2}, ("ShaderNodeNewGeometry", "Position"), "its middle"),
    ({"kind": "SUN", "angle": 0.2}, ("ShaderNodeNewGeometry", "Position"), "middle"),
    ({"kind": "AREA", "size": 0.2}, ("ShaderNodeNewGeometry", "Incoming"), "straight on"),
    ({"kind": "AREA", "size": 0.2}, ("ShaderNodeTexIES", "Fac"), "straight on"),
])
def test_what_a_lamp_can_not_look_at_is_told(stage, settings, source, word):
    _fed(lamp(energy=20, **settings), *source)
    lights, message = warned()
    assert len(lights) == 1
    assert word in message


def test_the_distance_counts_as_one_metre_wherever_it_is_asked_for(stage):
    # As the strength itself, and behind a node: .7 + .2. Exact answer: 20 W, and 18 W.
    bulb = lamp("POINT", energy=20, shadow_soft_size=0)
    emission = emission_nodes(bulb, (1, 1, 1), 1)
    path = emission.id_data.nodes.new("ShaderNodeLightPath")
    emission.id_data.links.new(path.outputs["Ray Length"], emission.inputs["Strength"])
    assert warned()[0][0].power() == pytest.approx([20, 20, 20], rel=1e-3)
    _fed(bulb, "ShaderNodeLightPath", "Ray Length", "Strength")
    assert warned()[0][0].power() == pytest.approx([18, 18, 18], rel=5e-3)


def test_a_lamp_whose_nodes_give_nothing_is_told_of(build, stage):
    emission_nodes(lamp("POINT", energy=20), (1, 1, 1), 0)
    lights, message = warned()
    assert lights == ()
    assert "nodes give no light" in message
    with pytest.raises(NothingToBake, match="no light: lamp 'Lamp': its nodes give no light"):
        export()

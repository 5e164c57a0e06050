"""Values that materials read, of their nodes and of the object that shows them, changed after a bake."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import bpy
import numpy as np
import pytest
from radiosity.tests.blender.relight.hand import pixels, refused, relight

Turn = Callable[[], None]


def node(stage: Any, kind: str, output: str | int = 0, **settings: Any) -> Any:
    """A new node whose output is the base colour of the square."""
    shader = stage.shader(bpy.data.objects["Square"].data.materials[0])
    made = shader.id_data.nodes.new(kind)
    for name, value in settings.items():
        setattr(made, name, value)
    shader.id_data.links.new(made.outputs[output], shader.inputs["Base Color"])
    return made


def set_value(owner: Any, name: str, value: Any) -> None:
    if isinstance(owner, bpy.types.ID) and name not in owner.bl_rna.properties:
        owner[name] = value
    else:
        setattr(owner, name, value)


def rgb_node(stage: Any) -> Turn:
    socket = node(stage, "ShaderNodeRGB").outputs[0]
    return lambda: set_value(socket, "default_value", (0.1, 0.2, 0.3, 1))


def value_node(stage: Any) -> Turn:
    socket = node(stage, "ShaderNodeValue").outputs[0]
    return lambda: set_value(socket, "default_value", 0.7)


def ramp(stage: Any) -> Turn:
    element = node(stage, "ShaderNodeValToRGB").color_ramp.elements[0]
    return lambda: set_value(element, "color", (0.1, 0.2, 0.3, 1))


def muted_link(stage: Any) -> Turn:
    (link,) = node(stage, "ShaderNodeRGB").outputs[0].links
    link.is_muted = True
    return lambda: set_value(link.to_socket, "default_value", (0.1, 0.2, 0.3, 1))


def object_coordinates(stage: Any) -> Turn:
    hand = stage.object("Hand", None)
    node(stage, "ShaderNodeTexCoord", "Object", object=hand)
    return lambda: set_value(hand, "location", (0.1, 0, 0))


def object_info(output: str, name: str, value: Any) -> Callable[[Any], Turn]:
    def prepared(stage: Any) -> Turn:
        node(stage, "ShaderNodeObjectInfo", output)
        square = bpy.data.objects["Square"]
        return lambda: set_value(square.data.materials[0] if output == "Material Index" else square, name, value)
    return prepared


def attribute(kind: str, owner: Callable[[], Any], name: str) -> Callable[[Any], Turn]:
    def prepared(stage: Any) -> Turn:
        node(stage, "ShaderNodeAttribute", attribute_type=kind, attribute_name=name)
        set_value(owner(), name, (0.1, 0.1, 0.1, 1))
        return lambda: set_value(owner(), name, (0.2, 0.1, 0.1, 1))
    return prepared


def mesh_attribute(stage: Any) -> Turn:
    node(stage, "ShaderNodeAttribute", attribute_name="Wear")
    bpy.data.objects["Square"].data.attributes.new("Wear", "FLOAT", "FACE")
    return wear


def wear() -> None:
    bpy.data.objects["Square"].data.attributes["Wear"].data[0].value = 0.4


def vertex_group(stage: Any) -> Turn:
    node(stage, "ShaderNodeAttribute", attribute_name="Weight")
    group = bpy.data.objects["Square"].vertex_groups.new(name="Weight")
    return lambda: group.add([0, 1], 0.6, "REPLACE")


def square() -> Any:
    return bpy.data.objects["Square"]


@pytest.mark.parametrize(("prepared", "line"), [
    (rgb_node, "material 'Square paint' reflects otherwise"),
    (value_node, "material 'Square paint' reflects otherwise"),
    (ramp, "material 'Square paint' reflects otherwise"),
    (muted_link, "material 'Square paint' reflects otherwise"),
    (object_coordinates, "material 'Square paint' reflects otherwise"),
    (object_info("Material Index", "pass_index", 3), "material 'Square paint' reflects otherwise"),
    (object_info("Color", "color", (0.2, 0.3, 0.4, 1)), "object 'Square' has another 'color' (Object Info)"),
    (object_info("Object Index", "pass_index", 3), "object 'Square' has another 'pass_index' (Object Info)"),
    (attribute("OBJECT", square, "color"), "object 'Square' has another 'color' (Object)"),
    (attribute("OBJECT", square, "Tint"), "object 'Square' has another 'Tint' (Object)"),
    (attribute("INSTANCER", square, "Tint"), "object 'Square' has another 'Tint' (Instancer)"),
    (attribute("VIEW_LAYER", lambda: bpy.context.scene, "Tint"), "object 'Square' has another 'Tint' (View Layer)"),
    (mesh_attribute, "object 'Square' has another 'Wear' (Geometry), which its materials read"),
    (vertex_group, "object 'Square' has another 'Weight' (Geometry), which its materials read"),
], ids=["rgb node", "value node", "color ramp", "muted link", "object coordinates", "material index", "object color",
        "object index", "color attribute of the object", "custom property", "instancer's property", "scene's property",
        "attribute", "vertex group"])
def test_what_a_material_reads_is_a_change(stage, prepared, line):
    # A value that the square's base colour comes from, changed after the bake. Exact answer: a relight says which.
    turn = prepared(stage)
    bpy.ops.radiosity.bake()
    turn()
    refused(line.replace("(", r"\(").replace(")", r"\)"))


@pytest.mark.parametrize("kind", ["visible_shadow", "visible_diffuse"])
def test_other_ray_visibility_needs_a_bake(baked, kind):
    # The square hidden from a kind of rays. Exact answer: a relight says so; of rays that a bake has not, nothing.
    square().visible_glossy = False
    relight()
    setattr(square(), kind, False)
    refused("object 'Square' has other ray visibility")


def test_another_map_for_nodes_without_a_name_needs_a_bake(stage):
    # Two UV maps, the second made the one that is rendered. Exact answer: the mesh changed.
    layers = square().data.uv_layers
    layers.new(name="First")
    layers.new(name="Second")
    layers["First"].active_render = True
    bpy.ops.radiosity.bake()
    layers["Second"].active_render = True
    refused("the mesh of object 'Square' changed")


def test_what_no_material_reads_is_no_change(stage):
    # Colour, numbers, property, weights and an attribute of a square whose material reads none. Exact answer: 1 W/m2.
    square().data.attributes.new("Wear", "FLOAT", "FACE")
    group = square().vertex_groups.new(name="Weight")
    bpy.ops.radiosity.bake()
    item = square()
    item.color, item.pass_index, item.data.materials[0].pass_index, item["Tint"] = (0.2, 0.3, 0.4, 1), 3, 4, 0.5
    group.add([0, 1], 0.6, "REPLACE")
    wear()
    relight()
    assert pixels() == pytest.approx(1, rel=0.01)


def test_a_strength_behind_a_muted_link_is_a_strength(stage):
    # A white world whose strength of .5 is linked to a value of 9, by a muted link; it is made 1, then the world is
    # hidden from diffuse rays. Exact answer: pi / 2 and pi W/m2 beside the sun's 1, then that alone.
    world = stage.world((1, 1, 1))
    background = world.node_tree.nodes["Background"]
    value = world.node_tree.nodes.new("ShaderNodeValue")
    value.outputs[0].default_value = 9
    world.node_tree.links.new(value.outputs[0], background.inputs["Strength"]).is_muted = True
    background.inputs["Strength"].default_value = 0.5
    bpy.ops.radiosity.bake()
    assert pixels() == pytest.approx(1 + math.pi / 2, rel=0.02)
    background.inputs["Strength"].default_value = 1
    relight()
    assert pixels() == pytest.approx(1 + math.pi, rel=0.02)
    world.cycles_visibility.diffuse = False
    relight()
    assert pixels() == pytest.approx(np.ones_like(pixels()), rel=0.01)


def test_a_node_that_keeps_the_worlds_colour_is_a_change(stage):
    # A world of an RGB node's colour. Exact answer: another colour needs a bake.
    tree = stage.world((1, 1, 1)).node_tree
    rgb = tree.nodes.new("ShaderNodeRGB")
    tree.links.new(rgb.outputs[0], tree.nodes["Background"].inputs["Color"])
    bpy.ops.radiosity.bake()
    rgb.outputs[0].default_value = (1, 0, 0, 1)
    refused("the world changed in more than its color and strength")

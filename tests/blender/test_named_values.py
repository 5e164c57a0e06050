"""What Attribute nodes ask of objects, instancers and view layers. Exact answers: what Cycles makes of these nodes."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np
import pytest
from radiosity.tests.blender.stage import emission_nodes, export, lamp, read_world, warned

TINT = (0.6, 0.3, 0.1)


@pytest.fixture
def attribute(build):
    """The Attribute node, named Tint, that is the base colour of the square Wall under a sun."""
    build.sun()
    material = build.material("Paint", (1, 1, 1))
    tree = material.node_tree
    node = tree.nodes.new("ShaderNodeAttribute")
    node.attribute_name = "Tint"
    tree.links.new(node.outputs["Color"], build.shader(material).inputs["Base Color"])
    build.mesh("Wall", material=material)
    return node


OWNERS = {"OBJECT": lambda: bpy.data.objects["Wall"], "OBJECT data": lambda: bpy.data.meshes["Wall"],
          "INSTANCER": lambda: bpy.data.objects["Wall"], "VIEW_LAYER": lambda: bpy.context.view_layer,
          "VIEW_LAYER scene": lambda: bpy.context.scene, "VIEW_LAYER world": lambda: bpy.context.scene.world}


@pytest.mark.parametrize("owner", OWNERS)
def test_a_custom_property_is_a_colour(attribute, owner):
    attribute.attribute_type = owner.split()[0]
    OWNERS[owner]()["Tint"] = TINT
    warnings: list[dict[str, Any]] = []
    assert np.allclose(export(warnings).reflectance, TINT, atol=1e-5)
    assert warnings == []


@pytest.mark.parametrize(("output", "expected"), [("Vector", TINT), ("Fac", 1 / 3), ("Alpha", 0.4)])
def test_other_outputs_give_its_vector_mean_and_alpha(attribute, output, expected):
    attribute.attribute_type = "OBJECT"
    bpy.data.objects["Wall"]["Tint"] = (*TINT, 0.4)
    tree, socket = attribute.id_data, attribute.outputs["Color"].links[0].to_socket
    tree.links.new(attribute.outputs[output], socket)
    assert np.allclose(export([]).reflectance, expected, atol=1e-5)


def test_numbers_and_blenders_own_properties_count(attribute):
    attribute.attribute_type = "OBJECT"
    wall = bpy.data.objects["Wall"]
    wall["Tint"] = 0.3
    assert np.allclose(export([]).reflectance, 0.3, atol=1e-5)
    attribute.attribute_name, wall.color = "color", (0.2, 0.4, 0.6, 1)
    assert np.allclose(export([]).reflectance, (0.2, 0.4, 0.6), atol=1e-5)


def test_each_instance_asks_its_own_instancer(build, attribute):
    # Two instances of a collection, with properties of their own. Exact answer: each has its instancer's colour.
    attribute.attribute_type = "INSTANCER"
    collection = bpy.data.collections.new("Walls")
    wall = bpy.data.objects["Wall"]
    collection.objects.link(wall)
    bpy.context.scene.collection.objects.unlink(wall)
    colours = {"A": TINT, "B": (0.1, 0.2, 0.3)}
    for name, colour in colours.items():
        empty = build.object(name, None)
        empty.instance_type, empty.instance_collection, empty["Tint"] = "COLLECTION", collection, colour
        empty.location.x = 2 * len(colours)
    scene = export([])
    for surface in scene.surfaces:
        assert np.allclose(np.asarray(scene.reflectance)[surface.triangles], colours[surface.name[0]], atol=1e-5)


@pytest.mark.parametrize("kind", ["OBJECT", "INSTANCER", "VIEW_LAYER"])
def test_what_nobody_has_is_black_and_told(attribute, kind):
    attribute.attribute_type = kind
    warnings: list[dict[str, Any]] = []
    assert np.allclose(export(warnings).reflectance, 0)
    (warning,) = warnings
    assert warning["object"] == "Wall"
    assert "has no 'Tint' for the Attribute node" in warning["message"]
    assert "material 'Paint'" in warning["message"]


def _attribute_into(socket: Any, kind: str) -> None:
    tree = socket.id_data
    node = tree.nodes.new("ShaderNodeAttribute")
    node.attribute_name, node.attribute_type = "Tint", kind
    tree.links.new(node.outputs["Color"], socket)


def test_a_world_that_asks_its_scene_is_told(build):
    world = build.world((1, 1, 1))
    background = next(node for node in world.node_tree.nodes if node.bl_idname == "ShaderNodeBackground")
    _attribute_into(background.inputs["Color"], "VIEW_LAYER")
    bpy.context.scene["Tint"] = TINT
    warnings: list[dict[str, Any]] = []
    assert not read_world(world, warnings)[0].radiance.any()
    (warning,) = warnings
    assert (warning["object"], warning["code"]) == (world.name, "world")
    assert "asks for 'Tint' (View Layer)" in warning["message"]


def test_a_lamp_that_asks_its_object_is_told(stage):
    bulb = lamp("POINT", energy=10)
    bulb["Tint"] = TINT
    emission = emission_nodes(bulb, (1, 1, 1), 1)
    rest = emission.id_data.nodes.new("ShaderNodeInvert")
    _attribute_into(rest.inputs["Color"], "OBJECT")
    emission.id_data.links.new(rest.outputs[0], emission.inputs["Color"])
    _, message = warned()
    assert "asks for 'Tint' (Object)" in message

"""The survey of a scene, which is compared with later sessions and with other files of the same scene."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from radiosity.radiosity_addon.blend_file import save_copy
from radiosity.radiosity_addon.survey import Survey, survey

COLOUR = (0.25, 0.5, 0.75, 1.0)
# What nodes are derived from.
NO_NODES = {"ShaderNode", "ShaderNodeCustomGroup", "ShaderNodeTree"}


def look() -> Survey:
    return survey(bpy.context.scene, bpy.context.view_layer)


def every_node(tree: Any) -> None:
    """One node of each kind that a material may have."""
    for name in dir(bpy.types):
        if name.startswith("ShaderNode") and name not in NO_NODES:
            tree.nodes.new(name)
    tree.nodes.new("NodeReroute")


def saved_image(path: Path) -> Any:
    image = bpy.data.images.new(path.stem, 2, 2)
    image.pixels.foreach_set(np.tile(np.float32(COLOUR), 4))
    image.filepath_raw, image.file_format = str(path), "PNG"
    image.save()
    bpy.data.images.remove(image)
    return bpy.data.images.load(str(path))


@pytest.fixture
def rich(build: Any, tmp_path: Path) -> Any:
    """A square whose material has all nodes, images of each kind, a group, and reads what its object has."""
    build.sun()
    material = build.textured("Paint", saved_image(tmp_path / "file.png"))
    tree = material.node_tree
    every_node(tree)
    for image in (build.image("packed", np.ones((2, 2, 4))), bpy.data.images.new("made", 2, 2)):
        tree.nodes.new("ShaderNodeTexImage").image = image
    sequence = bpy.data.images.load(str(tmp_path / "file.png"), check_existing=False)
    sequence.source = "SEQUENCE"
    node = tree.nodes.new("ShaderNodeTexImage")
    node.image, node.image_user.frame_duration, node.image_user.use_auto_refresh = sequence, 3, True
    group = bpy.data.node_groups.new("Group", "ShaderNodeTree")
    every_node(group)
    for _ in range(2):
        tree.nodes.new("ShaderNodeGroup").node_tree = group
    tree.nodes.new("ShaderNodeTexCoord").object = build.object("Hand", None)
    square = build.mesh("Square", material=material)
    bpy.data.objects["Hand"].location, square.rotation_euler = (0.1, 0.2, 0.3), (0.1, 0.2, 0.3)
    for kind, name in (("OBJECT", "Tint"), ("GEOMETRY", "Wear"), ("GEOMETRY", "Weight")):
        node = tree.nodes.new("ShaderNodeAttribute")
        node.attribute_type, node.attribute_name = kind, name
        mix = tree.nodes.new("ShaderNodeMixRGB")
        shown = build.shader(material).inputs["Base Color"].links[0].from_socket
        tree.links.new(shown, mix.inputs["Color1"])
        tree.links.new(node.outputs["Color"], mix.inputs["Color2"])
        tree.links.new(mix.outputs[0], build.shader(material).inputs["Base Color"])
    square["Tint"] = (0.1, 0.2, 0.3)
    square.data.attributes.new("Wear", "FLOAT", "FACE").data[0].value = 0.3
    square.vertex_groups.new(name="Weight").add([0, 1], 0.7, "REPLACE")
    return build


def test_a_scene_is_the_same_in_a_later_session_and_another_file(rich, tmp_path):
    # The scene saved, a copy of it in another folder, both opened again. Exact answer: the same survey, as kept too.
    first = look()
    assert set(first.read["Square"]) == {"'Tint' (Object)", "'Wear' (Geometry)", "'Weight' (Geometry)"}
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    (tmp_path / "other").mkdir()
    save_copy(tmp_path / "other" / "copy.blend")
    for path in (tmp_path / "scene.blend", tmp_path / "other" / "copy.blend"):
        bpy.ops.wm.open_mainfile(filepath=str(path))
        assert look() == first
    assert Survey.of_dict(json.loads(json.dumps(first.as_dict()))) == first


def test_the_frame_counts_for_what_moves_with_it(build, tmp_path):
    # A material with an image, whose node has settings of frames; then a sequence. Exact answer: neither another frame
    # nor these settings change the first; both change the second.
    build.sun()
    material = build.textured("Paint", saved_image(tmp_path / "file.png"))
    build.mesh("Square", material=material)
    scene = bpy.context.scene
    user = next(node for node in material.node_tree.nodes if node.bl_idname == "ShaderNodeTexImage").image_user

    def sums() -> list[str]:
        found = [look().surfaces["Paint"].shape]
        scene.frame_set(scene.frame_current + 1)
        found.append(look().surfaces["Paint"].shape)
        user.frame_offset += 1
        return [*found, look().surfaces["Paint"].shape]

    assert len(set(sums())) == 1
    bpy.data.images["file.png"].source = "SEQUENCE"
    user.use_auto_refresh = True
    assert len(set(sums())) == 3


def test_looks_of_nodes_say_nothing(rich):
    # Nodes moved, labelled, coloured, framed, and a point of a curve chosen. Exact answer: the same survey.
    first = look()
    tree = bpy.data.materials["Paint"].node_tree
    frame = tree.nodes.new("NodeFrame")
    for node in tree.nodes:
        node.location.x += 10
        node.label, node.use_custom_color, node.color = "Mine", True, (1, 0, 0)
        if node != frame:
            node.parent = frame
        if node.bl_idname == "ShaderNodeRGBCurve":
            point = node.mapping.curves[0].points[0]
            point.select = not point.select
    assert look() == first

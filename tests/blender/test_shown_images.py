"""Images whose files are missing are errors, wherever they are used; sequences show the present frame."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np
import pytest
from radiosity.radiosity_addon.images import srgb_to_linear
from radiosity.solver.errors import SceneError
from radiosity.tests.blender.stage import emission_nodes, export, read_world


def missing_image():
    image = bpy.data.images.new("brick.png", 4, 4)
    image.source, image.filepath = "FILE", "/nowhere/brick.png"
    image.reload()
    return image


def test_a_missing_texture_names_material_image_and_path(build):
    build.sun()
    build.mesh("Wall", material=build.textured("Brick", missing_image())).data.uv_layers.new()
    with pytest.raises(SceneError, match=r"material 'Brick': image 'brick.png' is missing at /nowhere/brick.png"):
        export([])


def test_a_missing_image_behind_other_nodes_is_an_error_too(build):
    # Where Cycles has to look, it shows magenta. Exact answer: the error as for a plain texture; none once unlinked.
    build.sun()
    material = build.textured("Brick", missing_image())
    build.mesh("Wall", material=material)
    tree, colour = material.node_tree, build.shader(material).inputs["Base Color"]
    gamma = tree.nodes.new("ShaderNodeGamma")
    tree.links.new(colour.links[0].from_socket, gamma.inputs["Color"])
    tree.links.new(gamma.outputs[0], colour)
    with pytest.raises(SceneError, match=r"material 'Brick': image 'brick.png' is missing at /nowhere/brick.png"):
        export([])
    tree.links.remove(gamma.inputs["Color"].links[0])
    assert export([]) is not None


def test_a_file_that_is_no_image_is_an_error_too(build, tmp_path):
    path = tmp_path / "brick.png"
    path.write_text("no image")
    image = missing_image()
    image.filepath = str(path)
    image.reload()
    build.sun()
    material = build.textured("Brick", image)
    texture = build.shader(material).inputs["Base Color"].links[0].from_node
    texture.projection = "BOX"
    build.mesh("Wall", material=material)
    with pytest.raises(SceneError, match=r"material 'Brick': image 'brick.png' can't be read from .*: restore"):
        export([])


def test_a_world_tells_which_frame_of_a_sequence_it_shows(build, tmp_path):
    picture = build.image("Frame", np.full((4, 4, 4), 1.0))
    picture.filepath_raw, picture.file_format = str(tmp_path / "frame_0001.png"), "PNG"
    picture.save()
    world = build.world((1, 1, 1))
    background = next(node for node in world.node_tree.nodes if node.bl_idname == "ShaderNodeBackground")
    texture = world.node_tree.nodes.new("ShaderNodeTexEnvironment")
    texture.image = bpy.data.images.load(picture.filepath_raw)
    texture.image.source = "SEQUENCE"
    world.node_tree.links.new(texture.outputs[0], background.inputs["Color"])
    warnings: list[dict[str, Any]] = []
    read_world(world, warnings)
    (warning,) = warnings
    assert "is a sequence: what it shows in the scene's frame 1 is baked" in warning["message"]


def test_a_missing_image_of_a_world_is_an_error(build):
    world = build.world((1, 1, 1))
    tree = world.node_tree
    background = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeBackground")
    sky_image = tree.nodes.new("ShaderNodeTexEnvironment")
    sky_image.image = missing_image()
    tree.links.new(sky_image.outputs[0], background.inputs["Color"])
    with pytest.raises(SceneError, match=rf"world '{world.name}': image 'brick.png' is missing at /nowhere/brick.png"):
        read_world(world, [])


def test_a_missing_image_of_a_lamp_is_an_error(build):
    sun = build.sun()
    emission = emission_nodes(sun, (1, 1, 1), 1)
    texture = emission.id_data.nodes.new("ShaderNodeTexImage")
    texture.image = missing_image()
    emission.id_data.links.new(texture.outputs[0], emission.inputs["Color"])
    build.mesh("Wall")
    with pytest.raises(SceneError, match=r"lamp 'Sun': image 'brick.png' is missing at /nowhere/brick.png"):
        export([])


def test_a_sequence_shows_the_present_frame(build, tmp_path):
    # Grey images of 0, 51 and 102 of 255 as frames 1 to 3, of which 3 is due. Exact answer: 102 in linear light.
    build.sun()
    for frame in (1, 2, 3):
        picture = build.image("Frame", np.full((4, 4, 4), ((frame - 1) / 5,) * 3 + (1,)))
        picture.filepath_raw, picture.file_format = str(tmp_path / f"frame_{frame:04}.png"), "PNG"
        picture.save()
    sequence = bpy.data.images.load(str(tmp_path / "frame_0001.png"))
    sequence.source = "SEQUENCE"
    material = build.textured("Screen", sequence)
    node = next(node for node in material.node_tree.nodes if node.bl_idname == "ShaderNodeTexImage")
    node.image_user.frame_duration, node.image_user.use_auto_refresh = 3, True
    build.mesh("Wall", material=material).data.uv_layers.new()
    bpy.context.scene.frame_set(3)
    warnings: list[dict[str, Any]] = []
    assert np.allclose(export(warnings).reflectance, srgb_to_linear(np.array(102 / 255)), atol=1e-4)
    (warning,) = warnings
    assert "is a sequence: its present frame is baked" in warning["message"]

"""Each kind of material against Cycles: what we export of it, and what Cycles' own bakes of the same surface show.

Reflectance is compared with Cycles' DIFFUSE bake of colour alone, emission with its EMIT bake, in the middle of each
lumel of the ruffled grid: to 1 % of the mean, root mean square.
"""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np
import pytest
from radiosity.solver.geometry import Geometry
from radiosity.tests.blender.ruffled_grid import GRID, assert_agree, cycles, diffuse, node, ours
from radiosity.tests.blender.stage import export, geometry_nodes


def _noise(tree, _material):
    return node(tree, "TexNoise", {"Scale": 3.0}).outputs["Color"]


def _voronoi(tree, _material):
    return node(tree, "TexVoronoi", {"Scale": 2.0}, feature="SMOOTH_F1").outputs["Distance"]


def _ramp(tree, _material):
    ramp = node(tree, "ValToRGB", {"Fac": node(tree, "TexWave", {"Scale": 0.7}).outputs["Fac"]})
    ramp.color_ramp.elements[0].color, ramp.color_ramp.elements[1].color = (0.8, 0.1, 0.05, 1), (0.1, 0.3, 0.7, 1)
    return ramp.outputs["Color"]


def _curves(tree, _material):
    curves = node(tree, "RGBCurve", {"Color": _noise(tree, None)})
    curves.mapping.curves[3].points[0].location = (0, 0.3)
    curves.mapping.update()
    return curves.outputs["Color"]


def _hue(tree, _material):
    return node(tree, "HueSaturation", {"Color": _noise(tree, None), "Hue": 0.3, "Saturation": 1.5}).outputs["Color"]


def _generated(tree, _material):
    return node(tree, "TexCoord").outputs["Generated"]


def _object_space(tree, _material):
    scaled = node(tree, "VectorMath", {0: node(tree, "TexCoord").outputs["Object"], 1: (0.5, 0.5, 0.5)},
                  operation="MULTIPLY_ADD")
    scaled.inputs[2].default_value = (0.1, 0.1, 0.1)
    return scaled.outputs[0]


def _world_space(tree, _material):
    scaled = node(tree, "VectorMath", {0: node(tree, "NewGeometry").outputs["Position"], 1: (0.2, 0.2, 0.2)},
                  operation="MULTIPLY_ADD")
    scaled.inputs[2].default_value = (0.3, 0.3, 0.3)
    return scaled.outputs[0]


def _normals(tree, _material):
    return node(tree, "VectorMath", {0: node(tree, "NewGeometry").outputs["Normal"]},
                operation="ABSOLUTE").outputs[0]


def _vertex_colours(tree, _material):
    layer = bpy.data.meshes["Grid"].color_attributes.new("Dirt", "FLOAT_COLOR", "POINT")
    values = np.random.default_rng(1).uniform(0.1, 0.9, (len(layer.data), 4)).astype(np.float32)
    layer.data.foreach_set("color", values.ravel())
    return node(tree, "VertexColor", layer_name="Dirt").outputs["Color"]


def _face_attribute(tree, _material):
    layer = bpy.data.meshes["Grid"].attributes.new("Age", "FLOAT", "FACE")
    layer.data.foreach_set("value", np.linspace(0.1, 0.9, GRID * GRID, dtype=np.float32))
    return node(tree, "Attribute", attribute_name="Age").outputs["Fac"]


def _vertex_group(tree, _material):
    group = bpy.data.objects["Grid"].vertex_groups.new(name="Dust")
    for index in range(0, (GRID + 1) ** 2, 3):
        group.add([index], 0.3 + 0.01 * index, "REPLACE")
    return node(tree, "Attribute", attribute_name="Dust").outputs["Fac"]


def _edge_attribute(tree, _material):
    layer = bpy.data.meshes["Grid"].attributes.new("Worn", "FLOAT", "EDGE")
    layer.data.foreach_set("value", np.random.default_rng(3).uniform(0.1, 0.9, len(layer.data)).astype(np.float32))
    return node(tree, "Attribute", attribute_name="Worn").outputs["Fac"]


def _random_object(tree, _material):
    return node(tree, "ObjectInfo").outputs["Random"]


def _object_colour(tree, _material):
    bpy.data.objects["Grid"].color = (0.2, 0.5, 0.7, 1)
    return node(tree, "ObjectInfo").outputs["Color"]


def _blackbody(tree, _material):
    bright = node(tree, "Blackbody", {"Temperature": 3200.0}).outputs["Color"]
    return node(tree, "VectorMath", {0: bright, 1: (0.3, 0.3, 0.3)}, operation="MULTIPLY").outputs[0]


def _math(tree, _material):
    half = node(tree, "Math", {0: 0.6, 1: 0.5}, operation="POWER").outputs[0]
    return node(tree, "CombineColor", {"Red": half, "Green": 0.25, "Blue": 0.1}).outputs[0]


def _group(tree, _material):
    group = bpy.data.node_groups.new("Paint", "ShaderNodeTree")
    group.interface.new_socket("Scale", in_out="INPUT", socket_type="NodeSocketFloat")
    group.interface.new_socket("Colour", in_out="OUTPUT", socket_type="NodeSocketColor")
    begin, end = group.nodes.new("NodeGroupInput"), group.nodes.new("NodeGroupOutput")
    noise = node(group, "TexNoise", {"Scale": begin.outputs["Scale"]})
    group.links.new(noise.outputs["Color"], end.inputs["Colour"])
    made = tree.nodes.new("ShaderNodeGroup")
    made.node_tree = group
    made.inputs["Scale"].default_value = 4
    return made.outputs["Colour"]


KINDS = (_noise, _voronoi, _ramp, _curves, _hue, _generated, _object_space, _world_space, _normals, _vertex_colours,
         _face_attribute, _vertex_group, _edge_attribute, _random_object, _object_colour, _blackbody, _math, _group)


@pytest.mark.parametrize("make", KINDS, ids=lambda make: make.__name__.strip("_"))
def test_a_colour_made_by_nodes_is_the_one_that_cycles_bakes(build, grid, make):
    # A Diffuse BSDF whose colour comes from such a node. Exact answer: Cycles' COLOR bake.
    grid.data.materials.append(diffuse(build, make))
    warnings: list[dict[str, Any]] = []
    scene = export(warnings)
    assert_agree(ours(scene, Geometry(scene).reflectance), cycles(grid, "DIFFUSE"))
    assert warnings == []


def test_shaders_mixed_by_a_texture_mix_their_colours(build, grid):
    # Red and blue diffuse shaders, mixed by a noise. Exact answer: Cycles' COLOR bake.
    def mixed(tree: Any) -> Any:
        first, second = (node(tree, "BsdfDiffuse", {"Color": colour})
                         for colour in ((0.8, 0.1, 0.1, 1), (0.1, 0.2, 0.7, 1)))
        return node(tree, "MixShader", {0: node(tree, "TexNoise", {"Scale": 3.0}).outputs[0],
                                        1: first.outputs[0], 2: second.outputs[0]})
    material = build.material("Mixed", (1, 1, 1))
    tree = material.node_tree
    tree.links.new(mixed(tree).outputs[0], tree.get_output_node("CYCLES").inputs["Surface"])
    grid.data.materials.append(material)
    warnings: list[dict[str, Any]] = []
    scene = export(warnings)
    assert_agree(ours(scene, Geometry(scene).reflectance), cycles(grid, "DIFFUSE"))
    assert warnings == []


def test_emission_by_nodes_is_what_cycles_bakes(build, grid):
    # Strength by a noise, colour by temperature, in Principled. Exact answer: pi times Cycles' EMIT bake.
    material = build.material("Glow", (0.2, 0.2, 0.2))
    tree, shader = material.node_tree, build.shader(material)
    tree.links.new(node(tree, "Blackbody", {"Temperature": 2500.0}).outputs[0], shader.inputs["Emission Color"])
    tree.links.new(node(tree, "TexNoise", {"Scale": 3.0}).outputs[0], shader.inputs["Emission Strength"])
    grid.data.materials.append(material)
    scene = export([])
    found = ours(scene, Geometry(scene).emission) / np.pi
    assert_agree(found, cycles(grid, "EMIT"))
    assert np.allclose(ours(scene, Geometry(scene).reflectance), 0.2)


def test_a_constant_by_nodes_becomes_one_flat_colour(build, grid):
    # A blackbody of 3,200 K times .3. Exact answer: a colour, and no texture.
    grid.data.materials.append(diffuse(build, _blackbody))
    scene = export([])
    assert scene.textures == ()
    assert np.ptp(np.asarray(scene.reflectance), axis=0).max() == 0
    assert np.allclose(np.asarray(scene.reflectance)[0], cycles(grid, "DIFFUSE")[0, 0], rtol=1e-4)


def test_a_light_path_counts_as_for_a_diffuse_ray(build, grid):
    # Red for cameras, blue for all other rays: diffuse light sees blue.
    def seen(tree, _material):
        path = node(tree, "LightPath").outputs["Is Camera Ray"]
        return node(tree, "MixRGB", {0: path, 1: (0.1, 0.2, 0.7, 1), 2: (0.8, 0.1, 0.1, 1)}).outputs[0]
    grid.data.materials.append(diffuse(build, seen))
    assert np.allclose(export([]).reflectance, (0.1, 0.2, 0.7), atol=1e-5)


def test_an_attribute_of_geometry_nodes_is_the_one_that_cycles_bakes(build, grid):
    # A modifier stores (x + .2) / 2 as "Wear", which is the colour. Exact answer: Cycles' COLOR bake.
    def build_tree(tree, geometry):
        store, place, part, half = (tree.nodes.new(kind) for kind in (
            "GeometryNodeStoreNamedAttribute", "GeometryNodeInputPosition", "ShaderNodeSeparateXYZ", "ShaderNodeMath"))
        half.operation = "MULTIPLY_ADD"
        half.inputs[1].default_value, half.inputs[2].default_value = 0.5, 0.1
        store.inputs["Name"].default_value = "Wear"
        value = next(socket for socket in store.inputs if socket.name == "Value" and socket.enabled)
        for source, target in ((geometry, store.inputs[0]), (place.outputs[0], part.inputs[0]),
                               (part.outputs["X"], half.inputs[0]), (half.outputs[0], value)):
            tree.links.new(source, target)
        return store.outputs[0]

    geometry_nodes(grid, build_tree)
    grid.data.materials.append(diffuse(
        build, lambda tree, _: node(tree, "Attribute", attribute_name="Wear").outputs["Fac"]))
    scene = export([])
    assert_agree(ours(scene, Geometry(scene).reflectance), cycles(grid, "DIFFUSE"))


def test_generated_coordinates_are_those_before_modifiers(build, grid):
    # A modifier lifts the grid by .3 m, which generated coordinates don't follow. Exact answer: Cycles' COLOR bake.
    lift = grid.modifiers.new("Lift", "DISPLACE")
    lift.direction, lift.strength, lift.mid_level = "Z", 0.3, 0.0
    grid.data.materials.append(diffuse(build, _generated))
    scene = export([])
    assert np.asarray(scene.vertices)[:, 2].min() > 0.2
    assert_agree(ours(scene, Geometry(scene).reflectance), cycles(grid, "DIFFUSE"))


def test_objects_that_share_mesh_and_material_keep_their_own_colours(build, grid):
    # Two objects of one mesh, coloured by Object Info. Exact answer: each object's own colour.
    grid.data.materials.append(diffuse(build, _object_colour))
    other = build.object("Other", grid.data)
    other.color, other.location = (0.7, 0.1, 0.3, 1), (3, 0, 0)
    scene = export([])
    for surface, colour in zip(scene.surfaces, ((0.2, 0.5, 0.7), (0.7, 0.1, 0.3)), strict=True):
        assert np.allclose(np.asarray(scene.reflectance)[surface.triangles], colour, atol=1e-5)


def test_a_factor_by_direction_counts_by_its_mean(build, grid):
    # Black and white mixed by Fresnel of index 1.5. Exact answer: 9.2 % (Walsh 1926: .0918), the same everywhere.
    def edge(tree, _material):
        return node(tree, "MixRGB", {0: node(tree, "Fresnel", {"IOR": 1.5}).outputs[0], 1: (0, 0, 0, 1),
                                     2: (1, 1, 1, 1)}).outputs[0]
    grid.data.materials.append(diffuse(build, edge))
    assert np.allclose(export([]).reflectance, 0.0918, atol=1e-4)


def test_metal_reflects_what_cycles_reflects_of_even_light(build, grid):
    # A metal of colour (.9, .6, .3) under light from everywhere sends back its colour: the energy is kept. Cycles'
    # own metal brightens towards the edge (F82), so its mean is a little higher: to 10 %.
    grid.data.materials.append(build.material("Gold", (0.9, 0.6, 0.3), Metallic=1.0, Roughness=0.3))
    for polygon in grid.data.polygons:
        polygon.use_smooth = False
    grid.data.vertices.foreach_set("co", np.column_stack([
        np.array([vertex.co.xy for vertex in grid.data.vertices]), np.zeros(len(grid.data.vertices))]).ravel())
    build.world((1, 1, 1))
    bpy.data.objects.remove(bpy.data.objects["Sun"])
    found = np.asarray(export([]).reflectance)[0]
    scene = bpy.context.scene
    scene.render.engine, scene.cycles.samples = "CYCLES", 256
    image = bpy.data.images.new("Reflected", 4, 4, float_buffer=True)
    image.colorspace_settings.name = "Non-Color"
    tree = grid.active_material.node_tree
    tree.nodes.active = tree.nodes.new("ShaderNodeTexImage")
    tree.nodes.active.image = image
    bpy.context.view_layer.objects.active = grid
    grid.select_set(True)
    bpy.ops.object.bake(type="GLOSSY", pass_filter={"DIRECT", "INDIRECT", "COLOR"}, margin=0, uv_layer="Paint")
    reflected = np.array(image.pixels[:]).reshape(-1, 4)[:, :3].mean(axis=0)
    assert np.allclose(found, (0.9, 0.6, 0.3))
    assert np.allclose(found, reflected, rtol=0.1)

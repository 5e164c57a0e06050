"""What materials and worlds become, against values known by heart."""

from __future__ import annotations

from typing import Any

import addon_utils
import bpy
import numpy as np
import pytest
from radiosity.radiosity_addon import cycles, evaluate
from radiosity.radiosity_addon.export import export_scene
from radiosity.radiosity_addon.images import srgb_to_linear
from radiosity.solver import sky
from radiosity.solver.geometry import Geometry
from radiosity.solver.scene import Scene
from radiosity.solver.settings import Settings
from radiosity.tests.blender.stage import export, read_world


def opaque(value: float, side: int = 4) -> np.ndarray:
    """(side, side, 4) of one grey, alpha 1."""
    return np.concatenate([np.full((side, side, 3), value), np.ones((side, side, 1))], axis=2)


def unwrap_square(square: Any, scale: float = 1.0) -> None:
    layer = square.data.uv_layers.new(name="Paint")
    layer.uv.foreach_set("vector", np.array([v.co.xy for v in square.data.vertices], np.float32).ravel() * scale)


def test_principled_gives_base_colour_and_emission_over_both_sides(build):
    # Base colour (.2, .4, .6), emission (1, .5, .25) of strength 3. Exact answer: exitance pi x 3 x colour.
    build.mesh("Lamp", material=build.material("Lamp", (0.2, 0.4, 0.6), Emission_Color=(1, 0.5, 0.25, 1),
                                               Emission_Strength=3.0))
    warnings: list[dict[str, Any]] = []
    scene = export(warnings)
    assert np.allclose(scene.reflectance, (0.2, 0.4, 0.6))
    assert np.allclose(scene.emission, np.pi * 3 * np.array([1, 0.5, 0.25]))
    assert warnings == []


def test_each_face_has_its_own_material_and_a_slot_too_high_means_the_last(build):
    # Three squares in one mesh, slots 0, 1 and 7 of two. Exact answer: red, green, green.
    build.sun()
    points = [(x + i, y, 0) for i in range(3) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))]
    mesh = build.mesh("Strip", points, [(4 * i, 4 * i + 1, 4 * i + 2, 4 * i + 3) for i in range(3)])
    for name, colour in (("Red", (0.5, 0, 0)), ("Green", (0, 0.5, 0))):
        mesh.data.materials.append(build.material(name, colour))
    mesh.data.polygons.foreach_set("material_index", [0, 1, 7])
    assert export([]).reflectance.tolist() == [[0.5, 0, 0]] * 2 + [[0, 0.5, 0]] * 4


def test_a_material_override_of_the_view_layer_goes_before_all(build):
    # A red and a plain square, and a green override. Exact answer: green, as a render shows them; no slot has changed.
    build.sun()
    red = build.mesh("Red", material=(0.5, 0, 0))
    build.mesh("Plain").location.z = 1
    bpy.context.view_layer.material_override = build.material("Green", (0, 0.5, 0))
    assert export([]).reflectance.tolist() == [[0, 0.5, 0]] * 4
    bpy.context.view_layer.material_override = None
    assert export([]).reflectance[0].tolist() == [0.5, 0, 0]
    assert red.material_slots[0].material.name == "Red paint"


def test_an_object_without_material_is_blenders_default_grey(build):
    build.sun()
    build.mesh("Plain")
    mesh = build.mesh("Empty slot")
    mesh.data.materials.append(None)
    assert np.allclose(export([]).reflectance, 0.8)


@pytest.mark.parametrize(("kind", "reflectance", "radiance"), [
    ("ShaderNodeBsdfDiffuse", (0.3, 0.2, 0.1), (0, 0, 0)), ("ShaderNodeEmission", (0, 0, 0), (0.3, 0.2, 0.1))])
def test_diffuse_and_emission_nodes_are_what_they_say(build, kind, reflectance, radiance):
    build.sun()
    material = build.material("Node", (1, 1, 1))
    node = material.node_tree.nodes.new(kind)
    node.inputs["Color"].default_value = (0.3, 0.2, 0.1, 1)
    material.node_tree.links.new(node.outputs[0], material.node_tree.get_output_node("CYCLES").inputs["Surface"])
    build.mesh("Square", material=material)
    scene = export([])
    assert np.allclose(scene.reflectance, reflectance)
    assert np.allclose(scene.emission, np.pi * np.array(radiance))


def test_an_image_reflects_as_linear_light_at_its_place(build):
    # A square under an image of two halves, sRGB .5 and 1 (held to .999). Exact answer: .21404 at the left, .999 right.
    build.sun()
    pixels = np.ones((8, 8, 4))
    pixels[:, :4, :3] = 0.5
    square = build.mesh("Square", material=build.textured("Tiles", build.image("Halves", pixels)))
    unwrap_square(square)
    scene = export([])
    geometry = Geometry(scene)
    left, right = ([0.1, 0.5], [0.9, 0.5])
    found = [geometry.reflectance(*hit(scene, x, y))[0, 0] for x, y in (left, right)]
    # The byte image holds 128 / 255.
    assert found == pytest.approx([float(srgb_to_linear(np.float32(128 / 255))), 0.999], abs=2e-3)


def hit(scene: Scene, x: float, y: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Triangle and barycentric coordinates of the point (x, y) of a scene in the plane z = 0."""
    corners = scene.vertices[scene.triangles][:, :, :2]
    for index, (a, b, c) in enumerate(corners):
        u, v = np.linalg.solve(np.column_stack([b - a, c - a]), np.array([x, y]) - a)
        if u >= 0 and v >= 0 and u + v <= 1:
            return np.array([index]), np.array([u], np.float32), np.array([v], np.float32)
    raise AssertionError((x, y))


def test_srgb_decoding_has_the_standards_values():
    # IEC 61966-2-1: 0 -> 0, .04045 -> .0031308, .5 -> .2140411, 1 -> 1.
    values = srgb_to_linear(np.array([0, 0.04045, 0.5, 1], np.float32))
    assert values == pytest.approx([0, 0.0031308, 0.2140411, 1], abs=1e-6)


def test_a_float_image_is_linear_already(build):
    # A float image of .25 everywhere. Exact answer: reflectance .25.
    build.sun()
    square = build.mesh("Square", material=build.textured("Matt", build.image(
        "Quarter", opaque(0.25), is_float=True)))
    unwrap_square(square)
    scene = export([])
    assert Geometry(scene).reflectance(*hit(scene, 0.3, 0.6)) == pytest.approx(0.25, abs=1e-4)


def test_a_mapping_node_moves_the_image(build):
    # Two halves, .2 left and .6 right, moved by half an image. Exact answer: .6 left.
    build.sun()
    pixels = opaque(0.2, 8)
    pixels[:, 4:, :3] = 0.6
    material = build.textured("Moved", build.image("Halves", pixels, is_float=True))
    tree = material.node_tree
    image = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeTexImage")
    mapping, place = tree.nodes.new("ShaderNodeMapping"), tree.nodes.new("ShaderNodeTexCoord")
    mapping.inputs["Location"].default_value = (0.5, 0, 0)
    tree.links.new(place.outputs["UV"], mapping.inputs["Vector"])
    tree.links.new(mapping.outputs["Vector"], image.inputs["Vector"])
    unwrap_square(build.mesh("Square", material=material))
    scene = export([])
    assert Geometry(scene).reflectance(*hit(scene, 0.25, 0.5)) == pytest.approx(0.6, abs=1e-3)


def test_reflectance_of_one_or_above_is_held_and_the_material_named(build):
    build.sun()
    build.mesh("Wall", material=build.material("Chalk", (1.0, 1.5, 0.5)))
    warnings: list[dict[str, Any]] = []
    scene = export(warnings)
    assert np.allclose(scene.reflectance, (0.999, 0.999, 0.5))
    assert [(entry["object"], entry["code"]) for entry in warnings] == [("Chalk", "reflectance")]


def test_glass_is_left_out_and_said_so(build):
    # A matt square and a pane of glass. Exact answer: the pane blocks nothing, its object has no triangle.
    build.sun()
    build.mesh("Floor", material=(0.5, 0.5, 0.5))
    build.mesh("Pane", material=build.material("Glass", (0.9, 0.9, 0.9), Transmission_Weight=1.0))
    warnings: list[dict[str, Any]] = []
    scene = export(warnings)
    assert [(surface.name, surface.count, surface.receives) for surface in scene.surfaces] == [
        ("Floor", 2, True), ("Pane", 0, False)]
    assert {entry["object"] for entry in warnings} == {"Glass", "Pane"}


def test_a_mere_volume_lets_all_light_through(build):
    # A fog in a cube about a square, nothing linked to Surface. Exact answer: the square alone is left.
    build.sun()
    fog = build.material("Fog", (1, 1, 1))
    tree = fog.node_tree
    tree.nodes.remove(build.shader(fog))
    volume = tree.nodes.new("ShaderNodeVolumePrincipled")
    tree.links.new(volume.outputs[0], tree.get_output_node("CYCLES").inputs["Volume"])
    build.mesh("Square")
    build.cube("Domain", 6.0, material=fog)
    warnings: list[dict[str, Any]] = []
    scene = export(warnings)
    assert [surface.count for surface in scene.surfaces] == [2, 0]
    assert any("as through air" in entry["message"] for entry in warnings if entry["object"] == "Fog")


def test_a_lamp_of_glass_keeps_its_light(build):
    # Clear and shining. Exact answer: it stays in the scene and shines.
    build.mesh("Bulb", material=build.material("Bulb", (1, 1, 1), Transmission_Weight=1.0, Emission_Strength=2.0,
                                               Emission_Color=(1, 1, 1, 1)))
    assert np.allclose(export([]).emission, 2 * np.pi)


def test_what_shines_and_lets_light_through_reflects_as_it_is_mixed(build):
    # Base colour .6 with alpha .25 that shines. Exact answer: it counts as opaque and reflects .15, a quarter of that.
    build.mesh("Veil", material=build.material("Veil", (0.6, 0.6, 0.6), Alpha=0.25, Emission_Strength=2.0))
    scene = export([])
    assert np.allclose(scene.reflectance, 0.15)
    assert np.allclose(scene.emission, np.pi * 2 * 0.25)
    assert np.allclose(scene.opacity, 1)


def test_a_material_that_differs_by_side_is_told(build):
    # A panel that glows with a strength that is linked to Backfacing, and one that has the node unlinked beside.
    build.sun()
    for name in ("Panel", "Plain"):
        made = build.material(name, (0.5, 0.5, 0.5))
        build.mesh(name, material=made)
        sides = made.node_tree.nodes.new("ShaderNodeNewGeometry")
        if name == "Panel":
            made.node_tree.links.new(sides.outputs["Backfacing"], build.shader(made).inputs["Emission Strength"])
    warnings: list[dict[str, Any]] = []
    export(warnings)
    (told,) = warnings
    assert (told["object"], told["code"]) == ("Panel", "material")
    assert "Backfacing" in told["message"]


@pytest.mark.parametrize(("alpha", "count"), [(1.0, 0), (0.5, 1)])
def test_transparent_shadows_that_are_off_are_told_where_they_matter(build, alpha, count):
    build.sun()
    made = build.material("Veil", (0.5, 0.5, 0.5), Alpha=alpha)
    made.use_transparent_shadow = False
    build.mesh("Veil", material=made)
    warnings: list[dict[str, Any]] = []
    export(warnings)
    assert [warning["object"] for warning in warnings] == ["Veil"] * count
    assert all("Transparent Shadows" in warning["message"] for warning in warnings)


def test_an_image_times_a_colour_is_read_through_the_mix_node(build):
    # An image of .5 multiplied by (.2, .4, .8), as glTF imports have it. Exact answer: (.1, .2, .4).
    build.sun()
    material = build.textured("Tinted", build.image("Half", opaque(0.5), is_float=True))
    tree = material.node_tree
    image = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeTexImage")
    mix = tree.nodes.new("ShaderNodeMix")
    mix.data_type, mix.blend_type = "RGBA", "MULTIPLY"
    factor, a, b = (socket for socket in mix.inputs if socket.enabled)
    factor.default_value, b.default_value = 1.0, (0.2, 0.4, 0.8, 1)
    tree.links.new(image.outputs["Color"], a)
    result = next(socket for socket in mix.outputs if socket.enabled)
    tree.links.new(result, build.shader(material).inputs["Base Color"])
    unwrap_square(build.mesh("Square", material=material))
    warnings: list[dict[str, Any]] = []
    scene = export(warnings)
    assert Geometry(scene).reflectance(*hit(scene, 0.3, 0.6))[0] == pytest.approx([0.1, 0.2, 0.4], abs=1e-4)
    assert warnings == []


def test_a_group_of_nodes_is_looked_into(build):
    # A diffuse shader inside a group, its colour handed in. Exact answer: the colour on the group node.
    build.sun()
    group = bpy.data.node_groups.new("Paint", "ShaderNodeTree")
    group.interface.new_socket("Tint", in_out="INPUT", socket_type="NodeSocketColor")
    group.interface.new_socket("Surface", in_out="OUTPUT", socket_type="NodeSocketShader")
    kinds = ("NodeGroupInput", "NodeGroupOutput", "ShaderNodeBsdfDiffuse")
    begin, end, diffuse = (group.nodes.new(kind) for kind in kinds)
    group.links.new(begin.outputs["Tint"], diffuse.inputs["Color"])
    group.links.new(diffuse.outputs[0], end.inputs["Surface"])
    material = build.material("Grouped", (1, 1, 1))
    node = material.node_tree.nodes.new("ShaderNodeGroup")
    node.node_tree = group
    node.inputs["Tint"].default_value = (0.1, 0.3, 0.5, 1)
    material.node_tree.links.new(node.outputs[0], material.node_tree.get_output_node("CYCLES").inputs["Surface"])
    build.mesh("Square", material=material)
    assert np.allclose(export([]).reflectance, (0.1, 0.3, 0.5))


def marble(build):
    """A Principled material whose base colour is a noise; the socket's own colour is .3."""
    material = build.material("Marble", (0.3, 0.3, 0.3))
    noise = material.node_tree.nodes.new("ShaderNodeTexNoise")
    material.node_tree.links.new(noise.outputs["Color"], build.shader(material).inputs["Base Color"])
    return material


def test_without_cycles_nodes_are_told_with_the_value_used(build):
    # A base colour driven by a noise texture, Cycles switched off. Exact answer: the socket's own colour, two lines.
    build.sun()
    build.mesh("Square", material=marble(build))
    bpy.context.scene.world = None
    warnings: list[dict[str, Any]] = []
    addon_utils.disable("cycles")
    try:
        scene = export(warnings)
    finally:
        addon_utils.enable("cycles")
    assert np.allclose(scene.reflectance, 0.3)
    assert {(entry["object"], entry["code"]) for entry in warnings} == {("Marble", "material")}
    assert "object 'Square'" in warnings[0]["message"]
    assert "Cycles is switched off" in warnings[0]["message"]
    assert "(0.3, 0.3, 0.3) is used" in warnings[1]["message"]


def test_an_evaluated_material_leaves_no_trace(build):
    # A marble square, something selected and active. Exact answer: no new data, same selection, settings and nodes.
    build.sun()
    square = build.mesh("Square", material=marble(build))
    unwrap_square(square)
    square.select_set(True)
    bpy.context.view_layer.objects.active = square
    bpy.context.scene.render.engine = "BLENDER_WORKBENCH"

    def state() -> Any:
        kinds = ("scenes", "objects", "meshes", "materials", "images", "node_groups", "cameras", "worlds", "lights")
        return ({kind: [item.name for item in getattr(bpy.data, kind)] for kind in kinds},
                [item.name for item in bpy.context.selected_objects], bpy.context.view_layer.objects.active.name,
                bpy.context.scene.render.engine, bpy.context.scene.cycles.samples, square.data.uv_layers.keys(),
                [node.name for node in square.active_material.node_tree.nodes], square.active_material.users,
                square.active_material.node_tree.nodes.active, square.mode)
    before = state()
    scene = export([])
    assert len(scene.textures) == 1
    assert state() == before


def test_a_second_export_takes_materials_from_memory(build, monkeypatch):
    # The same marble twice. Exact answer: one bake; a third one after a change of the noise, with another result.
    build.sun()
    item = build.mesh("Square", material=marble(build))
    evaluate.forget()
    bakes = []
    bake = cycles.bake_emission
    monkeypatch.setattr(cycles, "bake_emission", lambda *given: bakes.append(given) or bake(*given))
    first, second = export([]), export([])
    assert len(bakes) == 1
    assert np.array_equal(first.textures[0].pixels, second.textures[0].pixels)
    noise = next(node for node in item.active_material.node_tree.nodes if node.bl_idname == "ShaderNodeTexNoise")
    noise.inputs["Scale"].default_value += 1
    third = export([])
    assert len(bakes) == 2
    assert not np.array_equal(first.textures[0].pixels, third.textures[0].pixels)


def test_metal_and_glass_are_told_with_what_diffuse_light_does_not_carry(build):
    # Metal of colour .6, clear glass, a matt colour. Exact answers: .6 reflected and .6 of it not diffusely; all of
    # the light of the glass; nothing of the matt one's.
    build.sun()
    build.mesh("A", material=build.material("Metal", (0.6, 0.6, 0.6), Metallic=1.0))
    build.mesh("B", material=build.material("Glass", (1, 1, 1), Transmission_Weight=1.0, Specular_IOR_Level=0.0))
    build.mesh("C", material=build.material("Matt", (0.3, 0.3, 0.3), Specular_IOR_Level=0.0))
    rows = {row["name"]: row for row in export_scene(
        bpy.context.scene, bpy.context.view_layer, Settings(), []).materials}
    assert rows["Metal"]["diffuse_reflectance"] == pytest.approx([0.6] * 3)
    assert rows["Metal"]["not_carried"] == pytest.approx(0.6, abs=1e-4)
    assert rows["Matt"]["not_carried"] == 0
    assert rows["Glass"]["not_carried"] == pytest.approx(1, abs=1e-4)
    assert "refracted" in rows["Glass"]["reason"]


def test_a_plain_world_is_a_constant_sky(build):
    world = build.world((0.1, 0.2, 0.4))
    assert np.allclose(read_world(world, [])[0].radiance, (0.1, 0.2, 0.4))


def test_any_other_world_is_rendered_by_cycles_direction_by_direction(build):
    # A world whose colour is (direction + 1) / 2. Exact answer: that, in every direction, to a pixel's width.
    world = build.world((0, 0, 0))
    tree = world.node_tree
    background = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeBackground")
    place, scaled = tree.nodes.new("ShaderNodeTexCoord"), tree.nodes.new("ShaderNodeVectorMath")
    scaled.operation = "MULTIPLY_ADD"
    scaled.inputs[1].default_value = scaled.inputs[2].default_value = (0.5, 0.5, 0.5)
    tree.links.new(place.outputs["Generated"], scaled.inputs[0])
    tree.links.new(scaled.outputs[0], background.inputs["Color"])
    before = len(bpy.data.scenes), len(bpy.data.images), len(bpy.data.worlds), len(bpy.data.cameras)
    found, _ = read_world(world, [])
    directions = np.random.default_rng(0).normal(size=(2000, 3))
    directions = (directions / np.linalg.norm(directions, axis=1, keepdims=True)).astype(np.float32)
    assert np.abs(sky.radiance(found, directions) - (directions + 1) / 2).max() < 2 * np.pi / 1024
    assert (len(bpy.data.scenes), len(bpy.data.images), len(bpy.data.worlds), len(bpy.data.cameras)) == before

"""Views of a bake: the baked look, lux, patches; they show what was baked and leave nothing behind."""

from __future__ import annotations

import importlib.util
import math
from pathlib import Path
from types import ModuleType
from typing import Any

import bpy
import numpy as np
import pytest
from radiosity.radiosity_addon import patch_mesh, preview, results, slots
from radiosity.radiosity_addon.baked_light import VIEW_MARK

# Of a white irradiance of 1 W/m2, lx.
WHITE = 683.0


def load(name: str) -> ModuleType:
    """A file beside this one as a module."""
    spec = importlib.util.spec_from_file_location(name, Path(__file__).with_name(f"{name}.py"))
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


fingerprints = load("fingerprint")


def snapshot() -> dict[str, Any]:
    """All datablocks, evaluated, so that no transform is behind."""
    bpy.context.view_layer.update()
    found: dict[str, Any] = fingerprints.fingerprint()
    return found


def changes(before: dict[str, Any]) -> list[str]:
    found: list[str] = fingerprints.differences(before, snapshot())
    return found


def rich_scene(build: Any) -> None:
    """Slots of every kind: two on the mesh, one on the object above one of the mesh, an empty one, none, a shared mesh;
    a texture with holes, a node group, a coat that mixes; maps and colours of the user's."""
    colour = build.image("Photo", np.full((2, 2, 4), 0.5))
    holes = build.textured("Holes", colour)
    node = next(node for node in holes.node_tree.nodes if node.bl_idname == "ShaderNodeTexImage")
    holes.node_tree.links.new(node.outputs["Alpha"], build.shader(holes).inputs["Alpha"])
    group = bpy.data.node_groups.new("Paint", "ShaderNodeTree")
    group.interface.new_socket("Shader", in_out="OUTPUT", socket_type="NodeSocketShader")
    inner = group.nodes.new("ShaderNodeBsdfDiffuse")
    group.links.new(inner.outputs[0], group.nodes.new("NodeGroupOutput").inputs[0])
    grouped = build.material("Grouped", (0.1, 0.2, 0.3))
    caller = grouped.node_tree.nodes.new("ShaderNodeGroup")
    caller.node_tree = group
    output = next(node for node in grouped.node_tree.nodes if node.bl_idname == "ShaderNodeOutputMaterial")
    mixed = grouped.node_tree.nodes.new("ShaderNodeMixShader")
    grouped.node_tree.links.new(build.shader(grouped).outputs[0], mixed.inputs[1])
    grouped.node_tree.links.new(caller.outputs[0], mixed.inputs[2])
    grouped.node_tree.links.new(mixed.outputs[0], output.inputs["Surface"])

    two = build.cube("Two", material=(0.6, 0.1, 0.1))
    two.data.materials.append(holes)
    two.data.polygons[3].material_index = 1
    two.data.uv_layers.new(name="Mine")
    own = build.mesh("Own", material=(0.1, 0.6, 0.1))
    own.location = (3, 0, 0)
    own.material_slots[0].link = "OBJECT"
    own.material_slots[0].material = grouped
    hidden = build.mesh("Hidden", material=grouped)
    hidden.location = (3, 3, 0)
    hidden.material_slots[0].link = "OBJECT"
    hidden.material_slots[0].material = holes
    hidden.material_slots[0].link = "DATA"
    empty = build.mesh("Empty")
    empty.location = (-3, 0, 0)
    empty.data.materials.append(None)
    bare = build.mesh("Bare")
    bare.location = (0, 3, 0)
    bare.data.polygons[0].material_index = 2
    twin = build.object("Twin", bare.data)
    twin.location = (0, -3, 0)
    bare.data.color_attributes.new("Mine", "BYTE_COLOR", "POINT")
    twin["note"] = "mine"
    bare.select_set(True)
    bpy.context.view_layer.objects.active = bare


@pytest.mark.parametrize("target", ["lightmap", "vertex"])
def test_views_and_clear_leave_every_datablock_as_it_was(sunny, target):
    # Slots, maps and node trees of every kind. Exact answer: each view off again is the file before it, and a cleared
    # file is the one before the bake: names, node trees, slots, users, images, UV maps, attributes, settings.
    rich_scene(sunny)
    bpy.context.scene.radiosity.target = target
    before = snapshot()
    assert bpy.ops.radiosity.bake() == {"FINISHED"}
    baked = snapshot()
    assert fingerprints.differences(before, baked) != []
    assert bpy.ops.radiosity.preview() == {"FINISHED"}
    shown = [slot.material for item in bpy.data.objects if item.type == "MESH" for slot in item.material_slots]
    assert len(shown) == 7
    assert all(material is not None and VIEW_MARK in material for material in shown)
    assert bpy.ops.radiosity.preview() == {"FINISHED"}
    assert changes(baked) == []
    for view in (bpy.ops.radiosity.preview, bpy.ops.radiosity.lux_view, bpy.ops.radiosity.leak_view):
        assert view() == {"FINISHED"}
        assert changes(baked) != []
    assert bpy.ops.radiosity.clear() == {"FINISHED"}
    assert changes(before) == []


def test_a_view_survives_saving_and_loading(sunny, tmp_path):
    # Saved while the baked look is on. Exact answer: loaded again, the slots go back to what they were.
    rich_scene(sunny)
    bpy.ops.radiosity.bake()
    wanted = {item.name: [(slot.link, slot.material.name if slot.material else None) for slot in item.material_slots]
              for item in bpy.data.objects}
    bpy.ops.radiosity.preview()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "shown.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "shown.blend"))
    assert bpy.context.scene.radiosity_view.mode == "BAKED"
    assert bpy.ops.radiosity.preview() == {"FINISHED"}
    assert {item.name: [(slot.link, slot.material.name if slot.material else None) for slot in item.material_slots]
            for item in bpy.data.objects} == wanted
    assert not [name for name in bpy.data.materials.keys() if name.startswith("Radiosity")]  # noqa: SIM118 - bpy


def render_middle() -> np.ndarray:
    """The radiance in the middle of what Cycles sees from straight above, without lamps: (3,)."""
    scene = bpy.context.scene
    data = bpy.data.cameras.new("Camera")
    data.type, data.ortho_scale = "ORTHO", 0.5
    camera = bpy.data.objects.new("Camera", data)
    camera.location = (0.5, 0.5, 5)
    scene.collection.objects.link(camera)
    scene.camera = camera
    for item in scene.objects:
        item.hide_render |= item.type == "LIGHT"
    scene.render.engine = "CYCLES"
    scene.cycles.samples, scene.cycles.use_denoising = 1, False
    scene.render.resolution_x = scene.render.resolution_y = 4
    scene.render.image_settings.file_format = "OPEN_EXR"
    path = Path(bpy.app.tempdir) / "middle.exr"
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(str(path), check_existing=False)
    image.colorspace_settings.name = "Linear Rec.709"
    pixels = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(pixels)
    bpy.data.images.remove(image)
    return pixels.reshape(-1, 4)[5, :3]


@pytest.mark.parametrize(("target", "quantity"), [("lightmap", "radiance"), ("lightmap", "irradiance"),
                                                  ("lightmap", "radiosity"), ("vertex", "radiance")])
def test_the_baked_look_is_albedo_times_light_over_pi(sunny, target, quantity):
    # A square of colour (.5, .25, .125) under a sun of 1 W/m2, rendered by Cycles without any lamp.
    # Exact answer: rho E / pi, whatever was stored.
    sunny.mesh("Square", material=(0.5, 0.25, 0.125))
    bpy.context.scene.radiosity.target, bpy.context.scene.radiosity.quantity = target, quantity
    bpy.ops.radiosity.bake()
    bpy.ops.radiosity.preview()
    assert render_middle() == pytest.approx(np.array([0.5, 0.25, 0.125]) / math.pi, rel=0.01)


def test_mixed_shaders_and_groups_look_as_their_parts(sunny):
    # A mix, one half Principled (.1, .2, .3), the other a Diffuse of .8 inside a group. Exact answer: the mean colour.
    rich_scene(sunny)
    for name in ("Two", "Own", "Empty", "Bare", "Twin"):
        bpy.data.objects.remove(bpy.data.objects[name])
    bpy.data.objects["Hidden"].location = (0, 0, 0)
    bpy.ops.radiosity.bake()
    bpy.ops.radiosity.preview()
    assert render_middle() == pytest.approx(np.array([0.45, 0.5, 0.55]) / math.pi, rel=0.02)


def test_a_bake_during_a_view_reads_the_users_materials_and_keeps_the_view(sunny):
    # A wall beside a floor, baked, then baked again with the baked look on. Exact answer: the same light, still shown.
    sunny.mesh("Floor", material=(0.7, 0.7, 0.7))
    sunny.mesh("Wall", points=((0, 0, 0), (0, 1, 0), (0, 1, 1), (0, 0, 1)), material=(0.7, 0.1, 0.1))
    bpy.ops.radiosity.bake()

    def light() -> np.ndarray:
        image = bpy.data.objects["Floor"]["radiosity_lightmaps"]
        pixels = np.empty(len(image.pixels), np.float32)
        image.pixels.foreach_get(pixels)
        return pixels

    first = light()
    bpy.ops.radiosity.preview()
    bpy.ops.radiosity.bake()
    assert (light() == first).all()
    assert bpy.context.scene.radiosity_view.mode == "BAKED"
    assert slots.COVERED in bpy.data.objects["Floor"]
    with preview.suspended():
        assert [slot.material.name for slot in bpy.data.objects["Floor"].material_slots] == ["Floor paint"]
    assert VIEW_MARK in bpy.data.objects["Floor"].material_slots[0].material


def closed_box(build: Any) -> None:
    """A cube with its faces inward, the ceiling turned outward, lit by a point lamp."""
    box = build.cube("Box", 2.0, material=(0.5, 0.5, 0.5))
    box.data.flip_normals()
    ceiling = next(face for face in box.data.polygons if face.center.z > 0.9)
    ceiling.flip()
    lamp = bpy.data.lights.new("Lamp", "POINT")
    lamp.energy = 10
    build.object("Lamp", lamp)


def test_leaks_lead_to_a_flipped_face(sunny):
    # A closed box whose ceiling faces outward. Exact answers: no ray escapes; a fifth of the floor's rays meet the
    # ceiling's back (F of opposite squares of a cube: .1998); the worst place sees it, and its object gets selected.
    closed_box(sunny)
    bpy.ops.radiosity.bake()
    found = patch_mesh.load()
    assert found is not None
    table, objects = found
    assert objects == ["Box"]
    assert table.row_sum.min() == 1
    floor = table.normal[:, 2] > 0.9
    assert np.average(table.back_faces[floor], weights=table.area[floor]) == pytest.approx(0.1998, rel=0.03)
    assert bpy.ops.radiosity.leak_view() == {"FINISHED"}
    # The map covers the insides, and of the ceiling its inner side, which is the back; its values are the patches' own.
    shown = next(item for item in bpy.data.objects if VIEW_MARK in item).data
    area = sum(face.area for face in shown.polygons)
    assert area == pytest.approx(24, rel=0.02)
    figure = np.array([value.value for value in shown.attributes["figure"].data])
    up = np.array([face.normal.z > 0.9 for face in shown.polygons])
    assert figure[up].mean() == pytest.approx(0.1998, rel=0.05)
    assert figure[[face.normal.z < -0.9 for face in shown.polygons]].max() == 0
    bpy.data.objects["Box"].select_set(False)
    assert bpy.ops.radiosity.worst() == {"FINISHED"}
    assert bpy.data.objects["Box"].select_get()
    first = bpy.context.scene.cursor.location.copy()
    assert np.abs(np.array(first)).max() == pytest.approx(1, abs=1e-3)
    bpy.ops.radiosity.worst()
    assert bpy.context.scene.cursor.location != first
    bpy.context.scene.radiosity_view.figure = "escaped"
    assert bpy.ops.radiosity.worst() == {"CANCELLED"}
    for figure in ("absorbed", "leaving"):
        bpy.context.scene.radiosity_view.figure = figure
        assert bpy.context.scene.radiosity_view.scale_title.startswith(figure.capitalize())


def test_an_excluded_object_blocks_light_and_holds_none(sunny):
    # A board over a floor under the sun, excluded. Exact answers: no map on the board, its shadow on the floor.
    floor = sunny.mesh("Floor", points=[(-2, -2, 0), (2, -2, 0), (2, 2, 0), (-2, 2, 0)], material=(0.0, 0.0, 0.0))
    board = sunny.mesh("Board", material=(0.0, 0.0, 0.0))
    board.location = (-0.5, -0.5, 1)
    board.radiosity.exclude = True
    bpy.context.scene.radiosity.resolution = 64
    bpy.ops.radiosity.bake()
    assert "radiosity_lightmaps" in floor
    assert not len(board.data.uv_layers)
    assert results.result_of(board) is None
    bpy.ops.radiosity.lux_view()
    row = bpy.context.scene.radiosity_view.rows["Floor"]
    assert row.minimum < 1
    assert row.mean == pytest.approx(WHITE * 15 / 16, rel=0.02)
    with pytest.raises(RuntimeError, match="'Board' is excluded from bakes: untick Exclude"):
        bpy.ops.radiosity.bake(options="--only Board")


def test_density_counts_pixels_a_metre(sunny):
    # Two squares of 1 m2 on one page, one at three times the density. Exact answer: its map is three times as wide.
    for name, factor in (("Coarse", 1), ("Fine", 3)):
        sunny.mesh(name, material=(0.5, 0.5, 0.5)).radiosity.density = factor
    bpy.data.objects["Fine"].location.x = 5
    bpy.context.scene.radiosity.resolution = 128
    bpy.ops.radiosity.bake()
    width = {}
    for name in ("Coarse", "Fine"):
        uv = np.array([point.vector[:] for point in bpy.data.objects[name].data.uv_layers["UVMap_Lightmap"].uv])
        width[name] = np.ptp(uv[:, 0])
    assert width["Fine"] == pytest.approx(3 * width["Coarse"], rel=0.02)


def test_findings_of_a_check_are_listed(sunny):
    # A curve, which can't hold a bake, beside a square. Exact answer: one finding on it; clear empties the list.
    sunny.mesh("Square", material=(0.5, 0.5, 0.5))
    curve = bpy.data.curves.new("Curve", "CURVE")
    curve.dimensions, curve.fill_mode = "2D", "BOTH"
    spline = curve.splines.new("POLY")
    spline.points.add(3)
    for point, place in zip(spline.points, ((2, 0), (3, 0), (3, 1), (2, 1)), strict=True):
        point.co = (*place, 0, 1)
    spline.use_cyclic_u = True
    sunny.object("Curve", curve)
    assert bpy.ops.radiosity.check() == {"FINISHED"}
    view = bpy.context.scene.radiosity_view
    assert [finding.name for finding in view.findings if finding.code == "not_baked"] == ["Curve"]
    index = [finding.name for finding in view.findings].index("Curve")
    assert bpy.ops.radiosity.show_finding(index=index) == {"FINISHED"}
    assert [item.name for item in bpy.context.selected_objects] == ["Curve"]
    bpy.ops.radiosity.clear()
    assert not len(view.findings)

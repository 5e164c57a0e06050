"""Check: each finding in a scene in which it fires, and in the same scene mended, in which it doesn't."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import bpy
import numpy as np
import pytest
from radiosity import operators
from radiosity.radiosity_addon.check import check, find
from radiosity.radiosity_addon.check_cost import (
    BYTES,
    BYTES_LUMEL,
    BYTES_TRIANGLE,
    FILL,
    SECONDS_RAY,
    SECONDS_TRIANGLE,
    expected_cost,
    expected_rays,
)
from radiosity.radiosity_addon.export import export_scene
from radiosity.radiosity_addon.request import Request
from radiosity.solver.bake import bake
from radiosity.solver.errors import NothingToBake, SceneError, SettingsError
from radiosity.solver.geometry import Geometry
from radiosity.solver.settings import Settings

SETTINGS = {"error": 0.1, "resolution": 64}


def codes(name: str, **settings: Any) -> list[str]:
    """What is found about one object or material."""
    found = find(bpy.context.scene, bpy.context.view_layer, Settings(**{**SETTINGS, **settings}))
    return [entry["code"] for entry in found.warnings if entry["object"] == name]


def fires_and_not(name: str, code: str, mend: Callable[[], Any], **settings: Any) -> None:
    """The finding is there, with a fix in its message; it is gone once the scene is mended."""
    found = find(bpy.context.scene, bpy.context.view_layer, Settings(**{**SETTINGS, **settings}))
    told = [entry for entry in found.warnings if (entry["object"], entry["code"]) == (name, code)]
    assert len(told) == 1, found.warnings
    assert ":" in told[0]["message"] or ";" in told[0]["message"]
    mend()
    assert code not in codes(name, **settings)


@pytest.fixture
def stage(build: Any) -> Any:
    """A grey square under a sun of half a degree: nothing to find."""
    build.sun().data.angle = 0.01
    build.mesh("Square", material=(0.5, 0.5, 0.5))
    return build


def test_a_sound_scene_has_no_findings(stage):
    found = find(bpy.context.scene, bpy.context.view_layer, Settings(**SETTINGS))
    assert found.warnings == []
    assert found.failure is None


def test_a_mirror_is_told_with_what_is_not_carried(stage):
    # A metal square. Exact answer: non_diffuse, gone when it is matt.
    paint = stage.material("Mirror", (0.8, 0.8, 0.8), Metallic=1.0, Roughness=0.05)
    stage.mesh("Plate", material=paint).location.x = 3
    shader = stage.shader(paint)

    def mend():
        shader.inputs["Metallic"].default_value, shader.inputs["Roughness"].default_value = 0.0, 1.0
        shader.inputs["Specular IOR Level"].default_value = 0.0

    fires_and_not("Mirror", "non_diffuse", mend)


def test_reflectance_above_95_per_cent_is_told(stage):
    paint = stage.material("Snow", (0.98, 0.98, 0.98), Roughness=1.0)
    stage.shader(paint).inputs["Specular IOR Level"].default_value = 0.0
    stage.mesh("Plate", material=paint).location.x = 3

    def mend():
        stage.shader(paint).inputs["Base Color"].default_value = (0.9, 0.9, 0.9, 1)

    fires_and_not("Snow", "bright", mend)


def test_an_image_that_is_missing_is_told_of_each_material(stage):
    # A file that is not there. Exact answer: told, beside the error that a bake would end with; gone with the node.
    image = bpy.data.images.new("Bricks", 2, 2)
    image.source, image.filepath = "FILE", "/nowhere/bricks.png"
    paint = stage.textured("Wall", image)
    stage.mesh("Plate", material=paint).location.x = 3
    node = next(node for node in paint.node_tree.nodes if node.bl_idname == "ShaderNodeTexImage")
    found = find(bpy.context.scene, bpy.context.view_layer, Settings(**SETTINGS))
    assert [entry["code"] for entry in found.warnings if entry["object"] == "Wall"].count("missing_image") == 1
    paint.node_tree.nodes.remove(node)
    assert "missing_image" not in codes("Wall")


def test_a_mesh_without_faces_is_told(stage):
    # An edge; one that a modifier makes faces of; two that renders do not show. Exact answer: the first alone is told.
    ends = ((0, 0, 3), (1, 0, 3))
    edge, other, third = (stage.mesh(name, ends, ()) for name in ("Edge", "Hidden", "In hidden collection"))
    screw = stage.mesh("Screw", ends, ())
    for item in (edge, other, third, screw):
        item.data.edges.add(1)
        item.data.edges[0].vertices = (0, 1)
    screw.modifiers.new("Screw", "SCREW").axis = "X"
    other.hide_render = True
    away = bpy.data.collections.new("Away")
    bpy.context.scene.collection.children.link(away)
    bpy.context.scene.collection.objects.unlink(third)
    away.objects.link(third)
    away.hide_render = True
    found = find(bpy.context.scene, bpy.context.view_layer, Settings(**SETTINGS))
    assert [entry["object"] for entry in found.warnings if entry["code"] == "no_faces"] == ["Edge"]
    fires_and_not("Edge", "no_faces", lambda: setattr(edge, "hide_render", True))


def test_faces_without_area_are_told(stage):
    points = ((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (2, 0, 0))
    plate = stage.mesh("Plate", points, ((0, 1, 2, 3), (0, 1, 4)))
    plate.location.x = 3

    def mend():
        plate.data.vertices[4].co.y = 0.5

    fires_and_not("Plate", "zero_area", mend)


def test_a_face_that_is_turned_over_is_told(stage):
    box = stage.cube("Box")
    box.location.x = 5
    box.data.polygons[2].flip()
    fires_and_not("Box", "flipped", lambda: box.data.polygons[2].flip())


def test_a_room_that_faces_outward_is_told_by_its_lamp(stage):
    # A closed box with normals outward and a lamp inside. Exact answer: flipped, with the lamp's name; not when the
    # lamp is outside.
    stage.cube("Room", 4.0).location.x = 10
    lamp = stage.object("Bulb", bpy.data.lights.new("Bulb", "POINT"))
    lamp.location.x = 10.3
    bpy.context.view_layer.update()

    def mend():
        lamp.location.x = 20
        bpy.context.view_layer.update()

    fires_and_not("Room", "flipped", mend)


@pytest.mark.parametrize("kind", ["PERSP", "ORTHO"])
def test_backs_that_the_camera_sees_are_told(stage, kind):
    # A square that faces up, two metres above a camera that looks up at it. Exact answer: its backs fill the part that
    # it has of the view there, which is 1.44 x .81 m (50 mm on 36 x 20.25) or 2 x 1.125 m (ortho).
    high = stage.mesh("High")
    high.location = (0, 0, 3)
    camera = stage.object("Eye", bpy.data.cameras.new("Eye"))
    camera.data.type, camera.data.ortho_scale = kind, 2.0
    camera.location, camera.rotation_euler.x = (0.5, 0.5, 1), np.pi
    bpy.context.scene.camera = camera
    found = find(bpy.context.scene, bpy.context.view_layer, Settings(**SETTINGS))
    [told] = [entry["message"] for entry in found.warnings if entry["code"] == "back_seen"]
    width, height = (1.44, 0.81) if kind == "PERSP" else (2.0, 1.125)
    assert f"fill {min(1, width) * min(1, height) / (width * height):.0%} of" in told
    fires_and_not("High", "back_seen", lambda: high.data.polygons[0].flip())


def test_an_edge_of_three_faces_is_told(stage):
    points = ((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (0, -1, 0), (1, -1, 0))
    plate = stage.mesh("Plate", points, ((0, 1, 2, 3), (1, 0, 4, 5), (1, 0, 6, 7)))
    plate.location.x = 3

    def mend():
        plate.data.clear_geometry()
        plate.data.from_pydata(points, [], ((0, 1, 2, 3), (1, 0, 4, 5)))

    fires_and_not("Plate", "non_manifold", mend)


def test_faces_in_one_place_are_told_with_the_other_object(stage):
    other = stage.mesh("Other")
    found = find(bpy.context.scene, bpy.context.view_layer, Settings(**SETTINGS))
    told = [entry for entry in found.warnings if entry["code"] == "overlapping"]
    assert {entry["object"] for entry in told} == {"Square", "Other"}
    assert "'Square'" in next(entry["message"] for entry in told if entry["object"] == "Other")
    other.location.z = -0.1
    assert codes("Other") == codes("Square") == []


def test_a_plate_that_dwarfs_all_else_is_told(stage):
    plate = stage.mesh("Plate")
    plate.scale, plate.location.z = (1000, 1000, 1), -1

    def mend():
        plate.scale = (2, 2, 1)

    fires_and_not("Plate", "giant", mend)


def test_a_room_is_no_giant_plate_though_it_dwarfs_what_stands_in_it(stage):
    # A square of 1 m2 in a room of 20 x 20 x 3 m, whose faces look inward.
    room = stage.cube("Room", 20.0)
    room.scale = (-1, 1, 0.15)
    assert "giant" not in codes("Room")


def test_a_plate_that_dwarfs_all_else_gets_half_of_the_lumels_unless_the_user_says_more(stage):
    # A square of 1 m2 beside a plate of 10^6 m2. Exact: at a thousandth of the density both take as many lumels; with a
    # density in pixels per metre, or a factor of the user's, the plate takes what was asked for, and check says so.
    plate = stage.mesh("Plate")
    plate.scale, plate.location.z = (1000, 1000, 1), -1
    layer = bpy.context.view_layer

    def shares(**settings):
        warnings = []
        layer.update()
        exported = export_scene(bpy.context.scene, layer, Settings(**settings), warnings)
        told = [entry for entry in warnings if entry["code"] == "giant"]
        return {item.name: item.density for item in exported.scene.surfaces}, told

    densities, told = shares()
    assert densities["Square"] == 1
    assert densities["Plate"] == pytest.approx(1e-3, rel=1e-4)
    assert "1e+03 times as wide" in told[0]["message"]
    assert shares(texel_density=2.0) == ({"Square": 1, "Plate": 1}, [])
    plate.radiosity.density = 0.5
    assert shares() == ({"Square": 1, "Plate": 0.5}, [])
    fires_and_not("Plate", "giant", lambda: setattr(plate, "scale", (2, 2, 1)))


@pytest.mark.parametrize(("kind", "size"), [("POINT", "shadow_soft_size"), ("SPOT", "shadow_soft_size"),
                                            ("SUN", "angle")])
def test_a_lamp_without_size_is_told(stage, kind, size):
    lamp = stage.object("Bulb", bpy.data.lights.new("Bulb", kind))
    setattr(lamp.data, size, 0.0)
    fires_and_not("Bulb", "no_size", lambda: setattr(lamp.data, size, 0.1))


@pytest.mark.parametrize("hide", ["item", "collection", "outer collection", "layer"])
def test_what_a_render_hides_is_not_told(stage, hide):
    # A lamp without power and a plate whose image is missing, both in a collection within another. Exact answer: both
    # are told; neither once they, or one of these collections, are hidden from renders or left out of the layer.
    outer, inner = (bpy.data.collections.new(name) for name in ("Outer", "Inner"))
    bpy.context.scene.collection.children.link(outer)
    outer.children.link(inner)
    image = bpy.data.images.new("Bricks", 2, 2)
    image.source, image.filepath = "FILE", "/nowhere/bricks.png"
    hidden = [stage.object("Bulb", bpy.data.lights.new("Bulb", "POINT")),
              stage.mesh("Plate", material=stage.textured("Wall", image))]
    hidden[0].data.energy = 0
    for item in hidden:
        item.users_collection[0].objects.unlink(item)
        inner.objects.link(item)
    found = find(bpy.context.scene, bpy.context.view_layer, Settings(**SETTINGS))
    told = {(entry["object"], entry["code"]) for entry in found.warnings}
    assert {("Bulb", "no_power"), ("Wall", "missing_image")} <= told
    if hide == "layer":
        bpy.context.view_layer.layer_collection.children["Outer"].children["Inner"].exclude = True
    for item in {"item": hidden, "collection": [inner], "outer collection": [outer], "layer": []}[hide]:
        item.hide_render = True
    assert find(bpy.context.scene, bpy.context.view_layer, Settings(**SETTINGS)).warnings == []


def test_a_lamp_without_power_is_told(stage):
    lamp = stage.object("Bulb", bpy.data.lights.new("Bulb", "POINT"))
    lamp.data.energy = 0
    fires_and_not("Bulb", "no_power", lambda: setattr(lamp.data, "energy", 1.0))


def _mapped(stage: Any, corners: Any) -> Any:
    """A second square with a UV map of these corners; the first one's map is whole."""
    for name in ("Square", "Plate"):
        item = bpy.data.objects.get(name) or stage.mesh(name)
        layer = item.data.uv_layers.new(name="Light")
        uv = ((0, 0), (1, 0), (1, 1), (0, 1)) if name == "Square" else corners
        layer.uv.foreach_set("vector", np.ravel(uv).astype(np.float32))
    bpy.data.objects["Plate"].location.x = 3
    return bpy.data.objects["Plate"].data.uv_layers["Light"]


WHOLE = ((0.1, 0.1), (0.9, 0.1), (0.9, 0.9), (0.1, 0.9))


@pytest.mark.parametrize(("corners", "code"), [
    (((0.1, 0.1), (0.9, 0.1), (0.9, 0.2), (0.1, 0.2)), "uv_stretch"),
    (((0.1, 0.1), (0.9, 0.1), (0.9, 0.9), (0.5, 0.5)), "uv_no_area"),
    (((-0.5, 0.1), (0.9, 0.1), (0.9, 0.9), (-0.5, 0.9)), "uv_outside"),
    (((0.1, 0.1), (0.9, 0.9), (0.9, 0.1), (0.1, 0.9)), "uv_overlap"),
])
def test_a_bad_uv_map_is_told(stage, corners, code):
    layer = _mapped(stage, corners)

    def mend():
        layer.uv.foreach_set("vector", np.ravel(WHOLE).astype(np.float32))

    fires_and_not("Plate", code, mend, uv_layer="Light")


def test_uneven_density_is_told(stage):
    # Two faces of one area, one with a tenth of the room each way.
    points = ((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (2, 0, 0), (3, 0, 0), (3, 1, 0), (2, 1, 0))
    plate = stage.mesh("Plate", points, ((0, 1, 2, 3), (4, 5, 6, 7)))
    plate.location.x = 5
    for item in (plate, bpy.data.objects["Square"]):
        item.data.uv_layers.new(name="Light")
    square = np.array(((0, 0), (1, 0), (1, 1), (0, 1))) * 0.4
    bpy.data.objects["Square"].data.uv_layers["Light"].uv.foreach_set("vector", square.astype(np.float32).ravel())

    def lay(scale):
        uv = np.concatenate([square, square * scale + 0.5])
        plate.data.uv_layers["Light"].uv.foreach_set("vector", uv.astype(np.float32).ravel())

    lay(0.1)
    fires_and_not("Plate", "uv_density", lambda: lay(1), uv_layer="Light")


def test_a_mesh_without_room_for_a_map_is_told(stage):
    plate = stage.mesh("Plate")
    plate.location.x = 3
    for number in range(8):
        plate.data.uv_layers.new(name=f"Map {number}")
    fires_and_not("Plate", "not_baked", lambda: plate.data.uv_layers.remove(plate.data.uv_layers[7]))


def test_the_list_is_written_for_other_programs_too(stage, tmp_path, capsys):
    # One lamp without size. Exact answer: one warning with object, code and message, and what the bake will take.
    bpy.data.objects["Sun"].data.angle = 0
    path = tmp_path / "found.json"
    request = Request(Settings(**SETTINGS), output=tmp_path / "out", report=path)
    assert check(request, bpy.context.scene, bpy.context.view_layer) == 0
    report = json.loads(path.read_text())
    assert [(entry["object"], entry["code"]) for entry in report["warnings"]] == [("Sun", "no_size")]
    assert report["bakes"] == ["Square"]
    lumels = int(FILL * 64**2)
    assert report["expected"]["lumels"] == lumels
    assert report["expected"]["memory_bytes"] == BYTES + lumels * BYTES_LUMEL + 2 * BYTES_TRIANGLE
    assert report["expected"]["seconds"] > 2 * SECONDS_TRIANGLE
    assert not (tmp_path / "out").exists()
    assert "bakes       Square" in capsys.readouterr().out


def test_a_scene_that_fails_is_told_with_all_other_findings(stage, tmp_path):
    # A broken mesh, and a lamp without power. Exact answer: both are in the list; the exit is that of the failure.
    bpy.data.objects["Square"].data.vertices[0].co.x = float("nan")
    bpy.data.objects["Sun"].data.energy = 0
    path = tmp_path / "found.json"
    with pytest.raises(SceneError, match="vertex 0"):
        check(Request(Settings(**SETTINGS), report=path), bpy.context.scene, bpy.context.view_layer)
    assert [entry["code"] for entry in json.loads(path.read_text())["warnings"]] == ["no_power", "error"]


def test_the_list_takes_the_place_of_no_other_file(stage, tmp_path, capsys):
    # A file of the user's by the list's name. Exact answer: refused before anything is looked at, the file as it was.
    path = tmp_path / "notes.txt"
    path.write_text("mine")
    with pytest.raises(SettingsError, match=r"notes\.txt is no report"):
        check(Request(Settings(**SETTINGS), report=path), bpy.context.scene, bpy.context.view_layer)
    assert path.read_text() == "mine"
    assert capsys.readouterr() == ("", "")


def test_no_light_is_told_as_the_bake_tells_it(stage):
    bpy.data.objects.remove(bpy.data.objects["Sun"])
    found = find(bpy.context.scene, bpy.context.view_layer, Settings(**SETTINGS))
    assert isinstance(found.failure, NothingToBake)
    assert [entry["code"] for entry in found.warnings] == ["error"]


def test_the_operator_keeps_the_list_for_the_panel(stage):
    operators.register()
    try:
        bpy.data.objects["Sun"].data.angle = 0
        assert bpy.ops.radiosity.check() == {"FINISHED"}
        kept = bpy.context.scene.radiosity_view.findings
        assert [(entry.name, entry.code) for entry in kept] == [("Sun", "no_size")]
    finally:
        operators.unregister()


@pytest.mark.parametrize(("lamps", "error", "target"), [
    (1, 0.1, "lightmap"), (1, 0.03, "lightmap"), (9, 0.1, "lightmap"), (1, 0.1, "vertex")])
def test_the_work_that_is_foretold_is_about_that_of_the_bake(build, lamps, error, target):
    # A grey room of 256 x 256 pixels, or of 192 triangles with vertex colours, under one lamp or nine. Within a factor
    # of two, the lumels of the bake, and within three, its rays. Memory and time are what they are made of.
    room = build.cube("Room", 2.0, material=(0.5, 0.5, 0.5))
    room.data.flip_normals()
    if target == "vertex":
        cuts = room.modifiers.new("Cuts", "SUBSURF")
        cuts.subdivision_type, cuts.levels, cuts.render_levels = "SIMPLE", 2, 2
    for number in range(lamps):
        data = bpy.data.lights.new("Lamp", "POINT")
        data.shadow_soft_size = 0.1
        build.object("Lamp", data).location = (number % 3 * 0.5 - 0.5, number // 3 * 0.5 - 0.5, 0.5)
    settings = Settings(error=error, target=target, resolution=256 if target == "lightmap" else None)
    scene = export_scene(bpy.context.scene, bpy.context.view_layer, settings, []).scene
    report = bake(scene, settings).report
    geometry = Geometry(scene)
    assert 1 / 3 < expected_rays(geometry, settings, report["lumels"]) / report["rays"] < 3
    foretold = expected_cost(geometry, settings)
    assert 1 / 2 < foretold.lumels / report["lumels"] < 2
    assert foretold.memory_bytes == BYTES + foretold.lumels * BYTES_LUMEL + len(scene.triangles) * BYTES_TRIANGLE
    # A thread shoots between a hundred thousand and a hundred million rays a second.
    rays = expected_rays(geometry, settings, foretold.lumels) / settings.thread_count
    assert 1e-8 < (foretold.seconds - len(scene.triangles) * SECONDS_TRIANGLE) / rays - SECONDS_RAY < 1e-5

"""Meshes in Edit Mode: a bake reads none, and takes its result to none."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import bpy
import numpy as np
import pytest
from radiosity.radiosity_addon.command import parse_options
from radiosity.radiosity_addon.job import Job
from radiosity.radiosity_addon.mesh_layers import UV_MAP
from radiosity.radiosity_addon.relight import RelightJob
from radiosity.radiosity_addon.relight_request import relight_request
from radiosity.radiosity_addon.results import result_of
from radiosity.radiosity_addon.window_request import request_in


@pytest.fixture
def squares(sunny: Any) -> Iterator[Any]:
    """Two squares side by side under a sun; no mesh stays in Edit Mode."""
    sunny.mesh("Floor")
    sunny.mesh("Other").location.x = 3
    yield sunny
    if bpy.context.object is not None and bpy.context.object.mode == "EDIT":
        bpy.ops.object.mode_set(mode="OBJECT")


def edit(name: str, scene: Any = None) -> None:
    """Press Tab on an object, in the window's scene or in another one."""
    layer = (scene or bpy.context.scene).view_layers[0]
    layer.objects.active = item = bpy.data.objects[name]
    with bpy.context.temp_override(scene=layer.id_data, view_layer=layer, active_object=item, object=item):
        bpy.ops.object.mode_set(mode="EDIT")


def baked_while(name: str, options: str = "", scene: Any = None) -> list[str]:
    """Bake, and press Tab on an object before the results are written; codes of the warnings."""
    job = Job(request_in(bpy.context, parse_options(options)), bpy.context.scene, bpy.context.view_layer)
    try:
        job.export()
        job.start()
        # An operator within an override must not run beside a thread (see `leave_edit_mode`).
        job.wait(60)
        assert job.is_done
        edit(name, scene)
        return [entry["code"] for entry in job.finish().report["warnings"]]
    finally:
        job.close()


def layout(name: str) -> np.ndarray:
    """(corners, 2) our UV map."""
    layer = bpy.data.objects[name].data.uv_layers[UV_MAP]
    return np.array([corner.vector for corner in layer.uv])


@pytest.mark.parametrize("verb", ["bake", "check", "compare", "working_plane"])
@pytest.mark.parametrize("only", ["Floor", "Other"])
def test_a_mesh_in_edit_mode_is_told_whatever_is_baked(squares, tmp_path, verb, only):
    # A render's view has no faces of an edited mesh. Exact answer: one error that names it, be it baked or one that
    # blocks light alone.
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    bpy.context.scene.radiosity.only_selected = True
    bpy.data.objects[only].select_set(True)
    edit("Floor")
    with pytest.raises(RuntimeError, match=r"object 'Floor' is in Edit Mode: leave it \(Tab\) and bake again"):
        getattr(bpy.ops.radiosity, verb)()


def test_a_mesh_that_another_object_edits_is_told_by_that_objects_name(squares):
    # "Before" comes first and shows the mesh of "Floor", which is edited.
    bpy.data.objects["Other"].data = bpy.data.objects["Floor"].data
    edit("Floor")
    bpy.data.objects["Other"].name = "Before"
    with pytest.raises(RuntimeError, match="object 'Floor' is in Edit Mode"):
        bpy.ops.radiosity.bake()


def test_an_edited_object_that_renders_do_not_show_is_no_obstacle(squares):
    bpy.data.objects["Floor"].hide_render = True
    edit("Floor")
    assert bpy.ops.radiosity.bake() == {"FINISHED"}
    assert result_of(bpy.data.objects["Other"]) is not None


def test_a_relight_in_edit_mode_is_told(squares):
    bpy.context.scene.radiosity.groups = "lamp"
    bpy.ops.radiosity.bake()
    edit("Floor")
    with pytest.raises(RuntimeError, match="object 'Floor' is in Edit Mode"):
        bpy.ops.radiosity.relight()


@pytest.mark.parametrize("target", ["lightmap", "vertex"])
def test_a_mesh_that_was_edited_during_the_bake_gets_its_result(squares, target):
    # Exact answer: it is in Object Mode again, with the layers and values of a bake that nobody disturbed, one warning.
    floor = bpy.data.objects["Floor"]
    assert baked_while("Floor", f"--target {target}") == ["left_edit_mode"]
    assert floor.mode == "OBJECT"
    layers = floor.data.uv_layers.keys(), floor.data.color_attributes.keys()
    assert layers == ((["UVMap", UV_MAP], []) if target == "lightmap" else ([], ["Radiosity"]))
    assert result_of(floor) is not None
    if target == "lightmap":
        disturbed = layout("Floor")
        bpy.ops.radiosity.bake()
        assert np.array_equal(layout("Floor"), disturbed)
        assert np.ptp(disturbed, axis=0).min() > 0.1
    bpy.ops.radiosity.clear()
    assert (floor.data.uv_layers.keys(), floor.data.color_attributes.keys()) == ([], [])


def test_a_text_that_was_edited_during_the_bake_is_converted(squares):
    squares.object("Text", bpy.data.curves.new("Text", "FONT"))
    # The letters' own thin triangles are told of too.
    codes = baked_while("Text", "--apply-modifiers")
    assert [code for code in codes if code != "zero_area"] == ["left_edit_mode", "converted"]


def test_what_a_bake_does_not_show_stays_in_edit_mode(squares):
    squares.mesh("Hidden").hide_render = True
    assert baked_while("Hidden") == []
    assert bpy.data.objects["Hidden"].mode == "EDIT"


def test_a_mesh_that_is_edited_in_another_scene_is_left_as_it_is(squares):
    # Its Edit Mode can't be left from here. Exact answer: one warning, no layer on it, and all else is stored.
    other = bpy.data.scenes.new("Other")
    item = bpy.data.objects.new("Elsewhere", bpy.data.objects["Floor"].data)
    other.collection.objects.link(item)
    assert baked_while("Elsewhere", scene=other) == ["not_stored"]
    with bpy.context.temp_override(scene=other, view_layer=other.view_layers[0], active_object=item, object=item):
        bpy.ops.object.mode_set(mode="OBJECT")
    assert item.data.uv_layers.keys() == []
    assert result_of(bpy.data.objects["Other"]) is not None


def test_a_mesh_that_was_edited_during_a_relight_gets_its_result(squares):
    bpy.context.scene.radiosity.groups = "lamp"
    bpy.ops.radiosity.bake()
    before = layout("Floor")
    job = RelightJob(relight_request(bpy.context.scene, parse_options("", "relight")), bpy.context.scene,
                     bpy.context.view_layer)
    try:
        job.export()
        job.start()
        edit("Floor")
        assert [entry["code"] for entry in job.finish().report["warnings"]] == ["left_edit_mode"]
    finally:
        job.close()
    assert np.array_equal(layout("Floor"), before)


@pytest.mark.parametrize("verb", ["clear", "density"])
def test_what_reads_layers_waits_for_object_mode(squares, verb):
    # In Edit Mode layers have no values. Exact answer: refused before anything is changed, and nothing is in its way
    # afterwards.
    bpy.ops.radiosity.bake()
    edit("Floor")
    with pytest.raises(RuntimeError, match="A mesh is in Edit Mode"):
        getattr(bpy.ops.radiosity, verb)()
    assert bpy.data.objects["Floor"].data.uv_layers.keys() == ["UVMap", UV_MAP]
    bpy.ops.object.mode_set(mode="OBJECT")
    assert getattr(bpy.ops.radiosity, verb)() == {"FINISHED"}

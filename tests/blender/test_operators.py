"""The operators, in background: they wait, tell errors in one line, and leave what is the user's as it was."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from radiosity import operators
from radiosity.radiosity_addon.command import parse_options, request_of
from radiosity.radiosity_addon.job import Job
from radiosity.radiosity_addon.panel_words import in_panel_words
from radiosity.radiosity_addon.request import Request
from radiosity.solver.errors import RadiosityError, SettingsError


@pytest.fixture
def stage(build: Any) -> Iterator[Any]:
    """The operators, and a square under a sun of 1 W/m2, with settings for the quickest bake."""
    operators.register()
    build.sun()
    build.mesh("Square", material=(0.5, 0.5, 0.5))
    settings = bpy.context.scene.radiosity
    settings.error, settings.resolution = 0.2, 32
    yield build
    operators.unregister()


def state() -> Any:
    """Everything of the file that a failed bake must leave alone."""
    return ({name: sorted(item.name for item in getattr(bpy.data, name)) for name in (
        "objects", "meshes", "images", "materials", "scenes", "worlds", "cameras")},
        [layer.name for layer in bpy.data.objects["Square"].data.uv_layers],
        bpy.context.scene.render.engine, bpy.context.active_object, list(bpy.context.selected_objects))


def test_an_unsaved_file_can_hold_packed_images(stage):
    # A square alone under a sun, packed. Exact answer: 1 / pi in an image of the file; active map and selection stay.
    square = bpy.data.objects["Square"]
    square.data.uv_layers.new(name="Paint")
    bpy.context.scene.radiosity.pack = True
    before = state()
    assert bpy.ops.radiosity.bake() == {"FINISHED"}
    image = square["radiosity_lightmaps"]
    assert image.packed_file is not None
    pixels = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(pixels)
    lit = pixels.reshape(-1, 4)[:, 0]
    assert lit[lit > 0] == pytest.approx(1 / math.pi, rel=0.02)
    assert square.data.uv_layers.active.name == "Paint"
    assert state()[2:] == before[2:]


def test_an_unsaved_file_without_a_folder_is_told(stage):
    before = state()
    with pytest.raises(RuntimeError, match=r"the \.blend is not saved, so there is no folder for the lightmaps"):
        bpy.ops.radiosity.bake()
    assert state() == before


def test_the_operators_options_go_before_the_panel(stage, tmp_path):
    # The panel asks for 32 pixels, the options for 64. Exact answer: 64, written into the folder of the options.
    options = f"--resolution 64 --output '{tmp_path}' --quantity irradiance"
    assert bpy.ops.radiosity.bake(options=options) == {"FINISHED"}
    image = bpy.data.objects["Square"]["radiosity_lightmaps"]
    assert tuple(image.size) == (64, 64)
    assert Path(bpy.path.abspath(image.filepath)).parent == tmp_path


def test_wrong_options_are_told_in_one_line(stage):
    with pytest.raises(RuntimeError, match="argument --error: invalid float value: 'much'"):
        bpy.ops.radiosity.bake(options="--error much")


@pytest.mark.parametrize(("options", "line"), [
    ("--target vertex --uv-layer Paint", "--uv-layer 'Paint' is given, and vertex colours need no UV map"),
    ("--reflectances", "--reflectances is given, and no light groups are kept: add --groups lamp"),
    ("--groups none --group-layers", "--group-layers is given, and no light groups are kept"),
])
def test_options_that_would_have_no_effect_are_told(stage, tmp_path, options, line):
    # In the operator and on the command line. What the panel holds is no such option: it waits for its use.
    settings = bpy.context.scene.radiosity
    settings.reflectances = settings.group_layers = True
    settings.uv_layer = "Paint"
    with pytest.raises(RuntimeError, match=line):
        bpy.ops.radiosity.bake(options=f"--output '{tmp_path}' {options}")
    with pytest.raises(SettingsError, match=line):
        request_of(parse_options(options), bpy.context.scene, str(tmp_path / "a.blend"))
    assert request_of(parse_options("--target vertex"), bpy.context.scene, str(tmp_path / "a.blend")).groups == "none"


@pytest.mark.parametrize("name", ["bake", "relight", "compare"])
@pytest.mark.parametrize("options", ["--help", "--error .1 -h"])
def test_asking_an_operator_for_help_does_not_end_blender(stage, capsys, name, options):
    # The command line's help ends its program. Exact answer: one error, with the help on the terminal.
    with pytest.raises(RuntimeError, match=f"ask for the help, which is on the terminal: leave it away to {name}"):
        getattr(bpy.ops.radiosity, name)(options=options)
    assert f"usage: radiosity {name}" in capsys.readouterr().out


def test_a_failure_leaves_the_file_as_it_was_and_frees_the_way(stage, tmp_path):
    # A coordinate that is not finite. Exact answer: one line, no change, and a next bake that works.
    square = bpy.data.objects["Square"]
    square.data.vertices[0].co.x = math.nan
    before = state()
    options = f"--output '{tmp_path}'"
    with pytest.raises(RuntimeError, match="object 'Square': vertex 0 is at"):
        bpy.ops.radiosity.bake(options=options)
    assert state() == before
    square.data.vertices[0].co.x = 0
    assert bpy.ops.radiosity.bake(options=options) == {"FINISHED"}


def test_warnings_are_told_in_the_words_of_the_panel_and_counted(stage, tmp_path, capfd):
    # A square with an array, whose mesh can't hold the result. Exact answer: advice names the settings, no option of
    # the command line; the last line counts one warning.
    bpy.data.objects["Square"].modifiers.new("Array", "ARRAY").count = 2
    bpy.ops.radiosity.bake(options=f"--output '{tmp_path}'")
    told = [line for line in capfd.readouterr().out.splitlines() if line.startswith(("Warning: ", "Info: "))]
    assert "apply them (Apply Modifiers does), or bake with a UV map of your own (UV Map)" in told[0]
    assert told[-1].endswith("1 warning: see the Info editor")
    assert in_panel_words("see it (--no-apply-modifiers keeps them, --save too)") == (
        "see it (Apply Modifiers off keeps them, --save too)")


def test_a_second_start_is_refused(stage):
    # One job on its way. Exact answer: another is refused by job and operator until the first is closed.
    context = bpy.context
    first = Job(Request(), context.scene, context.view_layer)
    try:
        with pytest.raises(RadiosityError, match="already on its way"):
            Job(Request(), context.scene, context.view_layer)
        assert not bpy.ops.radiosity.bake.poll()
    finally:
        first.close()
    assert bpy.ops.radiosity.bake.poll()


@pytest.mark.parametrize("verb", ["bake", "check", "clear", "clear_groups", "compare", "density", "leak_view",
                                  "lux_view", "preview", "relight", "working_plane", "worst"])
def test_buttons_that_wait_for_a_job_say_so(stage, verb):
    # One job on its way. Exact answer: the reason that a button's tooltip shows, and not the context.
    first = Job(Request(), bpy.context.scene, bpy.context.view_layer)
    try:
        with pytest.raises(RuntimeError, match="A bake is on its way: wait for it, or press Esc to cancel it"):
            getattr(bpy.ops.radiosity, verb)()
    finally:
        first.close()


def test_selected_only_bakes_the_selection(stage, tmp_path):
    stage.mesh("Other")
    bpy.data.objects["Other"].select_set(True)
    bpy.context.scene.radiosity.only_selected = True
    assert bpy.ops.radiosity.bake(options=f"--output '{tmp_path}'") == {"FINISHED"}
    assert "radiosity_lightmaps" in bpy.data.objects["Other"]
    assert "radiosity_lightmaps" not in bpy.data.objects["Square"]


def test_clear_undoes_a_bake(stage):
    bpy.context.scene.radiosity.pack = True
    before = state()
    bpy.ops.radiosity.bake()
    assert state() != before
    assert bpy.ops.radiosity.clear() == {"FINISHED"}
    # The empty first map that the bake put before its own goes too.
    assert state() == before


def test_check_lists_what_bakes(stage):
    assert bpy.ops.radiosity.check() == {"FINISHED"}


def test_registering_twice_over_leaves_nothing_behind(stage):
    # Off and on again. Exact answer: the operators and settings work as before.
    from radiosity import radiosity_addon

    operators.unregister()
    radiosity_addon.unregister()
    assert not hasattr(bpy.types.Scene, "radiosity")
    radiosity_addon.register()
    operators.register()
    assert bpy.context.scene.radiosity.target == "lightmap"
    assert bpy.ops.radiosity.check() == {"FINISHED"}


@pytest.mark.parametrize("convert", [True, False])
def test_a_selected_text_is_baked_with_apply_modifiers(stage, convert):
    # A text and a path, which has no faces. Exact answer: the text is baked, and nothing else; or what to do is told.
    settings = bpy.context.scene.radiosity
    settings.only_selected, settings.pack, settings.apply_modifiers = True, True, convert
    path = bpy.data.curves.new("Path", "CURVE")
    path.splines.new("POLY").points.add(1)
    for item in (stage.object("Text", bpy.data.curves.new("Text", "FONT")), stage.object("Path", path)):
        item.select_set(True)
    if not convert:
        with pytest.raises(RuntimeError, match=r"'Text' is a font: .* or switch on Apply Modifiers"):
            bpy.ops.radiosity.bake()
        return
    assert bpy.ops.radiosity.check() == {"FINISHED"}
    assert bpy.ops.radiosity.bake() == {"FINISHED"}
    assert [item.name for item in bpy.data.objects if "radiosity_lightmaps" in item] == ["Text mesh"]


@pytest.mark.parametrize("verb", ["bake", "check"])
def test_a_text_that_is_selected_beside_a_mesh_and_left_out_is_told(stage, capfd, verb):
    # Without Apply Modifiers. Exact answer: the square is baked, and one warning names the text and what to do.
    settings = bpy.context.scene.radiosity
    settings.only_selected, settings.pack, settings.apply_modifiers = True, True, False
    for item in (bpy.data.objects["Square"], stage.object("Text", bpy.data.curves.new("Text", "FONT"))):
        item.select_set(True)
    assert getattr(bpy.ops.radiosity, verb)() == {"FINISHED"}
    assert "Text: is not baked, it is a font and has no mesh that could hold the result" in capfd.readouterr().out
    assert "radiosity_lightmaps" not in bpy.data.objects["Text"]


def test_a_selected_path_is_no_mesh(stage):
    bpy.context.scene.radiosity.only_selected = True
    stage.object("Path", bpy.data.curves.new("Path", "CURVE")).select_set(True)
    with pytest.raises(RuntimeError, match="no mesh is selected that is not excluded"):
        bpy.ops.radiosity.bake()

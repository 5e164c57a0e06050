"""The command line as a user runs it: exit codes, one clear line for each thing that is wrong, and what is written."""

from __future__ import annotations

import json
import math
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from radiosity.solver import image_file

# The quickest bake there is.
QUICK = ("--error", ".2", "--resolution", "32")


def command(*arguments: Any, **options: Any) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, "-m", "radiosity", *map(str, arguments)], capture_output=True, text=True,
                          timeout=300, check=False, **options)


def error_line(done: subprocess.CompletedProcess[str]) -> str:
    """The one line that tells what is wrong; there must be no traceback and no second one."""
    lines = [line for line in done.stderr.splitlines() if line.startswith("radiosity: error: ")]
    assert len(lines) == 1, done.stderr
    assert "Traceback" not in done.stderr
    return lines[0]


def save(folder: Path, name: str = "scene.blend") -> Path:
    """The open file on disk."""
    path = folder / name
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    return path


def room(build: Any) -> None:
    """Two squares face to face under a sun that shines between them."""
    build.sun()
    build.mesh("Floor", material=(0.5, 0.5, 0.5))
    build.mesh("Wall", ((0, 1, 0), (1, 1, 0), (1, 1, 1), (0, 1, 1)), material=(0.8, 0.2, 0.2))


def test_a_bake_writes_what_it_says_and_leaves_the_scene_file_alone(build, tmp_path):
    # Two squares under a sun of 1 W/m2. Exact answer: exit code 0, a report, an EXR of it, a .blend with the UV maps in
    # slot 1, the scene's own file bit for bit as it was.
    room(build)
    path = save(tmp_path)
    before = path.read_bytes()
    out = tmp_path / "out"
    done = command("bake", path, *QUICK, "--output", out, "--save", tmp_path / "baked.blend")
    assert done.returncode == 0, done.stderr
    assert path.read_bytes() == before
    report = json.loads((out / "report.json").read_text())
    assert {"version", "scene", "settings", "stages", "lumels", "patches", "rays", "triangles", "peak_memory_bytes",
            "seconds", "error", "energy", "outputs", "warnings"} <= report.keys()
    assert [entry["object"] for entry in report["outputs"]] == ["Floor", "Wall"]
    assert report["seconds"] >= sum(stage["seconds"] for stage in report["stages"])
    pixels = image_file.read_exr(out / report["outputs"][0]["image"])
    assert list(pixels.shape[1::-1]) == report["outputs"][0]["resolution"]
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "baked.blend"))
    mesh = bpy.data.objects["Floor"].data
    assert [layer.name for layer in mesh.uv_layers] == ["UVMap", "UVMap_Lightmap"]
    image = bpy.data.objects["Floor"]["radiosity_lightmaps"]
    assert Path(bpy.path.abspath(image.filepath)).resolve() == (out / report["outputs"][0]["image"]).resolve()
    # Blender's own view of the image, at the middle of the floor's UV, is the floor's light: at least the sun's.
    values = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(values)
    assert np.allclose(values.reshape(*pixels.shape[:2], 4)[:, :, :3], pixels)
    uv = np.mean([item.vector for item in mesh.uv_layers["UVMap_Lightmap"].uv], axis=0)
    x, y = (uv * pixels.shape[1::-1]).astype(int)
    assert pixels[y, x].min() * math.pi > 0.98


def test_a_file_that_was_saved_while_a_mesh_was_edited_is_baked(build, tmp_path):
    # Nobody can leave Edit Mode in a command. Exact answer: both squares baked, the file on disk as it was.
    room(build)
    bpy.context.view_layer.objects.active = bpy.data.objects["Floor"]
    bpy.ops.object.mode_set(mode="EDIT")
    path = save(tmp_path)
    before = path.read_bytes()
    done = command("bake", path, *QUICK, "--output", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    report = json.loads((tmp_path / "out" / "report.json").read_text())
    assert [entry["object"] for entry in report["outputs"]] == ["Floor", "Wall"]
    assert path.read_bytes() == before


def test_the_users_uv_map_is_used_and_no_other_made(build, tmp_path):
    # A square with a map over the whole image. Exact answer: one image for it, no new map in the saved file.
    build.sun()
    square = build.mesh("Square", material=(0.5, 0.5, 0.5))
    layer = square.data.uv_layers.new(name="Mine")
    layer.uv.foreach_set("vector", np.array([v.co.xy for v in square.data.vertices], np.float32).ravel())
    path = save(tmp_path)
    done = command("bake", path, *QUICK, "--uv-layer", "Mine", "--save", tmp_path / "baked.blend")
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "lightmaps" / "Lightmap_Square.exr").is_file()
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "baked.blend"))
    assert [layer.name for layer in bpy.data.objects["Square"].data.uv_layers] == ["Mine"]
    # A square alone under a sun: E / pi everywhere.
    pixels = image_file.read_exr(tmp_path / "lightmaps" / "Lightmap_Square.exr")
    assert pixels == pytest.approx(1 / math.pi, rel=0.02)


def test_vertex_colours_lie_on_the_corners(build, tmp_path):
    # A square alone under a sun. Exact answer: 1 / pi on its four corners, in a float colour attribute.
    build.sun()
    build.mesh("Square", material=(0.5, 0.5, 0.5))
    path = save(tmp_path)
    done = command("bake", path, "--error", ".2", "--target", "vertex", "--save", tmp_path / "baked.blend")
    assert done.returncode == 0, done.stderr
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "baked.blend"))
    attribute = bpy.data.objects["Square"].data.color_attributes["Radiosity"]
    assert (attribute.data_type, attribute.domain) == ("FLOAT_COLOR", "CORNER")
    colours = np.array([item.color for item in attribute.data])
    assert colours == pytest.approx(np.array([[1 / math.pi] * 3 + [1]] * 4), rel=0.02)


def test_modifiers_are_applied_in_the_saved_file_so_that_the_map_fits(build, tmp_path):
    # A square with an array of 3. Exact answer: the saved mesh has 3 faces, the map and no modifier; one line says so.
    build.sun()
    build.mesh("Row").modifiers.new("Array", "ARRAY").count = 3
    path = save(tmp_path)
    done = command("bake", path, *QUICK, "--save", tmp_path / "baked.blend")
    assert done.returncode == 0, done.stderr
    assert "radiosity: warning: Row: its modifiers (Array) were applied" in done.stderr
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "baked.blend"))
    row = bpy.data.objects["Row"]
    assert (len(row.data.polygons), len(row.modifiers), row.data.name) == (3, 0, "Row")
    assert "UVMap_Lightmap" in row.data.uv_layers


def test_objects_of_one_mesh_share_its_map_and_have_an_image_each(build, tmp_path):
    # Two objects of one mesh, one in the shade of the other. Exact answer: one map, two images, the lower one dark.
    build.sun()
    first = build.mesh("High", material=(0.5, 0.5, 0.5))
    second = build.object("Low", first.data)
    first.location.z, first.scale = 0.5, (40, 40, 1)
    first.location.x = first.location.y = -20
    second.location.z = 0
    path = save(tmp_path)
    done = command("bake", path, *QUICK, "--save", tmp_path / "baked.blend")
    assert done.returncode == 0, done.stderr
    outputs = {entry["object"]: entry for entry in json.loads(
        (tmp_path / "lightmaps" / "report.json").read_text())["outputs"]}
    assert outputs["High"]["uv_layer"] == outputs["Low"]["uv_layer"] == "UVMap_Lightmap"
    high, low = (image_file.read_exr(tmp_path / "lightmaps" / outputs[name]["image"]) for name in ("High", "Low"))
    assert high.max() == pytest.approx(1 / math.pi, rel=0.05)
    assert low.max() < 0.01 * high.max()


def spoil(build: Any, what: str, folder: Path) -> tuple[Any, ...]:
    """Make the scene of a test of bad input; further arguments for it."""
    if what != "no light":
        build.sun()
    if what == "no mesh":
        return ()
    square = build.mesh("Square", material=(0.5, 0.5, 0.5))
    if what == "not finite":
        square.data.vertices[1].co.z = math.nan
    if what == "no texture":
        image = bpy.data.images.new("brick.png", 4, 4)
        image.source, image.filepath = "FILE", "/nowhere/brick.png"
        square.data.materials[0] = build.textured("Brick", image)
    if what == "no folder":
        (folder / "taken").write_text("a file where a folder is wanted")
        return ("--output", folder / "taken")
    if what == "own file":
        return ("--save", folder / "scene.blend")
    if what == "own file as report":
        return ("--report", folder / "scene.blend")
    return {"no map": ("--uv-layer", "Mine"), "no object": ("--only", "Sqare")}.get(what, ())


@pytest.mark.parametrize(("what", "code", "line"), [
    ("no mesh", 3, "no mesh with faces"),
    ("no light", 3, "the scene has no light: add a lamp"),
    ("not finite", 1, "object 'Square': vertex 1 is at (1, 0, nan)"),
    ("no texture", 1, "material 'Brick': image 'brick.png' is missing at /nowhere/brick.png: restore the file"),
    ("no folder", 1, "can't be written to"),
    ("own file", 2, "is the scene's own file, which a bake never changes: give another name"),
    ("own file as report", 2, "scene.blend has the name of an image, a page or a scene: let it end in .json"),
    ("no map", 2, "object 'Square' has no UV map 'Mine' (it has none): add it"),
    ("no object", 2, "only names 'Sqare', which the scene does not have: did you mean 'Square'?"),
])
def test_bad_input_is_told_in_one_line(build, tmp_path, what, code, line):
    # A scene with one thing wrong. Exact answer: its exit code, one line, and nothing written.
    extra = spoil(build, what, tmp_path)
    path = save(tmp_path)
    before = path.read_bytes()
    done = command("bake", path, *QUICK, *extra)
    assert line in error_line(done)
    assert done.returncode == code
    assert path.read_bytes() == before
    assert not (tmp_path / "lightmaps").exists()


@pytest.mark.parametrize(("arguments", "line"), [
    (("bake", "scene.blend", "--error", "much"), "argument --error: invalid float value: 'much'"),
    (("bake", "scene.blend", "--error", ".1", "--preset", "high"), "not allowed with argument --error"),
    (("bake", "."), "is no file: give the path of a .blend file"),
    (("bake", "nowhere.blend"), "nowhere.blend does not exist: give the path of a .blend file"),
    (("bake", f"{'x' * 300}.blend"), "x.blend does not exist: give the path of a .blend file"),
    ((), "the following arguments are required: COMMAND"),
])
def test_wrong_arguments_end_with_code_2(tmp_path, arguments, line):
    done = command(*arguments, cwd=tmp_path)
    assert line in error_line(done)
    assert done.returncode == 2


def test_a_linked_object_is_not_baked_and_blocks_all_the_same(build, tmp_path):
    # A square linked from another file over a local one, under a sun. Exact answer: the local one alone is baked, dark;
    # asked for by name, the linked one is refused with code 1.
    roof = build.mesh("Roof", ((-50, -50, 1), (50, -50, 1), (50, 50, 1), (-50, 50, 1)))
    assert roof
    library = save(tmp_path, "library.blend")
    bpy.ops.wm.read_factory_settings(use_empty=True)
    with bpy.data.libraries.load(str(library), link=True) as (_, into):
        into.objects = ["Roof"]
    bpy.context.scene.collection.objects.link(into.objects[0])
    build.world((0, 0, 0))
    build.sun()
    build.mesh("Floor")
    path = save(tmp_path)
    done = command("bake", path, *QUICK)
    assert done.returncode == 0, done.stderr
    assert "radiosity: warning: Roof: is not baked, it is linked from //library.blend" in done.stderr
    outputs = json.loads((tmp_path / "lightmaps" / "report.json").read_text())["outputs"]
    assert [entry["object"] for entry in outputs] == ["Floor"]
    assert image_file.read_exr(tmp_path / "lightmaps" / outputs[0]["image"]).max() < 0.003
    refused = command("bake", path, *QUICK, "--only", "Roof")
    assert "object 'Roof' is linked from //library.blend and can't be written to: make it local" in error_line(refused)
    assert refused.returncode == 1


def test_check_tells_what_bakes_without_baking(build, tmp_path):
    room(build)
    done = command("check", save(tmp_path))
    assert done.returncode == 0, done.stderr
    assert "bakes       Floor: 2 triangles" in done.stdout
    assert "1 lamps, 0 emissive triangles, sky black" in done.stdout


@pytest.mark.skipif(sys.platform == "win32", reason="there is no SIGINT to send")
def test_an_interrupt_cancels_with_code_130(build, tmp_path):
    # A bake to an error that takes minutes, interrupted once it works. Exact answer: 130, one line, no image.
    room(build)
    path = save(tmp_path)
    process = subprocess.Popen([sys.executable, "-m", "radiosity", "bake", str(path), "--error", ".001", "--resolution",
                                "1024"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                               env={**os.environ, "PYTHONUNBUFFERED": "1"})
    assert process.stdout is not None
    for line in process.stdout:
        if line.startswith(("patches", "form factors", "gather")):
            break
    time.sleep(0.2)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 130, errors
    assert len([line for line in errors.splitlines() if line.startswith("radiosity: error: ")]) == 1
    assert not (tmp_path / "lightmaps").exists()


@pytest.mark.skipif(sys.platform == "win32", reason="there is no SIGINT to send")
def test_an_interrupt_while_blender_is_loaded_ends_with_code_130(tmp_path):
    # Blender's module does not survive an exception while it is imported. Exact answer: 130, one line, nothing left.
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    process = subprocess.Popen([sys.executable, "-m", "radiosity", "check", "scene.blend"], stdout=subprocess.PIPE,
                               stderr=subprocess.PIPE, text=True, env={**os.environ, "TMPDIR": str(temporary)})
    # It is made for Blender, right before the import.
    while process.poll() is None and not any(temporary.glob("radiosity-*")):
        time.sleep(0.01)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 130, errors
    assert errors == "radiosity: error: cancelled: nothing was changed\n"
    assert not any(temporary.iterdir())


def test_the_example_makes_a_scene_that_bakes(tmp_path):
    # The project's own Cornell box. Exact answer: eight objects receive, two triangles shine.
    script = Path(__file__).resolve().parents[2] / "examples" / "cornell_box.py"
    path = tmp_path / "box.blend"
    made = subprocess.run([sys.executable, str(script), str(path)], capture_output=True, text=True, check=False)
    assert made.returncode == 0, made.stderr
    done = command("check", path)
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("bakes ") == 8
    assert "0 lamps, 2 emissive triangles, sky black" in done.stdout

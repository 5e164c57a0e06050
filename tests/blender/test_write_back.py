"""Results written into Blender: what is ours is replaced, what is the user's stays."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from radiosity.radiosity_addon import baked_images, mesh_layers, undone
from radiosity.radiosity_addon.clear import clear
from radiosity.radiosity_addon.command import parse_options
from radiosity.radiosity_addon.job import run
from radiosity.radiosity_addon.names import block_name
from radiosity.radiosity_addon.results import result_of
from radiosity.radiosity_addon.window_request import request_in
from radiosity.solver import image_file
from radiosity.solver.errors import OutputError

PIXELS = np.random.default_rng(1).uniform(0, 100000, (6, 8, 3)).astype(np.float32)


def values(image: Any) -> np.ndarray:
    """(h, w, 3) of a Blender image."""
    found = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(found)
    return found.reshape(image.size[1], image.size[0], -1)[:, :, :3]


def test_a_file_that_is_not_ours_is_never_overwritten(tmp_path):
    # A user's file of the wanted name. Exact answer: it stays bit for bit; ours gets _2, and twice written is one file.
    theirs = tmp_path / "Lightmap_1.exr"
    image_file.write_exr(theirs, np.ones((2, 2, 3), np.float32))
    kept = theirs.read_bytes()
    for _ in range(2):
        path = baked_images.write_file(tmp_path, "Lightmap_1", PIXELS, {}, set())
        assert path == tmp_path / "Lightmap_1_2.exr"
    assert theirs.read_bytes() == kept
    assert sorted(item.name for item in tmp_path.iterdir()) == ["Lightmap_1.exr", "Lightmap_1_2.exr"]


@pytest.mark.parametrize(("names", "files"), [(("a/b", "a:b"), ["a_b", "a_b_2"]), (("a", "A"), ["a", "A_2"])])
def test_names_that_file_systems_refuse_are_changed_and_stay_apart(tmp_path, names, files):
    # Two objects, "a/b" and "a:b", or "a" and "A", one where case makes no difference. Exact answer: two files.
    taken: set[str] = set()
    paths = [baked_images.write_file(tmp_path, name, PIXELS, {}, taken) for name in names]
    assert [path.stem for path in paths] == files


def test_names_that_are_too_long_for_files_are_cut_and_stay_apart(tmp_path):
    # Two names of 301 bytes that differ in the last. Exact answer: two files, and the same when they are written again.
    written = []
    for _ in range(2):
        taken: set[str] = set()
        written += [baked_images.write_file(tmp_path, "x" * 300 + end, PIXELS, {}, taken) for end in "12"]
    assert written[:2] == written[2:]
    assert {*written} == {*tmp_path.iterdir()}
    assert len({*written}) == 2


def test_a_users_image_keeps_its_name_and_pixels(build, tmp_path):
    # An image of the user's called as ours would be. Exact answer: it stays, ours stands beside it.
    theirs = build.image("Lightmap_1", np.full((2, 2, 4), 0.25), is_float=True)
    path = baked_images.write_file(tmp_path, "Lightmap_1", PIXELS, {}, set())
    ours = baked_images.linked_image("Lightmap_1", path, "", pack=False)
    assert bpy.data.images["Lightmap_1"] == theirs
    assert ours != theirs
    assert values(theirs) == pytest.approx(0.25)


def test_baking_again_replaces_our_image_wherever_it_is_used(build, tmp_path):
    # A material that shows our first image. Exact answer: it shows the second, and there is one image.
    path = baked_images.write_file(tmp_path, "Lightmap_1", PIXELS, {}, set())
    material = build.textured("Preview", baked_images.linked_image("Lightmap_1", path, "", pack=False))
    again = baked_images.linked_image("Lightmap_1", path, "", pack=False)
    node = next(node for node in material.node_tree.nodes if node.bl_idname == "ShaderNodeTexImage")
    assert node.image == again
    assert [image.name for image in bpy.data.images if image.name.startswith("Lightmap")] == ["Lightmap_1"]


def test_a_packed_image_keeps_every_bit_in_the_blend(build, tmp_path):
    # Values up to 100,000, above what half floats hold. Exact answer: the same bits after saving and opening.
    path = baked_images.write_file(tmp_path, "Lightmap_1", PIXELS, {}, set())
    baked_images.packed_image("Lightmap_1", path)
    path.unlink()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "packed.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "packed.blend"))
    image = bpy.data.images["Lightmap_1"]
    assert image.packed_file is not None
    assert (values(image) == PIXELS).all()


def test_our_map_stands_in_slot_1_and_the_users_maps_are_untouched(build):
    # A mesh with one map of the user's, active. Exact answer: ours is the second, theirs is active and the same.
    mesh = build.mesh("Square").data
    theirs = mesh.uv_layers.new(name="Paint")
    before = mesh_uv(mesh, "Paint")
    assert theirs.active_render
    uv = np.random.default_rng(2).uniform(size=(4, 2)).astype(np.float32)
    for _ in range(2):
        assert mesh_layers.put_uv(mesh, uv, "Square") == "UVMap_Lightmap"
    assert [layer.name for layer in mesh.uv_layers] == ["Paint", "UVMap_Lightmap"]
    assert (mesh_uv(mesh, "UVMap_Lightmap") == uv).all()
    assert (mesh_uv(mesh, "Paint") == before).all()
    assert mesh.uv_layers.active.name == "Paint"
    assert mesh.uv_layers["Paint"].active_render


def mesh_uv(mesh: Any, name: str) -> np.ndarray:
    return np.array([item.vector[:] for item in mesh.uv_layers[name].uv], np.float32)


def test_a_mesh_without_maps_gets_an_empty_first_one(build):
    # Textures without a map are read at (0, 0). Exact answer: the first map is zeros and active, ours is the second.
    mesh = build.mesh("Square").data
    mesh_layers.put_uv(mesh, np.ones((4, 2), np.float32), "Square")
    assert [layer.name for layer in mesh.uv_layers] == ["UVMap", "UVMap_Lightmap"]
    assert not mesh_uv(mesh, "UVMap").any()
    assert mesh.uv_layers["UVMap"].active_render


def test_a_users_map_of_our_name_is_not_taken(build):
    mesh = build.mesh("Square").data
    mesh.uv_layers.new(name="UVMap_Lightmap")
    before = mesh_uv(mesh, "UVMap_Lightmap")
    assert mesh_layers.put_uv(mesh, np.full((4, 2), 0.5, np.float32), "Square") == "UVMap_Lightmap.001"
    assert (mesh_uv(mesh, "UVMap_Lightmap") == before).all()


def test_a_mesh_with_eight_maps_is_told(build):
    mesh = build.mesh("Square").data
    for number in range(8):
        mesh.uv_layers.new(name=f"Map {number}")
    with pytest.raises(OutputError, match="object 'Square': its mesh has 8 UV maps"):
        mesh_layers.put_uv(mesh, np.zeros((4, 2), np.float32), "Square")


def test_colours_are_floats_on_corners_and_the_active_ones_stay(build):
    # A mesh with colours of the user's. Exact answer: ours beside them, values above 1 kept, theirs active.
    mesh = build.mesh("Square").data
    mesh.color_attributes.new("Paint", "BYTE_COLOR", "POINT")
    mesh.color_attributes.active_color_index = mesh.color_attributes.render_color_index = 0
    colours = np.random.default_rng(3).uniform(0, 9, (4, 3)).astype(np.float32)
    for _ in range(2):
        name = mesh_layers.put_colours(mesh, "Radiosity", colours)
    attribute = mesh.color_attributes[name]
    assert (attribute.data_type, attribute.domain, len(mesh.color_attributes)) == ("FLOAT_COLOR", "CORNER", 2)
    assert (np.array([item.color[:3] for item in attribute.data], np.float32) == colours).all()
    assert mesh.color_attributes.active_color.name == "Paint"


def test_clear_takes_away_what_is_ours_and_nothing_else(build, tmp_path):
    # A square with a map, colours and an image of each kind. Exact answer: the user's are left.
    square = build.mesh("Square")
    build.image("Photo", np.zeros((2, 2, 4)))
    square.data.uv_layers.new(name="Paint")
    mesh_layers.put_uv(square.data, np.zeros((4, 2), np.float32), "Square")
    mesh_layers.put_colours(square.data, "Radiosity", np.zeros((4, 3), np.float32))
    path = baked_images.write_file(tmp_path, "Lightmap_1", PIXELS, {}, set())
    square[baked_images.MARK] = baked_images.packed_image("Lightmap_1", path)
    assert clear() == (1, 1)
    assert [image.name for image in bpy.data.images] == ["Photo"]
    assert [layer.name for layer in square.data.uv_layers] == ["Paint"]
    assert not len(square.data.color_attributes)
    assert not list(square.keys())
    assert not list(square.data.keys())


def bake(*, only: str = "", output: Path | None = None, options: str = "") -> list[str]:
    """Bake the open file's scene; the messages of its warnings."""
    scene = bpy.context.scene
    request = request_in(bpy.context, parse_options(options))
    settings = replace(request.settings, only=(only,) if only else ())
    report = run(replace(request, settings=settings, output=output), scene, scene.view_layers[0]).report
    return [entry["message"] for entry in report["warnings"]]


def light(name: str) -> float:
    """The mean light of an object's image, where there is any."""
    pixels = values(bpy.data.objects[name][baked_images.MARK])
    return float(pixels[pixels > 0].mean()) * math.pi


def test_a_later_bake_leaves_images_that_others_show(sunny, tmp_path):
    # Two squares under a sun of 1 W/m2, on one page; then the sun has 3, and one of them is baked. Exact answer: 3 on
    # that one and 1 on the other, in files of their own; baked together again both have 3 on the first page.
    sunny.mesh("A")
    sunny.mesh("B").location.x = 3
    bake(output=tmp_path)
    assert (light("A"), light("B")) == pytest.approx((1, 1), rel=0.02)
    bpy.data.lights["Sun"].energy = 3
    for _ in range(2):
        assert bake(only="A", output=tmp_path) == []
        assert (light("A"), light("B")) == pytest.approx((3, 1), rel=0.02)
    images = {name: bpy.data.objects[name][baked_images.MARK] for name in "AB"}
    assert {name: Path(bpy.path.abspath(image.filepath)).name for name, image in images.items()} == {
        "A": "Lightmap_1_2.exr", "B": "Lightmap_1.exr"}
    assert image_file.read_exr(tmp_path / "Lightmap_1.exr").max() * math.pi == pytest.approx(1, rel=0.02)
    bake(output=tmp_path)
    assert (light("A"), light("B")) == pytest.approx((3, 3), rel=0.02)
    assert {bpy.data.objects[name][baked_images.MARK].name for name in "AB"} == {"Lightmap_1"}


def test_a_file_that_held_others_too_is_replaced_and_told(sunny, tmp_path):
    # Two squares baked to a file, the .blend opened again as it was, and one of them baked. Exact answer: one warning
    # that names the file and the other; none when it is baked once more.
    sunny.mesh("A")
    sunny.mesh("B").location.x = 3
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    told = []
    for only in ("", "A", "A"):
        told.append(bake(only=only, output=tmp_path))
        bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "scene.blend"))
    assert [len(messages) for messages in told] == [0, 1, 0]
    assert "'Lightmap_1.exr' held the light of 'B' too" in told[1][0]


def test_an_image_that_a_hidden_object_shows_stays_and_is_told(sunny):
    # Two squares on one page under a sun of 1 W/m2; one is hidden, the sun has 3. Exact answer: each has its own light,
    # and one warning says of the hidden one why the other's image has another name than before.
    sunny.mesh("A")
    hidden = sunny.mesh("B")
    hidden.location.x = 3
    bake()
    hidden.hide_render = True
    bpy.data.lights["Sun"].energy = 3
    (message,) = bake()
    assert "still shows the image 'Lightmap_1': this light is in 'Lightmap_1_2'" in message
    assert (light("A"), light("B")) == pytest.approx((3, 1), rel=0.02)


def test_packed_images_that_others_show_stay_too(sunny):
    sunny.mesh("A")
    sunny.mesh("B").location.x = 3
    bake()
    bpy.data.lights["Sun"].energy = 3
    bake(only="A")
    assert (light("A"), light("B")) == pytest.approx((3, 1), rel=0.02)


def test_each_scene_of_a_file_keeps_its_images(sunny, tmp_path):
    # A square a scene under suns of 1 and 3 W/m2, baked into one folder. Exact answer: each shows its scene's light.
    sunny.mesh("A")
    bake(output=tmp_path)
    other = bpy.data.scenes.new("Other")
    other.radiosity.error, other.radiosity.resolution, other.radiosity.pack = 0.2, 32, True
    sun = bpy.data.lights.new("Other sun", "SUN")
    sun.energy = 3
    for item in (bpy.data.objects.new("Other sun", sun), bpy.data.objects.new("B", bpy.data.objects["A"].data.copy())):
        other.collection.objects.link(item)
    request = replace(request_in(bpy.context, parse_options("")), output=tmp_path)
    run(request, other, other.view_layers[0])
    assert (light("A"), light("B")) == pytest.approx((1, 3), rel=0.02)


@pytest.mark.parametrize("target", ["lightmap", "vertex"])
def test_an_object_whose_mesh_a_bake_laid_out_anew_loses_its_result(sunny, target):
    # Two objects of one mesh, baked one after the other. Exact answer: the mesh holds the second's layout or colours,
    # so the first has no result any more, and one warning says so.
    mesh = sunny.mesh("A").data
    sunny.object("B", mesh).location.x = 3
    options = f"--target {target}"
    assert bake(only="A", options=options) == []
    (message,) = bake(only="B", options=options)
    assert message.startswith("shares its mesh with 'B'")
    assert result_of(bpy.data.objects["A"]) is None
    assert result_of(bpy.data.objects["B"]) is not None


def test_a_file_of_another_blend_stays_and_is_told(sunny, tmp_path):
    # Two .blend files beside each other, baked into the folder that both have by default, twice. Exact answer: a file
    # each and a warning that names the other; once that is gone, nothing stands in the way.
    sunny.mesh("A")
    out = tmp_path / "lightmaps"
    for name, strength, told in (("one", 1, 0), ("two", 3, 1), ("one", 1, 0), ("two", 3, 1)):
        bpy.data.lights["Sun"].energy = strength
        bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / f"{name}.blend"))
        messages = bake(output=out)
        assert len(messages) == told
        assert all("'Lightmap_1.exr'" in message and "one.blend" in message for message in messages)
        bpy.ops.radiosity.clear()
    for name, strength in (("Lightmap_1", 1), ("Lightmap_1_2", 3)):
        assert image_file.read_exr(out / f"{name}.exr").max() * math.pi == pytest.approx(strength, rel=0.02)
    (tmp_path / "one.blend").unlink()
    assert bake(output=out) == []
    assert light("A") == pytest.approx(3, rel=0.02)
    assert bpy.data.objects["A"][baked_images.MARK].filepath.endswith("Lightmap_1.exr")


def test_a_file_of_a_blend_that_may_not_be_looked_at_stays(sunny, tmp_path):
    # A lightmap that names a .blend of which nobody can tell whether it is there: for root, whom no rights stop, one of
    # a name longer than names can be. Exact answer: the file as it was, ours beside it, and a warning.
    sunny.mesh("A")
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    theirs = tmp_path / "Lightmap_1.exr"
    baked_images.write_marked(theirs, np.ones((4, 4, 3), np.float32), {baked_images.BLEND: f"{'x' * 300}.blend"})
    before = theirs.read_bytes()
    (message,) = bake(output=tmp_path)
    assert message.startswith("the lightmap 'Lightmap_1.exr' was baked from")
    assert theirs.read_bytes() == before
    assert image_file.read_exr(tmp_path / "Lightmap_1_2.exr").max() * math.pi == pytest.approx(1, rel=0.02)


def test_after_an_undo_a_file_that_is_away_is_not_taken_for_another_layout(sunny, tmp_path):
    # The lightmap's file is moved away, then another layout lies there. Exact answer: the result stays, then goes.
    item = sunny.mesh("A")
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    assert bake(output=tmp_path, options="--no-pack") == []
    path = tmp_path / "Lightmap_1.exr"
    path.rename(tmp_path / "away")
    assert not undone.forget_replaced()
    assert result_of(item) is not None
    baked_images.write_marked(path, PIXELS, {baked_images.LAYOUT: "another"})
    assert undone.forget_replaced()
    assert result_of(item) is None


def test_what_is_saved_in_the_place_of_another_bake_has_its_files_too(sunny, tmp_path):
    # Two .blend files, baked into one folder and saved as the same third one. Exact answer: one file, of the last.
    sunny.mesh("A")
    out, saved = tmp_path / "lightmaps", tmp_path / "baked.blend"
    for name, strength in (("one", 1), ("two", 3)):
        bpy.data.lights["Sun"].energy = strength
        bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / f"{name}.blend"))
        assert bake(output=out, options=f"--save '{saved}'") == []
        bpy.ops.radiosity.clear()
    assert [path.name for path in out.glob("*.exr")] == ["Lightmap_1.exr"]
    assert image_file.read_exr(out / "Lightmap_1.exr").max() * math.pi == pytest.approx(3, rel=0.02)


@pytest.mark.parametrize("options", ["--target vertex", "--atlas object"])
def test_objects_of_long_names_have_results_of_their_own(sunny, tmp_path, options):
    # Two objects of one mesh, in the sun and in the shade, and their scene, all with names as long as Blender takes.
    # Exact answer: each has its light, and a second bake leaves no more than the first.
    bpy.context.scene.name = longest = block_name("x" * 999)
    first = sunny.mesh(f"{longest[:-1]}1")
    second = sunny.object(f"{longest[:-1]}2", first.data)
    second.location.x = 5
    sunny.mesh("Roof", ((4, -1, 2), (7, -1, 2), (7, 2, 2), (4, 2, 2)))
    left = set()
    for _ in range(2):
        bake(output=tmp_path, options=options)
        bright, dark = (brightest(result_of(item)) for item in (first, second))
        assert bright == pytest.approx(1 / math.pi, rel=0.02)
        assert dark < 0.02 * bright
        left.add((len(bpy.data.images), len(first.data.attributes), len(list(tmp_path.iterdir()))))
    assert len(left) == 1
    clear()
    assert not len(first.data.color_attributes)


def brightest(result: Any) -> float:
    """The most light of a result."""
    if result.image is not None:
        return float(values(result.image).max())
    colours = result.item.data.color_attributes[result.layer].data
    return max(float(item.color[0]) for item in colours)

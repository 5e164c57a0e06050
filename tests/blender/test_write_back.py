"""Results written into Blender: what is ours is replaced, what is the user's stays."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from radiosity.radiosity_addon import baked_images, mesh_layers
from radiosity.radiosity_addon.clear import clear
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


def test_names_that_file_systems_refuse_are_changed_and_stay_apart(tmp_path):
    # Two objects, "a/b" and "a:b". Exact answer: two files.
    taken: set[Path] = set()
    paths = [baked_images.write_file(tmp_path, name, PIXELS, {}, taken) for name in ("a/b", "a:b")]
    assert [path.name for path in paths] == ["a_b.exr", "a_b_2.exr"]


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

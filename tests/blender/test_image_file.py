"""Blender reads the files that the solver writes."""

import os
import tempfile

import numpy as np
import pytest

os.environ.setdefault("BLENDER_USER_RESOURCES", tempfile.mkdtemp())
bpy = pytest.importorskip("bpy", reason="the bpy wheel is not installed")

from radiosity.solver.image_file import write_exr  # noqa: E402


def test_blender_reads_the_same_values_the_same_way_up(tmp_path):
    # 3 x 5 distinct values up to 1e4: Blender's Image.pixels (first row at the bottom) holds the same floats.
    pixels = np.random.default_rng(2).uniform(0, 1e4, (3, 5, 3)).astype(np.float32)
    write_exr(tmp_path / "a.exr", pixels, {"quantity": "radiance", "unit": "W/(m2 sr)"})
    image = bpy.data.images.load(str(tmp_path / "a.exr"))
    image.colorspace_settings.name = "Non-Color"
    try:
        assert tuple(image.size) == (5, 3)
        got = np.empty(3 * 5 * 4, np.float32)
        image.pixels.foreach_get(got)
        assert np.array_equal(got.reshape(3, 5, 4)[:, :, :3], pixels)
    finally:
        bpy.data.images.remove(image)


def test_blender_finds_light_groups_as_render_layers(tmp_path):
    # An image with light groups "sun" and "lamps.north": the compositor's image node offers these layers by name.
    pixels = np.ones((2, 2, 3), np.float32)
    write_exr(tmp_path / "b.exr", pixels, layers={"sun": pixels * 2, "lamps.north": pixels * 3})
    image = bpy.data.images.load(str(tmp_path / "b.exr"))
    tree = bpy.data.node_groups.new("layers", "CompositorNodeTree")
    try:
        node = tree.nodes.new("CompositorNodeImage")
        node.image = image
        for name in ("sun", "lamps.north"):
            node.layer = name
            assert node.layer == name
        with pytest.raises(TypeError):
            node.layer = "moon"
    finally:
        bpy.data.node_groups.remove(tree)
        bpy.data.images.remove(image)

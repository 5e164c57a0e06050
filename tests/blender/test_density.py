"""The density view: pixels per metre measured, shown, and taken away again."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np
import pytest
from radiosity import operators
from radiosity.radiosity_addon import preview
from radiosity.radiosity_addon.density import densities
from radiosity.tests.blender.snapshot import additions, changes, snapshot


@pytest.fixture
def stage(build: Any) -> Any:
    """Two squares of 1 m and 2 m with the same UV map over half of an image of 64 pixels each way."""
    operators.register()
    for name, side in (("Small", 1), ("Large", 2)):
        square = build.mesh(name, material=(0.5, 0.5, 0.5))
        square.scale = (side, side, 1)
        uv = np.array(((0, 0), (0.5, 0), (0.5, 0.5), (0, 0.5)), np.float32)
        square.data.uv_layers.new(name="Light").uv.foreach_set("vector", uv.ravel())
    settings = bpy.context.scene.radiosity
    settings.uv_layer, settings.resolution = "Light", 64
    bpy.context.view_layer.update()
    yield build
    operators.unregister()


def test_density_is_pixels_over_metres(stage):
    # 32 pixels over 1 m and over 2 m. Exact answer: 32 and 16 px/m.
    found = {each.item.name: each.pixels_per_metre for each in densities(bpy.context.scene)}
    assert found == pytest.approx({"Small": 32, "Large": 16})


def test_the_view_covers_the_materials_and_gives_them_back(stage):
    # Shown, then hidden. Exact answer: every surface has a checker; afterwards the file is the same to the last bit.
    before = snapshot()
    assert bpy.ops.radiosity.density() == {"FINISHED"}
    for name in ("Small", "Large"):
        shown = bpy.data.objects[name].material_slots[0].material
        assert any(node.bl_idname == "ShaderNodeTexChecker" for node in shown.node_tree.nodes)
    preview.hide()
    after = snapshot()
    assert changes(before, after) == {}
    assert additions(before, after) == set()


def test_without_a_layout_there_is_nothing_to_show(stage):
    bpy.context.scene.radiosity.uv_layer = ""
    with pytest.raises(RuntimeError, match="no object has a lightmap yet"):
        bpy.ops.radiosity.density()

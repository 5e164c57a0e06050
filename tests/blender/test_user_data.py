"""What is the user's stays the user's: the whole file is compared before and after a bake, a failure, a cancel."""

from __future__ import annotations

import math
import re
from typing import Any

import bpy
import numpy as np
import pytest
from radiosity.radiosity_addon.check import find
from radiosity.radiosity_addon.job import Job, run
from radiosity.radiosity_addon.request import Request
from radiosity.solver.errors import Cancelled, SceneError, UnwrapError
from radiosity.solver.settings import Settings
from radiosity.tests.blender.snapshot import additions, changes, snapshot

SETTINGS = {"error": 0.3, "resolution": 64, "threads": 2}
# What a bake adds: images, its UV map or colours, their marks, and the list of what was baked.
OURS = re.compile(r"images\[Lightmap|UVMap_Lightmap|\['?radiosity|radiosity_(uv_map|colours|lightmaps)|"
                  r"radiosity_view|radiosity_(patch|result)|attribute Radiosity|\[Radiosity|meshes\[radiosity|"
                  r"cache_files|images\[Render Result\]")


@pytest.fixture
def stage(build: Any) -> Any:
    """A scene with all that a bake could touch: UV maps, colours, modifiers, nodes, a sky, a selection."""
    sun = build.sun()
    sun.data.angle = 0.01
    noise = build.material("Noise", (0.5, 0.5, 0.5))
    texture = noise.node_tree.nodes.new("ShaderNodeTexNoise")
    noise.node_tree.links.new(texture.outputs["Color"], build.shader(noise).inputs["Base Color"])
    first = build.mesh("First", material=noise)
    for name in ("Paint", "Detail"):
        uv = np.random.default_rng(0).random(8).astype(np.float32)
        first.data.uv_layers.new(name=name).uv.foreach_set("vector", uv)
    first.data.uv_layers.active = first.data.uv_layers["Detail"]
    first.data.uv_layers["Paint"].active_render = True
    colour = first.data.color_attributes.new("Mask", "BYTE_COLOR", "CORNER")
    colour.data.foreach_set("color", np.linspace(0, 1, 16).astype(np.float32))
    build.object("Second", first.data).location.x = 3
    cube = build.cube("Cube", material=build.textured("Brick", build.image("Bricks", np.full((2, 2, 4), 0.5))))
    cube.location, cube.scale = (0, 3, 0.5), (1, -2, 0.5)
    cube.modifiers.new("Bevel", "BEVEL").show_viewport = False
    cube["of the user"] = 5
    hidden = build.mesh("Hidden")
    hidden.hide_render = True
    build.object("Letter", bpy.data.curves.new("Letter", "FONT")).location.z = 5
    world = build.world((0.1, 0.2, 0.3))
    sky = world.node_tree.nodes.new("ShaderNodeTexGradient")
    background = next(node for node in world.node_tree.nodes if node.bl_idname == "ShaderNodeBackground")
    world.node_tree.links.new(sky.outputs["Color"], background.inputs["Color"])
    scene = bpy.context.scene
    scene.render.engine, scene.render.resolution_x, scene.cycles.samples = "BLENDER_WORKBENCH", 321, 77
    scene.render.filepath, scene.frame_current = "//mine", 7
    first.select_set(True)
    bpy.context.view_layer.objects.active = cube
    bpy.context.view_layer.update()
    return build


def request(folder: Any, **settings: Any) -> Request:
    return Request(Settings(**{**SETTINGS, **settings}), folder)


@pytest.mark.parametrize("target", ["lightmap", "vertex"])
def test_a_bake_changes_nothing_that_was_there(stage, tmp_path, target):
    # Exact answer: every value of the file from before is the same to the last bit; what is new is ours.
    before = snapshot()
    run(request(tmp_path, target=target), bpy.context.scene, bpy.context.view_layer)
    after = snapshot()
    theirs = {path: values for path, values in changes(before, after).items() if not OURS.search(path)}
    assert theirs == {}
    assert {path for path in additions(before, after) if not OURS.search(path)} == set()


def test_a_second_bake_changes_nothing_either(stage, tmp_path):
    run(request(tmp_path), bpy.context.scene, bpy.context.view_layer)
    before = snapshot()
    run(request(tmp_path), bpy.context.scene, bpy.context.view_layer)
    theirs = {path: values for path, values in changes(before, snapshot()).items() if not OURS.search(path)}
    assert theirs == {}


def _same(before: dict[str, Any]) -> None:
    after = snapshot()
    assert changes(before, after) == {}
    assert additions(before, after) == set()


def test_a_bake_that_fails_at_its_start_changes_nothing(stage, tmp_path):
    # A vertex that is not a number. Exact answer: the same file to the last bit, with nothing more in it.
    bpy.data.objects["Hidden"].hide_render = False
    bpy.data.objects["Hidden"].data.vertices[0].co.x = math.inf
    before = snapshot()
    with pytest.raises(SceneError, match="vertex 0"):
        run(request(tmp_path), bpy.context.scene, bpy.context.view_layer)
    _same(before)


def test_a_bake_that_fails_on_its_way_changes_nothing(stage, tmp_path):
    # Pages too small for the charts, which the unwrap finds out. Exact answer: the same.
    before = snapshot()
    with pytest.raises(UnwrapError):
        run(request(tmp_path, resolution=4), bpy.context.scene, bpy.context.view_layer)
    _same(before)


def test_a_bake_that_is_cancelled_changes_nothing(stage, tmp_path):
    before = snapshot()
    job = Job(request(tmp_path, error=0.01), bpy.context.scene, bpy.context.view_layer)
    try:
        job.export()
        job.start()
        job.cancel()
        with pytest.raises(Cancelled):
            job.finish()
    finally:
        job.close()
    _same(before)


def test_a_check_changes_nothing(stage):
    before = snapshot()
    assert find(bpy.context.scene, bpy.context.view_layer, Settings(**SETTINGS)).failure is None
    _same(before)


def test_the_snapshot_sees_small_changes(stage):
    # One bit each of a vertex, a UV map, a colour, a node's input, a render setting, the selection, a pixel, the sky.
    # Exact answer: each is seen, or this comparison would be worth nothing.
    first, scene = bpy.data.objects["First"], bpy.context.scene
    shader = stage.shader(bpy.data.materials["Noise"])
    background = next(node for node in scene.world.node_tree.nodes if node.bl_idname == "ShaderNodeBackground")
    touches = [
        lambda: setattr(first.data.vertices[0].co, "x", 1e-7),
        lambda: setattr(first.data.uv_layers["Paint"].uv[1].vector, "x", 0.123),
        lambda: setattr(first.data.color_attributes["Mask"].data[2], "color", (1, 0, 0, 1)),
        lambda: setattr(shader.inputs["Roughness"], "default_value", 0.123),
        lambda: setattr(scene.cycles, "samples", 78),
        lambda: bpy.data.objects["Second"].select_set(True),
        lambda: bpy.data.images["Bricks"].pixels.foreach_set(np.zeros(16, np.float32)),
        lambda: setattr(background.inputs["Strength"], "default_value", 2.0),
        lambda: setattr(bpy.data.objects["Cube"].modifiers["Bevel"], "width", 0.2),
        lambda: setattr(first.data.uv_layers, "active", first.data.uv_layers["Paint"]),
    ]
    for touch in touches:
        before = snapshot()
        touch()
        assert changes(before, snapshot())

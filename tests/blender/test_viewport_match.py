"""What a window reads from its viewport is what a render shows, and where that is not known a render is asked."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import bpy
import numpy as np
import pytest
from radiosity.radiosity_addon import cycles
from radiosity.radiosity_addon.export import export_parts, export_scene
from radiosity.radiosity_addon.parts import whole
from radiosity.radiosity_addon.viewport_match import has_the_same_objects, is_the_same
from radiosity.solver.settings import Settings

SHORT = 1e-6


def modifier(kind: str, **values: Any) -> Callable[[Any, Any], None]:
    def add(build: Any, cube: Any) -> None:
        made = cube.modifiers.new(kind.title(), kind)
        for name, value in values.items():
            setattr(made, name, value)

    return add


def curve(**values: Any) -> Callable[[Any, Any], None]:
    def add(build: Any, cube: Any) -> None:
        data = bpy.data.curves.new("Curve", "CURVE")
        for name, value in values.items():
            setattr(data, name, value)
        build.object("Curve", data)

    return add


def tree_with(node: str) -> Callable[[Any, Any], None]:
    def add(build: Any, cube: Any) -> None:
        tree = bpy.data.node_groups.new("Tree", "GeometryNodeTree")
        tree.nodes.new(node)
        cube.modifiers.new("Nodes", "NODES").node_group = tree

    return add


def instances(**hidden: bool) -> Callable[[Any, Any], None]:
    def add(build: Any, cube: Any) -> None:
        collection = bpy.data.collections.new("Kept apart")
        inside = build.cube("Inside")
        collection.objects.link(inside)
        bpy.context.scene.collection.objects.unlink(inside)
        for name, value in hidden.items():
            setattr(inside, name, value)
        placed = build.object("Placed", None)
        placed.instance_type, placed.instance_collection = "COLLECTION", collection

    return add


def simplified(build: Any, cube: Any) -> None:
    bpy.context.scene.render.use_simplify = True


def balls(build: Any, cube: Any) -> None:
    data = bpy.data.metaballs.new("Balls")
    data.resolution, data.render_resolution = 0.5, 0.1
    build.object("Balls", data)


def eye_closed(build: Any, cube: Any) -> None:
    cube.hide_set(True)


def edited(build: Any, cube: Any) -> None:
    bpy.context.view_layer.objects.active = cube
    bpy.ops.object.mode_set(mode="EDIT")


def hidden(which: str) -> Callable[[Any, Any], None]:
    def hide(build: Any, cube: Any) -> None:
        setattr(cube, which, True)

    return hide


def hidden_collection(build: Any, cube: Any) -> None:
    collection = bpy.data.collections.new("Hidden")
    bpy.context.scene.collection.children.link(collection)
    collection.objects.link(cube)
    bpy.context.scene.collection.objects.unlink(cube)
    collection.hide_render = True


APART = {
    "subdivision": modifier("SUBSURF", levels=1, render_levels=2),
    "subdivision by the graphics card": modifier("SUBSURF", levels=2, render_levels=2),
    "modifier off in viewports": modifier("SOLIDIFY", show_viewport=False),
    "modifier off in renders": modifier("SOLIDIFY", show_render=False),
    "screw": modifier("SCREW"),
    "particles": modifier("PARTICLE_SYSTEM"),
    "finer curve": curve(render_resolution_u=24),
    "finer balls": balls,
    "nodes that ask": tree_with("GeometryNodeIsViewport"),
    "instance hidden in renders": instances(hide_render=True),
    "instance hidden in viewports": instances(hide_viewport=True),
    "simplified": simplified,
    "eye closed": eye_closed,
    "hidden in viewports": hidden("hide_viewport"),
    "hidden in renders": hidden("hide_render"),
    "collection hidden in renders": hidden_collection,
    "being edited": edited,
}
ALIKE = {
    "nothing": lambda build, cube: None,
    "bevel": modifier("BEVEL"),
    "array": modifier("ARRAY", count=3),
    "curve": curve(),
    "curve as fine": curve(resolution_u=7, render_resolution_u=7),
    "nodes that do not ask": tree_with("GeometryNodeMeshCube"),
    "instances": instances(),
    "hidden from both": lambda build, cube: (hidden("hide_viewport")(build, cube), hidden("hide_render")(build, cube)),
}


def place(build: Any, add: Callable[[Any, Any], Any]) -> tuple[Any, Any]:
    build.sun()
    build.cube("Other").location.x = 3
    add(build, build.cube("Cube"))
    bpy.context.view_layer.update()
    return bpy.context.scene, bpy.context.view_layer


@pytest.mark.parametrize("what", APART)
def test_a_viewport_that_may_show_another_thing_is_not_taken_for_a_render(build, what):
    assert not is_the_same(*place(build, APART[what]))


@pytest.mark.parametrize("what", ALIKE)
def test_a_viewport_that_shows_the_same_is_taken_for_a_render(build, what):
    scene, layer = place(build, ALIKE[what])
    assert is_the_same(scene, layer)
    assert has_the_same_objects(layer)


def test_a_layer_without_render_is_not_taken_for_one(build):
    scene, layer = place(build, ALIKE["nothing"])
    layer.use = False
    assert not is_the_same(scene, layer)


@pytest.mark.parametrize("what", ["subdivision", "subdivision by the graphics card", "modifier off in viewports",
                                  "eye closed", "hidden in viewports", "instance hidden in viewports", *ALIKE])
def test_what_a_window_reads_is_what_a_render_shows(build, what):
    # Exact answer: the triangles of the scene read at once, as a render shows it, to the bit.
    scene, layer = place(build, {**APART, **ALIKE}[what])
    settings = Settings(resolution=32)
    in_parts = whole(export_parts(scene, layer, settings, [], part_seconds=SHORT)).scene
    at_once = export_scene(scene, layer, settings, []).scene
    assert np.array_equal(in_parts.vertices, at_once.vertices)
    assert np.array_equal(in_parts.triangles, at_once.triangles)
    assert [surface.name for surface in in_parts.surfaces] == [surface.name for surface in at_once.surfaces]


@pytest.mark.parametrize(("what", "asked"), [("bevel", False), ("subdivision", True)])
def test_a_render_is_asked_only_where_the_viewport_may_differ(build, what, asked, monkeypatch):
    # A render's view makes all viewports draw anew.
    scene, layer = place(build, {**APART, **ALIKE}[what])
    calls = []
    real = cycles.with_render_depsgraph
    monkeypatch.setattr(cycles, "with_render_depsgraph", lambda *args: (calls.append(1), real(*args))[1])
    whole(export_parts(scene, layer, Settings(resolution=32), [], part_seconds=SHORT))
    assert bool(calls) == asked

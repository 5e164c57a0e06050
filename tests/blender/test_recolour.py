"""Base colours changed after a bake that kept what they need: the images follow, and what they can't follow is said."""

from __future__ import annotations

import json
import math
import subprocess
import sys
from argparse import Namespace
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from radiosity import operators
from radiosity.radiosity_addon import cache, live_relight
from radiosity.radiosity_addon.job import Job
from radiosity.radiosity_addon.parts import whole
from radiosity.radiosity_addon.relight import RelightJob
from radiosity.radiosity_addon.relight_request import kept_in, relight_request
from radiosity.solver import image_file
from radiosity.solver.errors import Cancelled

GREY, RED = (0.5, 0.5, 0.5), (0.8, 0.1, 0.3)


@pytest.fixture
def room(build: Any, tmp_path: Path) -> Iterator[Any]:
    """A saved file with a closed grey cube of 2 m about a point lamp, to be baked with groups and reflectances."""
    operators.register()
    build.cube("Room", 2.0, material=matt(build, "Room paint", GREY)).data.flip_normals()
    data = bpy.data.lights.new("Lamp", "POINT")
    data.energy, data.shadow_soft_size = 40.0, 0.1
    build.object("Lamp", data)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    settings = bpy.context.scene.radiosity
    # Without a margin, the mean over an image is that over the walls.
    settings.error, settings.resolution, settings.margin = 0.1, 32, 0
    settings.groups, settings.reflectances = "lamp", True
    yield build
    operators.unregister()


def matt(build: Any, name: str, colour: tuple[float, ...]) -> Any:
    """A material without gloss, so that it reflects its colour."""
    return build.material(name, colour, Specular_IOR_Level=0.0)


def paint(build: Any, colour: tuple[float, ...]) -> None:
    build.shader(bpy.data.materials["Room paint"]).inputs["Base Color"].default_value = (*colour, 1)


def light(folder: Path | None = None) -> np.ndarray:
    """(3,) mean of the room's light, W/m2, as the last report's image has it."""
    folder = folder or Path(bpy.data.filepath).parent / "lightmaps"
    told = json.loads((folder / "report.json").read_text())
    pixels = image_file.read_exr(folder / told["outputs"][0]["image"]).reshape(-1, 3) * math.pi
    return np.asarray(pixels[pixels.any(axis=1)].mean(axis=0))


def relight() -> None:
    assert bpy.ops.radiosity.relight() == {"FINISHED"}


def refused(message: str) -> None:
    with pytest.raises(RuntimeError, match=message):
        bpy.ops.radiosity.relight()


def test_a_repainted_room_has_the_light_that_its_new_paint_absorbs(room, tmp_path):
    # Grey of .5, painted red, and a lamp twice as bright. Exact answer: a closed room absorbs what its lamp sends out,
    # (1 - rho) E A, so its mean light is twice (1 - .5) / (1 - rho) times what it was.
    bpy.ops.radiosity.bake()
    before = light()
    paint(room, RED)
    bpy.data.objects["Lamp"].data.energy *= 2
    relight()
    assert light() == pytest.approx(before * 2 * 0.5 / (1 - np.array(RED)), rel=0.03)
    told = json.loads((tmp_path / "lightmaps" / "report.json").read_text())
    assert told["rays"] == 0
    assert told["recoloured"]["names"] == ["Room paint"]
    assert told["recoloured"]["rays_kept"] == 32
    assert 0 <= told["recoloured"]["noise"] < 0.05
    paint(room, GREY)
    bpy.data.objects["Lamp"].data.energy /= 2
    relight()
    assert light() == pytest.approx(before, rel=2e-3)


def test_vertex_colours_follow_too(room, tmp_path):
    # Exact answer as above, on the corners.
    def mean() -> np.ndarray:
        attribute = bpy.data.objects["Room"].data.color_attributes["Radiosity"]
        return np.asarray(np.mean([item.color[:3] for item in attribute.data], axis=0))

    bpy.ops.radiosity.bake(options="--target vertex")
    before = mean()
    paint(room, RED)
    relight()
    assert mean() == pytest.approx(before * 0.5 / (1 - np.array(RED)), rel=0.05)


def test_an_image_and_another_material_are_followed(room):
    # An image of one red pixel in place of the grey, then another material of that red in the slot. Exact answer: as by
    # the red itself.
    bpy.ops.radiosity.bake()
    before = light()
    expected = before * 0.5 / (1 - np.array(RED))
    image = room.image("red", np.broadcast_to([*RED, 1.0], (2, 2, 4)), is_float=True)
    material = bpy.data.materials["Room paint"]
    node = material.node_tree.nodes.new("ShaderNodeTexImage")
    node.image = image
    link = material.node_tree.links.new(node.outputs["Color"], room.shader(material).inputs["Base Color"])
    relight()
    assert light() == pytest.approx(expected, rel=0.03)
    material.node_tree.links.remove(link)
    material.node_tree.nodes.remove(node)
    relight()
    assert light() == pytest.approx(before, rel=2e-3)
    bpy.data.objects["Room"].data.materials[0] = matt(room, "Other", RED)
    relight()
    assert light() == pytest.approx(expected, rel=0.03)


def test_the_colour_that_a_material_reads_of_its_object_is_followed(room):
    # Paint of the object's own colour. Exact answer: as by paint of that colour; where it glows, it needs a bake.
    material, item = bpy.data.materials["Room paint"], bpy.data.objects["Room"]
    info = material.node_tree.nodes.new("ShaderNodeObjectInfo")
    material.node_tree.links.new(info.outputs["Color"], room.shader(material).inputs["Base Color"])
    item.color = (*GREY, 1)
    bpy.ops.radiosity.bake()
    before = light()
    item.color = (*RED, 1)
    relight()
    assert light() == pytest.approx(before * 0.5 / (1 - np.array(RED)), rel=0.03)
    room.shader(material).inputs["Emission Strength"].default_value = 1.0
    bpy.ops.radiosity.bake()
    item.color = (*GREY, 1)
    refused(r"object 'Room' has another 'color' \(Object Info\), which its materials read")


def test_live_follows_a_node_that_keeps_its_colour_in_its_output(room):
    # Live switched on, the paint's RGB node turned. Exact answer: the light of the new paint.
    material = bpy.data.materials["Room paint"]
    rgb = material.node_tree.nodes.new("ShaderNodeRGB")
    rgb.outputs[0].default_value = (*GREY, 1)
    material.node_tree.links.new(rgb.outputs[0], room.shader(material).inputs["Base Color"])
    bpy.ops.radiosity.bake()
    before = light()
    scene = bpy.context.scene
    scene.radiosity.live_relight = True
    rgb.outputs[0].default_value = (*RED, 1)
    live_relight.update()
    assert live_relight.problem(scene) == ""
    assert light() == pytest.approx(before * 0.5 / (1 - np.array(RED)), rel=0.03)


def test_what_else_a_material_changes_needs_a_bake(room):
    # Glass in place of paint; a material that glows, and then changes its colour too. Exact answer: each is said.
    bpy.ops.radiosity.bake()
    shader = room.shader(bpy.data.materials["Room paint"])
    shader.inputs["Alpha"].default_value = 0.5
    refused("what rays can meet has changed since the bake")
    shader.inputs["Alpha"].default_value = 1.0
    shader.inputs["Emission Strength"].default_value = 1.0
    bpy.ops.radiosity.bake()
    paint(room, RED)
    refused("material 'Room paint' gives light, and changed in more than its color and strength")
    bpy.data.objects["Room"].data.materials[0] = matt(room, "Other", RED)
    refused("object 'Room' has other materials")


def test_without_the_option_nothing_of_it_is_kept(room):
    # Groups alone, then both, then none. Exact answer: files and the relight's answer say so.
    bpy.ops.radiosity.bake(options="--no-reflectances")
    folder = kept_in(bpy.context.scene)
    assert not cache.follows_colours(folder)
    size = cache.size(folder)
    paint(room, RED)
    refused("material 'Room paint' reflects otherwise")
    bpy.ops.radiosity.bake()
    assert cache.follows_colours(folder)
    assert cache.size(folder) > 2 * size
    assert bpy.ops.radiosity.clear_groups() == {"FINISHED"}
    assert not folder.exists()


def test_layers_and_what_colours_change_add_up_to_the_image(room, tmp_path):
    # Groups written as layers. Exact answer: they and the layer "Reflectance" add up to the relit image.
    bpy.context.scene.radiosity.group_layers = True
    bpy.ops.radiosity.bake()
    paint(room, RED)
    relight()
    told = json.loads((tmp_path / "lightmaps" / "report.json").read_text())["outputs"][0]
    layers, _ = image_file.read_layers(tmp_path / "lightmaps" / told["groups"])
    image = image_file.read_exr(tmp_path / "lightmaps" / told["image"])
    assert set(layers) == {"", "Lamp", "Reflectance"}
    assert layers["Lamp"] + layers["Reflectance"] == pytest.approx(image, rel=1e-3, abs=1e-5)
    assert layers["Reflectance"][..., 1].min() < 0 < layers["Reflectance"][..., 0].max()


def test_live_follows_base_colours(room):
    # Live switched on, the room painted. Exact answer: the light of the new paint, and no second update.
    bpy.ops.radiosity.bake()
    before = light()
    scene = bpy.context.scene
    scene.radiosity.live_relight = True
    paint(room, RED)
    live_relight.update()
    assert live_relight.problem(scene) == ""
    assert light() == pytest.approx(before * 0.5 / (1 - np.array(RED)), rel=0.03)
    image = bpy.data.objects["Room"]["radiosity_lightmaps"]
    live_relight.update()
    assert bpy.data.objects["Room"]["radiosity_lightmaps"] == image


def test_live_notices_another_material_in_a_slot(room):
    # Live switched on, another material put into the room's slot; then, while the baked look covers the slots, nothing.
    # Exact answer: the light of that material, and no second update.
    bpy.ops.radiosity.bake()
    before = light()
    scene, item = bpy.context.scene, bpy.data.objects["Room"]
    other = matt(room, "Other paint", RED)
    scene.radiosity.live_relight = True
    item.material_slots[0].material = other
    live_relight.update()
    assert live_relight.problem(scene) == ""
    assert light() == pytest.approx(before * 0.5 / (1 - np.array(RED)), rel=0.03)
    image = item["radiosity_lightmaps"]
    bpy.ops.radiosity.preview()
    assert item.material_slots[0].material != other
    live_relight.update()
    assert item["radiosity_lightmaps"] == image


def test_a_relight_in_a_windows_parts_is_the_relight_at_once(room):
    # The room painted, the work in parts and a thread. Exact answer: the image of the relight at once, to the bit; Esc
    # in its middle leaves the image that was.
    bpy.ops.radiosity.bake()
    paint(room, RED)
    relight()
    scene, item = bpy.context.scene, bpy.data.objects["Room"]
    expected, request = light(), relight_request(scene, Namespace())
    job = RelightJob(request, scene, bpy.context.view_layer)
    try:
        whole(job.exporting(1e-6))
        job.start()
        assert job.finish().exit_code == 0
    finally:
        job.close()
    assert (light() == expected).all()
    image = item["radiosity_lightmaps"]
    job = RelightJob(request, scene, bpy.context.view_layer)
    try:
        job.export()
        job.cancel()
        job.start()
        with pytest.raises(Cancelled):
            job.finish()
    finally:
        job.close()
    assert item["radiosity_lightmaps"] == image
    assert Job.current is None


def test_live_waits_for_what_is_on_its_way(room):
    # The lamp changed while a bake runs, then while a relight of Live's own does. Exact answer: asked for again a
    # moment later, both times; the relight, which shows what is old already, is told to end.
    bpy.ops.radiosity.bake()
    scene = bpy.context.scene
    scene.radiosity.live_relight = True
    bpy.data.lights["Lamp"].energy = 20.0
    request = relight_request(scene, Namespace())
    for kind, ends in ((Job, False), (partial(RelightJob, live=True), True)):
        job = kind(request, scene, bpy.context.view_layer)
        try:
            assert live_relight.update() == live_relight.PAUSE
            if ends:
                with pytest.raises(Cancelled):
                    job.refuse_cancelled()
            else:
                job.refuse_cancelled()
        finally:
            job.close()
    before = light()
    assert live_relight.update() is None
    assert light() == pytest.approx(before / 2, rel=0.01)


def test_the_baked_look_is_no_other_material(room):
    # The view of the baked light covers the room's own material during a bake, then during a relight. Exact answer: no
    # change, then the paint.
    bpy.ops.radiosity.bake()
    bpy.ops.radiosity.preview()
    bpy.ops.radiosity.bake()
    before = light()
    bpy.ops.radiosity.preview()
    relight()
    assert light() == pytest.approx(before, rel=2e-3)
    bpy.ops.radiosity.preview()
    paint(room, RED)
    relight()
    assert light() == pytest.approx(before * 0.5 / (1 - np.array(RED)), rel=0.03)


def test_the_command_line_follows_base_colours_of_another_file(room, tmp_path):
    # A file that was never baked, with what was kept for another. Exact answer: code 0, and the light of the paint.
    def command(*arguments: Any) -> None:
        done = subprocess.run([sys.executable, "-m", "radiosity", *map(str, arguments)], capture_output=True, text=True,
                              timeout=300, check=False)
        assert done.returncode == 0, done.stderr

    bpy.context.scene.radiosity.groups, bpy.context.scene.radiosity.reflectances = "none", False
    bpy.ops.wm.save_mainfile()
    path, out = tmp_path / "scene.blend", tmp_path / "out"
    command("bake", path, "--groups", "lamp", "--reflectances", "--output", out)
    before = light(out)
    paint(room, RED)
    bpy.ops.wm.save_mainfile()
    command("relight", path, "--output", out)
    assert light(out) == pytest.approx(before * 0.5 / (1 - np.array(RED)), rel=0.03)

"""Relight: lamps are changed after a bake, and the images follow; what can't be followed is said."""

from __future__ import annotations

import json
import math
from typing import Any

import bpy
import numpy as np
import pytest
from radiosity.radiosity_addon import cache, live_relight
from radiosity.radiosity_addon.relight_panel import kept_groups
from radiosity.radiosity_addon.relight_request import kept_in
from radiosity.solver import image_file
from radiosity.tests.blender.relight.hand import lamp, pixels, refused, relight


def test_power_and_colour_follow_without_a_ray(baked, tmp_path):
    # A sun of 1 W/m2, then of 3 in blue and green. Exact answer: 0, 1.5 and 3 W/m2; image, EXR and report say so.
    lamp().energy, lamp().color = 3.0, (0.0, 0.5, 1.0)
    relight()
    assert pixels() == pytest.approx(np.tile([0, 1.5, 3], (len(pixels()), 1)), rel=0.01)
    told = json.loads((tmp_path / "lightmaps" / "report.json").read_text())
    assert told["rays"] == 0
    assert told["groups"] == [{"name": "Sun", "baked": [1, 1, 1], "now": pytest.approx([0, 1.5, 3], rel=1e-3)}]
    stored = image_file.read_exr(tmp_path / "lightmaps" / told["outputs"][0]["image"])
    assert stored.max(axis=(0, 1)) * math.pi == pytest.approx([0, 1.5, 3], rel=0.01)


@pytest.mark.parametrize("how", ["hide_render", "energy", "unlink"])
def test_a_lamp_goes_out_and_on_again(baked, how):
    # The sun hidden from renders, or without power, or taken out of the scene. Exact answer: black, then 1 W/m2 again.
    sun = bpy.data.objects["Sun"]
    collection = bpy.context.scene.collection
    if how == "hide_render":
        sun.hide_render = True
    elif how == "energy":
        lamp().energy = 0
    else:
        collection.objects.unlink(sun)
    relight()
    assert not len(pixels())
    if how == "hide_render":
        sun.hide_render = False
    elif how == "energy":
        lamp().energy = 1
    else:
        collection.objects.link(sun)
    relight()
    assert pixels() == pytest.approx(1, rel=0.01)


def test_emission_and_world_are_groups_of_their_own(stage):
    # A glowing square, alone, in a grey world, under a sun; all three changed, the world to red. Exact answer: it does
    # not light itself; 2 W/m2 from the sun and pi W/m2 of red from the world.
    square = bpy.data.objects["Square"]
    shader = stage.shader(square.data.materials[0])
    shader.inputs["Emission Strength"].default_value = 1.0
    background = stage.world((0.5, 0.5, 0.5)).node_tree.nodes["Background"]
    bpy.ops.radiosity.bake()
    assert pixels() == pytest.approx(1 + math.pi / 2, rel=0.02)
    names = [group.name for group in kept_groups(kept_in(bpy.context.scene))]
    assert names == ["Sun", "Square paint", "World"]
    lamp().energy, shader.inputs["Emission Strength"].default_value = 2.0, 7.0
    background.inputs["Color"].default_value = (1, 0, 0, 1)
    relight()
    assert pixels() == pytest.approx(np.tile([2 + math.pi, 2, 2], (len(pixels()), 1)), rel=0.02)


def without(item: Any) -> Any:
    """A linking collection that excludes an object."""
    made = bpy.data.collections.new("Linked")
    made.objects.link(item)
    made.collection_objects[0].light_linking.link_state = "EXCLUDE"
    return made


def change(stage: Any, what: str) -> None:
    square = bpy.data.objects["Square"]
    if what == "moved":
        square.location.x = 0.1
    elif what == "mesh":
        square.data.vertices[0].co.z = 0.1
    elif what == "removed":
        square.hide_render = True
        stage.mesh("Other")
    elif what == "new":
        stage.mesh("Other")
    elif what == "color":
        stage.shader(square.data.materials[0]).inputs["Base Color"].default_value = (0.2, 0.5, 0.5, 1)
    elif what == "material":
        square.data.materials[0] = stage.material("Gold", (1, 1, 0))
    elif what == "lamp moved":
        bpy.data.objects["Sun"].rotation_euler.x = 0.2
    elif what == "lamp shape":
        lamp().angle = 0.3
    elif what == "lamp linked":
        bpy.data.objects["Sun"].light_linking.blocker_collection = without(square)
    elif what == "linked":
        square.light_linking.blocker_collection = without(square)
    elif what == "lamp new":
        stage.object("Late", bpy.data.lights.new("Late", "POINT"))
    elif what == "emission":
        stage.shader(square.data.materials[0]).inputs["Emission Strength"].default_value = 1.0
    elif what == "world":
        bpy.context.scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = (1, 1, 1, 1)


@pytest.mark.parametrize(("what", "line"), [
    ("moved", "object 'Square' was moved: the kept light does not hold any more, bake again"),
    ("mesh", "the mesh of object 'Square' changed"),
    ("removed", "object 'Square' was removed or hidden; object 'Other' is new"),
    ("new", "object 'Other' is new"),
    ("color", "material 'Square paint' reflects otherwise"),
    ("material", "object 'Square' has other materials"),
    ("lamp moved", "lamp 'Sun' was moved, or its shape or linking changed"),
    ("lamp shape", "lamp 'Sun' was moved, or its shape or linking changed"),
    ("lamp linked", "lamp 'Sun' was moved, or its shape or linking changed"),
    ("linked", "object 'Square' has other light linking"),
    ("lamp new", "lamp 'Late' gave no light at the bake"),
    ("emission", "material 'Square paint' gave no light at the bake"),
    ("world", "world 'World' gave no light at the bake"),
])
def test_what_needs_a_bake_is_said(baked, what, line):
    # One thing of the scene changed after the bake. Exact answer: a relight says which, and changes nothing.
    change(baked, what)
    refused(line)


def test_options_that_need_another_bake_are_refused(baked):
    # Kept light of 32 pixels a side. Exact answer: 32 are no other bake, 64 are, and groups are chosen by a bake.
    refused("resolution is 64, and the kept light was baked with 32", "--resolution 64")
    refused("unrecognized arguments: --groups", "--groups all")
    assert bpy.ops.radiosity.relight(options="--resolution 32") == {"FINISHED"}


def test_a_change_that_is_undone_needs_no_bake(baked):
    # The square moved there and back. Exact answer: 1 W/m2 again.
    square = bpy.data.objects["Square"]
    square.location.x = 3
    refused("moved")
    square.location.x = 0
    relight()
    assert pixels() == pytest.approx(1, rel=0.01)


def test_without_kept_groups_a_relight_says_how_to_get_them(baked, tmp_path):
    # A bake without groups, after one with them: those are gone, as they belong to other images.
    assert kept_in(bpy.context.scene) is not None
    bpy.ops.radiosity.bake(options="--groups none --resolution 16")
    refused("no light groups are kept in .*: bake with --groups lamp first")
    with pytest.raises(RuntimeError, match="no light groups are kept in"):
        bpy.ops.radiosity.relight(options=f"--output '{tmp_path / 'nowhere'}'")
    assert not (tmp_path / "nowhere").exists()


def test_an_output_folder_that_can_not_be_keeps_no_groups(baked):
    # A name longer than names can be, as the panel is drawn with it. Exact answer: nothing is kept there.
    bpy.context.scene.radiosity.output = f"//{'x' * 300}"
    assert kept_in(bpy.context.scene) is None


def test_lamps_of_a_collection_are_changed_together(stage):
    # Two suns of 1 and 2 W/m2 in a collection, in one group. Exact answer: both doubled, 6 W/m2; one alone is refused.
    both = bpy.data.collections.new("Key")
    bpy.context.scene.collection.children.link(both)
    bpy.context.scene.collection.objects.unlink(bpy.data.objects["Sun"])
    second = bpy.data.objects.new("Second", lamp().copy())
    second.data.energy = 2
    for sun in (bpy.data.objects["Sun"], second):
        both.objects.link(sun)
    bpy.ops.radiosity.bake(options="--groups collection")
    assert [group.name for group in kept_groups(kept_in(bpy.context.scene))] == ["Key"]
    lamp().energy, second.data.energy = 2, 4
    relight()
    assert pixels() == pytest.approx(6, rel=0.01)
    second.data.energy = 5
    refused("'Sun' was changed otherwise than the rest of light group 'Key'")


def test_kept_groups_have_a_size_and_are_cleared_by_a_button(baked, tmp_path):
    # One group of 32 x 32 pixels; a file of the user's in the folder. Exact answer: 32 * 32 * 6 bytes and what goes
    # with them; cleared, all is gone but the user's file.
    folder = kept_in(bpy.context.scene)
    assert folder == tmp_path / "lightmaps" / "Scene.radiosity"
    assert 32 * 32 * 6 < cache.size(folder) < 32 * 32 * 6 + 20000
    (folder / "notes.txt").write_text("mine")
    assert bpy.ops.radiosity.clear_groups() == {"FINISHED"}
    assert [path.name for path in folder.iterdir()] == ["notes.txt"]
    assert not bpy.ops.radiosity.clear_groups.poll()


@pytest.mark.parametrize(("spoil", "line"), [
    (lambda folder: (folder / cache.ABOUT).write_text("{"), "can't be read"),
    (lambda folder: (folder / cache.ABOUT).write_text('{"format": "other"}'), "kept by another version"),
    (lambda folder: (folder / "layers_0.npy").unlink(), "can't be read"),
    (lambda folder: (folder / "layers_0.npy").write_bytes(b"\x93NUMPY"), "can't be read"),
], ids=["cut off", "other version", "layers gone", "layers cut off"])
def test_damaged_groups_are_told(baked, spoil, line):
    spoil(kept_in(bpy.context.scene))
    refused(line)


def test_layers_of_the_group_file_add_up_to_the_image(stage, tmp_path):
    # A white and a red sun. Exact answer: the file's layers, named after them, add up to the lightmap, also when relit.
    red = stage.object("Red", lamp().copy())
    red.data.color = (1, 0, 0)
    bpy.ops.radiosity.bake(options="--group-layers")
    for factor in (1, 2):
        red.data.energy = factor
        if factor == 2:
            bpy.context.scene.radiosity.group_layers = True
            relight()
        told = json.loads((tmp_path / "lightmaps" / "report.json").read_text())["outputs"][0]
        layers, header = image_file.read_layers(tmp_path / "lightmaps" / told["groups"])
        image = image_file.read_exr(tmp_path / "lightmaps" / told["image"])
        assert set(layers) == {"", "Sun", "Red"}
        assert layers["Sun"] + layers["Red"] == pytest.approx(image, rel=1e-3, abs=1e-6)
        assert layers["Red"].max(axis=(0, 1)) * math.pi == pytest.approx([factor, 0, 0], rel=0.01)
        assert header["radiosity:quantity"] == "radiance"


def test_vertex_colours_are_relit(stage):
    # A square alone, its light on its corners, the sun made 3 W/m2 of green. Exact answer: 3 / pi there.
    bpy.ops.radiosity.bake(options="--target vertex")
    lamp().energy, lamp().color = 3, (0, 1, 0)
    relight()
    attribute = bpy.data.objects["Square"].data.color_attributes["Radiosity"]
    colours = np.array([item.color[:3] for item in attribute.data]) * math.pi
    assert colours == pytest.approx(np.tile([0, 3, 0], (4, 1)), rel=0.01)


def test_packed_images_are_relit_from_the_users_folder(stage, tmp_path):
    # Images packed, no output folder. Exact answer: nothing is written beside the .blend, and the image follows.
    bpy.context.scene.radiosity.pack = True
    bpy.ops.radiosity.bake()
    folder = kept_in(bpy.context.scene)
    assert cache.user_folder() in folder.parents
    lamp().energy = 2
    relight()
    assert pixels() == pytest.approx(2, rel=0.01)
    assert not (tmp_path / "lightmaps").exists()
    assert bpy.ops.radiosity.clear_groups() == {"FINISHED"}


def test_live_updates_once_a_change_and_tells_what_stands_in_the_way(baked):
    # Live switched on; the sun changed, left alone, then changed while the square was moved. Exact answer: updated, not
    # again, refused with a line for the panel.
    scene = bpy.context.scene
    scene.radiosity.live_relight = True
    lamp().energy = 2
    live_relight.update()
    assert pixels() == pytest.approx(2, rel=0.01)
    image = bpy.data.objects["Square"]["radiosity_lightmaps"]
    live_relight.update()
    assert bpy.data.objects["Square"]["radiosity_lightmaps"] == image
    assert live_relight.problem(scene) == ""
    bpy.data.objects["Square"].location.x, lamp().energy = 1, 3
    live_relight.update()
    assert "object 'Square' was moved" in live_relight.problem(scene)
    assert pixels() == pytest.approx(2, rel=0.01)


@pytest.mark.parametrize(("of", "name", "value"), [
    ("object", "rotation_euler", (1, 0, 0)), ("lamp", "angle", 1), ("lamp", "type", "POINT"),
])
def test_live_tells_of_a_lamp_that_shines_otherwise_until_it_is_as_before(baked, of, name, value):
    # A sun that is turned, larger or no sun any more, then as it was. Exact answer: a line for the panel, then none.
    scene, sun = bpy.context.scene, bpy.data.objects["Sun"]
    block = sun if of == "object" else sun.data
    kept = getattr(block, name)
    before = kept.copy() if of == "object" else kept
    scene.radiosity.live_relight = True
    for now, told in ((value, True), (before, False)):
        setattr(block, name, now)
        bpy.context.view_layer.update()
        live_relight.update()
        assert live_relight.problem(scene).startswith("lamp 'Sun' was moved, or its shape or linking changed") == told
    assert live_relight.problem(scene) == ""
    assert pixels() == pytest.approx(1, rel=0.01)


def test_live_follows_a_collection_that_is_excluded_from_the_view_layer(baked):
    # The sun alone in a collection that is excluded, then not. Exact answer: black, then 1 W/m2 again.
    scene, sun = bpy.context.scene, bpy.data.objects["Sun"]
    lamps = bpy.data.collections.new("Lamps")
    scene.collection.children.link(lamps)
    lamps.objects.link(sun)
    scene.collection.objects.unlink(sun)
    scene.radiosity.live_relight = True
    for excluded in (True, False):
        scene.view_layers[0].layer_collection.children["Lamps"].exclude = excluded
        bpy.context.view_layer.update()
        live_relight.update()
        assert (len(pixels()) == 0) == excluded
    assert pixels() == pytest.approx(1, rel=0.01)

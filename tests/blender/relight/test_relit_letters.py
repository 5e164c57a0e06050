"""Relight of text that was converted to a mesh: it follows in the file as baked and as it was before."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from radiosity.tests.blender.relight.hand import lamp, refused, relight


@pytest.fixture
def lettered(stage: Any) -> Any:
    """The stage with a letter beside the square, saved, and then baked as a mesh."""
    data = bpy.data.curves.new("Letter", "FONT")
    data.body, data.extrude = "I", 0.1
    stage.object("Letter", data).location.x = 3
    bpy.context.scene.radiosity.apply_modifiers = True
    bpy.ops.wm.save_mainfile()
    bpy.ops.radiosity.bake()
    return stage


def brightest(name: str) -> float:
    """The most light on an object, red, in W/m2."""
    image = bpy.data.objects[name]["radiosity_lightmaps"]
    return float(np.reshape(image.pixels[:], (-1, 4))[:, 0].max()) * math.pi


def test_light_on_a_converted_letter_follows(lettered):
    # The sun from 1 to 3 W/m2, where the letter is a mesh now, and in the file as it was before the bake, twice. Exact
    # answer: 3 W/m2 on the letter's mesh, which is made anew where it is not there.
    lamp().energy = 3.0
    relight()
    assert brightest("Letter mesh") == pytest.approx(3, rel=0.01)
    bpy.ops.wm.revert_mainfile()
    lamp().energy = 2.0
    for _ in range(2):
        relight()
        assert brightest("Letter mesh") == pytest.approx(2, rel=0.01)


def test_a_converted_letter_that_has_changed_needs_another_bake(lettered):
    # Its mesh is moved, or has a vertex elsewhere; turned back, it holds again. Exact answer: refused by the letter's
    # name, then done.
    item = bpy.data.objects["Letter mesh"]
    item.location.z = 1
    refused("object 'Letter' was moved")
    item.location.z = 0
    before = item.data.vertices[0].co.copy()
    item.data.vertices[0].co.z = 1
    refused("the mesh of object 'Letter' changed")
    item.data.vertices[0].co = before
    relight()


def test_a_letter_that_stays_one_is_told(lettered):
    # The file as it was before the bake, without leave to convert. Exact answer: the square follows, and a warning says
    # what the letter lacks.
    bpy.ops.wm.revert_mainfile()
    bpy.context.scene.radiosity.apply_modifiers = False
    lamp().energy = 3.0
    relight()
    assert brightest("Square") == pytest.approx(3, rel=0.01)
    report = json.loads((Path(bpy.data.filepath).parent / "lightmaps" / "report.json").read_text())
    (told,) = [entry["message"] for entry in report["warnings"] if entry["object"] == "Letter"]
    assert told == "has no mesh that could hold the result: let it be converted (--apply-modifiers)"


def test_other_colours_are_not_followed_where_meshes_changed_their_order(lettered):
    # Base colours are followed, the letter came before another mesh and its own comes after it, and the square turns
    # white. Exact answer: refused.
    bpy.ops.wm.revert_mainfile()
    bpy.context.scene.radiosity.reflectances = True
    lettered.mesh("Last").location.x = -3
    bpy.ops.radiosity.bake()
    shader = lettered.shader(bpy.data.objects["Square"].data.materials[0])
    shader.inputs["Base Color"].default_value = (1, 1, 1, 1)
    refused("can't be followed, as meshes are in another order")

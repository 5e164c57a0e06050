"""The picture that `make bake` leaves shows baked light alone, on whatever objects hold it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from radiosity import operators
from radiosity.tools import picture

CORNERS = [(-2, -2, 0), (2, -2, 0), (2, 2, 0), (-2, 2, 0)]


def rendered(blend: Path, report: Path) -> np.ndarray:
    """(h, w, 3) of the picture of a baked .blend."""
    picture.render(blend, report, blend.with_suffix(".png"), exposure=0.0, side=64)
    image = bpy.data.images.load(str(blend.with_suffix(".png")))
    pixels = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(pixels)
    return pixels.reshape(image.size[1], image.size[0], -1)[:, :, :3]


@pytest.fixture
def camera(build: Any) -> Any:
    """A camera that looks straight down on 1 x 1 m about the origin."""
    data = bpy.data.cameras.new("Camera")
    data.type, data.ortho_scale = "ORTHO", 1.0
    made = build.object("Camera", data)
    made.location = (0, 0, 3)
    bpy.context.scene.camera = made
    bpy.context.scene.render.resolution_x = bpy.context.scene.render.resolution_y = 64
    operators.register()
    yield made
    operators.unregister()


@pytest.mark.parametrize("what", ["object", "instance of a collection", "curve"])
def test_baked_light_is_shown_where_no_lamp_is_left(build, camera, tmp_path, what):
    # White paint (.8) that fills the picture, under a sun of 1 W/m2, which is gone before the picture is made. Exact
    # answer: radiance .8 / pi everywhere, as sRGB has it.
    white = build.material("White", (0.8, 0.8, 0.8), Specular_IOR_Level=0.0)
    if what == "curve":
        data = bpy.data.curves.new("Sheet", "CURVE")
        data.dimensions, data.fill_mode = "2D", "BOTH"
        spline = data.splines.new("POLY")
        spline.points.add(3)
        spline.use_cyclic_u = True
        for point, (x, y, z) in zip(spline.points, CORNERS, strict=True):
            point.co = (x, y, z, 1)
        data.materials.append(white)
        build.object("Sheet", data)
    else:
        sheet = build.mesh("Sheet", CORNERS, material=white)
    if what.startswith("instance"):
        collection = bpy.data.collections.new("Sheets")
        bpy.context.scene.collection.objects.unlink(sheet)
        collection.objects.link(sheet)
        stand = build.object("Stand", None)
        stand.instance_type, stand.instance_collection = "COLLECTION", collection
        stand.location = (0.5, 0, 0)
    sun = build.sun()
    settings = bpy.context.scene.radiosity
    settings.error, settings.resolution, settings.apply_modifiers = 0.2, 64, True
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    bpy.ops.radiosity.bake()
    bpy.data.objects.remove(sun)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "baked.blend"))
    linear = 0.8 / np.pi
    assert rendered(tmp_path / "baked.blend", tmp_path / "lightmaps" / "report.json") == pytest.approx(
        1.055 * linear ** (1 / 2.4) - 0.055, abs=0.02)

"""Meshes of quads, as people model: what is written into the mesh shows the light of the right place."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from radiosity import operators
from radiosity.radiosity_addon.mesh_arrays import corner_vertices, read, read_uv
from radiosity.solver import image_file

SIDE = 24


@pytest.fixture
def hills(build: Any, tmp_path: Path) -> Any:
    """Black hills of 24 x 24 quads, none of them flat, in a saved file; the sun shines straight down with 1 W/m2."""
    heights = np.random.default_rng(0).random((SIDE + 1, SIDE + 1))
    points = [(x, y, heights[x, y]) for x in range(SIDE + 1) for y in range(SIDE + 1)]
    first = [x * (SIDE + 1) + y for x in range(SIDE) for y in range(SIDE)]
    faces = [(a, a + SIDE + 1, a + SIDE + 2, a + 1) for a in first]
    operators.register()
    made = build.mesh("Hills", points, faces, material=build.material("Black", (0, 0, 0), Specular_IOR_Level=0.0))
    build.sun()
    settings = bpy.context.scene.radiosity
    settings.error, settings.resolution, settings.quantity = 0.2, 512, "irradiance"
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    yield made
    operators.unregister()


def shown(item: Any, image: str) -> tuple[np.ndarray, np.ndarray]:
    """(t,) irradiance that the image has, by the mesh's UV map, at the middle of each triangle, and their slopes."""
    mesh = item.data
    mesh.calc_loop_triangles()
    corners = read(mesh.loop_triangles, "loops", np.int32, 3)
    middle = read_uv(mesh, "UVMap_Lightmap")[corners].mean(axis=1)
    pixels = image_file.read_exr(Path(bpy.data.filepath).parent / "lightmaps" / image)[:, :, 0]
    x, y = np.minimum((middle * pixels.shape[::-1]).astype(int), np.subtract(pixels.shape[::-1], 1)).T
    points = read(mesh.vertices, "co", np.float32, 3)[corner_vertices(mesh)[corners]]
    normal = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
    return pixels[y, x], normal[:, 2] / np.linalg.norm(normal, axis=1)


@pytest.mark.parametrize("shared", [False, True])
def test_every_half_of_a_quad_shows_its_own_light(hills, build, shared):
    # Irradiance of the sun is the cosine of the slope. At the middle of each half within 2 %, whether the mesh is the
    # object's own or shared with one far away.
    if shared:
        build.object("Far hills", hills.data).location = (100, 0, 0)
    bpy.ops.radiosity.bake()
    told = json.loads((Path(bpy.data.filepath).parent / "lightmaps" / "report.json").read_text())
    light, cosine = shown(hills, told["outputs"][0]["image"])
    assert light == pytest.approx(cosine, rel=0.02)

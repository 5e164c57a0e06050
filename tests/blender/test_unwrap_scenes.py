"""Unwrapping of real scenes, through arrays."""

import os
import tempfile
from pathlib import Path

import numpy as np
import pytest

os.environ.setdefault("BLENDER_USER_RESOURCES", tempfile.mkdtemp())
bpy = pytest.importorskip("bpy", reason="the bpy wheel is not installed")

from radiosity.solver.layout import flat_triangles, world_areas  # noqa: E402
from radiosity.solver.lumels import lumels  # noqa: E402
from radiosity.solver.scene import Scene, Surface  # noqa: E402
from radiosity.solver.settings import Settings  # noqa: E402

SCENES = Path(__file__).resolve().parents[3] / "shared" / "scenes"


def scene_of(name):
    """All meshes of a .blend file as one scene."""
    path = SCENES / name / f"{name}.blend"
    if not path.is_file():
        pytest.skip(f"{path} is absent")
    bpy.ops.wm.open_mainfile(filepath=str(path))
    vertices, triangles, surfaces, base, first = [], [], [], 0, 0
    for item in bpy.context.evaluated_depsgraph_get().object_instances:
        if item.object.type != "MESH":
            continue
        mesh = item.object.to_mesh()
        mesh.calc_loop_triangles()
        points = np.empty(3 * len(mesh.vertices), np.float32)
        mesh.vertices.foreach_get("co", points)
        corners = np.empty(3 * len(mesh.loop_triangles), np.int32)
        mesh.loop_triangles.foreach_get("vertices", corners)
        matrix = np.array(item.matrix_world)
        vertices.append(points.reshape(-1, 3) @ matrix[:3, :3].T + matrix[:3, 3])
        triangles.append(corners.reshape(-1, 3) + base)
        surfaces.append(Surface(item.object.name, first, len(triangles[-1])))
        base, first = base + len(vertices[-1]), first + len(triangles[-1])
        item.object.to_mesh_clear()
    return Scene(np.concatenate(vertices), np.concatenate(triangles), surfaces=tuple(surfaces))


@pytest.mark.parametrize("name", ["cornell", "godot_livingroom", "pc_terrain"])
def test_a_real_scene_is_unwrapped_whole(name):
    # On 512 x 512 pixels: no overlap told, all objects with area on the page, and the lumels' areas add up to the
    # surface's (copies of a triangle counted once) within 3 %.
    scene = scene_of(name)
    warnings = []
    result = lumels(scene, Settings(resolution=512), warnings)
    assert warnings == []
    assert (result.page_of_surface == 0).all()
    corners = scene.vertices[scene.triangles[result.receivers.triangle]]
    sides = np.stack([corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]], axis=1)
    steps = np.einsum("nsc,ncx->nsx", result.receivers.footprint.astype(float), sides)
    covered = np.linalg.norm(np.cross(steps[:, 0], steps[:, 1]), axis=1).sum()
    solid = np.flatnonzero(~flat_triangles(scene))
    owner = np.repeat(np.arange(len(scene.surfaces)), [surface.count for surface in scene.surfaces])
    unique = {}
    for triangle in solid:
        points = scene.vertices[scene.triangles[triangle]]
        turn = int(np.lexsort(points.T[::-1])[0])
        unique.setdefault((owner[triangle], np.roll(points, -turn, axis=0).tobytes()), triangle)
    assert covered == pytest.approx(world_areas(scene)[list(unique.values())].sum(), rel=.03)

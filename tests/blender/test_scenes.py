"""Whole scenes made by others bake as they come: no traceback, no black map, every warning true."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

bpy = pytest.importorskip("bpy", reason="the bpy wheel is not installed")

from radiosity.solver import image_file  # noqa: E402

SCENES = Path(__file__).resolve().parents[3] / "shared" / "scenes"
# Triangles as Blender counts them, objects, and the codes of all warnings.
KNOWN = {
    "cornell": (32, 16, set()),
    "godot_livingroom": (5086, 2, {"zero_area"}),
    "pc_terrain": (3868, 35, set()),
    "pc_house": (10497, 2, set()),
    "truck_town": (30477, 20, {"zero_area", "giant"}),
    "zdm2": (58772, 1, {"zero_area"}),
    "pandora": (60690, 1, set()),
    "classroom": (103832, 79, {"zero_area", "material", "reflectance", "giant"}),
    "living-room": (143163, 65, {"zero_area", "material", "reflectance", "not_baked"}),
}
# Two corners nearer than this part of the longest side, or a height below it: no area.
FLAT = 1e-7


def triangles_of_objects() -> dict[str, np.ndarray]:
    """(n, 3, 3) metres for every mesh object of the open file."""
    found = {}
    for item in bpy.context.scene.objects:
        if item.type != "MESH":
            continue
        mesh = item.data
        mesh.calc_loop_triangles()
        points, corners = np.empty(3 * len(mesh.vertices)), np.empty(3 * len(mesh.loop_triangles), np.int32)
        mesh.vertices.foreach_get("co", points)
        mesh.loop_triangles.foreach_get("vertices", corners)
        matrix = np.array(item.matrix_world)
        found[item.name] = (points.reshape(-1, 3) @ matrix[:3, :3].T)[corners.reshape(-1, 3)]
    return found


def flat(corners: np.ndarray) -> np.ndarray:
    """(n,) bool: triangles without area."""
    sides = np.roll(corners, -1, axis=1) - corners
    longest = np.linalg.norm(sides, axis=2).max(axis=1)
    return np.asarray(np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1) <= FLAT * longest**2)


@pytest.mark.slow
@pytest.mark.parametrize("name", KNOWN)
def test_a_scene_made_by_others_bakes_as_it_comes(name, tmp_path):
    # Coarse, for time: 512 pixels a side, error .3. Exact: every object but those of glass has lumels on a page; light
    # is finite and not negative; no object is black all over; triangles add up; each warning names what is so.
    path = SCENES / name / f"{name}.blend"
    if not path.is_file():
        pytest.skip(f"{path} is absent")
    triangles, objects, codes = KNOWN[name]
    done = subprocess.run(
        [sys.executable, "-m", "radiosity", "bake", str(path), "--output", str(tmp_path), "--error", ".3",
         "--resolution", "512", "--save", str(tmp_path / "baked.blend")],
        capture_output=True, text=True, timeout=500, check=False)
    assert done.returncode in (0, 4), done.stdout + done.stderr
    assert "Traceback" not in done.stderr
    report = json.loads((tmp_path / "report.json").read_text(encoding="utf-8"))
    warnings = report["warnings"]
    assert {warning["code"] for warning in warnings} == codes
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "baked.blend"))
    meshes = triangles_of_objects()
    assert len(meshes) == objects
    assert sum(map(len, meshes.values())) == triangles
    for warning in warnings:
        if warning["code"] == "zero_area":
            assert flat(meshes[warning["object"]]).any(), warning
    glass = {warning["object"] for warning in warnings if warning["code"] == "not_baked"}
    assert {output["object"] for output in report["outputs"]} == set(meshes) - glass
    left_out = sum(len(meshes[item]) for item in glass) + sum(
        int(flat(corners).sum()) for item, corners in meshes.items() if item not in glass)
    assert report["triangles"] == pytest.approx(triangles - left_out, rel=0.002)
    for output in report["outputs"]:
        page = image_file.read_exr(tmp_path / output["image"])
        assert np.isfinite(page).all()
        assert page.min() >= 0
        assert lit_on(page, output), f"{output['object']} is black"


def lit_on(page: np.ndarray, output: dict[str, str]) -> bool:
    """Whether any light is on an object's page, at the middles of its triangles and between these and the corners."""
    mesh = bpy.data.objects[output["object"]].data
    uv = np.empty(2 * len(mesh.loops), np.float32)
    mesh.uv_layers[output["uv_layer"]].uv.foreach_get("vector", uv)
    corners = np.empty(3 * len(mesh.loop_triangles), np.int32)
    mesh.loop_triangles.foreach_get("loops", corners)
    corner = uv.reshape(-1, 2)[corners.reshape(-1, 3)]
    # In the cornell box both middles of the floor lie under the blocks.
    middle = corner.mean(axis=1)
    places = np.concatenate([middle, *(0.25 * middle + 0.75 * corner[:, side] for side in range(3))])
    height, width = page.shape[:2]
    column, row = (np.clip(places * (width, height), 0, (width - 1, height - 1))).astype(int).T
    return bool(page[row, column].any())

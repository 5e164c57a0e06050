"""A material made by nodes, which Cycles has to evaluate, bakes in the real Blender: by mouse, and without a window."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from radiosity.solver.image_file import read_exr
from radiosity.tests.gui.test_window import SCREEN, WINDOW, blender
from radiosity.tools import real_blender

HERE = Path(__file__).parent
EXACT = 2.0
WANTED = 0.01


@pytest.fixture
def scene(linux_zip: Path, tmp_path: Path) -> Path:
    """The furnace of nodes, and resources with the extension in them."""
    resources = tmp_path / "resources"
    resources.mkdir()
    blender(resources, "--command", "extension", "install-file", "-r", "user_default", "-e", linux_zip)
    path = tmp_path / "nodes.blend"
    blender(resources, "-b", "--factory-startup", "--python-exit-code", "3", "--python", HERE / "node_furnace.py", "--",
            path)
    return path


@pytest.mark.slow
@pytest.mark.usefixtures("real_blender")
def test_a_click_bakes_a_furnace_made_by_nodes(scene: Path, tmp_path: Path) -> None:
    # Exact answer: 2 at every lumel.
    baked, result, values = (tmp_path / name for name in ("baked.blend", "seen.json", "values.json"))
    job = {"tab": "Radiosity", "visit": [["press", "radiosity.bake"], ["save", str(baked)]], "shots": str(tmp_path),
           "result": str(result), "settings": {"preset": "draft", "resolution": 64}}
    done = real_blender.run([*WINDOW, str(scene), "--python", str(HERE / "drive.py")], tmp_path / "resources",
                            timeout=420, program=SCREEN, extra={"DRIVE_JOB": json.dumps(job)})
    assert json.loads(result.read_text(encoding="utf-8"))["error"] == "", done.stdout
    assert "Traceback" not in done.stdout, done.stdout
    blender(tmp_path / "resources", "-b", "--factory-startup", "--python-exit-code", "3", baked,
            "--python", HERE / "read_lightmaps.py", "--", values)
    samples = json.loads(values.read_text(encoding="utf-8"))["samples"]
    assert {sample["object"] for sample in samples} == {"Furnace"}
    assert np.allclose([sample["light"] for sample in samples], EXACT, rtol=WANTED)


@pytest.mark.slow
@pytest.mark.usefixtures("real_blender")
def test_the_command_line_bakes_a_furnace_made_by_nodes(scene: Path, tmp_path: Path) -> None:
    # Exact answer: 2 at every lumel; the report has a row for the material.
    report = tmp_path / "report.json"
    blender(tmp_path / "resources", "-b", scene, "-c", "radiosity", "bake", "--output", tmp_path / "maps",
            "--error", "0.01", "--resolution", "64", "--report", report)
    told = json.loads(report.read_text(encoding="utf-8"))
    pixels = read_exr(tmp_path / told["outputs"][0]["image"])
    lit = pixels[(pixels > 0).any(axis=2)]
    assert np.allclose(lit, EXACT, rtol=WANTED)
    assert [entry["code"] for entry in told["warnings"]] == []
    assert [row["name"] for row in told["materials"]] == ["Wall"]
    assert told["materials"][0]["diffuse_reflectance"] == pytest.approx([0.5] * 3, abs=1e-4)

"""A bake by mouse in the real Blender's window: the extension from the zip, the sidebar's tab, the button."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from radiosity.tools import real_blender

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
SHOTS = ROOT / "out" / "gui"
SCREEN = ("xvfb-run", "--auto-servernum", "--server-args=-screen 0 1400x900x24 +extension GLX -nolisten tcp", "blender")
# The panel's radiance over 1 - the highest reflectance, W/(m2 sr): no light in the box is brighter.
BRIGHTEST = 14 / (1 - 0.73)
WINDOW = ("--enable-event-simulate", "--window-geometry", "0", "0", "1400", "900")


def blender(resources: Path, *arguments: str | Path) -> str:
    """Run the real Blender without a window; its output. Fails on an exit code that is not 0."""
    done = real_blender.run([str(argument) for argument in arguments], resources, timeout=300)
    assert done.returncode == 0, done.stdout
    return done.stdout


def red_over_green(samples: list[dict[str, Any]]) -> float:
    """Red by green of the light of some samples."""
    light = np.array([sample["light"] for sample in samples]).mean(axis=0)
    return float(light[0] / light[1])


@pytest.mark.slow
@pytest.mark.usefixtures("real_blender")
def test_a_click_on_bake_radiosity_bakes_the_cornell_box(linux_zip: Path, tmp_path: Path) -> None:
    # The example's Cornell box, 2 m: left wall red, right wall green, panel of 14 W/(m2 sr) under the ceiling.
    # No closed form; the light is finite, below what the panel sends out after all bounces, and redder at the left.
    resources = tmp_path / "resources"
    resources.mkdir()
    SHOTS.mkdir(parents=True, exist_ok=True)
    for old in SHOTS.glob("*.png"):
        old.unlink()
    scene, baked = tmp_path / "box.blend", tmp_path / "baked.blend"
    result, values = tmp_path / "seen.json", tmp_path / "values.json"
    blender(resources, "--command", "extension", "install-file", "-r", "user_default", "-e", linux_zip)
    blender(resources, "-b", "--factory-startup", "--python-exit-code", "3",
            "--python", ROOT / "examples" / "cornell_box.py", "--", scene)
    job = {"tab": "Radiosity", "operator": "radiosity.bake", "shots": str(SHOTS), "save": str(baked),
           "result": str(result), "settings": {"preset": "draft", "resolution": 128}}
    done = real_blender.run([*WINDOW, str(scene), "--python", str(HERE / "drive.py")], resources, timeout=420,
                            program=SCREEN, extra={"DRIVE_JOB": json.dumps(job)})
    assert result.is_file(), done.stdout
    told = json.loads(result.read_text(encoding="utf-8"))
    assert told["error"] == "", done.stdout
    assert "Traceback" not in done.stdout, done.stdout
    # The window went on drawing and answering while the bake ran.
    assert told["seen"]["ticks_while_baking"] >= 2
    assert {path.stem for path in SHOTS.glob("*.png")} >= {"1-tab", "2-button", "4-done"}

    blender(resources, "-b", "--factory-startup", "--python-exit-code", "3", baked,
            "--python", HERE / "read_lightmaps.py", "--", values)
    found = json.loads(values.read_text(encoding="utf-8"))
    assert found["images"]
    for image in found["images"].values():
        assert image["finite"]
        assert image["lit"] > 0.3
        assert 1 < image["highest"] < BRIGHTEST
    assert {sample["object"] for sample in found["samples"]} >= {"Floor", "Ceiling", "Left Wall", "Right Wall"}
    floor = [sample for sample in found["samples"] if sample["object"] == "Floor"]
    assert all(0.02 < sum(sample["light"]) / 3 < 2 for sample in floor)
    left, right = ([sample for sample in floor if (sample["position"][0] < 1) == side] for side in (True, False))
    assert red_over_green(left) > 1.1 * red_over_green(right)

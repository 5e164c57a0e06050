"""A bake by mouse in the real Blender's window: the extension from the zip, the sidebar's tab, the button."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from radiosity.tools import real_blender

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
SHOTS = ROOT / "out" / "gui"
SCREEN = ("xvfb-run", "--auto-servernum", "--server-args=-screen 0 1400x900x24 +extension GLX -nolisten tcp", "blender")
WINDOW = ("--enable-event-simulate", "--window-geometry", "0", "0", "1400", "900")


def blender(resources: Path, *arguments: str | Path) -> str:
    """Run the real Blender without a window; its output. Fails on an exit code that is not 0."""
    done = real_blender.run([str(argument) for argument in arguments], resources, timeout=300)
    assert done.returncode == 0, done.stdout
    return done.stdout


@pytest.mark.slow
@pytest.mark.usefixtures("real_blender")
def test_a_click_on_bake_radiosity_bakes_the_cornell_box(linux_zip: Path, tmp_path: Path) -> None:
    # The example's Cornell box: a white floor and back wall, a red wall at one side, a green one at the other.
    # Exact answer: none in closed form; the images in the .blend are lit, and redder beside the red wall.
    resources = tmp_path / "resources"
    resources.mkdir()
    SHOTS.mkdir(parents=True, exist_ok=True)
    scene, baked = tmp_path / "box.blend", tmp_path / "baked.blend"
    result, values = tmp_path / "seen.json", tmp_path / "values.json"
    blender(resources, "--command", "extension", "install-file", "-r", "user_default", "-e", linux_zip)
    blender(resources, "-b", "--factory-startup", "--python-exit-code", "3",
            "--python", ROOT / "examples" / "cornell_box.py", "--", scene)
    job = {"tab": "Radiosity", "operator": "radiosity.bake", "shots": str(SHOTS), "save": str(baked),
           "result": str(result)}
    done = real_blender.run([*WINDOW, str(scene), "--python", str(HERE / "drive.py")], resources, timeout=420,
                            program=SCREEN, extra={"DRIVE_JOB": json.dumps(job)})
    assert result.is_file(), done.stdout
    told = json.loads(result.read_text(encoding="utf-8"))
    assert told["error"] == "", done.stdout
    blender(resources, "-b", "--factory-startup", "--python-exit-code", "3", baked,
            "--python", HERE / "read_lightmaps.py", "--", values)
    found = json.loads(values.read_text(encoding="utf-8"))
    print(told, found)
    assert found

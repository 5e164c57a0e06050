"""Compare with Cycles by mouse in the real Blender's window: cancelled in the middle, then to the end."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from radiosity.tests.gui.test_window import HERE, ROOT, SCREEN, SHOTS, WINDOW, blender
from radiosity.tools import real_blender

# Seconds that a window under software drawing may not answer; Cycles' shortest bake here would block it for longer.
LONGEST_GAP = 2.5


@pytest.mark.slow
@pytest.mark.usefixtures("real_blender")
def test_the_window_answers_while_cycles_bakes_and_shows_the_comparison(linux_zip: Path, tmp_path: Path) -> None:
    # The example's Cornell box. Exact answer: Esc ends Cycles within a second and leaves no image; the second run fills
    # the image editor, and writes a page.
    resources, scene, result = tmp_path / "resources", tmp_path / "box.blend", tmp_path / "seen.json"
    resources.mkdir()
    SHOTS.mkdir(parents=True, exist_ok=True)
    blender(resources, "--command", "extension", "install-file", "-r", "user_default", "-e", linux_zip)
    blender(resources, "-b", "--factory-startup", "--python-exit-code", "3",
            "--python", ROOT / "examples" / "cornell_box.py", "--", scene)
    job = {"tab": "Radiosity", "operator": "radiosity.compare", "shots": str(SHOTS), "save": "",
           "result": str(result), "settings": {"preset": "draft", "resolution": 64}}
    done = real_blender.run([*WINDOW, str(scene), "--python", str(HERE / "drive_compare.py")], resources, timeout=420,
                            program=SCREEN, extra={"DRIVE_JOB": json.dumps(job)})
    assert result.is_file(), done.stdout
    told = json.loads(result.read_text(encoding="utf-8"))
    assert told["error"] == "", done.stdout
    assert "Traceback" not in done.stdout, done.stdout
    seen = told["seen"]
    # On a busy machine the window, drawn in software, is late by itself; that is no time of the comparison's.
    assert seen["seconds_to_cancel"] < 1.0 + seen["gap_cancelled"]
    assert max(seen["gap_cancelled"], seen["gap_running"]) < LONGEST_GAP
    assert not [name for name in seen["images_after_cancel"] if name.startswith("Radiosity")]
    assert seen["shown"] == "Radiosity Compare"
    assert {"Lightmap_1 ours", "Lightmap_1 cycles", "Lightmap_1 error"} <= set(seen["images"])
    assert (tmp_path / "compare" / "compare.html").is_file()

"""Undo of a second bake in the real Blender's window: packed images and UV maps come back, replaced files do not."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from radiosity.tests.gui.test_live_window import installed
from radiosity.tests.gui.test_window import HERE, ROOT, SCREEN, SHOTS, WINDOW, blender
from radiosity.tools import real_blender as real_blender_tool

pytestmark = [pytest.mark.slow, pytest.mark.timeout(900)]
BAKE = ["press", "radiosity.bake"]
# Another size of the floor makes another layout, another seed makes none.
VISIT = [
    BAKE, ["change", "Floor", "scale", [1.4, 1, 1]], ["mark", "packed", True],
    BAKE, ["mark", "packed again", False],
    ["undo", "undo"], ["compare", "packed", "packed, undone"],
    ["undo", "redo"], ["compare", "packed again", "packed, redone"],
    ["change", "", "pack", False], BAKE, ["change", "Floor", "scale", [1, 1, 1]], ["mark", "files", True],
    BAKE, ["mark", "files again", False],
    ["undo", "undo"], ["note_results", "other layout, undone"],
    ["undo", "redo"], ["compare", "files again", "files, redone"],
    ["change", "", "seed", 1], ["mark", "seed", True],
    BAKE, ["undo", "undo"], ["note_results", "same layout, undone"], ["compare", "seed", "same layout, undone"],
]


@pytest.fixture(scope="module")
def seen(linux_zip: Path, tmp_path_factory: pytest.TempPathFactory, real_blender: None) -> dict[str, Any]:
    """One visit for all tests: the example's Cornell box, baked six times."""
    folder = tmp_path_factory.mktemp("undo")
    scene, result = folder / "box.blend", folder / "seen.json"
    SHOTS.mkdir(parents=True, exist_ok=True)
    blender(installed(folder, linux_zip), "-b", "--factory-startup", "--python-exit-code", "3",
            "--python", ROOT / "examples" / "cornell_box.py", "--", scene)
    job = {"tab": "Radiosity", "shots": str(SHOTS), "result": str(result), "visit": VISIT,
           "settings": {"preset": "draft", "error": 0.3, "resolution": 64, "pack": True, "watch": False},
           "fingerprint": str(HERE.parent / "blender" / "fingerprint.py")}
    done = real_blender_tool.run([*WINDOW, str(scene), "--python", str(HERE / "drive.py")], folder / "resources",
                                 timeout=780, program=SCREEN, extra={"DRIVE_JOB": json.dumps(job)})
    assert result.is_file(), done.stdout
    told = json.loads(result.read_text(encoding="utf-8"))
    assert told["error"] == "", done.stdout
    assert "Traceback" not in done.stdout, done.stdout
    return dict(told["seen"])


def test_undo_of_a_second_bake_brings_back_a_packed_first_one(seen: dict[str, Any]) -> None:
    # The floor was made wider between two packed bakes. Exact answer: UV maps, images, all else are the first bake's
    # after undo, and the second's after redo.
    assert seen["differences"]["packed, undone"] == []
    assert seen["differences"]["packed, redone"] == []


def test_undo_of_a_second_bake_shows_no_replaced_file_by_another_layout(seen: dict[str, Any]) -> None:
    # The same with files. Exact answer: no object has a result after undo; after redo all is as after the second bake.
    assert seen["results"]["other layout, undone"] == []
    assert seen["differences"]["files, redone"] == []


def test_undo_of_a_second_bake_keeps_results_where_the_layout_is_the_same(seen: dict[str, Any]) -> None:
    # Another seed between two bakes. Exact answer: all results stay, and of the file only the image's pixels differ.
    assert "Floor" in seen["results"]["same layout, undone"]
    assert {line.split(":")[0] for line in seen["differences"]["same layout, undone"]} <= {"images/Lightmap_1.pixels"}

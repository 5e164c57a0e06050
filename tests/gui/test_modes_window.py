"""Modes, workspaces and the extension changed while bakes are on their way, in the real Blender's window."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from radiosity.tests.gui.test_live_window import installed
from radiosity.tests.gui.test_window import HERE, ROOT, SCREEN, SHOTS, WINDOW, blender
from radiosity.tools import real_blender as real_blender_tool

pytestmark = [pytest.mark.slow, pytest.mark.timeout(900)]


@pytest.fixture(scope="module")
def seen(linux_zip: Path, tmp_path_factory: pytest.TempPathFactory, real_blender: None) -> dict[str, Any]:
    """One visit for all tests (see `drive_modes`): the example's Cornell box, whose meshes have no UV map."""
    folder = tmp_path_factory.mktemp("modes")
    resources, scene, result = installed(folder, linux_zip), folder / "box.blend", folder / "seen.json"
    SHOTS.mkdir(parents=True, exist_ok=True)
    blender(resources, "-b", "--factory-startup", "--python-exit-code", "3",
            "--python", ROOT / "examples" / "cornell_box.py", "--", scene)
    job = {"shots": str(SHOTS), "result": str(result),
           "settings": {"error": 0.05, "resolution": 64, "watch": False}}
    done = real_blender_tool.run([*WINDOW, str(scene), "--python", str(HERE / "drive_modes.py")], resources,
                                 timeout=780, program=SCREEN, extra={"DRIVE_JOB": json.dumps(job)})
    assert result.is_file(), done.stdout
    told = json.loads(result.read_text(encoding="utf-8"))
    assert told["error"] == "", done.stdout
    assert "Traceback" not in done.stdout, done.stdout
    return dict(told["seen"])


def test_a_bake_in_edit_mode_is_refused(seen: dict[str, Any]) -> None:
    # Exact answer: one line, and no mesh has a UV map.
    assert "object 'Floor' is in Edit Mode: leave it (Tab) and bake again" in seen["reports"]
    assert not any(seen["after_refused"].values())


def test_a_mesh_that_is_edited_during_a_bake_gets_its_result(seen: dict[str, Any]) -> None:
    # Tab in the middle, and vertices being moved when the worker ends. Exact answer: the bake waits for that, says so,
    # leaves Edit Mode, stores all, and one undo takes all of it back.
    assert seen["waits"]
    assert any("end the tool in Edit Mode" in text for text in seen["waits_text"] if text)
    assert seen["mode_after"] == "OBJECT"
    assert {tuple(names) for names in seen["after_tab"].values()} == {("UVMap", "UVMap_Lightmap")}
    assert not any(seen["after_undo"].values())


def test_another_workspace_keeps_no_line_of_a_bake(seen: dict[str, Any]) -> None:
    assert len(seen["told_in"]) == 1
    assert seen["left_texts"] == []


def test_switching_the_extension_off_ends_its_bake(seen: dict[str, Any]) -> None:
    # Exact answer: the work is over at once, no status bar tells of it, and the next bake goes to its end.
    assert not seen["runs_after_off"]
    assert seen["texts_after_off"] == []
    assert seen["starts_after_on"]
    assert all("UVMap_Lightmap" in names for names in seen["after_on"].values())

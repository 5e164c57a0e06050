"""A watched bake, by mouse in the real Blender's window: cancelled, kept as good enough, left in its middle."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from radiosity.tests.gui.test_window import HERE, ROOT, SCREEN, SHOTS, WINDOW, blender
from radiosity.tools import real_blender as real_blender_tool

pytestmark = [pytest.mark.slow, pytest.mark.timeout(900)]
# Seconds that the extension may keep the window's thread in one go, and that Esc may take.
LONGEST_CALL, LONGEST_CANCEL = 0.1, 1.0
# Seconds of that thread before the bake, where its panel is shown: a software driver compiles the looks' shader then.
LONGEST_IDLE = 0.2
# Seconds that a window, drawn in software on cores that the bake has too, may be later than it is by itself.
LONGEST_GAP = 3.0
# What is printed of a visit.
TOLD = ("gaps", "own", "held", "seconds_to_look", "seconds_to_draw", "spent_to_look", "seconds_to_cancel")


def watch(folder: Path, scene: Path, job: dict[str, Any],
          window: tuple[str, ...] = WINDOW) -> tuple[dict[str, Any], int]:
    """Let `drive_live` visit a scene in a real Blender's window, where the extension is installed in `folder`; what it
    saw, and Blender's exit code. `job` has what the driver is told beside paths."""
    result = folder / "seen.json"
    SHOTS.mkdir(parents=True, exist_ok=True)
    told_to = {"tab": "Radiosity", "shots": str(SHOTS), "result": str(result),
               "fingerprint": str(HERE.parent / "blender" / "fingerprint.py"), **job}
    done = real_blender_tool.run([*window, str(scene), "--python", str(HERE / "drive_live.py")], folder / "resources",
                                 timeout=780, program=SCREEN, extra={"DRIVE_JOB": json.dumps(told_to)})
    assert result.is_file(), done.stdout
    told = json.loads(result.read_text(encoding="utf-8"))
    print({name: told["seen"].get(name) for name in TOLD})
    assert told["error"] == "", done.stdout
    assert "Traceback" not in done.stdout, done.stdout
    return dict(told["seen"]), done.returncode


def installed(folder: Path, linux_zip: Path) -> Path:
    """The user's folder of a Blender that has the extension, in `folder`."""
    resources = folder / "resources"
    resources.mkdir()
    blender(resources, "--command", "extension", "install-file", "-r", "user_default", "-e", linux_zip)
    return resources


@pytest.fixture(scope="module")
def seen(linux_zip: Path, tmp_path_factory: pytest.TempPathFactory, real_blender: None) -> dict[str, Any]:
    """One visit for all tests (see `drive_live`): the example's Cornell box."""
    folder = tmp_path_factory.mktemp("live")
    scene = folder / "box.blend"
    blender(installed(folder, linux_zip), "-b", "--factory-startup", "--python-exit-code", "3",
            "--python", ROOT / "examples" / "cornell_box.py", "--", scene)
    found, code = watch(folder, scene, {"settings": {"preset": "high", "resolution": 512}})
    assert code == 0
    return found


def test_the_window_answers_while_it_bakes(seen: dict[str, Any]) -> None:
    # Everything that the bake does in the window's thread, in seconds of that thread: parts of reading the scene, looks
    # at the worker, drawing, writing. The box has no world to render and no image to bake.
    assert {"export", "draft", "draw", "write"} <= set(seen["own"])
    late = {what: seconds for what, seconds in seen["own"].items()
            if seconds > (LONGEST_IDLE if what == "idle" else LONGEST_CALL)}
    assert late == {}
    assert max(seen["gaps"].values()) < LONGEST_GAP + seen["gaps"]["idle"]


def test_esc_ends_the_work_within_a_second_and_leaves_the_file_as_it_was(seen: dict[str, Any]) -> None:
    # Exact answer: no datablock differs from before the bake, though a first look and a draft had been shown.
    # On a busy machine the window is late by itself; that is no time of the bake's.
    assert seen["seconds_to_cancel"] < LONGEST_CANCEL + seen["gaps"]["idle"]
    assert seen["after_cancel"] == []


def test_good_enough_keeps_the_draft_in_one_undo_step(seen: dict[str, Any]) -> None:
    # The first draft has half of the 512 pixels, the finer one, which may be there before the button is pressed, all.
    # Exact answer: those of the draft that was shown last; the report has its own estimate and the user's wish; the
    # file differs until one undo.
    side = {"error 0.3": 256, "error 0.06": 512}[seen["kept"]]
    report = seen["report"]
    assert report["good_enough"] is True
    assert {tuple(output["resolution"]) for output in report["outputs"]} == {(side, side)}
    assert report["error"]["wanted"] == pytest.approx(0.01)
    assert report["error"]["estimated"]["lumels_audited"] > 0
    assert seen["after_keep"] != []
    assert seen["after_undo"] == []


def test_loading_a_file_and_quitting_end_a_bake(seen: dict[str, Any]) -> None:
    # Blender was quit in the middle of a bake, and its exit code was 0.
    assert not seen["runs_after_load"]
    assert seen["runs_at_quit"]

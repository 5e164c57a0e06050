"""Live relight of an animated light, and names in another language, in the real Blender's window."""

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
    """One visit for all tests (see `drive_relight`): the example's Cornell box."""
    folder = tmp_path_factory.mktemp("relight")
    resources, scene, result = installed(folder, linux_zip), folder / "box.blend", folder / "seen.json"
    SHOTS.mkdir(parents=True, exist_ok=True)
    blender(resources, "-b", "--factory-startup", "--python-exit-code", "3",
            "--python", ROOT / "examples" / "cornell_box.py", "--", scene)
    job = {"tab": "Radiosity", "shots": str(SHOTS), "result": str(result),
           "settings": {"error": 0.1, "resolution": 64, "watch": False, "groups": "lamp"}}
    done = real_blender_tool.run([*WINDOW, str(scene), "--python", str(HERE / "drive_relight.py")], resources,
                                 timeout=780, program=SCREEN, extra={"DRIVE_JOB": json.dumps(job)})
    assert result.is_file(), done.stdout
    told = json.loads(result.read_text(encoding="utf-8"))
    assert told["error"] == "", done.stdout
    assert "Traceback" not in done.stdout, done.stdout
    return dict(told["seen"])


def test_live_follows_a_light_to_another_frame(seen: dict[str, Any]) -> None:
    # The panel has a quarter of its strength in frame 20. Exact answer: a quarter of the light.
    assert seen["after"] == pytest.approx(seen["before"] / 4, rel=0.01)


def test_names_of_objects_are_not_translated(seen: dict[str, Any]) -> None:
    # The table of lux in German. Exact answer: its heads are, as Durchschnitt, and the object Floor is no Boden.
    assert "Durchschnitt" in seen["table"]
    assert "'Floor'" in seen["table"]

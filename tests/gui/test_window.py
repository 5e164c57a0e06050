"""By mouse in the real Blender's window: the extension from the zip, the sidebar's tab, every button in one visit."""

from __future__ import annotations

import csv
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from radiosity.tools import real_blender as real_blender_tool

# Software drawing and Eevee's shaders take their time where other work goes on.
pytestmark = [pytest.mark.slow, pytest.mark.timeout(900)]
HERE = Path(__file__).parent
ROOT = HERE.parents[1]
SHOTS = ROOT / "out" / "gui"
SCREEN = ("xvfb-run", "--auto-servernum", "--server-args=-screen 0 1400x1600x24 +extension GLX -nolisten tcp",
          "blender")
# The panel's radiance over 1 - the highest reflectance, W/(m2 sr): no light in the box is brighter.
BRIGHTEST = 14 / (1 - 0.73)
WINDOW = ("--enable-event-simulate", "--window-geometry", "0", "0", "1400", "1600")


def blender(resources: Path, *arguments: str | Path) -> str:
    """Run the real Blender without a window; its output. Fails on an exit code that is not 0."""
    done = real_blender_tool.run([str(argument) for argument in arguments], resources, timeout=300)
    assert done.returncode == 0, done.stdout
    return done.stdout


def red_over_green(samples: list[dict[str, Any]]) -> float:
    """Red by green of the light of some samples."""
    light = np.array([sample["light"] for sample in samples]).mean(axis=0)
    return float(light[0] / light[1])


# Metres between the working plane's points: so many that measuring them outlasts several of the driver's ticks.
SPACING = 0.005
# Seconds to let Eevee compile its shaders, and Cycles draw.
EEVEE, CYCLES = 25.0, 3.0


@dataclass(frozen=True)
class Visit:
    """What came of the visit: what was seen, the .blend after the bake and at the end, and where they lie."""

    seen: dict[str, Any]
    baked: Path
    last: Path
    folder: Path
    resources: Path


def visit_of(baked: Path, last: Path) -> list[list[Any]]:
    """The steps of the visit (see drive.py)."""
    return [
        ["view_camera"], ["shot", "1-tab"], ["mark", "before", True],
        ["press", "radiosity.bake"], ["shot", "2-baked"], ["save", str(baked)], ["mark", "baked", False],
        ["undo", "undo"], ["compare", "before", "undo"], ["undo", "redo"], ["compare", "baked", "redo"],
        ["survey"],
        ["press", "radiosity.preview"], ["idle", EEVEE], ["shot", "3-preview-eevee"],
        ["press", "radiosity.preview"], ["compare", "baked", "preview off"],
        ["render_with", "CYCLES"], ["press", "radiosity.preview"], ["idle", CYCLES], ["shot", "4-preview-cycles"],
        ["press", "radiosity.lux_view"], ["idle", CYCLES], ["shot", "5-lux"],
        ["cancel", "radiosity.working_plane"],
        ["press", "radiosity.working_plane"], ["idle", CYCLES], ["shot", "6-working-plane"],
        ["press", "radiosity.lux_csv"],
        ["press", "radiosity.leak_view"], ["press", "radiosity.worst"], ["idle", CYCLES], ["shot", "7-leaks"],
        ["press", "radiosity.check"], ["shot", "8-checks"], ["render_with", ""],
        ["press", "radiosity.clear"], ["shot", "9-clear"], ["compare", "before", "clear"],
        ["flip", "Floor", "radiosity.exclude"], ["save", str(last)],
    ]


@pytest.fixture(scope="module")
def visit(linux_zip: Path, tmp_path_factory: pytest.TempPathFactory, real_blender: None) -> Visit:
    """One visit for all tests: the example's Cornell box, the tab, the buttons."""
    folder = tmp_path_factory.mktemp("visit")
    resources = folder / "resources"
    resources.mkdir()
    SHOTS.mkdir(parents=True, exist_ok=True)
    for old in SHOTS.glob("[0-9]-*.png"):
        old.unlink()
    scene, baked, last, result = (folder / name for name in ("box.blend", "baked.blend", "last.blend", "seen.json"))
    blender(resources, "--command", "extension", "install-file", "-r", "user_default", "-e", linux_zip)
    blender(resources, "-b", "--factory-startup", "--python-exit-code", "3",
            "--python", ROOT / "examples" / "cornell_box.py", "--", scene)
    job = {"tab": "Radiosity", "shots": str(SHOTS), "result": str(result), "visit": visit_of(baked, last),
           "settings": {"preset": "draft", "resolution": 128}, "views": {"spacing": SPACING},
           "fingerprint": str(HERE.parent / "blender" / "fingerprint.py")}
    done = real_blender_tool.run([*WINDOW, str(scene), "--python", str(HERE / "drive.py")], resources, timeout=780,
                                 program=SCREEN, extra={"DRIVE_JOB": json.dumps(job)})
    assert result.is_file(), done.stdout
    told = json.loads(result.read_text(encoding="utf-8"))
    assert told["error"] == "", done.stdout
    assert "Traceback" not in done.stdout, done.stdout
    return Visit(told["seen"], baked, last, folder, resources)


def test_a_click_on_bake_radiosity_bakes_the_cornell_box(visit: Visit) -> None:
    # The example's Cornell box, 2 m: left wall red, right wall green, panel of 14 W/(m2 sr) under the ceiling.
    # No closed form; the light is finite, below what the panel sends out after all bounces, and redder at the left.
    # The window went on drawing and answering while the bake ran.
    assert visit.seen["ticks of radiosity.bake"] >= 2
    values = visit.folder / "values.json"
    blender(visit.resources, "-b", "--factory-startup", "--python-exit-code", "3", visit.baked,
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


def test_undo_after_a_bake_restores_all_data_and_redo_brings_it_back(visit: Visit) -> None:
    # Exact answer: no datablock differs from before the bake after undo, nor from the baked ones after redo.
    assert visit.seen["differences"]["undo"] == []
    assert visit.seen["differences"]["redo"] == []


def test_views_switch_on_and_off_by_their_buttons(visit: Visit) -> None:
    # The baked look from a solid viewport, and off again. Exact answer: the file as after the bake, pictures of each.
    assert visit.seen["differences"]["preview off"] == []
    assert visit.seen["shading"]["radiosity.preview"] == "RENDERED"
    modes = visit.seen["mode"]
    assert [modes[f"radiosity.{name}"] for name in ("preview", "lux_view", "working_plane", "leak_view", "clear")] == [
        "BAKED", "LUX", "LUX", "LEAKS", "OFF"]
    assert visit.seen["ticks of radiosity.working_plane"] >= 1
    assert {path.stem for path in SHOTS.glob("*.png")} >= {
        "1-tab", "2-baked", "3-preview-eevee", "4-preview-cycles", "5-lux", "6-working-plane", "7-leaks", "8-checks",
        "9-clear", "object"}
    table = list(csv.reader((visit.folder / "lightmaps" / "lux.csv").read_text(encoding="utf-8").splitlines()))
    assert {row[0] for row in table} >= {"Floor", "Ceiling", "Plane 0.8 m"}


def test_esc_ends_the_measuring_of_a_working_plane(visit: Visit) -> None:
    # Esc while points are measured. Exact answer: the table of lux has baked objects alone.
    assert visit.seen["ran radiosity.working_plane"]
    assert "Floor" in visit.seen["rows after Esc"]
    assert not [name for name in visit.seen["rows after Esc"] if name.startswith("Plane")]


def test_a_click_on_clear_leaves_the_file_as_it_was_before_the_bake(visit: Visit) -> None:
    # Exact answer: what differs is the 3D cursor, which the button for the worst place has moved, and its selection.
    left = [line for line in visit.seen["differences"]["clear"] if "cursor" not in line and ".selected" not in line]
    assert left == []


def test_a_click_in_the_object_properties_excludes_the_object(visit: Visit) -> None:
    # The floor's check box was clicked once. Exact answer: the saved floor is excluded, and check says "blocks only".
    told = blender(visit.resources, "-b", visit.last, "--command", "radiosity", "check")
    assert any(line.startswith("blocks only") and "Floor" in line for line in told.splitlines()), told

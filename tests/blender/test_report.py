"""The report as it is written, and progress as it is shown."""

from __future__ import annotations

import io
import json
import math
import os
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from radiosity.radiosity_addon import report
from radiosity.radiosity_addon.blend_file import open_blend
from radiosity.radiosity_addon.progress import STAGE_WEIGHTS, Progress, Terminal, clock
from radiosity.radiosity_addon.request import Request, folder_beside
from radiosity.solver.errors import OutputError, SettingsError


def with_error(low: float) -> dict[str, Any]:
    return {"error": {"wanted": 0.03, "estimated": {"rms": low + 0.01, "rms_low": low, "rms_high": low + 0.02}}}


@pytest.mark.parametrize(("low", "reached"), [(0.0, True), (0.03, True), (0.031, False)])
def test_the_wanted_error_is_missed_only_where_the_whole_interval_is_above_it(low: float, reached: bool) -> None:
    assert report.reached(with_error(low)) is reached


def test_the_report_is_plain_json_whatever_is_in_it(tmp_path: Path) -> None:
    # NumPy's types, paths, and numbers that are not finite. Exact answer: Python's, text, and null.
    path = tmp_path / "report.json"
    report.write({"a": np.float32(0.5), "b": np.arange(2), "c": math.nan, "d": (Path("x"), np.bool_(True))}, path)
    assert json.loads(path.read_text()) == {"a": 0.5, "b": [0, 1], "c": None, "d": ["x", True]}
    assert list(tmp_path.iterdir()) == [path]


def test_paths_are_relative_to_the_reports_folder(tmp_path: Path) -> None:
    found = report.relative_to_report(tmp_path / "maps" / "a.exr", tmp_path / "told" / "report.json")
    assert found == "../maps/a.exr"


def test_a_folder_that_is_a_file_is_refused_before_the_bake(tmp_path: Path) -> None:
    (tmp_path / "taken").touch()
    with pytest.raises(OutputError, match="taken can't be written to"):
        Request(output=tmp_path / "taken").check_writable()


@pytest.mark.parametrize("report_path", ["taken/report.json", "new/deep/taken.json/report.json", "taken.json"])
def test_a_refusal_leaves_no_folder_behind(tmp_path: Path, report_path: str) -> None:
    # New folders for the images, and a report that can't be: in a file, in a folder with an impossible name, a folder.
    (tmp_path / "taken").touch()
    (tmp_path / "taken.json").mkdir()
    place = tmp_path / report_path.replace("deep", "deep/" + "x" * 300)
    with pytest.raises(OutputError):
        Request(output=tmp_path / "new" / "deep", report=place).check_writable()
    assert {item.name for item in tmp_path.iterdir()} == {"taken", "taken.json"}


@pytest.mark.parametrize("length", [250, 300])
def test_a_name_that_is_too_long_is_refused_before_the_bake(tmp_path: Path, length: int) -> None:
    # Of the report, the .blend and the folder, too long for the system (255) or only while it is written. Exact answer:
    # one line, and no folder is left.
    name, out = "x" * (length - 6), tmp_path / "out"
    for request in (Request(output=out, report=out / f"{name}.json"), Request(save=out / f"{name}.blend")):
        with pytest.raises(OutputError, match=r"can't be written \(file name too long\): choose another name"):
            request.check_writable()
    with pytest.raises(OutputError, match=r"can't be written to \(file name too long\)"):
        Request(output=out / ("x" * 300)).check_writable()
    with pytest.raises(SettingsError, match="does not exist"):
        open_blend(tmp_path / ("x" * 300 + ".blend"))
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("text", ["BLENDER-v402", '{"scene": "mine"}', '{"scene": ', "[1]", "notes"])
def test_a_report_takes_the_place_of_no_other_file(tmp_path: Path, text: str) -> None:
    # A file of the user's by the report's name, given or in the output folder. Exact answer: refused before any work,
    # the file as it was.
    path = tmp_path / "report.json"
    path.write_text(text)
    for request in (Request(output=tmp_path), Request(output=tmp_path / "out", report=path)):
        with pytest.raises(SettingsError, match=r"report\.json is no report, and only reports are overwritten by one"):
            request.check_writable()
    assert [item.name for item in tmp_path.iterdir()] == ["report.json"]
    assert path.read_text() == text


@pytest.mark.parametrize("kept", [{}, {"energy": None}, {"bakes": []}])
def test_a_report_takes_the_place_of_an_earlier_one(tmp_path: Path, kept: dict[str, Any]) -> None:
    # Of whichever command, and of a file that holds nothing.
    path = tmp_path / "report.json"
    path.touch()
    assert Request(output=tmp_path).check_writable() == []
    report.write({"scene": "a.blend", "blender": "5.0.1", "settings": {}, "warnings": [], **kept}, path)
    assert Request(output=tmp_path).check_writable() == []


@pytest.mark.parametrize(("names", "line"), [
    ({"report": "Lightmap_1.exr"}, "--report .*Lightmap_1.exr has the name of an image"),
    ({"report": "new.blend"}, "--report .*new.blend has the name of"),
    ({"save": "both.json", "report": "both.json"}, "--save .*both.json does not end in .blend"),
    ({"save": "Lightmap_1.exr"}, "--save .*Lightmap_1.exr does not end in .blend"),
])
def test_no_two_results_may_have_one_name(tmp_path: Path, names: dict[str, str], line: str) -> None:
    request = Request(output=tmp_path, **{word: tmp_path / name for word, name in names.items()})
    with pytest.raises(SettingsError, match=line):
        request.check_writable()


@pytest.mark.skipif(sys.platform == "win32", reason="there are no pipes with a path")
def test_a_report_goes_into_no_device(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    with pytest.raises(OutputError, match="pipe is no file: give the name of a file"):
        Request(report=pipe).check_writable()


def test_the_folder_stands_beside_the_blend_and_needs_one() -> None:
    assert folder_beside("/scenes/room.blend", advice="") == Path("/scenes/lightmaps")
    assert folder_beside("/scenes/room.blend", "//maps", advice="") == Path("/scenes/maps")
    assert folder_beside("", "/tmp/maps", advice="") == Path("/tmp/maps")
    with pytest.raises(SettingsError, match=r"not saved.*: save it first"):
        folder_beside("", "//maps", advice="save it first")


def test_progress_never_goes_back_and_ends_at_the_whole() -> None:
    # All stages in order, one of them twice, one never. Exact answer: a rising part from 0 to 1.
    progress, seen = Progress(), []
    for stage in [*STAGE_WEIGHTS, "gather", "write"]:
        for part in (0.0, 0.5, 1.0):
            if stage != "unwrap":
                progress(stage, part)
                seen.append(progress.fraction)
    assert seen == sorted(seen)
    assert seen[0] == 0
    assert seen[-1] == pytest.approx(1)


def test_a_log_gets_one_line_a_stage_with_per_cent() -> None:
    # The stages before the gather weigh 32 of 106. Exact answer: 30 %, told once.
    progress, log = Progress(), io.StringIO()
    terminal = Terminal(progress, log)
    for part in (0.0, 0.3, 0.6):
        progress("gather", part)
        terminal.show()
    terminal.close()
    assert log.getvalue() == "gather: 30%\n"


def test_time_left_is_minutes_and_seconds() -> None:
    assert [clock(0.4), clock(65), clock(3600)] == ["0:00", "1:05", "60:00"]

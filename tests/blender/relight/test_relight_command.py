"""Relight by the command: report, exit codes, an interrupt, another file of the same scene."""

from __future__ import annotations

import json
import math
import signal
import subprocess
import sys
import threading
import time
from argparse import Namespace
from typing import Any

import bpy
import numpy as np
import pytest
from radiosity.radiosity_addon import cache
from radiosity.radiosity_addon.relight import relight_command
from radiosity.radiosity_addon.relight_request import kept_in, relight_request
from radiosity.solver import image_file
from radiosity.solver.errors import Cancelled
from radiosity.tests.blender.relight.hand import lamp, pixels, relight


def relit_by_command() -> int:
    """What `relight` does on the command line, in this Blender; its exit code."""
    scene = bpy.context.scene
    return relight_command(relight_request(scene, Namespace()), scene, bpy.context.view_layer, {})


def test_the_report_has_all_that_a_bakes_has(baked, tmp_path):
    # Nothing changed. Exact answer: the keys of the bake's report and `groups`; where light goes is null, as no more is
    # known than where that of the bake went; what the lamps don't change is what it was.
    path = tmp_path / "lightmaps" / "report.json"
    before = json.loads(path.read_text())
    relight()
    after = json.loads(path.read_text())
    assert after.keys() == {*before, "groups"}
    assert after["energy"] is None
    for word in ("error", "lumels", "triangles", "patches", "cells", "solver", "materials"):
        assert after[word] == before[word]


def test_an_error_that_the_bake_did_not_reach_is_told_by_the_exit_code(baked, capsys):
    # Kept light whose bake ended short of the error that was wanted. Exact answer: 4 instead of 0, as of the bake, one
    # line, and the image follows all the same.
    assert relit_by_command() == 0
    about = kept_in(bpy.context.scene) / cache.ABOUT
    told = json.loads(about.read_text())
    told["report"]["error"]["estimated"]["rms_low"] = 1.0
    about.write_text(json.dumps(told))
    lamp().energy = 2
    capsys.readouterr()
    assert relit_by_command() == 4
    assert "the wanted error of 20.00% was not reached" in capsys.readouterr().err
    assert pixels() == pytest.approx(2, rel=0.01)


@pytest.mark.skipif(sys.platform == "win32", reason="there is no SIGINT to send")
def test_an_interrupt_cancels_a_relight(baked):
    # Ctrl C as soon as the relight listens to it. Exact answer: code 130, the image and Ctrl C as they were.
    lamp().energy = 2
    before, handler = pixels(), signal.getsignal(signal.SIGINT)

    def interrupt() -> None:
        while signal.getsignal(signal.SIGINT) is handler:
            time.sleep(1e-4)
        signal.raise_signal(signal.SIGINT)

    threading.Thread(target=interrupt, daemon=True).start()
    with pytest.raises(Cancelled) as cancelled:
        relit_by_command()
    assert cancelled.value.exit_code == 130
    assert np.array_equal(pixels(), before)
    assert signal.getsignal(signal.SIGINT) is handler


def command(*arguments: Any) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, "-m", "radiosity", *map(str, arguments)], capture_output=True, text=True,
                          timeout=300, check=False)


def test_the_command_line_relights_another_file_of_the_same_scene(stage, tmp_path):
    # The sun doubled in a file that was never baked, with the groups of one that was. Exact answer: code 0, an image of
    # 2 W/m2, a saved .blend with the UV map; a word that asks for another bake: code 2.
    path, out = tmp_path / "scene.blend", tmp_path / "out"
    lamp().energy = 1
    bpy.ops.wm.save_mainfile()
    done = command("bake", path, "--error", ".2", "--resolution", "32", "--groups", "lamp", "--output", out)
    assert done.returncode == 0, done.stderr
    lamp().energy = 2
    bpy.ops.wm.save_mainfile()
    done = command("relight", path, "--output", out, "--save", tmp_path / "relit.blend", "--report", out / "relit.json")
    assert done.returncode == 0, done.stderr
    assert "relit" in done.stdout
    told = json.loads((out / "relit.json").read_text())["outputs"][0]
    assert image_file.read_exr(out / told["image"]).max() * math.pi == pytest.approx(2, rel=0.01)
    done = command("relight", path, "--output", out, "--resolution", "64")
    assert done.returncode == 2
    assert "error: resolution is 64, and the kept light was baked with 32: leave it away, or bake again" in done.stderr
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "relit.blend"))
    assert "UVMap_Lightmap" in bpy.data.objects["Square"].data.uv_layers
    assert pixels() == pytest.approx(2, rel=0.01)

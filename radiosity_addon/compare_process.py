"""Starts another Blender for Cycles' part of a comparison, and looks after it: baking in this one would block it."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import bpy

from ..solver.errors import Cancelled, RadiosityError
from .compare_child import STATUS

# What the other Blender runs: this add-on's code under a name of its own, out of the same folder. Its own extensions
# stay off, and the wheels are found where they are found here.
BOOT = """
import importlib, importlib.util, json, os, sys
import bpy
job = sys.argv[-1]
with open(job, encoding="utf-8") as file:
    known = json.load(file)
sys.path[:0] = [path for path in known["sys_path"] if path not in sys.path]
root = known["package"]
spec = importlib.util.spec_from_file_location("radiosity_child", os.path.join(root, "__init__.py"),
                                              submodule_search_locations=[root])
sys.modules["radiosity_child"] = importlib.util.module_from_spec(spec)
spec.loader.exec_module(sys.modules["radiosity_child"])
importlib.import_module("radiosity_child.radiosity_addon.compare_child").main(job)
if not bpy.app.binary_path:
    # All is written. As a module, Blender 4.2 may crash when Python tidies up at its end.
    os._exit(0)
"""
# Exit code of a Blender whose script failed.
FAILED = 3
# Seconds between two looks, and how long a Blender that was asked to end may take.
TICK, GRACE = 0.1, 2.0
# Python's last word on an error; and how many lines of what was said are looked through for it.
REASON = re.compile(r"\w+(Error|Exception)\b: ")
LAST_LINES = 40

Told = Callable[[str, float], None]


def run_job(job: dict[str, Any], folder: Path, told: Told, cancelled: Callable[[], bool]) -> None:
    """Run a job of `compare_child.py` to its end.

    Parameters
    ----------
    job : as JSON takes it.
    folder : where job, results and the log are.
    told : called with what is done and the fraction of it, now and then.
    cancelled : asked now and then whether to stop.

    Raises
    ------
    RadiosityError
        If the other Blender fails, with its own last word.
    Cancelled
        If it was asked to stop; the other Blender has ended then.
    """
    path, log_path = folder / f"{job['do']}.json", folder / f"{job['do']}.log"
    package = str(Path(__file__).resolve().parents[1])
    path.write_text(json.dumps({**job, "folder": str(folder), "package": package, "sys_path": sys.path}),
                    encoding="utf-8")
    (folder / STATUS).unlink(missing_ok=True)
    with tempfile.TemporaryDirectory(prefix="radiosity-resources-") as resources, log_path.open("wb") as log:
        # Standard input stays open as long as this program lives; the other one ends when it closes.
        process = subprocess.Popen(_command(path), stdin=subprocess.PIPE, stdout=log, stderr=subprocess.STDOUT,
                                   env={**os.environ, "BLENDER_USER_RESOURCES": resources, **_temporary(folder)})
        try:
            _watch(process, folder / STATUS, told, cancelled)
        finally:
            _end(process)
    if process.returncode:
        raise RadiosityError(f"Cycles could not {job['do']} the twin of the scene ({_reason(log_path, process)}): "
                             "see that the scene renders with Cycles, and that there is memory for it twice")


def _command(job: Path) -> list[str]:
    """This program once more, without a window: the bpy module in its Python, or Blender itself."""
    if not bpy.app.binary_path:
        return [sys.executable, "-I", "-c", BOOT, str(job)]
    return [bpy.app.binary_path, "--background", "--factory-startup", "-noaudio", "--python-exit-code", str(FAILED),
            "--python-expr", BOOT, "--", str(job)]


def _temporary(folder: Path) -> dict[str, str]:
    """Where the other Blender keeps its own temporary files: they go with ours, however it ends."""
    return dict.fromkeys(("TMPDIR", "TEMP", "TMP"), str(folder))


def _watch(process: subprocess.Popen[bytes], status: Path, told: Told, cancelled: Callable[[], bool]) -> None:
    stage, since = "", time.monotonic()
    while process.poll() is None:
        if cancelled():
            raise Cancelled("the comparison was cancelled: nothing was changed")
        known = _read(status)
        if known and known["stage"] != stage:
            stage, since = known["stage"], time.monotonic()
        if known:
            expected = known["expected"]
            told(stage, min((time.monotonic() - since) / expected, 1.0) if expected else 0.0)
        time.sleep(TICK)


def _read(status: Path) -> dict[str, Any]:
    try:
        found: dict[str, Any] = json.loads(status.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}  # not there yet, or just being replaced
    return found


def _end(process: subprocess.Popen[bytes]) -> None:
    """End it if it still runs."""
    if process.stdin is not None:
        process.stdin.close()
    if process.poll() is None:
        process.terminate()
    try:
        process.wait(GRACE)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def _reason(log: Path, process: subprocess.Popen[bytes]) -> str:
    """The last line of an error in what it said."""
    lines = log.read_text(encoding="utf-8", errors="replace").splitlines()[-LAST_LINES:]
    errors = [line.strip() for line in lines if REASON.match(line)]
    return errors[-1] if errors else f"exit code {process.returncode}"

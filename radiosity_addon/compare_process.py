"""Starts another Blender for Cycles' part of a comparison, and looks after it: baking in this one would block it."""

from __future__ import annotations

import json
import os
import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ..solver.errors import Cancelled, RadiosityError
from . import child_blender
from .compare_child import STATUS

# Seconds between two looks.
TICK = 0.1

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
    path.write_text(json.dumps({**job, **child_blender.known("compare_child", folder)}), encoding="utf-8")
    (folder / STATUS).unlink(missing_ok=True)
    with tempfile.TemporaryDirectory(prefix="radiosity-resources-") as resources, log_path.open("wb") as log:
        # Standard input stays open as long as this program lives; the other one ends when it closes.
        process = subprocess.Popen(
            child_blender.command(path), stdin=subprocess.PIPE, stdout=log, stderr=subprocess.STDOUT,
            env={**os.environ, "BLENDER_USER_RESOURCES": resources, **child_blender.temporary(folder)})
        try:
            _watch(process, folder / STATUS, told, cancelled)
        finally:
            _end(process)
    if process.returncode:
        reason = child_blender.reason(log_path, process)
        raise RadiosityError(f"Cycles could not {job['do']} the twin of the scene ({reason}): see that the "
                             "scene renders with Cycles, and that there is memory for it twice")


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
    """End it if it still runs: at once, as all that it writes goes with its folder."""
    if process.stdin is not None:
        process.stdin.close()
    if process.poll() is None:
        process.kill()
        process.wait()

"""Our program's bake of a twin, through its command line alone."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from radiosity.solver import image_file

from .scenes import Case

Float = NDArray[np.floating[Any]]

# Exit codes with results: done, and the wanted error was not reached.
DONE, ERROR_NOT_REACHED = 0, 4


@dataclass(frozen=True)
class OurBake:
    """One bake by our program.

    radiance : (rows, columns, 3) float32 for each receiver, E / pi, row 0 at v = 0.
    seconds : what its report says, export and write-back included;  process_seconds : with Python's start.
    cpu_seconds : of the whole process, all threads;
    rays : shot in all;  reached : whether it says that it reached the wanted error;  estimated : the error it reports.
    """

    radiance: dict[str, Float]
    seconds: float
    process_seconds: float
    cpu_seconds: float
    rays: int
    reached: bool
    estimated: dict[str, float]
    stages: list[dict[str, Any]]


def bake(case: Case, known: dict[str, Any], error: float, folder: Path, extra: tuple[str, ...] = ()) -> OurBake:
    """Bake the twin's receivers to `error` into `folder`.

    Raises
    ------
    RuntimeError
        If the program fails; the message is what it said, or that a receiver's image is missing.
    """
    folder.mkdir(parents=True, exist_ok=True)
    report_path = folder / "report.json"
    report_path.unlink(missing_ok=True)
    names = [row["object"] for row in known["receivers"]]
    command = [
        *(sys.executable, "-m", "radiosity", "bake", str(case.folder / "twin.blend")),
        *("--output", str(folder), "--error", f"{error:g}", "--uv-layer", known["uv_layer"]),
        *("--resolution", str(known["resolution"]), "--report", str(report_path)),
        *(word for name in names for word in ("--only", name)),
        *extra,
    ]
    started, cpu = time.perf_counter(), _children_seconds()
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=os.environ.copy())
    passed, cpu = time.perf_counter() - started, _children_seconds() - cpu
    if done.returncode not in {DONE, ERROR_NOT_REACHED}:
        said = (done.stderr.strip() or done.stdout.strip() or "nothing").splitlines()
        raise RuntimeError(f"{case.name}: our bake ended with code {done.returncode} and said: {said[-1]}")
    report = json.loads(report_path.read_text())
    return OurBake(
        radiance=_images(report, report_path.parent, names, known["resolution"]),
        seconds=float(report["seconds"]),
        process_seconds=passed,
        cpu_seconds=cpu,
        rays=int(report["rays"]),
        reached=done.returncode == DONE,
        estimated={key: value for key, value in report["error"]["estimated"].items() if isinstance(value, int | float)},
        stages=report["stages"],
    )


def _children_seconds() -> float:
    times = os.times()
    return times.children_user + times.children_system


def _images(report: dict[str, Any], folder: Path, names: list[str], resolution: int) -> dict[str, Float]:
    paths = {output["object"]: folder / output["image"] for output in report["outputs"] if output.get("image")}
    missing = [name for name in names if name not in paths]
    if missing:
        raise RuntimeError(f"the report names no image of {missing[0]!r}: it has {sorted(paths)}")
    images = {name: image_file.read_exr(paths[name]) for name in names}
    for name, image in images.items():
        if image.shape != (resolution, resolution, 3):
            raise RuntimeError(f"the image of {name!r} has shape {image.shape}, not {resolution} pixels a side")
    return images

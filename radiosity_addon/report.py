"""report.json: what the solver tells, completed by what only Blender's side knows."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..solver.settings import Settings
from ..solver.whole_file import whole_file
from .memory import peak_memory_bytes
from .warn import Warnings

# What every report of ours has, that of a check and of a comparison too.
OURS = frozenset({"scene", "blender", "settings", "warnings"})
# Our own stages before those of the solver.
EARLIER = ("export", "first look", "unwrap", "draft")


def complete(report: dict[str, Any], *, scene: str, blender: str, settings: Settings, outputs: list[dict[str, Any]],
             warnings: Warnings, stages: dict[str, float], seconds: float,
             materials: Sequence[dict[str, Any]] = ()) -> dict[str, Any]:
    """The solver's report with scene, settings, outputs, warnings, our own stages, and the whole time."""
    before = [{"name": name, "seconds": stages[name], "rays": 0} for name in EARLIER if name in stages]
    after = [{"name": name, "seconds": stages[name], "rays": 0} for name in ("write",) if name in stages]
    return {
        **report,
        "scene": scene,
        "blender": blender,
        "settings": {**report["settings"], **settings.as_dict()},
        "stages": [*before, *report["stages"], *after],
        "outputs": outputs,
        "materials": list(materials),
        "warnings": warnings,
        "peak_memory_bytes": peak_memory_bytes(),
        "seconds": seconds,
    }


def reached(report: dict[str, Any]) -> bool:
    """Whether the wanted error may be reached, as far as the audit can tell: not if its whole interval is above."""
    return bool(report["error"]["estimated"]["rms_low"] <= report["error"]["wanted"])


def relative_to_report(path: Path, report: Path | None) -> str:
    """A file's path as the report gives it: relative to the report's folder, with forward slashes."""
    return path.as_posix() if report is None else relative_path(path, report.parent)


def relative_path(path: Path, folder: Path) -> str:
    """A path relative to a folder, with forward slashes; as it is if that can't be."""
    try:
        return Path(os.path.relpath(path, folder)).as_posix()
    except ValueError:
        return path.as_posix()  # another drive


def is_report(path: Path) -> bool:
    """Whether a file is a report of ours, which another may replace; an empty one is as good."""
    try:
        with path.open("rb") as file:
            start = file.read(1)
            # Scenes and images, which may be large, are known by their first byte.
            return not start or (start == b"{" and json.loads(start + file.read()).keys() >= OURS)
    except (OSError, ValueError):
        return False


def write(report: dict[str, Any], path: Path) -> None:
    """Write the report, whole or not at all.

    Raises
    ------
    OutputError
        If it can't be written.
    """
    with whole_file(path) as beside:
        beside.write_text(json.dumps(_plain(report), indent=1, allow_nan=False) + "\n", encoding="utf-8")


def _plain(value: Any) -> Any:
    """JSON's own types: NumPy's become Python's, numbers that are not finite become null."""
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, np.ndarray | np.generic):
        return _plain(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, Path):
        return str(value)
    return value

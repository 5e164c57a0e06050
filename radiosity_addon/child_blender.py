"""Another Blender that runs a module of this add-on, without a window: what would block this one is done there."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import bpy

# What the other Blender runs: this add-on's code under a name of its own, out of the same folder. Its own extensions
# stay off, and the wheels are found where they are found here. Of the solver, what a module asks for by name is loaded,
# and not the whole: a first look waits for this Blender.
BOOT = """
import importlib, importlib.util, json, os, sys, types
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
solver = sys.modules["radiosity_child.solver"] = types.ModuleType("radiosity_child.solver")
solver.__path__ = [os.path.join(root, "solver")]
importlib.import_module("radiosity_child.radiosity_addon." + known["module"]).main(job)
if not bpy.app.binary_path:
    # All is written. As a module, Blender 4.2 may crash when Python tidies up at its end.
    os._exit(0)
"""
# Exit code of a Blender whose script failed.
FAILED = 3
# Python's last word on an error; and how many lines of what was said are looked through for it.
REASON = re.compile(r"\w+(Error|Exception)\b: ")
LAST_LINES = 40


def known(module: str, folder: Path) -> dict[str, object]:
    """What a job's file has to say beside the job: the module whose `main` gets its path, and where things are."""
    return {"module": module, "folder": str(folder), "package": str(Path(__file__).resolve().parents[1]),
            "sys_path": sys.path}


def command(job: Path) -> list[str]:
    """This program once more, without a window: the bpy module in its Python, or Blender itself."""
    if not bpy.app.binary_path:
        return [sys.executable, "-I", "-c", BOOT, str(job)]
    return [bpy.app.binary_path, "--background", "--factory-startup", "-noaudio", "--python-exit-code", str(FAILED),
            "--python-expr", BOOT, "--", str(job)]


def temporary(folder: Path) -> dict[str, str]:
    """Where the other Blender keeps its own temporary files: they go with ours, however it ends."""
    return dict.fromkeys(("TMPDIR", "TEMP", "TMP"), str(folder))


def reason(log: Path, process: subprocess.Popen[bytes]) -> str:
    """The last line of an error in what it said."""
    lines = log.read_text(encoding="utf-8", errors="replace").splitlines()[-LAST_LINES:]
    errors = [line.strip() for line in lines if REASON.match(line)]
    return errors[-1] if errors else f"exit code {process.returncode}"

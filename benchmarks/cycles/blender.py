"""Blender as a module: the one place here that first imports bpy."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path
from typing import Any


def open_blend(path: Path) -> Any:
    """Open a .blend without the user's own extensions and settings, and return bpy.

    bpy puts the wheels of installed extensions ahead of everybody else's when it is first imported, so that it must
    find an empty folder of user resources.
    """
    os.environ.setdefault("BLENDER_USER_RESOURCES", tempfile.mkdtemp(prefix="blender-resources-"))
    import bpy

    if not path.is_file():
        raise FileNotFoundError(f"no scene at {path}: put it there or point RADIOSITY_SCENES to the scenes' folder")
    bpy.ops.wm.open_mainfile(filepath=str(path), load_ui=False, use_scripts=False)
    return bpy


def select_only(bpy: Any, objects: list[Any]) -> None:
    """Make `objects` the selection, the first of them active."""
    for other in bpy.context.view_layer.objects:
        other.select_set(False)
    for chosen in objects:
        chosen.select_set(True)
    bpy.context.view_layer.objects.active = objects[0]

"""Opening .blend files, readying them for a command and saving them, which Blender offers only as operators: the one
file that calls `bpy.ops.wm`."""

from __future__ import annotations

import os
from collections.abc import Container
from pathlib import Path
from typing import Any

import bpy

from ..solver.errors import OutputError, SettingsError


def open_blend(path: Path) -> None:
    """Open a .blend without its user interface, and without running scripts that it may hold.

    Raises
    ------
    SettingsError
        If there is no such file.
    OutputError
        If Blender can't read it.
    """
    if not os.path.isfile(path):
        wrong = "is no file" if os.path.exists(path) else "does not exist"
        raise SettingsError(f"{path} {wrong}: give the path of a .blend file")
    try:
        bpy.ops.wm.open_mainfile(filepath=str(path), load_ui=False, use_scripts=False)
    except RuntimeError as cause:
        raise OutputError(
            f"{path} can't be opened ({_first_line(cause)}): check that it is a .blend of this Blender") from cause


def leave_edit_mode(view_layer: Any, data: Container[Any] | None = None) -> list[str]:
    """Let none of these meshes, or nothing at all, be edited; names of the objects that were.

    Files are often saved so, and nobody can press Tab where there is no window. In Edit Mode a mesh takes no results.
    No other thread may run Python meanwhile: operators let go of the interpreter's lock, and those that run others, as
    this one does, use the override without it (Blender 5.0 crashes).
    """
    edited = [item for item in view_layer.objects if item.mode == "EDIT" and (data is None or item.data in data)]
    for item in edited:
        # One may leave it with another.
        if item.mode == "EDIT":
            with bpy.context.temp_override(scene=view_layer.id_data, view_layer=view_layer, active_object=item,
                                           object=item):
                bpy.ops.object.mode_set(mode="OBJECT")
    return [item.name for item in edited]


def save_copy(path: Path) -> None:
    """Save what is open to another .blend; the open one keeps its name and its state.

    Raises
    ------
    OutputError
        If the file can't be written.
    """
    try:
        bpy.ops.wm.save_as_mainfile(filepath=str(path), copy=True, check_existing=False, relative_remap=True)
    except RuntimeError as cause:
        raise OutputError(
            f"{path} can't be written ({_first_line(cause)}): check the folder's rights and space") from cause


def _first_line(cause: Exception) -> str:
    text = str(cause).strip()
    return text.splitlines()[0].removeprefix("Error: ") if text else type(cause).__name__

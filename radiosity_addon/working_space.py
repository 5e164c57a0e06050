"""The file's working space: what the red, green and blue of its colours are. Blender before 5.0 knows one alone."""

from __future__ import annotations

import bpy

from .warn import Warnings, warn

# What images are read in and written in.
OURS = "Linear Rec.709"


def tell_working_space(warnings: Warnings) -> None:
    """Warn where colours are not those of Rec. 709."""
    space = bpy.data.colorspace.working_space if hasattr(bpy.data, "colorspace") else OURS
    if space != OURS:
        warn(warnings, "", "working_space", f"the file's working space is {space!r}, and a bake takes its colours for "
             f"{OURS}: they come out as others than a render shows; choose {OURS} (Render Properties > Color "
             "Management > Working Space)")

"""Where Blender's versions differ: the one file that asks for the version."""

from __future__ import annotations

from typing import Any

import bpy


def uses_nodes(data: Any) -> bool:
    """Whether a material's or world's node tree counts; from 5.0 on it always does."""
    if bpy.app.version >= (5, 0, 0):
        return data.node_tree is not None
    return bool(data.use_nodes) and data.node_tree is not None


def make_equirectangular(camera: Any) -> None:
    """Turn a camera (datablock) into a full panorama, as longitude and latitude."""
    camera.type = "PANO"
    # Cycles' own settings of a panorama became Blender's in 4.3.
    panorama = camera if bpy.app.version >= (4, 3, 0) else camera.cycles
    panorama.panorama_type = "EQUIRECTANGULAR"


def version() -> str:
    """Blender's version, for the report."""
    return str(bpy.app.version_string)

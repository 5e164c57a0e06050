"""Where Blender's versions differ: the one file that asks for the version."""

from __future__ import annotations

from typing import Any

import bpy


def uses_nodes(data: Any) -> bool:
    """Whether a material's or world's node tree counts; from 5.0 on it always does."""
    if bpy.app.version >= (5, 0, 0):
        return data.node_tree is not None
    return bool(data.use_nodes) and data.node_tree is not None


def version() -> str:
    """Blender's version, for the report."""
    return str(bpy.app.version_string)

"""Where Blender's versions differ: the one file that asks for the version."""

from __future__ import annotations

from typing import Any

import bpy


def uses_nodes(data: Any) -> bool:
    """Whether the node tree of a material, world or lamp counts.

    The switch is on its way out (for materials and worlds from 5.0, for lamps from 5.2), and reading it warns then.
    """
    switch = data.bl_rna.properties.get("use_nodes")
    if switch is None or getattr(switch, "is_deprecated", False):
        return data.node_tree is not None
    return bool(data.use_nodes) and data.node_tree is not None


def version() -> str:
    """Blender's version, for the report."""
    return str(bpy.app.version_string)


def reset_light(data: Any) -> None:
    """Undo what multiplies a lamp's power since Blender 4.5: exposure, temperature, power by area."""
    for name, value in (("exposure", 0.0), ("use_temperature", False), ("normalize", True)):
        if name in data.bl_rna.properties:
            setattr(data, name, value)


def instancers_hide_lamps() -> bool:
    """Whether the Ray Visibility of an instancer counts for the lamps that it shows, as it does for meshes.

    Measured: not in 4.3.2, but in 5.0.1. Lamps are objects of Cycles as meshes are from 4.4 on, which was not tried.
    """
    return bool(bpy.app.version >= (4, 4, 0))


def baked_footprint() -> float:
    """The part of a texel, each way, that Cycles' bake takes the mean of.

    Measured by the shadow edge of a sun: .5 in 4.2.23 and 5.0.1, 1 in 5.2.3 (5.1 was not tried).
    """
    return 1.0 if bpy.app.version >= (5, 2, 0) else 0.5

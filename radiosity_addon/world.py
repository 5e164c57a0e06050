"""The world as the solver's sky."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..solver.scene import Sky
from . import compat, cycles
from .sockets import Reader
from .warn import Warnings, warn


def read_world(world: Any, warnings: Warnings) -> Sky:
    """The sky: constant where the node tree is a plain background, else rendered to a map by Cycles.

    Raises
    ------
    SceneError
        If Cycles can't render it.
    """
    if world is None:
        return Sky()
    flat = _constant(world, warnings)
    if flat is None:
        radiance = cycles.render_world(world)
        if not np.isfinite(radiance).all() or radiance.min() < 0:
            warn(warnings, world.name, "world", "gives light that is negative or not finite in some directions: "
                 "it counts as black there")
            radiance = np.clip(np.nan_to_num(radiance, nan=0.0, posinf=0.0, neginf=0.0), 0, None)
        return Sky(radiance)
    if (flat < 0).any():
        warn(warnings, world.name, "world", "gives negative light: it counts as black")
    return Sky(np.clip(flat, 0, None))


def _constant(world: Any, warnings: Warnings) -> Any:
    """(3,) radiance of a world of one colour, or None for any other."""
    if not compat.uses_nodes(world):
        return np.array(world.color[:], np.float32)
    output = world.node_tree.get_output_node("CYCLES")
    if output is None:
        return np.zeros(3, np.float32)
    reader = Reader(world.name, warnings)
    source = reader.source(output.inputs["Surface"])
    if source is None:
        return np.zeros(3, np.float32)
    node = source.node
    if node.bl_idname != "ShaderNodeBackground":
        return None
    strength = node.inputs["Strength"]
    if not strength.is_linked and strength.default_value == 0:
        return np.zeros(3, np.float32)
    if node.inputs["Color"].is_linked or strength.is_linked:
        return None
    return np.array(node.inputs["Color"].default_value[:3], np.float32) * np.float32(strength.default_value)

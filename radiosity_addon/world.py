"""The world as the solver's sky, with its sun and other bright spots as lamps."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..solver.lights import Light
from ..solver.scene import Sky
from ..solver.sky_lamps import peel
from ..solver.sky_picture import Window
from . import compat, cycles
from .sockets import Reader
from .warn import Warnings, warn

Float = NDArray[np.floating[Any]]

CODE = "world"


def read_world(world: Any, warnings: Warnings) -> tuple[Sky, tuple[Light, ...]]:
    """The sky: constant where the node tree is a plain background, else rendered to a map by Cycles.

    Returns
    -------
    What is left of the sky, and the lamps that its bright spots become (see `solver.sky_lamps`).

    Raises
    ------
    SceneError
        If Cycles can't render it.
    """
    if world is None:
        return Sky(), ()
    if not world.cycles_visibility.diffuse:
        warn(warnings, world.name, CODE, "is hidden from diffuse rays (Ray Visibility): it gives no light")
        return Sky(), ()
    flat = _constant(world, warnings)
    if flat is None:
        whole = Sky(_clean(cycles.render_world(world), world, warnings))
        lamps, rest = peel(whole, lambda axis, half_angle: _close_look(world, axis, half_angle, warnings), world.name)
        return rest, lamps
    if (flat < 0).any():
        warn(warnings, world.name, CODE, "gives negative light: it counts as black")
    return Sky(np.clip(flat, 0, None)), ()


def _close_look(world: Any, axis: Float, half_angle: float, warnings: Warnings) -> Window:
    right, up = Window.sides(axis)
    half = float(np.tan(half_angle))
    return Window(axis, right, up, half, _clean(cycles.render_world_window(world, axis, right, up, half), world,
                                                warnings))


def _clean(radiance: Float, world: Any, warnings: Warnings) -> Float:
    """Radiance that a sky can have."""
    if np.isfinite(radiance).all() and radiance.min() >= 0:
        return radiance
    warn(warnings, world.name, CODE, "gives light that is negative or not finite in some directions: "
         "it counts as black there")
    return np.clip(np.nan_to_num(radiance, nan=0.0, posinf=0.0, neginf=0.0), 0, None)


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

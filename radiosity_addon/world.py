"""The world as the solver's sky, with its sun and other bright spots as lamps."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..solver.lights import Light
from ..solver.scene import Sky
from ..solver.sky_lamps import peel_parts
from ..solver.sky_picture import Window
from . import compat, world_render
from .parts import ENDLESS, Parts, whole
from .sockets import Reader
from .warn import Warnings, warn
from .world_render import Map

Float = NDArray[np.floating[Any]]
World = tuple[Sky, tuple[Light, ...]]

CODE = "world"


def read_world(world: Any, warnings: Warnings) -> tuple[Sky, tuple[Light, ...]]:
    """`world_parts` at once."""
    return whole(world_parts(world, warnings))


def world_parts(world: Any, warnings: Warnings, size: Map | None = None,
                part_seconds: float = ENDLESS) -> Parts[World]:
    """The sky: constant where the node tree is a plain background, else rendered to a map by Cycles, in parts.

    Parameters
    ----------
    size, part_seconds : as `world_render.map_parts`; None for what a bake needs.

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
        radiance = yield from world_render.map_parts(world, size or world_render.fine_map(world), part_seconds)
        peeled = yield from _peeled(world, Sky(_clean(radiance, world, warnings)), warnings, closely=size is None)
        yield
        return peeled
    if (flat < 0).any():
        warn(warnings, world.name, CODE, "gives negative light: it counts as black")
    return Sky(np.clip(flat, 0, None)), ()


def _peeled(world: Any, sky: Sky, warnings: Warnings, *, closely: bool) -> Parts[World]:
    """The sky without its bright spots, and these as lamps; `closely` looks at small ones by renders of their own."""
    peeling = peel_parts(sky, world.name)
    seen: Window | None = None
    while True:
        try:
            axis, half_angle = peeling.send(seen)
        except StopIteration as end:
            lamps, rest = end.value
            return rest, lamps
        seen = _close_look(world, axis, half_angle, warnings) if closely else None
        yield


def _close_look(world: Any, axis: Float, half_angle: float, warnings: Warnings) -> Window:
    right, up = Window.sides(axis)
    half = float(np.tan(half_angle))
    return Window(axis, right, up, half, _clean(world_render.window(world, axis, right, up, half), world, warnings))


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

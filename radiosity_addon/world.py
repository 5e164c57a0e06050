"""The world as the solver's sky, with its sun and other bright spots as lamps."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..solver.lights import Light
from ..solver.scene import Sky
from ..solver.sky_lamps import peel_parts
from ..solver.sky_picture import Window
from . import compat, shown_images, world_render
from .cycles_elsewhere import Elsewhere
from .named_values import tell_named
from .parts import ENDLESS, Parts, aside
from .sockets import Reader
from .warn import Warnings, warn
from .world_render import Map

Float = NDArray[np.floating[Any]]
World = tuple[Sky, tuple[Light, ...]]

CODE = "world"


def rendered_world(scene: Any, view_layer: Any) -> Any:
    """The world that lights a render of a view layer: its own one, if it has that, else the scene's; None for none."""
    if not view_layer.use_sky:
        return None
    # A world of its own came with Blender 5.
    return getattr(view_layer, "world_override", None) or scene.world


def needs_render(world: Any) -> bool:
    """Whether Cycles has to look at a world."""
    return world is not None and bool(world.cycles_visibility.diffuse) and _constant(world, []) is None


def world_parts(world: Any, warnings: Warnings, size: Map | None = None, part_seconds: float = ENDLESS,
                elsewhere: Elsewhere | None = None) -> Parts[World]:
    """The sky: constant where the node tree is a plain background, else rendered to a map by Cycles, in parts.

    Parameters
    ----------
    size, part_seconds : as `world_render.map_parts`; None for what a bake needs.
    elsewhere : another Blender; with None, and a world that it does not know, Cycles works in this one.

    Returns
    -------
    What is left of the sky, and the lamps that its bright spots become (see `solver.sky_lamps`).

    Raises
    ------
    SceneError
        If Cycles can't render it, or the file of an image is missing.
    """
    if world is None:
        return Sky(), ()
    if not world.cycles_visibility.diffuse:
        warn(warnings, world.name, CODE, "is hidden from diffuse rays (Ray Visibility): it gives no light")
        return Sky(), ()
    _tell_volume(world, warnings)
    flat = _constant(world, warnings)
    if flat is None:
        shown_images.require(world.node_tree, f"world {world.name!r}")
        tell_named(world, CODE, warnings)
        shown_images.tell_animated(world.node_tree, world.name, CODE, shown_images.FIRST, warnings)
        wanted = size or world_render.fine_map(world)
        if elsewhere is not None and not elsewhere.knows(world):
            elsewhere = None
        if elsewhere is None:
            radiance = yield from world_render.map_parts(world, wanted, part_seconds)
        else:
            shape = wanted.width, wanted.height, wanted.samples
            radiance = yield from elsewhere.ask(do="map", world=world.name, size=shape)
        sky = yield from aside(lambda: Sky(_clean(radiance, world.name, warnings)))
        return (yield from _peeled(world, sky, warnings, elsewhere, closely=size is None))
    if (flat < 0).any():
        warn(warnings, world.name, CODE, "gives negative light: it counts as black")
    return Sky(np.clip(flat, 0, None)), ()


def _peeled(world: Any, sky: Sky, warnings: Warnings, elsewhere: Elsewhere | None, *, closely: bool) -> Parts[World]:
    """The sky without its bright spots, and these as lamps; `closely` looks at small ones by renders of their own."""
    peeling = peel_parts(sky, world.name)
    seen: Window | None = None
    while True:
        wanted, ended = yield from aside(partial(_step, peeling, seen, closely=closely))
        if ended is not None:
            lamps, rest = ended
            return rest, lamps
        axis, half_angle = wanted
        seen = yield from _close_look(world, axis, half_angle, warnings, elsewhere)


def _step(peeling: Any, seen: Window | None, *, closely: bool) -> tuple[Any, Any]:
    """What a peeling wants to look at next, or its end; where nothing is looked at closely, its end."""
    try:
        wanted = peeling.send(seen)
        while not closely:
            peeling.send(None)
        return wanted, None
    except StopIteration as end:
        return None, end.value


def _close_look(world: Any, axis: Float, half_angle: float, warnings: Warnings,
                elsewhere: Elsewhere | None) -> Parts[Window]:
    right, up = Window.sides(axis)
    view = axis, right, up, float(np.tan(half_angle))
    if elsewhere is None:
        seen = world_render.window(world, *view)
        yield
    else:
        seen = yield from elsewhere.ask(do="window", world=world.name, view=view)
    return Window(*view, _clean(seen, world.name, warnings))


def _clean(radiance: Float, name: str, warnings: Warnings) -> Float:
    """Radiance that a sky can have."""
    if np.isfinite(radiance).all() and radiance.min() >= 0:
        return radiance
    warn(warnings, name, CODE, "gives light that is negative or not finite in some directions: "
         "it counts as black there")
    return np.clip(np.nan_to_num(radiance, nan=0.0, posinf=0.0, neginf=0.0), 0, None)


def _tell_volume(world: Any, warnings: Warnings) -> None:
    output = world.node_tree.get_output_node("CYCLES") if compat.uses_nodes(world) else None
    if output is not None and Reader(world.name, warnings).source(output.inputs["Volume"]) is not None:
        warn(warnings, world.name, CODE, "its volume is not baked: light goes through it as through air, unlink it")


def _constant(world: Any, warnings: Warnings) -> Any:
    """(3,) radiance of a world of one colour, or None for any other."""
    if not compat.uses_nodes(world):
        return np.array(world.color[:], np.float32)
    output = world.node_tree.get_output_node("CYCLES")
    if output is None:
        return np.zeros(3, np.float32)
    reader = Reader(world.name, warnings)
    with reader.at(output.inputs["Surface"]) as source:
        if source is None:
            return np.zeros(3, np.float32)
        if source.node.bl_idname != "ShaderNodeBackground":
            return None
        colour, strength = (source.node.inputs[name] for name in ("Color", "Strength"))
        if reader.source(strength) is None and strength.default_value == 0:
            return np.zeros(3, np.float32)
        if reader.source(colour) is not None or reader.source(strength) is not None:
            return None
        return np.array(colour.default_value[:3], np.float32) * np.float32(strength.default_value)

"""The legend of the false colours, drawn over the 3D viewport: title, colours, and the values of the isolines."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np

from . import false_colour
from .view_settings import LEAKS, LUX

# Place and size of the colours, in units of the interface: from the left and lower edge, width, height.
LEFT, LOW, WIDTH, HEIGHT = 24, 60, 18, 240
# Pieces that the colours are drawn in; lightness of the text.
PIECES = 64
TEXT = (0.95, 0.95, 0.95, 1.0)
SHADE = (0.0, 0.0, 0.0, 0.55)
FONT_SIZE = 11

_handles: list[Any] = []


def attach() -> None:
    """Draw in all 3D viewports; nothing where Blender has no window."""
    if not bpy.app.background:
        _handles.append(bpy.types.SpaceView3D.draw_handler_add(_draw, (), "WINDOW", "POST_PIXEL"))


def detach() -> None:
    """Draw no more."""
    while _handles:
        bpy.types.SpaceView3D.draw_handler_remove(_handles.pop(), "WINDOW")


def lines(view: Any) -> list[tuple[float, str]]:
    """Where on the scale (0 ... 1) which value stands."""
    low, high, step = view.scale_low, view.scale_high, view.scale_step
    span = max(high - low, 1e-12)
    return [((value - low) / span, false_colour.number(value)) for value in false_colour.ticks(low, high, step)]


def _draw() -> None:
    import blf

    context = bpy.context
    view = context.scene.radiosity_view
    if view.mode not in (LUX, LEAKS) or not context.space_data.overlay.show_overlays:
        return
    unit = context.preferences.system.ui_scale
    left, low, width, height = (value * unit for value in (LEFT, LOW, WIDTH, HEIGHT))
    _rectangle(left - 8 * unit, low - 12 * unit, width + 84 * unit, height + 44 * unit, SHADE)
    _colours(left, low, width, height)
    blf.size(0, FONT_SIZE * unit)
    blf.color(0, *TEXT)
    for part, text in lines(view):
        blf.position(0, left + width + 8 * unit, low + part * height - 4 * unit, 0)
        blf.draw(0, text)
    blf.position(0, left, low + height + 16 * unit, 0)
    blf.draw(0, view.scale_title)


def _rectangle(x: float, y: float, width: float, height: float, colour: tuple[float, ...]) -> None:
    import gpu
    from gpu_extras.batch import batch_for_shader

    shader = gpu.shader.from_builtin("UNIFORM_COLOR")
    corners = [(x, y), (x + width, y), (x + width, y + height), (x, y + height)]
    batch = batch_for_shader(shader, "TRIS", {"pos": corners}, indices=[(0, 1, 2), (0, 2, 3)])
    gpu.state.blend_set("ALPHA")
    shader.uniform_float("color", colour)
    batch.draw(shader)
    gpu.state.blend_set("NONE")


def _colours(x: float, y: float, width: float, height: float) -> None:
    import gpu
    from gpu_extras.batch import batch_for_shader

    part = np.linspace(0, 1, PIECES + 1)
    rgba = np.concatenate([false_colour.colour(part), np.ones((len(part), 1))], axis=1)
    corners = [(place, y + height * float(p)) for p in part for place in (x, x + width)]
    shader = gpu.shader.from_builtin("SMOOTH_COLOR")
    batch = batch_for_shader(shader, "TRI_STRIP", {"pos": corners, "color": np.repeat(rgba, 2, axis=0).tolist()})
    batch.draw(shader)

"""Findings on lamps: those without power or size."""

from __future__ import annotations

from typing import Any

from .visible import rendered_objects
from .warn import Warnings, warn

# Properties that hold a lamp's size, by its kind; all of them have to be 0 for it to have none.
SIZES = {"POINT": ("shadow_soft_size",), "SPOT": ("shadow_soft_size",), "SUN": ("angle",)}


def check_lights(view_layer: Any, warnings: Warnings) -> None:
    """Tell of the lamps that a render shows."""
    for item in rendered_objects(view_layer):
        if item.type != "LIGHT":
            continue
        data = item.data
        if data.energy == 0 or not any(data.color):
            what = "power" if data.energy == 0 else "colour"
            warn(warnings, item.name, "no_power", f"has {what} 0 and gives no light: raise it (Object Data > Light), "
                 "or hide the lamp from renders")
        elif data.type == "AREA":
            sides = (data.size, data.size_y if data.shape in {"RECTANGLE", "ELLIPSE"} else data.size)
            if not all(sides):
                warn(warnings, item.name, "no_size", "has an area of 0 and gives no light: give it a size")
        elif not any(getattr(data, name) for name in SIZES[data.type]):
            word = "angle" if data.type == "SUN" else "radius"
            warn(warnings, item.name, "no_size", f"has {word} 0: its shadows have hard edges, which show the lumels as "
                 f"steps; give it a {word}")

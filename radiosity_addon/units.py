"""The scene's unit scale: a Blender unit is a metre for light, as in Cycles, and what the panel says for lengths.

Blender's unit scale (`scale_length`) changes how lengths are shown and typed, not what a render shows: Cycles lights a
scene as if each Blender unit were a metre, and so does a bake. Only what is given in pixels per metre follows the
lengths that the user sees.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from ..solver.settings import Settings
from .warn import Warnings, warn


def metres_per_unit(scene: Any) -> float:
    """The length that Blender shows for one unit of a scene; 1 where it shows bare numbers."""
    units = scene.unit_settings
    return 1.0 if units.system == "NONE" else float(units.scale_length)


def per_blender_unit(settings: Settings, scene: Any, warnings: Warnings) -> Settings:
    """Settings whose texel density counts Blender units; warns where W/m2 and lux are not per square metre."""
    scale = float(f"{metres_per_unit(scene):.6g}")
    if scale == 1:
        return settings
    if settings.quantity != "radiance":
        warn(warnings, "", "unit_scale",
             f"the scene's unit scale is {scale:g}: its light is that of Cycles, which takes every Blender unit for a "
             f"metre, and {settings.quantity} is per square Blender unit: set the unit scale to 1 and scale the scene "
             "and its lamps if it has to be per square metre")
    if settings.texel_density is None:
        return settings
    return replace(settings, texel_density=settings.texel_density * scale)

"""What each object says of its own bake: left out, or finer and coarser than the others."""

from __future__ import annotations

from typing import Any

import bpy
from bpy.props import BoolProperty, FloatProperty, PointerProperty

LEAST_DENSITY, MOST_DENSITY = 1 / 64, 64.0


class RADIOSITY_PG_object(bpy.types.PropertyGroup):
    """Settings of one object."""

    exclude: BoolProperty(  # type: ignore[valid-type]
        name="Exclude", default=False,
        description="Give the object no lightmap and no baked colors. It still blocks, reflects and emits light")
    density: FloatProperty(  # type: ignore[valid-type]
        name="Density Factor", default=1.0, min=LEAST_DENSITY, max=MOST_DENSITY, soft_min=0.25, soft_max=4.0,
        description="Times as many pixels per meter as other objects get in lightmaps (2 is four times the pixels)")


CLASSES = (RADIOSITY_PG_object,)


def attach() -> None:
    """Give every object its settings."""
    bpy.types.Object.radiosity = PointerProperty(type=RADIOSITY_PG_object)


def detach() -> None:
    """Take them away again."""
    del bpy.types.Object.radiosity


def is_excluded(item: Any) -> bool:
    """Whether the user left an object out of the bake."""
    return bool(item.radiosity.exclude)


def density_of(item: Any) -> float:
    """The object's factor on the texel density, without the digits that a float property adds."""
    return float(f"{item.radiosity.density:.6g}")

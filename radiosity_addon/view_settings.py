"""What the views of a bake need to keep in each scene: which one is on, its scale, and the table of lux."""

from __future__ import annotations

from typing import Any

import bpy
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    IntProperty,
    PointerProperty,
    StringProperty,
)

from . import false_colour

OFF, BAKED, LUX, LEAKS = MODES = ("OFF", "BAKED", "LUX", "LEAKS")
HIDDEN = {"HIDDEN"}


def _scale_changed(self: Any, _context: Any) -> None:
    if self.mode == LUX and not self.automatic:
        self.scale_low, self.scale_high = self.low, max(self.high, self.low * 1.001 + 1e-9)
        self.scale_step = false_colour.nice_step(self.scale_high - self.scale_low)
        false_colour.set_scale(self.scale_low, self.scale_high, self.scale_step)


def _figure_changed(self: Any, _context: Any) -> None:
    from . import preview

    self.worst = 0
    if self.mode == LEAKS:
        preview.refresh()


class RADIOSITY_PG_row(bpy.types.PropertyGroup):
    """A line of the table: illuminance of a surface or of the working plane; `name` says of which."""

    minimum: FloatProperty(name="Minimum", description="Lowest illuminance, lx")  # type: ignore[valid-type]
    mean: FloatProperty(name="Mean", description="Mean illuminance over the area, lx")  # type: ignore[valid-type]
    maximum: FloatProperty(name="Maximum", description="Highest illuminance, lx")  # type: ignore[valid-type]
    area: FloatProperty(name="Area", description="Area, m2")  # type: ignore[valid-type]

    @property
    def uniformity(self) -> float:
        """Minimum over mean."""
        return float(self.minimum / self.mean) if self.mean > 0 else 0.0


class RADIOSITY_PG_finding(bpy.types.PropertyGroup):
    """One thing that a check found; `name` is the object's or material's."""

    code: StringProperty(name="Code")  # type: ignore[valid-type]
    message: StringProperty(name="Message")  # type: ignore[valid-type]


class RADIOSITY_PG_view(bpy.types.PropertyGroup):
    """Views of a bake."""

    mode: EnumProperty(  # type: ignore[valid-type]
        name="View", default=OFF, options=HIDDEN, items=[(mode, mode.capitalize(), "") for mode in MODES])
    automatic: BoolProperty(  # type: ignore[valid-type]
        name="Automatic Scale", default=True, description="Let the scale of the false colors fit the brightest surface")
    low: FloatProperty(  # type: ignore[valid-type]
        name="From", default=0.0, min=0.0, description="Illuminance of the darkest color, lx", update=_scale_changed)
    high: FloatProperty(  # type: ignore[valid-type]
        name="To", default=1000.0, min=1e-6, description="Illuminance of the brightest color, lx",
        update=_scale_changed)
    floor: PointerProperty(  # type: ignore[valid-type]
        name="Floor", type=bpy.types.Object, poll=lambda _self, item: item.type == "MESH",
        description="The plane lies over this object, measured from its top; empty: over the whole scene, from its "
        "lowest point")
    height: FloatProperty(  # type: ignore[valid-type]
        name="Height", default=0.8, subtype="DISTANCE", unit="LENGTH",
        description="Height of the working plane above the floor")
    spacing: FloatProperty(  # type: ignore[valid-type]
        name="Spacing", default=0.25, min=0.001, subtype="DISTANCE", unit="LENGTH",
        description="Distance between the points that are measured")
    border: FloatProperty(  # type: ignore[valid-type]
        name="Border", default=0.0, min=0.0, subtype="DISTANCE", unit="LENGTH",
        description="Part along the walls that is left out (EN 12464-1: 0.5 m at most)")
    figure: EnumProperty(  # type: ignore[valid-type]
        name="Figure", default="back_faces", description="What the patches' colors say", update=_figure_changed,
        items=[("back_faces", "Back Faces", "Part of a patch's rays that meet a back face: flipped normals and leaks"),
               ("escaped", "Escaped", "Part of a patch's rays that meet nothing, which is one minus its row sum: "
                "gaps in a closed room"),
               ("absorbed", "Absorbed", "Light that a patch keeps, W/m2"),
               ("leaving", "Leaving", "Light that leaves a patch, W/m2")])
    worst: IntProperty(name="Worst", default=0, min=0, options=HIDDEN)  # type: ignore[valid-type]
    rows: CollectionProperty(type=RADIOSITY_PG_row)  # type: ignore[valid-type]
    findings: CollectionProperty(type=RADIOSITY_PG_finding)  # type: ignore[valid-type]
    checked: BoolProperty(default=False, options=HIDDEN)  # type: ignore[valid-type]
    # The scale as it is shown now.
    scale_low: FloatProperty(options=HIDDEN)  # type: ignore[valid-type]
    scale_high: FloatProperty(options=HIDDEN, default=1.0)  # type: ignore[valid-type]
    scale_step: FloatProperty(options=HIDDEN, default=1.0)  # type: ignore[valid-type]
    scale_title: StringProperty(options=HIDDEN)  # type: ignore[valid-type]


CLASSES = (RADIOSITY_PG_row, RADIOSITY_PG_finding, RADIOSITY_PG_view)


def forget(scene: Any) -> None:
    """Take what a bake left in a scene's views out of it; what the user has set stays."""
    view = scene.radiosity_view
    view.rows.clear()
    view.findings.clear()
    for name in ("mode", "worst", "checked", "scale_low", "scale_high", "scale_step", "scale_title"):
        view.property_unset(name)


def attach() -> None:
    """Give every scene its views."""
    bpy.types.Scene.radiosity_view = PointerProperty(type=RADIOSITY_PG_view)


def detach() -> None:
    """Take them away again."""
    del bpy.types.Scene.radiosity_view

"""The panel's part for comparing with Cycles: the budget, the button, and what came of it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
from bpy.props import BoolProperty, FloatProperty, PointerProperty

from .compare import Comparison
from .compare_request import DEFAULT_SECONDS
from .job import Job


class RADIOSITY_PG_compare(bpy.types.PropertyGroup):
    """What a comparison is asked for."""

    seconds: FloatProperty(  # type: ignore[valid-type]
        name="Cycles' Time", description="Seconds that Cycles may bake the same lumels for: the longer, the surer the "
        "numbers", default=DEFAULT_SECONDS, min=1.0, soft_max=3600.0, max=1e5, precision=0, step=1000)
    camera: BoolProperty(  # type: ignore[valid-type]
        name="Camera View", description="Render the scene's camera too: Eevee with the baked light beside Cycles",
        default=False)


class RADIOSITY_PT_compare(bpy.types.Panel):
    """How far the bake is from Cycles, and how much faster."""

    bl_label = "Compare with Cycles"
    bl_idname = "RADIOSITY_PT_compare"
    bl_parent_id = "RADIOSITY_PT_bake"
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Radiosity"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: Any) -> None:
        layout, asked = self.layout, context.scene.radiosity_compare
        layout.use_property_split = True
        layout.use_property_decorate = False
        column = layout.column()
        column.enabled = Job.current is None
        column.prop(asked, "seconds")
        column.prop(asked, "camera")
        column.operator("radiosity.compare", icon="MOD_DATA_TRANSFER")
        if Comparison.last is not None:
            _draw_result(layout, Comparison.last)


def _draw_result(layout: Any, done: Any) -> None:
    """The numbers of the last comparison, and where to look at it."""
    numbers = done.report["comparison"]
    ours, cycles, equal = numbers["ours"], numbers["cycles"], numbers["equal_error"]
    box = layout.box().column(align=True)
    box.label(text=Path(str(done.report["scene"])).name, translate=False)
    rows = [("Error (RMS)", f"{ours['rms']:.2%}"), ("Bias", f"{ours['bias']:+.2%}"), ("95 % are within",
            f"{ours['p95_clean']:.2%}"), ("Worst", f"{ours['worst']:.1%}"), ("Our Time", f"{ours['seconds']:.1f} s"),
            ("Cycles' Time", f"{cycles['seconds']:.1f} s"), ("Cycles' Noise", f"{cycles['rms']:.2%}")]
    if equal and equal["factor"]:
        rows.append(("Cycles at equal error", f"{equal['factor']:.3g} times as long"))
    for name, value in rows:
        row = box.split(factor=0.5)
        row.label(text=name)
        row.label(text=value)
    box.operator("wm.url_open", text="Open the Page", icon="URL").url = done.files["page"].as_uri()


def attach() -> None:
    """Give every scene the settings of a comparison."""
    bpy.types.Scene.radiosity_compare = PointerProperty(type=RADIOSITY_PG_compare)


def detach() -> None:
    """Take them away again."""
    del bpy.types.Scene.radiosity_compare


CLASSES = (RADIOSITY_PG_compare, RADIOSITY_PT_compare)

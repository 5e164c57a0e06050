"""Sub-panels of the tab that look at a bake: the views, lux, leaks and energy, and what a check found."""

from __future__ import annotations

from typing import Any

import bpy

from . import false_colour, patch_mesh
from .job import Job
from .panel import Tab
from .results import any_result
from .view_settings import BAKED, LEAKS, LUX

# Rows of a table and findings that are shown at most; all rows are in the CSV.
MOST_ROWS = 24


class _Sub(Tab):
    bl_parent_id = "RADIOSITY_PT_bake"


class RADIOSITY_PT_view(_Sub, bpy.types.Panel):
    """The baked look, and the way back to the file as it was."""

    bl_label = "View"
    bl_idname = "RADIOSITY_PT_view"
    bl_order = 1

    @classmethod
    def poll(cls, _context: Any) -> bool:
        return any_result()

    def draw(self, context: Any) -> None:
        column = self.layout.column(align=True)
        column.enabled = Job.current is None
        shown = context.scene.radiosity_view.mode == BAKED
        column.operator("radiosity.preview", text="Show Materials" if shown else "Show Baked Light",
                        icon="MATERIAL" if shown else "SHADING_TEXTURE", depress=shown)
        if context.scene.radiosity_view.mode in (BAKED, LUX):
            column.label(text="Slots show copies of your materials", icon="INFO")
        column.operator("radiosity.clear", icon="TRASH")


class RADIOSITY_PT_lux(_Sub, bpy.types.Panel):
    """Illuminance in false colours and numbers."""

    bl_label = "Lux"
    bl_idname = "RADIOSITY_PT_lux"
    bl_order = 2

    @classmethod
    def poll(cls, context: Any) -> bool:
        return any_result() or len(context.scene.radiosity_view.rows) > 0

    def draw(self, context: Any) -> None:
        layout, view = self.layout, context.scene.radiosity_view
        layout.use_property_split = True
        layout.use_property_decorate = False
        layout.enabled = Job.current is None
        shown = view.mode == LUX
        layout.operator("radiosity.lux_view", text="Hide Lux" if shown else "Show Lux", icon="COLOR", depress=shown)
        layout.prop(view, "automatic")
        if not view.automatic:
            row = layout.row(align=True)
            row.prop(view, "low")
            row.prop(view, "high", text="")
        column = layout.column(heading="Working Plane")
        for name in ("floor", "height", "spacing", "border"):
            column.prop(view, name)
        layout.operator("radiosity.working_plane", icon="MESH_GRID")
        if len(view.rows):
            _table(layout.box(), view.rows)
            layout.operator("radiosity.lux_csv", icon="EXPORT")


class RADIOSITY_PT_leaks(_Sub, bpy.types.Panel):
    """Closure and energy of the patches."""

    bl_label = "Leaks and Energy"
    bl_idname = "RADIOSITY_PT_leaks"
    bl_order = 3

    @classmethod
    def poll(cls, _context: Any) -> bool:
        return patch_mesh.kept() is not None

    def draw(self, context: Any) -> None:
        layout, view = self.layout, context.scene.radiosity_view
        layout.use_property_split = True
        layout.use_property_decorate = False
        layout.enabled = Job.current is None
        layout.prop(view, "figure")
        shown = view.mode == LEAKS
        layout.operator("radiosity.leak_view", text="Hide Patches" if shown else "Show Patches", icon="FACESEL",
                        depress=shown)
        layout.operator("radiosity.worst", text="Next Worst Place" if view.worst else "Worst Place", icon="CURSOR")


class RADIOSITY_PT_checks(_Sub, bpy.types.Panel):
    """What the last check found."""

    bl_label = "Checks"
    bl_idname = "RADIOSITY_PT_checks"
    bl_order = 6

    @classmethod
    def poll(cls, context: Any) -> bool:
        return bool(context.scene.radiosity_view.checked)

    def draw(self, context: Any) -> None:
        layout, view = self.layout, context.scene.radiosity_view
        if not len(view.findings):
            layout.label(text="Nothing to mend", icon="CHECKMARK")
        for number, finding in enumerate(view.findings[:MOST_ROWS]):
            row = layout.row(align=True)
            known = finding.name in context.scene.objects
            row.operator("radiosity.show_finding", text=finding.name or "Scene", translate=not finding.name,
                         emboss=known, icon="OBJECT_DATA" if known else "ERROR").index = number
            row.label(text=finding.message)
        if len(view.findings) > MOST_ROWS:
            layout.label(text=f"{len(view.findings) - MOST_ROWS} more in the report of a bake")


def _table(layout: Any, rows: Any) -> None:
    _line(layout, "Lux", ("Min", "Mean", "Max", "Unif."))
    for row in rows[:MOST_ROWS]:
        _line(layout, row.name, (*(false_colour.number(value) for value in (row.minimum, row.mean, row.maximum)),
                                 f"{row.uniformity:.2f}"))
    if len(rows) > MOST_ROWS:
        layout.label(text=f"{len(rows) - MOST_ROWS} more in the CSV file")


def _line(layout: Any, name: str, values: tuple[str, ...]) -> None:
    """A name, and values to the right of it, with little height."""
    parts = layout.split(factor=0.3, align=True)
    parts.scale_y = 0.8
    parts.label(text=name, translate=False)
    cells = parts.row(align=True)
    for text in values:
        cells.label(text=text)


CLASSES = (RADIOSITY_PT_view, RADIOSITY_PT_lux, RADIOSITY_PT_leaks, RADIOSITY_PT_checks)

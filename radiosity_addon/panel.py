"""The "Radiosity" tab of the 3D viewport's sidebar."""

from __future__ import annotations

from typing import Any

import bpy

from . import look_overlay
from .job import Job
from .progress import clock


class Tab:
    """What all panels of the tab share."""

    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Radiosity"


class RADIOSITY_PT_bake(Tab, bpy.types.Panel):
    """The button, and what is asked for most often."""

    bl_label = "Radiosity"
    bl_idname = "RADIOSITY_PT_bake"

    def draw(self, context: Any) -> None:
        look_overlay.expect(context.area)
        layout, settings = self.layout, context.scene.radiosity
        layout.use_property_split = True
        layout.use_property_decorate = False
        column = layout.column()
        column.enabled = Job.current is None
        column.prop(settings, "target")
        column.prop(settings, "preset")
        column.prop(settings, "error")
        column.prop(settings, "only_selected")
        column.separator()
        if Job.current is None:
            column.operator("radiosity.bake", icon="LIGHT_AREA")
        else:
            _draw_progress(layout, Job.current)
        row = layout.row()
        row.enabled = Job.current is None
        row.operator("radiosity.check", icon="VIEWZOOM")


class RADIOSITY_PT_layout(Tab, bpy.types.Panel):
    """Where the light lies in images."""

    bl_label = "Layout"
    bl_idname = "RADIOSITY_PT_layout"
    bl_parent_id = "RADIOSITY_PT_bake"

    @classmethod
    def poll(cls, context: Any) -> bool:
        return bool(context.scene.radiosity.target == "lightmap")

    def draw(self, context: Any) -> None:
        layout, settings = self.layout, context.scene.radiosity
        layout.use_property_split = True
        layout.use_property_decorate = False
        item = context.active_object
        if item is not None and item.type == "MESH":
            layout.prop_search(settings, "uv_layer", item.data, "uv_layers")
        else:
            layout.prop(settings, "uv_layer")
        for name in ("resolution", "texel_density", "max_pages", "atlas", "margin"):
            row = layout.row()
            row.active = not (name == "texel_density" and settings.resolution > 0)
            row.prop(settings, name)
        layout.operator("radiosity.density", icon="TEXTURE")


class RADIOSITY_PT_result(Tab, bpy.types.Panel):
    """What is baked, and where it goes."""

    bl_label = "Result"
    bl_idname = "RADIOSITY_PT_result"
    bl_parent_id = "RADIOSITY_PT_bake"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: Any) -> None:
        layout, settings = self.layout, context.scene.radiosity
        layout.use_property_split = True
        layout.use_property_decorate = False
        for name in ("quantity", "passes", "footprint", "pack"):
            layout.prop(settings, name)
        row = layout.row()
        row.active = not settings.pack
        row.prop(settings, "output")
        for name in ("apply_modifiers", "watch", "keep_draft", "seed", "threads"):
            layout.prop(settings, name)


def _draw_progress(layout: Any, job: Job) -> None:
    progress = job.progress
    left = progress.seconds_left
    layout.progress(factor=progress.fraction, text=f"{progress.stage.capitalize()} {progress.fraction:.0%}")
    layout.label(text=f"{clock(left)} left, Esc cancels" if left is not None else "Esc cancels")
    if job.look is not None:
        layout.label(text=f"Shown: {job.look.title}")
    layout.operator("radiosity.good_enough", icon="CHECKMARK")


CLASSES = (RADIOSITY_PT_bake, RADIOSITY_PT_layout, RADIOSITY_PT_result)

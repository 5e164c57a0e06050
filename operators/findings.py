"""Show the object that a check's finding is about."""

from __future__ import annotations

from typing import Any

import bpy
from bpy.props import IntProperty


class RADIOSITY_OT_show_finding(bpy.types.Operator):
    """Select the object that this is about, and make it active"""

    bl_idname = "radiosity.show_finding"
    bl_label = "Select Object"
    bl_options = {"REGISTER", "UNDO"}

    index: IntProperty(name="Index", min=0)  # type: ignore[valid-type]

    @classmethod
    def poll(cls, context: Any) -> bool:
        return bool(context.mode == "OBJECT")

    @classmethod
    def description(cls, context: Any, properties: Any) -> str:
        """The whole finding, which the panel may cut short."""
        findings = context.scene.radiosity_view.findings
        return str(findings[properties.index].message) if properties.index < len(findings) else ""

    def execute(self, context: Any) -> set[str]:
        """Select."""
        findings = context.scene.radiosity_view.findings
        if self.index >= len(findings):
            return {"CANCELLED"}
        name = findings[self.index].name
        item = next((item for item in context.view_layer.objects if name in {item.name, item.name_full}), None)
        if item is None:
            self.report({"INFO"}, f"{name or 'The scene'}: {findings[self.index].message}")
            return {"CANCELLED"}
        for other in context.view_layer.objects:
            other.select_set(other == item)
        context.view_layer.objects.active = item
        return {"FINISHED"}


CLASSES = (RADIOSITY_OT_show_finding,)

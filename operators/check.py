"""Check: what would bake and what would not, without baking."""

from __future__ import annotations

from typing import Any

import bpy

from ..radiosity_addon.check import lines
from ..radiosity_addon.command import parse_options
from ..radiosity_addon.export import export_scene
from ..radiosity_addon.findings import keep_findings
from ..radiosity_addon.job import Job
from ..radiosity_addon.warn import Warnings, as_line
from ..radiosity_addon.window_request import settings_in
from ..solver.errors import RadiosityError


class RADIOSITY_OT_check(bpy.types.Operator):
    """Tell what will bake and what will not, and why"""

    bl_idname = "radiosity.check"
    bl_label = "Check"
    bl_options = {"REGISTER"}

    @classmethod
    def poll(cls, context: Any) -> bool:
        return Job.current is None and context.scene is not None

    def execute(self, context: Any) -> set[str]:
        """Export, and report."""
        warnings: Warnings = []
        try:
            settings = settings_in(context, parse_options(""))
            exported = export_scene(context.scene, context.view_layer, settings, warnings)
        except RadiosityError as error:
            keep_findings(context.scene, [*warnings, {"object": "", "code": "error", "message": str(error)}])
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        keep_findings(context.scene, warnings)
        for warning in warnings:
            self.report({"WARNING"}, as_line(warning))
        for line in lines(exported):
            self.report({"INFO"}, line)
        return {"FINISHED"}

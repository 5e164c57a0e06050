"""Check: what would bake and what would not, without baking."""

from __future__ import annotations

from typing import Any

import bpy

from ..radiosity_addon.check import find, lines
from ..radiosity_addon.command import parse_options
from ..radiosity_addon.findings import keep_findings
from ..radiosity_addon.panel_words import in_panel_words
from ..radiosity_addon.receiving import tell_passed_over
from ..radiosity_addon.warn import as_line
from ..radiosity_addon.window_request import passed_over, settings_in
from ..solver.errors import RadiosityError
from .working import is_free


class RADIOSITY_OT_check(bpy.types.Operator):
    """Tell what will bake and what will not, and why"""

    bl_idname = "radiosity.check"
    bl_label = "Check"
    bl_options = {"REGISTER"}

    @classmethod
    def poll(cls, context: Any) -> bool:
        return is_free(cls) and context.scene is not None

    def execute(self, context: Any) -> set[str]:
        """Look, keep what was found for the panel, and report."""
        try:
            convert = context.scene.radiosity.apply_modifiers
            options = parse_options("")
            settings = settings_in(context, options, convert=convert)
            found = find(context.scene, context.view_layer, settings, convert)
            tell_passed_over(passed_over(context, options, convert=convert), found.warnings)
        except RadiosityError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        keep_findings(context.scene, found.warnings)
        if context.area is not None:
            context.area.tag_redraw()  # the panel of findings may be new
        for warning in found.warnings:
            self.report({"ERROR"} if warning["code"] == "error" else {"WARNING"}, in_panel_words(as_line(warning)))
        if found.failure is not None:
            return {"CANCELLED"}
        for line in lines(found):
            self.report({"INFO"}, line)
        return {"FINISHED"}

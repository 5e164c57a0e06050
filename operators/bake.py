"""Bake Radiosity: in the window beside the user's work, in background or from scripts until it is done."""

from __future__ import annotations

from typing import Any

import bpy

from ..radiosity_addon.command import parse_options
from ..radiosity_addon.job import Job, Outcome, run
from ..radiosity_addon.live import LiveJob
from ..radiosity_addon.panel_words import in_panel_words
from ..radiosity_addon.summary import one_line
from ..radiosity_addon.warn import as_line
from ..radiosity_addon.window_request import request_in
from ..solver.errors import RadiosityError
from .working import Asked, Working

# More warnings than this are counted, and listed in the report.
SHOWN_WARNINGS = 5


class RADIOSITY_OT_bake(Asked, Working, bpy.types.Operator):
    """Bake the scene's diffuse light into lightmaps or vertex colors"""

    bl_idname = "radiosity.bake"
    bl_label = "Bake Radiosity"
    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context: Any) -> set[str]:
        """Bake and wait."""
        try:
            request = request_in(context, parse_options(self.options))
            outcome = run(request, context.scene, context.view_layer)
        except RadiosityError as error:
            return self._failed(error)
        return self._tell(outcome)

    def invoke(self, context: Any, _event: Any) -> set[str]:
        """Bake in a thread, looked after by a timer."""
        if bpy.app.background:
            return self.execute(context)
        kind = LiveJob if context.scene.radiosity.watch else Job
        try:
            job = kind(request_in(context, parse_options(self.options)), context.scene, context.view_layer)
        except RadiosityError as error:
            return self._failed(error)
        return self._begin(context, job)

    def _give_up(self, context: Any) -> None:
        self._job.give_up(keep=context.scene.radiosity.keep_draft)

    def _tell(self, outcome: Outcome) -> set[str]:
        warnings = outcome.report["warnings"]
        for warning in warnings[:SHOWN_WARNINGS]:
            self.report({"WARNING"}, in_panel_words(as_line(warning)))
        if len(warnings) > SHOWN_WARNINGS:
            self.report({"WARNING"}, f"{len(warnings) - SHOWN_WARNINGS} more warnings are in the report")
        if outcome.report.get("good_enough"):
            self.report({"INFO"}, "Good enough: kept a draft")
        elif outcome.exit_code:
            self.report({"WARNING"}, f"The wanted error of {outcome.report['error']['wanted']:.2%} was not reached")
        # The line that the status bar shows: warnings scroll by before it.
        told = f", {len(warnings)} warning{'s'[:len(warnings) > 1]}: see the Info editor" if warnings else ""
        self.report({"INFO"}, f"Baked {one_line(outcome.report)}{told}")
        return {"FINISHED"}

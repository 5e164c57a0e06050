"""Bake Radiosity: in the window beside the user's work, in background or from scripts until it is done."""

from __future__ import annotations

import time
from typing import Any

import bpy
from bpy.props import StringProperty

from ..radiosity_addon.command import parse_options
from ..radiosity_addon.job import Job, Outcome, run
from ..radiosity_addon.live import LiveJob
from ..radiosity_addon.look import Look
from ..radiosity_addon.parts import Parts, some
from ..radiosity_addon.summary import one_line
from ..radiosity_addon.warn import as_line
from ..radiosity_addon.window_request import request_in
from ..solver.errors import Cancelled, RadiosityError
from .status import redraw_views, show_status

# Seconds between two looks at the bake, and between two changes of what is told of it.
TICK, TOLD = 0.02, 0.1
# More warnings than this are counted, and listed in the report.
SHOWN_WARNINGS = 5


class RADIOSITY_OT_bake(bpy.types.Operator):
    """Bake the scene's diffuse light into lightmaps or vertex colors"""

    bl_idname = "radiosity.bake"
    bl_label = "Bake Radiosity"
    bl_options = {"REGISTER", "UNDO"}

    options: StringProperty(  # type: ignore[valid-type]
        name="Options", description="Options of the command line that go before the panel's settings",
        options={"SKIP_SAVE"})

    @classmethod
    def poll(cls, context: Any) -> bool:
        if Job.current is not None:
            cls.poll_message_set("A bake is on its way: wait for it, or press Esc to cancel it")
            return False
        return context.scene is not None

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
            self._job = kind(request_in(context, parse_options(self.options)), context.scene, context.view_layer)
        except RadiosityError as error:
            return self._failed(error)
        self._parts: Parts[Outcome | None] | None = self._job.exporting()
        self._look: Look | None = None
        self._told = 0.0
        manager = context.window_manager
        manager.progress_begin(0, 100)
        self._timer = manager.event_timer_add(TICK, window=context.window)
        manager.modal_handler_add(self)
        redraw_views(context)
        return {"RUNNING_MODAL"}

    def modal(self, context: Any, event: Any) -> set[str]:
        """Read the scene part by part, show how far the worker is, write the results part by part; Esc cancels."""
        if event.type == "ESC" and event.value == "PRESS":
            self._job.give_up(keep=context.scene.radiosity.keep_draft)
            return {"RUNNING_MODAL"}
        if event.type != "TIMER":
            # Nobody changes the scene while it is read or written to.
            return {"PASS_THROUGH"} if self._parts is None else {"RUNNING_MODAL"}
        try:
            outcome = self._tick(context)
        except RadiosityError as error:
            self._end(context)
            return self._failed(error)
        except BaseException:
            self._end(context)
            raise
        if outcome is None:
            return {"PASS_THROUGH"}
        self._end(context)
        return self._tell(outcome)

    def _tick(self, context: Any) -> Outcome | None:
        """One step of the work that is Blender's thread's; what came of the bake, at its end."""
        self._tell_progress(context)
        if self._job.look is not self._look:
            self._look = self._job.look
            redraw_views(context)
        if self._parts is None:
            if not self._job.is_done:
                return None
            self._parts = self._job.finishing()
        elif not self._job.is_baked:
            self._job.refuse_cancelled()
        try:
            some(self._parts)
        except StopIteration as end:
            outcome: Outcome | None = end.value
            self._parts = None
            if outcome is None:
                self._job.start()
            return outcome
        return None

    def _tell_progress(self, context: Any) -> None:
        """In the status bar and the panels, now and then."""
        now = time.monotonic()
        if now - self._told >= TOLD:
            self._told = now
            progress = self._job.progress
            context.window_manager.progress_update(round(progress.fraction * 100))
            show_status(context, f"Radiosity {progress.line()} (Esc cancels)")

    def cancel(self, context: Any) -> None:
        """Blender ends the operator: a file is loaded, or the window closed."""
        self._end(context)

    def _end(self, context: Any) -> None:
        if self._parts is not None:
            self._parts.close()
        self._job.close()
        context.window_manager.event_timer_remove(self._timer)
        context.window_manager.progress_end()
        show_status(context, None)
        redraw_views(context)

    def _failed(self, error: RadiosityError) -> set[str]:
        self.report({"WARNING"} if isinstance(error, Cancelled) else {"ERROR"}, str(error))
        return {"CANCELLED"}

    def _tell(self, outcome: Outcome) -> set[str]:
        warnings = outcome.report["warnings"]
        for warning in warnings[:SHOWN_WARNINGS]:
            self.report({"WARNING"}, as_line(warning))
        if len(warnings) > SHOWN_WARNINGS:
            self.report({"WARNING"}, f"{len(warnings) - SHOWN_WARNINGS} more warnings are in the report")
        if outcome.report.get("good_enough"):
            self.report({"INFO"}, "Good enough: kept a draft")
        elif outcome.exit_code:
            self.report({"WARNING"}, f"The wanted error of {outcome.report['error']['wanted']:.2%} was not reached")
        self.report({"INFO"}, f"Baked {one_line(outcome.report)}")
        return {"FINISHED"}

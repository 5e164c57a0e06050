"""Compare with Cycles: our bake, and Cycles' of the same lumels in another Blender; the open file stays as it is."""

from __future__ import annotations

from typing import Any

import bpy
from bpy.props import StringProperty

from ..radiosity_addon import compare_images
from ..radiosity_addon.command import parse_options
from ..radiosity_addon.compare import Compared, Comparison
from ..radiosity_addon.compare_request import CompareRequest, request_of
from ..radiosity_addon.job import Job, wait_for
from ..radiosity_addon.warn import as_line
from ..radiosity_addon.window_request import settings_in
from ..solver.errors import Cancelled, RadiosityError
from .status import show_status

# Seconds between two looks at the comparison.
TICK = 0.1


class RADIOSITY_OT_compare(bpy.types.Operator):
    """Bake the same light with Cycles too, and tell how far apart both are and how long each takes"""

    bl_idname = "radiosity.compare"
    bl_label = "Compare with Cycles"
    bl_options = {"REGISTER"}

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
        """Compare and wait."""
        try:
            done = wait_for(Comparison(self._request(context), context.scene, context.view_layer))
        except RadiosityError as error:
            return self._failed(error)
        return self._tell(done)

    def invoke(self, context: Any, _event: Any) -> set[str]:
        """Compare in a thread and another Blender, looked after by a timer."""
        if bpy.app.background:
            return self.execute(context)
        try:
            self._job = Comparison(self._request(context), context.scene, context.view_layer)
        except RadiosityError as error:
            return self._failed(error)
        try:
            self._job.export()
        except RadiosityError as error:
            self._job.close()
            return self._failed(error)
        except BaseException:
            self._job.close()
            raise
        self._job.start()
        manager = context.window_manager
        manager.progress_begin(0, 100)
        self._timer = manager.event_timer_add(TICK, window=context.window)
        manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: Any, event: Any) -> set[str]:
        """Show how far it is; Esc cancels; show the results when all has ended."""
        if event.type == "ESC" and event.value == "PRESS":
            self._job.cancel()
            return {"RUNNING_MODAL"}
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        progress = self._job.progress
        context.window_manager.progress_update(round(progress.fraction * 100))
        show_status(context, f"Comparing {progress.line()} (Esc cancels)")
        if not self._job.is_done:
            return {"PASS_THROUGH"}
        try:
            done = self._job.finish()
        except RadiosityError as error:
            return self._failed(error)
        finally:
            self._end(context)
        return self._tell(done)

    def cancel(self, context: Any) -> None:
        """Blender ends the operator: a file is loaded, or the window closed."""
        self._end(context)

    def _request(self, context: Any) -> CompareRequest:
        given = parse_options(self.options, "compare")
        kept = context.scene.radiosity_compare
        return request_of({"seconds": kept.seconds, "camera": kept.camera, **vars(given)},
                          settings_in(context, given), bpy.data.filepath)

    def _end(self, context: Any) -> None:
        self._job.close()
        context.window_manager.event_timer_remove(self._timer)
        context.window_manager.progress_end()
        show_status(context, None)

    def _failed(self, error: RadiosityError) -> set[str]:
        self.report({"WARNING"} if isinstance(error, Cancelled) else {"ERROR"}, str(error))
        return {"CANCELLED"}

    def _tell(self, done: Compared) -> set[str]:
        for warning in done.report["warnings"]:
            self.report({"WARNING"}, as_line(warning))
        where = "" if not bpy.app.background and compare_images.show(done) else f": see {done.files['page']}"
        ours = done.report["comparison"]["ours"]
        self.report({"INFO"}, f"Error {ours['rms']:.2%} against Cycles, bias {ours['bias']:+.2%}, in "
                    f"{ours['seconds']:.1f} s{where}")
        return {"FINISHED"}


CLASSES = (RADIOSITY_OT_compare,)

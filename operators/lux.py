"""Lux: illuminance in false colours, on a working plane, and as a table."""

from __future__ import annotations

from typing import Any

import bpy

from ..radiosity_addon import lux
from ..radiosity_addon.job import Job
from ..radiosity_addon.request import folder_beside
from ..radiosity_addon.results import any_result
from ..radiosity_addon.settings import ADVICE
from ..radiosity_addon.view_settings import LUX
from ..radiosity_addon.working_plane import PlaneJob
from ..solver.errors import Cancelled, RadiosityError
from .preview import shade_materials, toggle

# Seconds between two looks at the worker.
TICK = 0.1
TABLE_FILE = "lux.csv"


class RADIOSITY_OT_lux_view(bpy.types.Operator):
    """Show the illuminance of baked surfaces in false colors with isolines, and list it in lx"""

    bl_idname = "radiosity.lux_view"
    bl_label = "Show Lux"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: Any) -> bool:
        if Job.current is not None or context.scene is None:
            return False
        if not any_result() and context.scene.radiosity_view.mode != LUX:
            cls.poll_message_set("Nothing is baked: press Bake Radiosity first")
            return False
        return True

    def execute(self, context: Any) -> set[str]:
        """Measure, then switch."""
        if context.scene.radiosity_view.mode != LUX:
            try:
                lux.keep(context.scene, lux.measure(context.scene, context.evaluated_depsgraph_get()), surfaces=True)
            except RadiosityError as error:
                self.report({"ERROR"}, str(error))
                return {"CANCELLED"}
        return toggle(self, context, LUX, "{} objects show their illuminance")


class RADIOSITY_OT_working_plane(bpy.types.Operator):
    """Measure the illuminance on a horizontal plane above the floor"""

    bl_idname = "radiosity.working_plane"
    bl_label = "Measure Working Plane"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: Any) -> bool:
        return Job.current is None and context.scene is not None

    def execute(self, context: Any) -> set[str]:
        """Measure and wait."""
        try:
            self._start(context)
        except RadiosityError as error:
            return self._failed(error)
        try:
            return self._tell(context)
        finally:
            self._job.close()

    def invoke(self, context: Any, _event: Any) -> set[str]:
        """Measure in a thread, looked after by a timer."""
        if bpy.app.background:
            return self.execute(context)
        try:
            self._start(context)
        except RadiosityError as error:
            return self._failed(error)
        self._timer = context.window_manager.event_timer_add(TICK, window=context.window)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: Any, event: Any) -> set[str]:
        """Esc cancels; show the results when the worker has ended."""
        if event.type == "ESC" and event.value == "PRESS":
            self._job.cancel()
            return {"RUNNING_MODAL"}
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        if context.area is not None:
            context.area.tag_redraw()
        if not self._job.is_done:
            return {"PASS_THROUGH"}
        try:
            return self._tell(context)
        finally:
            self.cancel(context)

    def cancel(self, context: Any) -> None:
        """End the worker and the timer."""
        self._job.close()
        context.window_manager.event_timer_remove(self._timer)

    def _start(self, context: Any) -> None:
        self._job = PlaneJob(context.scene, context.view_layer)
        try:
            self._job.export()
            self._job.start()
        except BaseException:
            self._job.close()
            raise

    def _tell(self, context: Any) -> set[str]:
        try:
            row = self._job.measured()
        except RadiosityError as error:
            return self._failed(error)
        shade_materials(context)
        self.report({"INFO"}, f"{row.name}: minimum {row.minimum:.4g}, mean {row.mean:.4g}, maximum {row.maximum:.4g} "
                    f"lx, uniformity {row.uniformity:.2f}")
        return {"FINISHED"}

    def _failed(self, error: RadiosityError) -> set[str]:
        self.report({"WARNING"} if isinstance(error, Cancelled) else {"ERROR"}, str(error))
        return {"CANCELLED"}


class RADIOSITY_OT_lux_csv(bpy.types.Operator):
    """Write the table of illuminance to lux.csv in the output folder"""

    bl_idname = "radiosity.lux_csv"
    bl_label = "Write Table as CSV"
    bl_options = {"REGISTER"}

    @classmethod
    def poll(cls, context: Any) -> bool:
        return context.scene is not None and len(context.scene.radiosity_view.rows) > 0

    def execute(self, context: Any) -> set[str]:
        """Write."""
        scene = context.scene
        try:
            path = folder_beside(bpy.data.filepath, scene.radiosity.output, advice=ADVICE) / TABLE_FILE
            lux.write_csv(path, scene.radiosity_view.rows)
        except RadiosityError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        self.report({"INFO"}, f"Wrote {path}")
        return {"FINISHED"}


CLASSES = (RADIOSITY_OT_lux_view, RADIOSITY_OT_working_plane, RADIOSITY_OT_lux_csv)

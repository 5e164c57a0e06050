"""Lux: illuminance in false colours, on a working plane, and as a table."""

from __future__ import annotations

from typing import Any

import bpy

from ..radiosity_addon import lux
from ..radiosity_addon.job import wait_for
from ..radiosity_addon.lux import Row
from ..radiosity_addon.request import folder_beside
from ..radiosity_addon.results import any_result
from ..radiosity_addon.settings import ADVICE
from ..radiosity_addon.view_settings import LUX
from ..radiosity_addon.working_plane import PlaneJob
from ..solver.errors import RadiosityError
from .preview import shade_materials, toggle
from .working import Working, is_free

TABLE_FILE = "lux.csv"


class RADIOSITY_OT_lux_view(bpy.types.Operator):
    """Show the illuminance of baked surfaces in false colors with isolines, and list it in lx"""

    bl_idname = "radiosity.lux_view"
    bl_label = "Show Lux"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: Any) -> bool:
        if not is_free(cls) or context.scene is None:
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


class RADIOSITY_OT_working_plane(Working, bpy.types.Operator):
    """Measure the illuminance on a horizontal plane above the floor"""

    bl_idname = "radiosity.working_plane"
    bl_label = "Measure Working Plane"
    bl_options = {"REGISTER", "UNDO"}
    doing = "Measuring"

    @classmethod
    def poll(cls, context: Any) -> bool:
        return is_free(cls) and context.scene is not None

    def execute(self, context: Any) -> set[str]:
        """Measure and wait."""
        try:
            row = wait_for(PlaneJob(context.scene, context.view_layer))
        except RadiosityError as error:
            return self._failed(error)
        return self._tell(row)

    def invoke(self, context: Any, _event: Any) -> set[str]:
        """Measure in a thread, looked after by a timer."""
        if bpy.app.background:
            return self.execute(context)
        try:
            job = PlaneJob(context.scene, context.view_layer)
        except RadiosityError as error:
            return self._failed(error)
        return self._begin(context, job)

    def _tell(self, row: Row) -> set[str]:
        shade_materials(bpy.context)
        self.report({"INFO"}, f"{row.name}: minimum {row.minimum:.4g}, mean {row.mean:.4g}, maximum {row.maximum:.4g} "
                    f"lx, uniformity {row.uniformity:.2f}")
        return {"FINISHED"}


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

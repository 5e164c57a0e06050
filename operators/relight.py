"""Relight: lamps as they are now into the baked images, from kept light groups; and Clear Groups."""

from __future__ import annotations

from typing import Any

import bpy
from bpy.props import StringProperty

from ..radiosity_addon import cache
from ..radiosity_addon.command import parse_options
from ..radiosity_addon.job import Job
from ..radiosity_addon.relight import relight
from ..radiosity_addon.relight_request import kept_in, relight_request
from ..radiosity_addon.warn import Warnings, as_line
from ..solver.errors import RadiosityError


class RADIOSITY_OT_relight(bpy.types.Operator):
    """Update the baked light to the lamps, emission and world as they are now, without another bake"""

    bl_idname = "radiosity.relight"
    bl_label = "Update Light"
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
        """Mix the kept groups and write the images."""
        warnings: Warnings = []
        try:
            request = relight_request(context.scene, parse_options(self.options))
            outcome = relight(request, context.scene, context.view_layer, warnings)
        except RadiosityError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        for warning in warnings:
            self.report({"WARNING"}, as_line(warning))
        told = outcome.report
        self.report({"INFO"}, f"Relit {len(told['outputs'])} objects from {len(told['groups'])} light groups in "
                    f"{told['seconds']:.2f} s")
        return {"FINISHED"}


class RADIOSITY_OT_clear_groups(bpy.types.Operator):
    """Delete the kept light groups of this scene from disk; baked images stay as they are"""

    bl_idname = "radiosity.clear_groups"
    bl_label = "Clear Groups"
    bl_options = {"REGISTER"}

    @classmethod
    def poll(cls, context: Any) -> bool:
        return Job.current is None and context.scene is not None and kept_in(context.scene) is not None

    def execute(self, context: Any) -> set[str]:
        """Delete, and say how much."""
        folder = kept_in(context.scene)
        if folder is None:
            return {"CANCELLED"}
        try:
            freed = cache.clear(folder)
        except OSError as cause:
            self.report({"ERROR"}, f"{folder} can't be deleted ({cause.strerror}): check its rights")
            return {"CANCELLED"}
        self.report({"INFO"}, f"Deleted {freed / 1e6:.1f} MB of light groups in {folder}")
        return {"FINISHED"}


CLASSES = (RADIOSITY_OT_relight, RADIOSITY_OT_clear_groups)

"""Relight: lamps as they are now into the baked images, from kept light groups; and Clear Groups."""

from __future__ import annotations

from argparse import Namespace
from typing import Any

import bpy

from ..radiosity_addon import cache, live_relight
from ..radiosity_addon.command import parse_options
from ..radiosity_addon.job import Outcome
from ..radiosity_addon.panel_words import in_panel_words
from ..radiosity_addon.relight import RelightJob, relight
from ..radiosity_addon.relight_request import kept_in, relight_request
from ..radiosity_addon.warn import as_line
from ..solver.errors import RadiosityError
from .working import Asked, Working, is_free


class RADIOSITY_OT_relight(Asked, Working, bpy.types.Operator):
    """Update the baked light to the lamps, emission and world as they are now, without another bake"""

    bl_idname = "radiosity.relight"
    bl_label = "Update Light"
    bl_options = {"REGISTER", "UNDO"}
    doing = "Relighting"

    def execute(self, context: Any) -> set[str]:
        """Mix the kept groups, write the images, and wait."""
        try:
            given = parse_options(self.options, "relight")
            request = relight_request(context.scene, given)
            outcome = relight(request, context.scene, context.view_layer, vars(given))
        except RadiosityError as error:
            return self._failed(error)
        return self._tell(outcome)

    def invoke(self, context: Any, _event: Any) -> set[str]:
        """The same in a thread, looked after by a timer."""
        if bpy.app.background:
            return self.execute(context)
        try:
            given = parse_options(self.options, "relight")
            job = RelightJob(relight_request(context.scene, given), context.scene, context.view_layer, vars(given))
        except RadiosityError as error:
            return self._failed(error)
        return self._begin(context, job)

    def _tell(self, outcome: Outcome) -> set[str]:
        told = outcome.report
        for warning in told["warnings"]:
            self.report({"WARNING"}, in_panel_words(as_line(warning)))
        self.report({"INFO"}, f"Relit {len(told['outputs'])} objects from {len(told['groups'])} light groups in "
                    f"{told['seconds']:.2f} s")
        return {"FINISHED"}


class RADIOSITY_OT_follow(Working, bpy.types.Operator):
    """Update the baked light after a change, as Live does"""

    bl_idname = "radiosity.follow"
    bl_label = "Follow"
    bl_options = {"INTERNAL"}
    doing = "Relighting"

    @classmethod
    def register(cls) -> None:
        """Live mode starts it, in a window that shows the scene."""
        live_relight.start_in_window(_follow)

    @classmethod
    def unregister(cls) -> None:
        """And no longer."""
        live_relight.start_in_window(None)

    def invoke(self, context: Any, _event: Any) -> set[str]:
        """Begin; what stands in the way is told in the panel, where Live is switched on."""
        self._scene_name = context.scene.name
        try:
            job = RelightJob(relight_request(context.scene, Namespace()), context.scene, context.view_layer, live=True)
        except RadiosityError as error:
            return self._failed(error)
        return self._begin(context, job)

    def _failed(self, error: RadiosityError) -> set[str]:
        live_relight.tell_problem(self._scene_name, str(error))
        return {"CANCELLED"}

    def _tell(self, outcome: Outcome) -> set[str]:
        return {"FINISHED"}


def _follow(scene: Any) -> None:
    """Start the operator in a window that shows the scene, if there is one."""
    for window in bpy.context.window_manager.windows:
        if window.scene == scene:
            with bpy.context.temp_override(window=window):
                bpy.ops.radiosity.follow("INVOKE_DEFAULT")
            return


class RADIOSITY_OT_clear_groups(bpy.types.Operator):
    """Delete the kept light groups of this scene from disk; baked images stay as they are"""

    bl_idname = "radiosity.clear_groups"
    bl_label = "Clear Groups"
    bl_options = {"REGISTER"}

    @classmethod
    def poll(cls, context: Any) -> bool:
        return is_free(cls) and context.scene is not None and kept_in(context.scene) is not None

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


CLASSES = (RADIOSITY_OT_relight, RADIOSITY_OT_follow, RADIOSITY_OT_clear_groups)

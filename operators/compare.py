"""Compare with Cycles: our bake, and Cycles' of the same lumels in another Blender; the open file stays as it is."""

from __future__ import annotations

from typing import Any

import bpy

from ..radiosity_addon import compare_images
from ..radiosity_addon.command import parse_options
from ..radiosity_addon.compare import Compared, Comparison
from ..radiosity_addon.compare_request import CompareRequest, request_of
from ..radiosity_addon.job import wait_for
from ..radiosity_addon.warn import as_line
from ..radiosity_addon.window_request import settings_in
from ..solver.errors import RadiosityError
from .working import Asked, Working


class RADIOSITY_OT_compare(Asked, Working, bpy.types.Operator):
    """Bake the same light with Cycles too, and tell how far apart both are and how long each takes"""

    bl_idname = "radiosity.compare"
    bl_label = "Compare with Cycles"
    bl_options = {"REGISTER"}
    doing = "Comparing"

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
            job = Comparison(self._request(context), context.scene, context.view_layer)
        except RadiosityError as error:
            return self._failed(error)
        return self._begin(context, job)

    def _request(self, context: Any) -> CompareRequest:
        given = parse_options(self.options, "compare")
        kept = context.scene.radiosity_compare
        return request_of({"seconds": kept.seconds, "camera": kept.camera, **vars(given)},
                          settings_in(context, given), bpy.data.filepath)

    def _tell(self, done: Compared) -> set[str]:
        for warning in done.report["warnings"]:
            self.report({"WARNING"}, as_line(warning))
        where = "" if not bpy.app.background and compare_images.show(done) else f": see {done.files['page']}"
        ours = done.report["comparison"]["ours"]
        self.report({"INFO"}, f"Error {ours['rms']:.2%} against Cycles, bias {ours['bias']:+.2%}, in "
                    f"{ours['seconds']:.1f} s{where}")
        return {"FINISHED"}


CLASSES = (RADIOSITY_OT_compare,)

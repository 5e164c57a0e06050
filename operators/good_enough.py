"""Good Enough: end the bake that is on its way, and keep what it has shown last."""

from __future__ import annotations

from typing import Any

import bpy

from ..radiosity_addon.job import Job
from ..radiosity_addon.live import LiveJob


class RADIOSITY_OT_good_enough(bpy.types.Operator):
    """End the bake and keep its last draft; without one yet, the bake ends with the first"""

    bl_idname = "radiosity.good_enough"
    bl_label = "Good Enough"

    @classmethod
    def poll(cls, _context: Any) -> bool:
        return isinstance(Job.current, LiveJob)

    def execute(self, _context: Any) -> set[str]:
        """Tell the bake, which writes its result by itself."""
        assert isinstance(Job.current, LiveJob)
        Job.current.good_enough()
        return {"FINISHED"}


CLASSES = (RADIOSITY_OT_good_enough,)

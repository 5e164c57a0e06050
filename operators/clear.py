"""Clear: take everything that we made out of the .blend; files on disk stay."""

from __future__ import annotations

from typing import Any

import bpy

from ..radiosity_addon.clear import clear
from .preview import shade_as_before
from .working import is_free


class RADIOSITY_OT_clear(bpy.types.Operator):
    """Remove all that bakes and views have made from the .blend: images, UV maps, color attributes. Files stay"""

    bl_idname = "radiosity.clear"
    bl_label = "Clear"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, _context: Any) -> bool:
        if any(mesh.is_editmode for mesh in bpy.data.meshes):
            cls.poll_message_set("A mesh is in Edit Mode: leave it (Tab)")
            return False
        return is_free(cls)

    def execute(self, context: Any) -> set[str]:
        """Remove, and say how much."""
        images, meshes = clear()
        shade_as_before(context)
        self.report({"INFO"}, f"Removed {images} images, and layers of {meshes} meshes")
        return {"FINISHED"}

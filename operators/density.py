"""Density: how many pixels of lightmap a metre gets, as a checker in the viewport."""

from __future__ import annotations

from typing import Any

import bpy

from ..radiosity_addon import density
from ..solver.errors import RadiosityError
from .preview import shade_materials
from .working import is_free


class RADIOSITY_OT_density(bpy.types.Operator):
    """Show a checker of lightmap pixels on each surface: green is the usual density, blue coarser, red finer"""

    bl_idname = "radiosity.density"
    bl_label = "Show Density"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: Any) -> bool:
        if any(mesh.is_editmode for mesh in bpy.data.meshes):
            cls.poll_message_set("A mesh is in Edit Mode: leave it (Tab)")
            return False
        return is_free(cls) and context.scene is not None

    def execute(self, context: Any) -> set[str]:
        """Show, and tell the range."""
        try:
            found = density.show(context.scene)
        except RadiosityError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        shade_materials(context)
        values = sorted(each.pixels_per_metre for each in found)
        self.report({"INFO"}, f"{len(found)} objects have {values[0]:.3g} to {values[-1]:.3g} px/m, usual is "
                    f"{values[len(values) // 2]:.3g}")
        return {"FINISHED"}


CLASSES = (RADIOSITY_OT_density,)

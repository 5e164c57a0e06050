"""The panel "Radiosity Lightmaps" in the properties of a mesh object."""

from __future__ import annotations

from typing import Any

import bpy


class RADIOSITY_PT_object(bpy.types.Panel):
    """Whether and how finely the object is baked."""

    bl_label = "Radiosity Lightmaps"
    bl_idname = "RADIOSITY_PT_object"
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "object"

    @classmethod
    def poll(cls, context: Any) -> bool:
        return context.object is not None and context.object.type == "MESH"

    def draw(self, context: Any) -> None:
        layout, settings = self.layout, context.object.radiosity
        layout.use_property_split = True
        layout.use_property_decorate = False
        layout.prop(settings, "exclude")
        row = layout.row()
        row.active = not settings.exclude and context.scene.radiosity.target == "lightmap"
        row.prop(settings, "density")


CLASSES = (RADIOSITY_PT_object,)

"""Preview: the viewport between the user's materials and the baked look."""

from __future__ import annotations

from typing import Any

import bpy

from ..radiosity_addon import preview
from ..radiosity_addon.results import any_result
from ..radiosity_addon.view_settings import BAKED
from ..solver.errors import RadiosityError
from .working import is_free

# Ways a viewport is shaded that show materials.
SHOWS_MATERIALS = ("MATERIAL", "RENDERED")
# How viewports were shaded before a view was switched on, by their address: it lasts as long as the window.
_shading_before: dict[int, str] = {}


class RADIOSITY_OT_preview(bpy.types.Operator):
    """Switch the viewport between your materials and the baked light on them; no material or slot is lost"""

    bl_idname = "radiosity.preview"
    bl_label = "Show Baked Light"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: Any) -> bool:
        if not is_free(cls) or context.scene is None:
            return False
        if not any_result():
            cls.poll_message_set("Nothing is baked: press Bake Radiosity first")
            return False
        return True

    def execute(self, context: Any) -> set[str]:
        """Switch."""
        return toggle(self, context, BAKED, "{} objects show their baked light")


def toggle(operator: Any, context: Any, mode: str, told: str) -> set[str]:
    """Switch a view on, or off if it is on; what the operator returns."""
    if context.scene.radiosity_view.mode == mode:
        preview.hide()
        shade_as_before(context)
        return {"FINISHED"}
    try:
        count = preview.show(context.scene, mode)
    except RadiosityError as error:
        operator.report({"ERROR"}, str(error))
        return {"CANCELLED"}
    shade_materials(context)
    operator.report({"INFO"}, told.format(count))
    return {"FINISHED"}


def shade_materials(context: Any) -> None:
    """Let the viewport show materials, if it does not."""
    space = context.space_data
    if space is not None and space.type == "VIEW_3D" and space.shading.type not in SHOWS_MATERIALS:
        _shading_before[space.as_pointer()] = space.shading.type
        space.shading.type = "MATERIAL"


def shade_as_before(context: Any) -> None:
    """The viewports' own shading again."""
    if context.window_manager is None:
        return
    for window in context.window_manager.windows:
        for area in window.screen.areas:
            for space in area.spaces:
                kept = _shading_before.pop(space.as_pointer(), None)
                if kept is not None:
                    space.shading.type = kept
    _shading_before.clear()


CLASSES = (RADIOSITY_OT_preview,)

"""Leaks: figures of the last bake's patches in false colours, and a way to their worst places."""

from __future__ import annotations

from typing import Any

import bpy

from ..radiosity_addon import leaks, patch_mesh
from ..radiosity_addon.view_settings import LEAKS
from .preview import toggle
from .working import is_free


class _OfPatches:
    @classmethod
    def poll(cls, context: Any) -> bool:
        if not is_free(cls) or context.scene is None:
            return False
        if patch_mesh.kept() is None:
            cls.poll_message_set("Nothing is baked: press Bake Radiosity first")  # type: ignore[attr-defined]
            return False
        return True


class RADIOSITY_OT_leak_view(_OfPatches, bpy.types.Operator):
    """Show the patches of the last bake, colored by where light leaks or where it goes"""

    bl_idname = "radiosity.leak_view"
    bl_label = "Show Patches"
    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context: Any) -> set[str]:
        """Switch."""
        return toggle(self, context, LEAKS, "{} patches are shown")


class RADIOSITY_OT_worst(_OfPatches, bpy.types.Operator):
    """Move the 3D cursor to the patch where the figure is highest and select its object; again for the next"""

    bl_idname = "radiosity.worst"
    bl_label = "Worst Place"
    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context: Any) -> set[str]:
        """Go to the next."""
        found = patch_mesh.load()
        assert found is not None
        table, objects = found
        view = context.scene.radiosity_view
        order = leaks.worst_first(table, view.figure)
        title = leaks.TITLES[view.figure]
        if not len(order):
            self.report({"INFO"}, f"{title}: none on any patch")
            return {"CANCELLED"}
        number = view.worst % len(order)
        index = int(order[number])
        name = leaks.place(table, objects, index, context)
        view.worst = number + 1
        value = float(leaks.figure(table, view.figure)[index])
        told = f"{value:.1%}" if leaks.is_share(view.figure) else f"{value:.4g}"
        self.report({"INFO"}, f"Place {number + 1} of {len(order)}, on {name}: {title} {told}")
        return {"FINISHED"}


CLASSES = (RADIOSITY_OT_leak_view, RADIOSITY_OT_worst)

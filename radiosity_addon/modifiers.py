"""Modifiers applied where they keep a mesh from holding its result."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import bpy

from . import cycles
from .binding import Binding
from .visible import carriers
from .warn import Warnings, warn


def apply_modifiers(scene: Any, view_layer: Any, bindings: Sequence[Binding], warnings: Warnings) -> set[str]:
    """Give each object the mesh that a render shows, without modifiers; returns the names of the objects changed.

    Objects that shared their mesh with others get one of their own. Those that show more than meshes of their own (see
    `carriers`) keep their modifiers, and so do those with shape keys, which would be lost.
    """
    names = dict.fromkeys(binding.object for binding in bindings if binding.mesh and not binding.linked)
    meshes = cycles.with_render_depsgraph(scene, view_layer, lambda depsgraph: _evaluated(depsgraph, names))
    for name, mesh in meshes.items():
        item = bpy.data.objects[name]
        kinds = ", ".join(modifier.name for modifier in item.modifiers)
        item.modifiers.clear()
        _replace_mesh(item, mesh)
        warn(warnings, name, "modifiers_applied",
             f"its modifiers ({kinds}) were applied, so that its mesh can hold the result "
             "(--no-apply-modifiers keeps them)")
    return set(meshes)


def _evaluated(depsgraph: Any, names: dict[str, None]) -> dict[str, Any]:
    kept = carriers(depsgraph)
    return {name: bpy.data.meshes.new_from_object(bpy.data.objects[name].evaluated_get(depsgraph),
                                                  preserve_all_data_layers=True, depsgraph=depsgraph)
            for name in names if name in bpy.data.objects and name not in kept
            and bpy.data.objects[name].data.shape_keys is None}


def _replace_mesh(item: Any, mesh: Any) -> None:
    """Give an object another mesh, under the same name if no other object uses the old one."""
    old, name = item.data, item.data.name
    item.data = mesh
    if old.users == 0:
        bpy.data.meshes.remove(old)
    mesh.name = name

"""Whether the viewport has evaluated what a render would show.

A render's view has to be evaluated anew each time it is asked for, and after it all viewports draw the scene from its
start; the viewport's own is there already.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import bpy

from .visible import rendered_objects

# Modifiers without settings of their own for renders, and with the same result in both. Not: subdivisions (levels, and
# the graphics card's part in them), screws, oceans, particles, fluids, read files.
SAME_IN_BOTH = frozenset({
    "ARRAY", "BEVEL", "BOOLEAN", "DECIMATE", "EDGE_SPLIT", "MASK", "MIRROR", "REMESH", "SKIN", "SOLIDIFY",
    "TRIANGULATE", "WELD", "WIREFRAME", "NODES",
    "ARMATURE", "CAST", "CORRECTIVE_SMOOTH", "CURVE", "DISPLACE", "HOOK", "LAPLACIANDEFORM", "LAPLACIANSMOOTH",
    "LATTICE", "MESH_DEFORM", "SHRINKWRAP", "SIMPLE_DEFORM", "SMOOTH", "SURFACE_DEFORM", "WARP", "WAVE",
    "DATA_TRANSFER", "NORMAL_EDIT", "WEIGHTED_NORMAL", "UV_PROJECT", "UV_WARP",
    "VERTEX_WEIGHT_EDIT", "VERTEX_WEIGHT_MIX", "VERTEX_WEIGHT_PROXIMITY",
})
# The node that tells geometry nodes which of the two they are evaluated for.
TELLS_APART = "GeometryNodeIsViewport"


def has_the_same_objects(view_layer: Any) -> bool:
    """Whether the viewport shows those objects that a render does, if not with the same modifiers."""
    shown = {item for item in view_layer.objects if item.visible_get(view_layer=view_layer)}
    return shown == set(rendered_objects(view_layer))


def is_the_same(scene: Any, view_layer: Any) -> bool:
    """Whether the viewport is known to show all that a render does, just as it does; False where that can't be told."""
    return (
        view_layer.use
        and not scene.render.use_simplify
        and all(item.mode == "OBJECT" for item in view_layer.objects)
        and has_the_same_objects(view_layer)
        and all(map(_evaluates_the_same, bpy.data.objects))
        # Instances show what is hidden from neither, whatever the view layer holds.
        and all(collection.hide_viewport == collection.hide_render for collection in bpy.data.collections)
        and not _tell_apart(bpy.data.node_groups)
    )


def _evaluates_the_same(item: Any) -> bool:
    """Whether an object, wherever it is used, is the same to the viewport and to a render."""
    return (
        item.hide_viewport == item.hide_render
        and item.show_instancer_for_viewport == item.show_instancer_for_render
        and all(modifier.type in SAME_IN_BOTH and modifier.show_viewport == modifier.show_render
                for modifier in item.modifiers)
        and _has_one_resolution(item.data)
    )


def _has_one_resolution(data: Any) -> bool:
    """Whether what an object holds is as fine in a render as in the viewport: balls and curves may not be."""
    if isinstance(data, bpy.types.MetaBall):
        return bool(data.resolution == data.render_resolution)
    if isinstance(data, bpy.types.Curve):
        return data.render_resolution_u in {0, data.resolution_u} and data.render_resolution_v in {0, data.resolution_v}
    return True


def _tell_apart(trees: Iterable[Any]) -> bool:
    return any(node.bl_idname == TELLS_APART for tree in trees if tree.bl_idname == "GeometryNodeTree"
               for node in tree.nodes)

"""Everything in the open .blend that a user could see change, as a flat table: path -> value.

Walks Blender's own description of its data (RNA) from every data-block, meshes and images to the last bit, and adds
what is no property of a data-block: selection, mode, what is hidden.
"""

from __future__ import annotations

import warnings
from typing import Any

import bpy
import numpy as np

# Counted or derived by Blender itself, or bare links back; Blender 4.2 crashes on the brush of `uv_sculpt`.
SKIPPED = frozenset({
    "rna_type", "users", "session_uid", "preview", "original", "is_evaluated", "id_data", "tag", "depsgraph",
    "loop_triangles", "loop_triangle_polygons", "vertex_normals", "polygon_normals", "corner_normals", "pixels",
    "vertices", "edges", "loops", "polygons", "uv_layers", "attributes", "color_attributes", "vertex_colors",
    "bindcode", "uv_layer_stencil", "uv_layer_clone", "loose_edges", "skin_vertices", "asset_data", "is_updated",
    "is_updated_data", "has_data", "is_dirty", "dimensions", "texspace_location", "texspace_size",
    "uv_sculpt"})
# What stands for the data-blocks of the program's window, which draws itself anew whenever it likes.
NOT_THE_USERS = frozenset({"window_managers", "screens", "workspaces", "brushes", "libraries", "rna_type"})
DEEPEST = 9
WIDTHS = {"FLOAT": ("value", 1, np.float32), "INT": ("value", 1, np.int32), "BOOLEAN": ("value", 1, np.bool_),
          "FLOAT_VECTOR": ("vector", 3, np.float32), "FLOAT2": ("vector", 2, np.float32),
          "FLOAT_COLOR": ("color", 4, np.float32), "BYTE_COLOR": ("color", 4, np.float32),
          "INT32_2D": ("value", 2, np.int32), "INT16_2D": ("value", 2, np.int32), "INT8": ("value", 1, np.int32)}


def snapshot() -> dict[str, Any]:
    """Path -> value of all there is."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # properties that a later Blender will not have
        return _snapshot()


def _snapshot() -> dict[str, Any]:
    found: dict[str, Any] = {}
    for prop in bpy.data.bl_rna.properties:
        if prop.type == "COLLECTION" and prop.identifier not in NOT_THE_USERS:
            for block in getattr(bpy.data, prop.identifier):
                _walk(found, f"{prop.identifier}[{block.name_full}]", block, ())
    for scene in bpy.data.scenes:
        for layer in scene.view_layers:
            place = f"{scene.name}/{layer.name}"
            active = layer.objects.active
            found[f"{place} active"] = active.name if active is not None else None
            for item in layer.objects:
                found[f"{place} {item.name} selected"] = item.select_get(view_layer=layer)
                found[f"{place} {item.name} hidden"] = item.hide_get(view_layer=layer)
                found[f"{place} {item.name} mode"] = item.mode
    found["mode"] = bpy.context.mode
    found["scene in the window"] = bpy.context.scene.name
    return found


def changes(before: dict[str, Any], after: dict[str, Any]) -> dict[str, tuple[Any, Any]]:
    """What is there no more, or has another value: path -> (before, after)."""
    now = {path: after.get(path, "gone") for path in before}
    return {path: (value, now[path]) for path, value in before.items() if now[path] != value}


def additions(before: dict[str, Any], after: dict[str, Any]) -> set[str]:
    """Paths that are new."""
    return set(after) - set(before)


def _walk(found: dict[str, Any], path: str, thing: Any, above: tuple[int, ...]) -> None:
    if len(above) > DEEPEST or (above and thing.as_pointer() in above):
        return
    here = (*above, thing.as_pointer())
    if isinstance(thing, bpy.types.Mesh):
        _mesh(found, path, thing)
    if isinstance(thing, bpy.types.Image) and thing.has_data:
        pixels = np.empty(len(thing.pixels), np.float32)
        thing.pixels.foreach_get(pixels)
        found[f"{path} pixels"] = pixels.tobytes()
    if isinstance(thing, bpy.types.ID):
        for key in thing.keys():  # noqa: SIM118 - an ID is no dict
            # What an addon registered is walked below; Blender makes its room when it is first read.
            if key not in thing.bl_rna.properties:
                value = thing[key]
                found[f"{path}[{key!r}]"] = str(value.to_dict() if hasattr(value, "to_dict") else value)
    for prop in thing.bl_rna.properties:
        if prop.identifier in SKIPPED:
            continue
        value = getattr(thing, prop.identifier, None)
        name = f"{path}.{prop.identifier}"
        if prop.type == "POINTER":
            _pointer(found, name, value, here)
        elif prop.type == "COLLECTION":
            for index, item in enumerate(value or ()):
                label = getattr(item, "name", "") if item is not None else ""
                _pointer(found, f"{name}[{label or index}]", item, here)
        else:
            found[name] = tuple(value) if getattr(prop, "is_array", False) else (
                frozenset(value) if isinstance(value, set) else value)


def _pointer(found: dict[str, Any], name: str, value: Any, above: tuple[int, ...]) -> None:
    if value is None or (isinstance(value, bpy.types.ID) and not value.is_embedded_data):
        found[name] = value.name_full if value is not None else None
    elif hasattr(value, "bl_rna") and hasattr(value, "as_pointer"):
        _walk(found, name, value, above)


def _mesh(found: dict[str, Any], path: str, mesh: Any) -> None:
    for attribute in mesh.attributes:
        name = f"{path} attribute {attribute.name} {attribute.domain} {attribute.data_type}"
        known = WIDTHS.get(attribute.data_type)
        if known is not None:
            values = np.zeros(len(attribute.data) * known[1], known[2])
            attribute.data.foreach_get(known[0], values)
            found[name] = values.tobytes()
    faces = np.empty(len(mesh.polygons), np.int32)
    mesh.polygons.foreach_get("loop_total", faces)
    found[f"{path} faces"] = faces.tobytes()
    layers, colours = mesh.uv_layers, mesh.color_attributes
    found[f"{path} active map"] = layers.active.name if layers.active is not None else None
    found[f"{path} rendered map"] = next((layer.name for layer in layers if layer.active_render), None)
    found[f"{path} active colour"] = colours.active_color.name if colours.active_color is not None else None
    found[f"{path} rendered colour"] = (colours[colours.render_color_index].name
                                        if 0 <= colours.render_color_index < len(colours) else None)
    found[f"{path} order of maps"] = [layer.name for layer in layers if layer.name != mesh.get("radiosity_uv_map")]

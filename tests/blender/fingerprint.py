"""Everything that a .blend holds, as plain values: to compare a file before and after.

Of every datablock: all properties as RNA knows them (nested ones too), custom properties, node trees with their links,
material slots, users, mesh attributes with all values, image pixels. Used in Blender's window too: imports no test.
"""

from __future__ import annotations

import hashlib
from typing import Any

import bpy
import numpy as np

# What changes without anyone changing the file, or says the same as something else that is read.
LEFT_OUT = {
    "users",
    "rna_type", "bl_rna", "session_uid", "is_evaluated", "is_updated", "is_updated_data", "tag", "original",
    "is_dirty", "depsgraph", "bindcode", "pixels", "preview", "has_data", "is_loaded", "select", "window_managers",
    "screens", "workspaces", "vertices", "edges", "loops", "polygons", "loop_triangles", "vertex_normals",
    "polygon_normals", "corner_normals", "loop_triangle_polygons", "uv_layers", "attributes", "color_attributes",
    "view_layers", "all_objects", "render_slots", "cycles_curves", "keying_sets_all", "device_option_count",
    "is_saved", "filepath_from_user", "tool_settings", "display", "links", "node", "internal_links",
    "uv_layer_clone", "uv_layer_stencil", "uv", "sequence_editor", "internal_data", "parent_recursive", "children",
    "children_recursive", "users_collection", "users_scene",
}
# Attributes of a mesh that only say what is selected or shown as active in the editor.
EDITOR = (".select_vert", ".select_edge", ".select_poly", ".corner_edge")
KINDS = {"FLOAT": ("value", 1), "INT": ("value", 1), "BOOLEAN": ("value", 1), "FLOAT_VECTOR": ("vector", 3),
         "FLOAT_COLOR": ("color", 4), "BYTE_COLOR": ("color", 4), "FLOAT2": ("vector", 2), "INT8": ("value", 1),
         "INT32_2D": ("value", 2), "INT16_2D": ("value", 2), "QUATERNION": ("value", 4)}
DEEPEST = 6


def users_are_counted() -> bool:
    """Whether Blender counts users right when it copies a material: 4.2 counts those of its images and groups twice,
    until the file is loaded again."""
    image = bpy.data.images.new("counted", 1, 1)
    material = bpy.data.materials.new("counted")
    if material.node_tree is None:
        material.use_nodes = True
    material.node_tree.nodes.new("ShaderNodeTexImage").image = image
    copy = material.copy()
    right = bool(image.users == 2)
    for made in (copy, material):
        bpy.data.materials.remove(made)
    bpy.data.images.remove(image)
    return right


def fingerprint() -> dict[str, Any]:
    """{"collection/name": values} of every datablock of the open file."""
    found: dict[str, Any] = {}
    for kind in bpy.data.bl_rna.properties:
        if kind.type != "COLLECTION" or kind.identifier in LEFT_OUT:
            continue
        for item in getattr(bpy.data, kind.identifier):
            if not (kind.identifier == "images" and item.type == "RENDER_RESULT"):
                found[f"{kind.identifier}/{item.name_full}"] = datablock(item)
    return found


def differences(before: dict[str, Any], after: dict[str, Any]) -> list[str]:
    """What is not the same, one line each."""
    if not users_are_counted():
        before, after = ({name: {**values, "users": None} for name, values in each.items()} for each in (before, after))
    told = [f"{name} is gone" for name in before.keys() - after.keys()]
    told += [f"{name} is new" for name in after.keys() - before.keys()]
    for name in before.keys() & after.keys():
        told += [f"{name}{path}" for path in _unequal(before[name], after[name])]
    return sorted(told)


def datablock(item: Any) -> dict[str, Any]:
    """One datablock as plain values."""
    values: dict[str, Any] = {"rna": _struct(item, 0), "custom": _custom(item), "users": item.users}
    if isinstance(item, bpy.types.Mesh):
        values["attributes"] = {layer.name: _attribute(layer) for layer in item.attributes if layer.name not in EDITOR}
        values["layers"] = {
            "uv": [(layer.name, layer.active, layer.active_render, layer.active_clone) for layer in item.uv_layers],
            "colours": ([layer.name for layer in item.color_attributes], item.color_attributes.render_color_index,
                        item.color_attributes.active_color_index),
            "materials": [slot.name if slot is not None else None for slot in item.materials]}
    if isinstance(item, bpy.types.Object):
        values["slots"] = [(slot.link, slot.material.name if slot.material else None) for slot in item.material_slots]
        values["selected"] = item.select_get() if item.name in bpy.context.view_layer.objects else None
    if isinstance(item, bpy.types.Image):
        pixels = np.empty(len(item.pixels), np.float32)
        item.pixels.foreach_get(pixels)
        values["pixels"] = _digest(pixels)
    if isinstance(item, bpy.types.Scene):
        values["objects"] = [thing.name for thing in item.objects]
    tree = item if isinstance(item, bpy.types.NodeTree) else getattr(item, "node_tree", None)
    if tree is not None:
        values["links"] = [(link.from_node.name, link.from_socket.identifier, link.to_node.name,
                            link.to_socket.identifier) for link in tree.links]
    return values


def _struct(item: Any, depth: int) -> dict[str, Any]:
    found = {}
    for prop in item.bl_rna.properties:
        if prop.identifier in LEFT_OUT or getattr(prop, "is_deprecated", False):
            continue
        try:
            found[prop.identifier] = _value(getattr(item, prop.identifier), prop, depth)
        except (AttributeError, RuntimeError):
            continue  # what this kind of datablock does not have
    return found


def _value(value: Any, prop: Any, depth: int) -> Any:
    if isinstance(value, bpy.types.NodeTree) and value.is_embedded_data:
        return _struct(value, depth + 1)
    if isinstance(value, bpy.types.ID):
        return ("datablock", value.name_full)
    if prop.type == "POINTER":
        return _struct(value, depth + 1) if value is not None and depth < DEEPEST else None
    if prop.type == "COLLECTION":
        items = [element for element in value if element is not None]
        if items and isinstance(items[0], bpy.types.ID):
            return sorted(element.name_full for element in items)
        return [_struct(element, depth + 1) for element in items] if depth < DEEPEST else None
    if prop.type in ("FLOAT", "INT", "BOOLEAN") and getattr(prop, "is_array", False):
        return [tuple(row) if hasattr(row, "__len__") else row for row in value]
    return set(value) if isinstance(value, set) else value


def _custom(item: Any) -> dict[str, Any]:
    """Custom properties; what registered property groups keep there is read as RNA."""
    known = set(item.bl_rna.properties.keys())
    return {key: _plain(item[key]) for key in item.keys() if key not in known}  # noqa: SIM118 - a bpy struct


def _plain(value: Any) -> Any:
    if hasattr(value, "to_dict"):
        return {key: _plain(entry) for key, entry in value.items()}
    if hasattr(value, "to_list"):
        return value.to_list()
    return ("datablock", value.name_full) if isinstance(value, bpy.types.ID) else value


def _attribute(layer: Any) -> tuple[str, str, str]:
    kind = KINDS.get(layer.data_type)
    if kind is None or not len(layer.data):
        return (layer.data_type, layer.domain, "")
    field, width = kind
    values = np.empty(len(layer.data) * width, bool if layer.data_type == "BOOLEAN" else
                      np.int32 if layer.data_type.startswith("INT") else np.float32)
    layer.data.foreach_get(field, values)
    return (layer.data_type, layer.domain, _digest(values))


def _digest(values: Any) -> str:
    return hashlib.sha256(np.ascontiguousarray(values).tobytes()).hexdigest()


def _unequal(first: Any, second: Any, path: str = "") -> list[str]:
    if isinstance(first, dict) and isinstance(second, dict):
        told = []
        for key in sorted({*first, *second}, key=str):
            if key not in first or key not in second:
                told.append(f"{path}.{key} {'is new' if key in second else 'is gone'}")
            else:
                told += _unequal(first[key], second[key], f"{path}.{key}")
        return told
    if isinstance(first, list) and isinstance(second, list) and len(first) == len(second):
        return [line for index, (one, other) in enumerate(zip(first, second, strict=True))
                for line in _unequal(one, other, f"{path}[{index}]")]
    return [] if first == second or (first != first and second != second) else [f"{path}: {first!r} became {second!r}"]

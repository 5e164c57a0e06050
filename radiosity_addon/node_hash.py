"""What a node tree's result depends on, as a digest: two trees with equal digests look the same."""

from __future__ import annotations

import hashlib
import os
from typing import Any

import bpy
import numpy as np

# Properties that tell where a node is drawn, and not what it does.
LOOKS = frozenset({
    "rna_type", "location", "location_absolute", "width", "width_hidden", "height", "dimensions", "select", "name",
    "label", "color", "use_custom_color", "show_options", "show_preview", "show_texture", "hide", "parent", "color_tag",
    "warning_propagation", "inputs", "outputs", "internal_links", "id_data", "interface", "frame_current",
    "panel_states_buffer", "bl_icon", "bl_description",
})
# How deep settings of settings (curves, ramps) are followed.
DEEPEST = 6


def tree_digest(tree: Any) -> str:
    """A hexadecimal SHA-256 of all nodes, links and settings, with images by their pixels and groups by their trees."""
    digest = hashlib.sha256()
    _tree(tree, digest, {})
    return digest.hexdigest()


def uses(tree: Any, kinds: frozenset[str]) -> bool:
    """Whether a node of these kinds is in the tree or in a group of it."""
    return any(node.bl_idname in kinds or (node.bl_idname == "ShaderNodeGroup" and node.node_tree is not None
                                           and uses(node.node_tree, kinds)) for node in tree.nodes)


def _tree(tree: Any, digest: Any, seen: dict[str, int]) -> None:
    number = {node.name: index for index, node in enumerate(tree.nodes)}
    for node in tree.nodes:
        _put(digest, node.bl_idname, node.mute)
        _settings(node, digest, seen, 0)
        for socket in (*node.inputs, *node.outputs):
            value = getattr(socket, "default_value", None)
            _put(digest, socket.identifier, _plain(value, digest, seen))
    for link in tree.links:
        _put(digest, number[link.from_node.name], link.from_socket.identifier, number[link.to_node.name],
             link.to_socket.identifier, link.is_muted)


def _settings(data: Any, digest: Any, seen: dict[str, int], depth: int) -> None:
    for prop in data.bl_rna.properties:
        if prop.identifier in LOOKS or getattr(prop, "is_deprecated", False):
            continue
        value = getattr(data, prop.identifier)
        if prop.type == "COLLECTION":
            for item in value if depth < DEEPEST else ():
                _settings(item, digest, seen, depth + 1)
        elif prop.type == "POINTER" and value is not None and not isinstance(value, bpy.types.ID):
            if depth < DEEPEST:
                _settings(value, digest, seen, depth + 1)
        else:
            _put(digest, prop.identifier, _plain(value, digest, seen))


def _plain(value: Any, digest: Any, seen: dict[str, int]) -> Any:
    """A value as text that tells it apart; data-blocks by what they hold."""
    if isinstance(value, bpy.types.Image):
        return _image(value)
    if isinstance(value, bpy.types.NodeTree):
        if value.name_full not in seen:
            seen[value.name_full] = len(seen)
            _tree(value, digest, seen)
        return seen[value.name_full]
    if isinstance(value, bpy.types.Object):
        return value.name_full, np.array(value.matrix_world).tobytes()
    if isinstance(value, bpy.types.ID):
        return value.name_full
    if hasattr(value, "__len__") and not isinstance(value, str | bytes | set):
        return [_plain(item, digest, seen) for item in value]
    return value


def _image(image: Any) -> Any:
    """An image by its file, or by its pixels where there is none or they were painted over."""
    told = (image.name_full, image.source, tuple(image.size), image.colorspace_settings.name, image.alpha_mode)
    if image.packed_file is not None and not image.is_dirty:
        return told, hashlib.sha256(image.packed_file.data).hexdigest()
    path = bpy.path.abspath(image.filepath, library=image.library)
    if not image.is_dirty and path and os.path.isfile(path):
        return told, path, os.path.getmtime(path), os.path.getsize(path)
    pixels = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(pixels)
    return told, hashlib.sha256(pixels.tobytes()).hexdigest()


def _put(digest: Any, *values: Any) -> None:
    digest.update(repr(values).encode())

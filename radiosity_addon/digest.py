"""Short sums of Blender's data and of ours, by which a change is found."""

from __future__ import annotations

import hashlib
import os
from dataclasses import fields, is_dataclass
from typing import Any

import bpy
import numpy as np

# Bytes of a sum; two things of one scene never share one of this length.
BYTES = 10
# What of a node says nothing about light: where it stands and how it looks.
LOOKS = frozenset({"rna_type", "type", "location", "location_absolute", "width", "width_hidden", "height", "dimensions",
                   "name", "label", "inputs", "outputs", "internal_links", "parent", "select", "show_options",
                   "show_preview", "show_texture", "hide", "use_custom_color", "color", "color_tag", "bl_icon",
                   "warning_propagation", "debug_zone_body_lazy_function_graph", "debug_zone_lazy_function_graph"})
# Nodes inside nodes are followed this deep.
DEEPEST = 32
# Types that are asked for often: what Python knows, and Blender's, which it looks up anew each time.
PLAIN = frozenset({str, bytes, float, int, bool, type(None)})
IMAGE, NODE_TREE, ID = bpy.types.Image, bpy.types.NodeTree, bpy.types.ID
# By node, inputs for colour and strength of light: they may be turned after a bake, and are in no sum.
LIGHT_INPUTS = {
    "ShaderNodeBackground": ("Color", "Strength"),
    "ShaderNodeEmission": ("Color", "Strength"),
    "ShaderNodeBsdfPrincipled": ("Emission Color", "Emission Strength"),
}


def digest(*values: Any) -> str:
    """A sum of numbers, text, arrays, containers, our dataclasses, images and node trees."""
    state = hashlib.blake2b(digest_size=BYTES)
    for value in values:
        _add(state, value, 0)
    return state.hexdigest()


def _add(state: Any, value: Any, depth: int) -> None:
    if type(value) in PLAIN:
        state.update(f"{value!r};".encode())
    elif isinstance(value, np.ndarray):
        state.update(f"{value.dtype.str}{value.shape}".encode())
        state.update(np.ascontiguousarray(value).data)
    elif isinstance(value, IMAGE):
        _add(state, _image(value), depth)
    elif isinstance(value, NODE_TREE):
        _add_tree(state, value, depth)
    elif isinstance(value, ID):
        state.update(f"{type(value).__name__} {value.name_full};".encode())
    elif is_dataclass(value):
        state.update(type(value).__name__.encode())
        for field in fields(value):
            state.update(field.name.encode())
            _add(state, getattr(value, field.name), depth)
    elif isinstance(value, dict):
        _add(state, sorted(value.items()), depth)
    elif isinstance(value, tuple | list):
        if all(type(item) is float for item in value):
            state.update(f"{value!r};".encode())
            return
        state.update(f"{len(value)}(".encode())
        for item in value:
            _add(state, item, depth)
    elif isinstance(value, np.generic):
        _add(state, value.item(), depth)
    else:
        state.update(f"{value!r};".encode())


def is_knob(node: Any, socket: Any) -> bool:
    """Whether an unlinked input of a node says how strong light is, and nothing else."""
    return socket.name in LIGHT_INPUTS.get(node.bl_idname, ())


def _image(image: Any) -> tuple[Any, ...]:
    """What tells one state of an image from another: its file, its packed bytes, or else its pixels."""
    about = (image.name_full, tuple(image.size), image.source, image.colorspace_settings.name, image.alpha_mode)
    if image.is_dirty or image.source not in {"FILE", "TILED", "SEQUENCE", "MOVIE"}:
        pixels = np.empty(len(image.pixels), np.float32)
        image.pixels.foreach_get(pixels)
        return (*about, pixels)
    if image.packed_file is not None:
        return (*about, np.frombuffer(image.packed_file.data, np.uint8))
    path = bpy.path.abspath(image.filepath, library=image.library)
    try:
        state = os.stat(path)
    except OSError:
        return (*about, path)
    return (*about, path, state.st_size, state.st_mtime_ns)


def _add_tree(state: Any, tree: Any, depth: int) -> None:
    """Nodes with their settings and values, and the links between them."""
    if depth > DEEPEST:
        return
    numbers = {node.name: number for number, node in enumerate(tree.nodes)}
    for node in tree.nodes:
        state.update(f"node {node.bl_idname} {node.mute};".encode())
        _add_settings(state, node, LOOKS, depth)
        for socket in node.inputs:
            if not (socket.is_linked or is_knob(node, socket)) and hasattr(socket, "default_value"):
                _add(state, _plain(socket.default_value), depth)
    links = sorted((numbers[link.from_node.name], link.from_socket.identifier, numbers[link.to_node.name],
                    link.to_socket.identifier) for link in tree.links if not link.is_muted)
    _add(state, links, depth)


def _add_settings(state: Any, thing: Any, left_out: frozenset[str], depth: int) -> None:
    """All properties of something of Blender's, those of what it holds too."""
    if depth > DEEPEST:
        return
    for prop in thing.bl_rna.properties:
        name = prop.identifier
        if name in left_out or name.startswith("bl_") or name == "rna_type":
            continue
        value = getattr(thing, name, None)
        if prop.type == "POINTER" and value is not None and not isinstance(value, ID):
            _add_settings(state, value, frozenset(), depth + 1)
        elif prop.type == "COLLECTION":
            for item in value or ():
                _add_settings(state, item, frozenset(), depth + 1)
        else:
            state.update(name.encode())
            _add(state, _plain(value), depth + 1)


def _plain(value: Any) -> Any:
    """Blender's vectors and arrays as tuples; all else as it is."""
    if type(value) in PLAIN or isinstance(value, ID) or not hasattr(value, "__len__"):
        return value
    return tuple(_plain(item) for item in value)

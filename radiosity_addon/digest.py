"""Short sums of Blender's data and of ours, by which a change is found.

Sums of one scene are the same in every session, and in all files that hold it.
"""

from __future__ import annotations

import hashlib
import os
from dataclasses import fields, is_dataclass
from typing import Any

import bpy
import numpy as np

from .shown_images import ANIMATED, FROM_FILES, file_of

# Bytes of a sum; two things of one scene never share one of this length.
BYTES = 10
# What all nodes have says where they stand and how they look; light depends on what one kind has beside it.
LOOKS = frozenset(bpy.types.Node.bl_rna.properties.keys())
# What says nothing in settings of settings, such as points of curves.
INNER = frozenset({"rna_type", "select"})
# Which frame of an image is shown; one frame needs none of it. The present one is the scene's, and is no setting.
PRESENT = frozenset({"frame_current"})
FRAMES = frozenset({"use_auto_refresh", "use_cyclic", "frame_duration", "frame_offset", "frame_start"})
# Settings of settings (curves, ramps) are followed this deep.
DEEPEST = 6
# Places are told apart to this many decimals of a metre, as float64 rounds on its way.
DECIMALS = 9
# Types that are asked for often: what Python knows, and Blender's, which it looks up anew each time.
PLAIN = frozenset({str, bytes, float, int, bool, type(None)})
IMAGE, NODE_TREE, OBJECT, TEXT, ID = (bpy.types.Image, bpy.types.NodeTree, bpy.types.Object, bpy.types.Text,
                                      bpy.types.ID)
IMAGE_USER = bpy.types.ImageUser
# By node, inputs for colour and strength of light: they may be turned after a bake.
LIGHT_INPUTS = {
    "ShaderNodeBackground": ("Color", "Strength"),
    "ShaderNodeEmission": ("Color", "Strength"),
    "ShaderNodeBsdfPrincipled": ("Emission Color", "Emission Strength"),
}


def digest(*values: Any, knobs: bool = True) -> str:
    """A sum of numbers, text, arrays, containers, our dataclasses, and Blender's data.

    Images and texts count by what they hold, node trees by nodes, links and groups, objects by their place, all else
    of Blender's by its name.

    Parameters
    ----------
    knobs : whether node trees count with what of them may be turned after a bake.
    """
    found = _Sum(knobs)
    for value in values:
        found.add(value)
    return found.text()


def is_knob(node: Any, socket: Any) -> bool:
    """Whether an unlinked input of a node says how strong light is, and nothing else."""
    return socket.name in LIGHT_INPUTS.get(node.bl_idname, ())


class _Sum:
    """Adds up values."""

    def __init__(self, knobs: bool) -> None:
        self._state = hashlib.blake2b(digest_size=BYTES)
        self._knobs = knobs
        # Numbers of the node trees that are in it, by their place in memory: a group may be used often.
        self._trees: dict[int, int] = {}

    def text(self) -> str:
        """The sum, hexadecimal."""
        return self._state.hexdigest()

    def add(self, value: Any) -> None:
        """Add a value of any type."""
        if type(value) in PLAIN:
            self._state.update(f"{value!r};".encode())
        elif isinstance(value, np.ndarray):
            self._state.update(f"{value.dtype.str}{value.shape}".encode())
            self._state.update(np.ascontiguousarray(value).data)
        elif isinstance(value, ID):
            self._add_block(value)
        elif is_dataclass(value):
            self._state.update(type(value).__name__.encode())
            for field in fields(value):
                self._state.update(field.name.encode())
                self.add(getattr(value, field.name))
        elif isinstance(value, dict):
            self.add(sorted(value.items()))
        elif isinstance(value, set | frozenset):
            self.add(sorted(value))
        elif isinstance(value, np.generic):
            self.add(value.item())
        elif hasattr(value, "__len__"):
            self._add_items(tuple(value))
        else:
            self._state.update(f"{value!r};".encode())

    def _add_items(self, values: tuple[Any, ...]) -> None:
        if all(type(item) is float for item in values):
            self._state.update(f"{values!r};".encode())
            return
        self._state.update(f"{len(values)}(".encode())
        for item in values:
            self.add(item)

    def _add_block(self, block: Any) -> None:
        """A data-block by what of it counts."""
        if isinstance(block, NODE_TREE):
            is_new = block.as_pointer() not in self._trees
            number = self._trees.setdefault(block.as_pointer(), len(self._trees))
            self._state.update(f"tree {number};".encode())
            if is_new:
                self._add_tree(block)
            return
        self._state.update(f"{type(block).__name__} {block.name_full};".encode())
        if isinstance(block, IMAGE):
            self.add(_image(block))
        elif isinstance(block, OBJECT):
            self.add(np.round(np.array(block.matrix_world, np.float64), DECIMALS))
        elif isinstance(block, TEXT):
            self.add(block.as_string())

    def _add_tree(self, tree: Any) -> None:
        """Nodes with their settings and values, and the links between them."""
        nodes = [node for node in tree.nodes if node.bl_idname != "NodeFrame"]
        numbers = {node.name: number for number, node in enumerate(nodes)}
        for node in nodes:
            self._state.update(f"node {node.bl_idname} {node.mute};".encode())
            self._add_settings(node, LOOKS, 0)
            # Some nodes, as RGB and Value, keep their value in an output. A linked input's own value counts where what
            # it is linked to is muted.
            for socket in (*node.inputs, *node.outputs):
                if hasattr(socket, "default_value") and (self._knobs or not is_knob(node, socket)):
                    self.add(socket.default_value)
        self.add(sorted((numbers[link.from_node.name], link.from_socket.identifier, numbers[link.to_node.name],
                         link.to_socket.identifier) for link in tree.links if not link.is_muted))

    def _add_settings(self, thing: Any, left_out: frozenset[str], depth: int) -> None:
        """All properties of something of Blender's, those of what it holds too."""
        if depth > DEEPEST:
            return
        for prop in thing.bl_rna.properties:
            name = prop.identifier
            if name in left_out or getattr(prop, "is_deprecated", False):
                continue
            value = getattr(thing, name)
            if prop.type == "POINTER" and value is not None and not isinstance(value, ID):
                self._add_settings(value, _left_out(thing, value), depth + 1)
            elif prop.type == "COLLECTION":
                for item in value:
                    self._add_settings(item, INNER, depth + 1)
            else:
                self._state.update(name.encode())
                self.add(_file(_path(thing, value)) if prop.type == "STRING" and prop.subtype == "FILE_PATH" else value)


def _left_out(node: Any, inner: Any) -> frozenset[str]:
    """What does not count of something that a node holds."""
    if not isinstance(inner, IMAGE_USER):
        return INNER
    animated = node.image is not None and node.image.source in ANIMATED
    return INNER | PRESENT if animated else INNER | PRESENT | FRAMES


def _image(image: Any) -> tuple[Any, ...]:
    """What tells one state of an image from another: its file, its packed bytes, or else its pixels."""
    about = (tuple(image.size), image.source, image.colorspace_settings.name, image.alpha_mode)
    if image.is_dirty or image.source not in FROM_FILES:
        pixels = np.empty(len(image.pixels), np.float32)
        image.pixels.foreach_get(pixels)
        return (*about, pixels)
    if image.packed_file is not None:
        return (*about, np.frombuffer(image.packed_file.data, np.uint8))
    return (*about, *_file(file_of(image)))


def _path(thing: Any, path: str) -> str:
    """Where a file lies that a node names."""
    return os.path.normpath(bpy.path.abspath(path, library=thing.id_data.library)) if path else ""


def _file(path: str) -> tuple[Any, ...]:
    """A file's state, without reading it."""
    try:
        state = os.stat(path)
    except OSError:
        return (path,)
    return path, state.st_size, state.st_mtime_ns

"""The inputs of shader nodes that alone say how strong light is: what may be turned after a bake.

A material or world is the sum of what its emitting nodes give, each in proportion to its own colour times strength.
"""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np

from . import compat
from .digest import LIGHT_INPUTS, digest
from .reads import reads_material_index
from .sockets import Reader, Triple, feeding

# What the one knob of a world without nodes is called.
FLAT = "color"


def knobs_of(block: Any) -> dict[str, Triple]:
    """Colour times strength by the node's name, of a material or world; what other nodes feed counts as 1."""
    if block is None or (isinstance(block, bpy.types.World) and not block.cycles_visibility.diffuse):
        return {}
    if not compat.uses_nodes(block):
        return {FLAT: _triple(block.color)} if hasattr(block, "color") else {}
    return {name: _strength(node) for name, node in giving(block.node_tree).items()}


def giving(tree: Any) -> dict[str, Any]:
    """The nodes whose light a tree's output gives to diffuse rays, by their names after those of the groups that they
    are in; what such rays don't see, as a backdrop for the camera, is left out.
    """
    output = tree.get_output_node("CYCLES")
    follower = _Follower()
    if output is not None:
        follower.follow(output.inputs["Surface"])
    return follower.found


def rest_of(block: Any) -> str:
    """A sum of all of a material or world but its knobs."""
    if block is None:
        return "nothing"
    if not compat.uses_nodes(block):
        return digest("flat" if hasattr(block, "color") else tuple(block.diffuse_color))
    index = getattr(block, "pass_index", 0) if reads_material_index(block.node_tree) else 0
    return digest(block.node_tree, index, knobs=False)


class _Follower(Reader):
    """Follows shaders to the nodes that give light."""

    def __init__(self) -> None:
        super().__init__("", [])
        self.found: dict[str, Any] = {}
        self._met: set[str] = set()

    def follow(self, socket: Any) -> None:
        """Find what gives light behind a shader's input."""
        with self.at(socket) as source:
            if source is None or not source.is_output:
                return
            name = "/".join(node.name for node in (*self._groups, source.node))
            if name in self._met:
                return
            self._met.add(name)
            if source.node.bl_idname in LIGHT_INPUTS and not self._is_off(source.node):
                self.found[name] = source.node
            for shader in self._shaders(source.node):
                self.follow(shader)

    def _is_off(self, node: Any) -> bool:
        """Whether the strength is linked to what is 0 for diffuse rays."""
        strength = node.inputs[LIGHT_INPUTS[node.bl_idname][1]]
        return feeding(strength) is not None and self.constant(strength) == (0.0, 0.0, 0.0)

    def _shaders(self, node: Any) -> list[Any]:
        """The shaders that a node passes on, of those that it mixes the ones with a part in the mixture."""
        shaders = [socket for socket in node.inputs if socket.type == "SHADER"]
        factor = self.constant(node.inputs[0]) if node.bl_idname == "ShaderNodeMixShader" else None
        if factor is None or 0 < factor[0] < 1:
            return shaders
        return shaders[:1] if factor[0] <= 0 else shaders[1:]


def _strength(node: Any) -> Triple:
    """Colour times strength."""
    colour, strength = (node.inputs[name] for name in LIGHT_INPUTS[node.bl_idname])
    value = np.ones(3) if feeding(colour) is not None else np.array(colour.default_value[:3], np.float64)
    if feeding(strength) is None:
        value = value * strength.default_value
    return _triple(np.maximum(value, 0))


def _triple(values: Any) -> Triple:
    red, green, blue = (float(value) for value in values[:3])
    return red, green, blue

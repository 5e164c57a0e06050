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
from .sockets import Triple, feeding

# What the one knob of a world without nodes is called.
FLAT = "color"
# Node groups inside node groups are followed this deep.
MOST_GROUPS = 16


def knobs_of(block: Any) -> dict[str, Triple]:
    """Colour times strength by the node's name, of a material or world; what other nodes feed counts as 1."""
    if block is None or (isinstance(block, bpy.types.World) and not block.cycles_visibility.diffuse):
        return {}
    if not compat.uses_nodes(block):
        return {FLAT: _triple(block.color)} if hasattr(block, "color") else {}
    return _of_tree(block.node_tree, "", 0)


def rest_of(block: Any) -> str:
    """A sum of all of a material or world but its knobs."""
    if block is None:
        return "nothing"
    if not compat.uses_nodes(block):
        return digest("flat" if hasattr(block, "color") else tuple(block.diffuse_color))
    index = getattr(block, "pass_index", 0) if reads_material_index(block.node_tree) else 0
    return digest(block.node_tree, index, knobs=False)


def _of_tree(tree: Any, path: str, depth: int) -> dict[str, Triple]:
    found: dict[str, Triple] = {}
    for node in tree.nodes:
        if node.mute:
            continue
        if getattr(node, "node_tree", None) is not None and depth < MOST_GROUPS:
            found |= _of_tree(node.node_tree, f"{path}{node.name}/", depth + 1)
        elif node.bl_idname in LIGHT_INPUTS:
            colour, strength = (node.inputs[name] for name in LIGHT_INPUTS[node.bl_idname])
            value = np.ones(3) if feeding(colour) is not None else np.array(colour.default_value[:3], np.float64)
            if feeding(strength) is None:
                value = value * strength.default_value
            found[path + node.name] = _triple(np.maximum(value, 0))
    return found


def _triple(values: Any) -> Triple:
    red, green, blue = (float(value) for value in values[:3])
    return red, green, blue

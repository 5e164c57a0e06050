"""What the materials of an object read of it beside its mesh's own shape and layers: colour, numbers, attributes."""

from __future__ import annotations

from typing import Any

from . import compat
from .mesh_arrays import read
from .mesh_part import KINDS
from .named_values import title, value_of, weights_of
from .shown_nodes import shown_nodes
from .visible import Shown

# What outputs of Object Info nodes tell of the object; its place counts by itself.
INFO = {"Color": "color", "Alpha": "color", "Object Index": "pass_index", "Random": "random"}
MATERIAL_INDEX = "Material Index"
# Who is asked, beside the types of Attribute nodes.
OBJECT_INFO = "OBJECT_INFO"


def reads(material: Any) -> frozenset[tuple[str, str]]:
    """Who is asked for what by name, by the nodes that a material shows."""
    if material is None or not compat.uses_nodes(material):
        return frozenset()
    found: set[tuple[str, str]] = set()
    for node in shown_nodes(material.node_tree):
        if node.bl_idname == "ShaderNodeAttribute":
            found.add((node.attribute_type, node.attribute_name))
        elif node.bl_idname == "ShaderNodeObjectInfo":
            found |= {(OBJECT_INFO, INFO[name]) for name in _linked(node) if name in INFO}
    return frozenset(found)


def reads_material_index(tree: Any) -> bool:
    """Whether a tree shows the index of its own material."""
    return any(node.bl_idname == "ShaderNodeObjectInfo" and MATERIAL_INDEX in _linked(node)
               for node in shown_nodes(tree))


def label(kind: str, name: str) -> str:
    """What of what `reads` gives is called."""
    return f"{name!r} ({title(kind)})"


def what_is_read(kind: str, name: str, item: Shown) -> Any:
    """The value of one of what `reads` gives; None where it is not there."""
    if kind == OBJECT_INFO:
        return item.random if name == "random" else getattr(item.original, name)
    if kind != "GEOMETRY":
        return value_of(kind, name, item)
    attribute = item.mesh.attributes.get(name)
    if attribute is None:
        return weights_of(item, name)
    if attribute.data_type not in KINDS:
        return None
    return attribute.data_type, attribute.domain, read(attribute.data, *KINDS[attribute.data_type])


def _linked(node: Any) -> list[str]:
    return [output.name for output in node.outputs if output.is_linked]

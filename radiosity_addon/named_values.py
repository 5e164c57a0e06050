"""What Attribute nodes ask for by name that lies on no mesh's own attributes: custom properties, and vertex groups.

As in Blender a name may be a custom property or a property of Blender's own. Type Instancer asks what shows an
instance, then the object; Object asks the object, then its data; View Layer asks layer, scene and world.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .shown_nodes import shown_nodes
from .visible import Shown
from .warn import Warnings, warn

Float = NDArray[np.floating[Any]]
Colour = tuple[float, ...]
# By type and name of an Attribute node: its colour with alpha.
Named = dict[tuple[str, str], Colour]

MISSING = (0.0, 0.0, 0.0, 0.0)


def named_values(tree: Any, item: Shown, material: str, warnings: Warnings) -> Named:
    """What the Attribute nodes of a material's tree ask of the object that shows it; what is not there is black."""
    found: Named = {}
    for kind, name in sorted(_asked(tree)):
        if kind == "GEOMETRY":
            continue
        value = value_of(kind, name, item)
        found[kind, name] = MISSING if value is None else value
        if value is None:
            stored = ("; what geometry nodes store on instances is not read: realize them, and set the node to Geometry"
                      if kind == "INSTANCER" else "")
            warn(warnings, item.original.name, "material", f"has no {name!r} for the Attribute node "
                 f"({title(kind)}) of material {material!r}: it counts as black{stored}")
    return found


def tell_named(data: Any, code: str, warnings: Warnings) -> None:
    """Tell what Attribute nodes of a world or lamp ask by name: Cycles is shown it without its scene and object."""
    for kind, name in sorted(_asked(data.node_tree)):
        if kind != "GEOMETRY" and not (kind == "VIEW_LAYER" and name in data):
            warn(warnings, data.name, code, f"its Attribute node asks for {name!r} ({title(kind)}), which is not "
                 "looked up here and counts as black: use a driver or a plain value instead")


def vertex_weights(tree: Any, item: Shown) -> dict[str, Float]:
    """The vertex groups that the Attribute nodes of a material's tree ask for: (vertices,) float32 each."""
    names = {name for kind, name in _asked(tree) if kind == "GEOMETRY" and name not in item.mesh.attributes}
    found = ((name, weights_of(item, name)) for name in sorted(names))
    return {name: weights for name, weights in found if weights is not None}


def value_of(kind: str, name: str, item: Shown) -> Colour | None:
    """What an Attribute node of a type other than Geometry finds by a name; None if nobody has it."""
    values = (_value(owner, name) for owner in _owners(kind, item))
    return next((value for value in values if value is not None), None)


def weights_of(item: Shown, name: str) -> Float | None:
    """(vertices,) float32 weights of a vertex group; None if there is no such."""
    groups = item.original.vertex_groups if item.own_mesh else {}
    if name not in groups:
        return None
    group = groups[name].index
    return np.array([next((entry.weight for entry in vertex.groups if entry.group == group), 0.0)
                     for vertex in item.mesh.vertices], np.float32)


def _asked(tree: Any) -> set[tuple[str, str]]:
    return {(node.attribute_type, node.attribute_name) for node in shown_nodes(tree)
            if node.bl_idname == "ShaderNodeAttribute"}


def title(kind: str) -> str:
    """Blender's name of whom an Attribute node asks."""
    return kind.replace("_", " ").title()


def _owners(kind: str, item: Shown) -> tuple[Any, ...]:
    if kind == "VIEW_LAYER":
        return item.layer
    own = item.original, item.original.data
    return (item.parent, *own) if kind == "INSTANCER" and item.parent is not None else own


def _value(owner: Any, name: str) -> Colour | None:
    """A property's number or up to four as a colour with alpha; None if there is no such."""
    if owner is None:
        return None
    value: Any = owner.get(name, getattr(owner, name, None) if name in owner.bl_rna.properties else None)
    if isinstance(value, int | float):
        return (float(value),) * 3 + (1.0,)
    numbers = list(value) if hasattr(value, "__len__") and not isinstance(value, str | bytes) else []
    if not 0 < len(numbers) <= len(MISSING) or not all(isinstance(number, int | float) for number in numbers):
        return None
    return (*map(float, numbers), *(0.0, 0.0, 0.0, 1.0)[len(numbers):])

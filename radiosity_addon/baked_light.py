"""A node group that gives the baked light of a surface: an image by its UV map, or a colour attribute."""

from __future__ import annotations

import math
from typing import Any

import bpy

from ..solver.quantities import LUMINOUS_EFFICACY
from .results import Result

# Custom property of all materials and node groups that a view makes; they go with it.
VIEW_MARK = "radiosity_view"
# Factor from what is stored to the radiance of a white surface, W / (m2 sr). Illuminance has no colour left.
TO_RADIANCE = {"radiance": 1.0, "irradiance": 1 / math.pi, "illuminance": 1 / (LUMINOUS_EFFICACY * math.pi),
               "radiosity": 1 / math.pi}
Key = tuple[str, str, str]


def key_of(result: Result) -> Key:
    """What the light of a result depends on: image, layer, quantity."""
    return (result.image.name_full if result.image is not None else "", result.layer, result.quantity)


def light_group(result: Result, scale: float) -> Any:
    """A node group with one output "Light": what is stored, times `scale`."""
    tree = bpy.data.node_groups.new("Radiosity Light", "ShaderNodeTree")
    tree[VIEW_MARK] = True
    tree.interface.new_socket("Light", in_out="OUTPUT", socket_type="NodeSocketColor")
    source = _image(tree, result) if result.image is not None else _attribute(tree, result.layer)
    factor = add(tree, "ShaderNodeVectorMath", 200, operation="SCALE")
    factor.inputs["Scale"].default_value = scale
    out = add(tree, "NodeGroupOutput", 400)
    tree.links.new(source, factor.inputs[0])
    tree.links.new(factor.outputs["Vector"], out.inputs["Light"])
    return tree


def add(tree: Any, kind: str, x: float = 0.0, **values: Any) -> Any:
    """A new node of a tree."""
    node = tree.nodes.new(kind)
    node.location.x = x
    for name, value in values.items():
        setattr(node, name, value)
    return node


def _image(tree: Any, result: Result) -> Any:
    place = add(tree, "ShaderNodeUVMap", -200, uv_map=result.layer)
    texture = add(tree, "ShaderNodeTexImage", 0, image=result.image, extension="EXTEND")
    tree.links.new(place.outputs["UV"], texture.inputs["Vector"])
    return texture.outputs["Color"]


def _attribute(tree: Any, name: str) -> Any:
    return add(tree, "ShaderNodeAttribute", 0, attribute_type="GEOMETRY", attribute_name=name).outputs["Color"]

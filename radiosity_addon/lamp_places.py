"""What of its surroundings a lamp's nodes look at, and where the lamps stand whose nodes look there."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from . import compat
from .object_random import random_of
from .parts import Parts
from .render_walk import Clock, walk
from .shown_nodes import shown_nodes
from .sockets import feeding, is_live
from .visible import meets

# What the outputs of nodes depend on; "" stands for all others of a node.
#   uv         the place on the lamp, or in a spot's picture
#   place      the object: how it stands in the world, its colour, index and random number
#   position   points of the lamp
#   direction  the way from the lamp to what is lit, in the world
#   length     the distance to what is lit
#   camera     the camera that looks
LOOKS: dict[str, dict[str, str]] = {
    "ShaderNodeNewGeometry": {
        "Position": "place position", "Parametric": "uv",
        **dict.fromkeys(("Normal", "True Normal", "Incoming", "Tangent"), "place direction")},
    "ShaderNodeTexCoord": {
        "Generated": "place position", "Object": "place position", "UV": "uv", "Reflection": "place direction",
        "Camera": "camera", "Window": "camera"},
    "ShaderNodeUVMap": {"": "uv"},
    "ShaderNodeObjectInfo": {"": "place"},
    "ShaderNodeVectorTransform": {"": "place"},
    "ShaderNodeTangent": {"": "place direction"},
    "ShaderNodeCameraData": {"": "camera"},
    "ShaderNodeLightPath": {"Ray Length": "length"},
}
# The same of textures whose vector nothing feeds.
UNFED = {
    "ShaderNodeTexImage": "uv", "ShaderNodeTexIES": "direction",
    **dict.fromkeys(
        (f"ShaderNodeTex{kind}" for kind in (
            "Brick", "Checker", "Environment", "Gabor", "Gradient", "Magic", "Noise", "Voronoi", "Wave")),
        "place position")}


@dataclass(frozen=True)
class Place:
    """A lamp's object, as its nodes may look at it.

    matrix : 16 numbers, its rows to world space.
    colour, index, random : as its Object Info says.
    """

    matrix: tuple[float, ...]
    colour: tuple[float, ...]
    index: int
    random: float


def looks(tree: Any) -> frozenset[str]:
    """The words of `LOOKS` that hold for a lamp's node tree."""
    return frozenset(word for words in _looks(tree) for word in words.split())


def _looks(tree: Any) -> Iterator[str]:
    for node in shown_nodes(tree):
        kinds = LOOKS.get(node.bl_idname, {})
        for output in node.outputs if kinds else ():
            if any(is_live(link) for link in output.links):
                yield kinds.get(output.name, kinds.get("", ""))
        if node.bl_idname in UNFED and feeding(node.inputs["Vector"]) is None:
            yield UNFED[node.bl_idname]


def is_rendered(instance: Any) -> bool:
    """Whether an instance of the dependency graph is a lamp that a render shows."""
    lamp = instance.object
    return bool(lamp.type == "LIGHT" and instance.show_self and not lamp.hide_render)


def lights_diffuse_surfaces(instance: Any) -> bool:
    """Whether diffuse rays meet a lamp that an instance shows."""
    return (meets(instance, "visible_diffuse") if compat.instancers_hide_lamps()
            else bool(instance.object.visible_diffuse))


def place_of(instance: Any) -> Place:
    """Where an instance of the dependency graph stands."""
    original = instance.object.original
    return Place(tuple(np.array(instance.matrix_world, np.float64).ravel().tolist()), tuple(original.color),
                 original.pass_index, random_of(instance))


def places_of(lights: Iterable[Any], scene: Any, view_layer: Any, part_seconds: float) -> Parts[dict[str, list[Place]]]:
    """Where a render shows lights, by the full name of their data.

    Raises
    ------
    SceneError
        If the view layer is switched off for rendering.
    """
    found: dict[str, dict[Place, None]] = {data.name_full: {} for data in lights}

    def look(depsgraph: Any, clock: Clock) -> bool:
        for instance in depsgraph.object_instances:
            if is_rendered(instance) and instance.object.data.original.name_full in found:
                found[instance.object.data.original.name_full][place_of(instance)] = None
        return True

    if found:
        yield from walk(scene, view_layer, look, part_seconds)
    return {name: list(places) for name, places in found.items()}

"""Colours and numbers behind the sockets of shader nodes: flat, or one image; anything else by a flat value."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import constants
from .warn import Warnings, warn

Triple = tuple[float, float, float]

# Longest chain of reroutes and groups that is followed; node trees can't be cyclic, so this is never met in good files.
LONGEST_CHAIN = 64
# Alpha modes in which Cycles multiplies an image's colour by its alpha.
ASSOCIATED = frozenset({"STRAIGHT", "PREMUL"})


@dataclass(frozen=True, eq=False)
class ImageUse:
    """An image on a surface.

    Attributes
    ----------
    image : the bpy image.
    uv_map : name of the UV map, "" for the one that is active for rendering.
    matrix : (2, 3) float64, texture coordinates = matrix @ (u, v, 1).
    """

    image: Any
    uv_map: str
    matrix: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Colour:
    """Linear RGB, times an image where there is one."""

    factor: Triple = (0.0, 0.0, 0.0)
    image: ImageUse | None = None

    def scaled(self, factor: float) -> Colour:
        """The colour times a number."""
        r, g, b = self.factor
        return Colour((r * factor, g * factor, b * factor), self.image if factor else None)

    def clipped(self, low: float, high: float) -> Colour:
        """The colour's factor held between two values."""
        r, g, b = (float(min(max(value, low), high)) for value in self.factor)
        return replace(self, factor=(r, g, b))

    @property
    def is_black(self) -> bool:
        """Whether nothing is there."""
        return not any(self.factor)


BLACK = Colour()


def luminance(colour: Colour) -> float:
    """Rec. 709 luminance of the colour's factor."""
    r, g, b = colour.factor
    return 0.2126 * r + 0.7152 * g + 0.0722 * b


class Reader:
    """Reads sockets of one node tree, and tells in its owner's name what it could not read."""

    def __init__(self, material: str, warnings: Warnings) -> None:
        self.material = material
        self.warnings = warnings
        self._groups: list[Any] = []

    def warn(self, message: str) -> None:
        """A warning about the material."""
        warn(self.warnings, self.material, "material", message)

    def guess(self, message: str) -> None:
        """A value was guessed, since nodes would have to be evaluated to know it."""
        self.warn(message)

    def source(self, socket: Any) -> Any:
        """The output socket that feeds an input, through reroutes and muted nodes; None if nothing does."""
        for _ in range(LONGEST_CHAIN):
            if not socket.is_linked:
                return None
            output = socket.links[0].from_socket
            node = output.node
            if node.bl_idname == "NodeReroute":
                socket = node.inputs[0]
            elif node.mute and node.internal_links:
                socket = node.internal_links[0].from_socket
            elif node.bl_idname == "ShaderNodeGroup" and node.node_tree is not None:
                self._groups.append(node)
                outputs = (inner for inner in node.node_tree.nodes if inner.bl_idname == "NodeGroupOutput")
                inside = next((inner for inner in outputs if inner.is_active_output), None)
                if inside is None:
                    return None
                socket = _same(inside.inputs, output)
            elif node.bl_idname == "NodeGroupInput" and (group := self._group_of(node)) is not None:
                socket = _same(group.inputs, output)
                if not socket.is_linked:
                    return socket
            else:
                return output
        return None

    def _group_of(self, node: Any) -> Any:
        """The group node, entered last, whose tree a node lies in."""
        return next((group for group in reversed(self._groups) if group.node_tree == node.id_data), None)

    def number(self, socket: Any) -> float:
        """The value of a number socket; one fed by other nodes than a plain value counts by its own setting."""
        source = self.source(socket)
        if source is None:
            return float(socket.default_value)
        if (known := constants.of(source, self.source)) is not None:
            return luminance(Colour(known))
        self.guess(f"{socket.name!r} is driven by {source.node.bl_label!r}, which is not evaluated: "
                   f"{float(socket.default_value):g} is used")
        return float(socket.default_value)

    def colour(self, socket: Any) -> Colour:
        """The value of a colour socket: flat, or an image."""
        source = self.source(socket)
        if source is None:
            return Colour(_triple(socket.default_value))
        if (known := constants.of(source, self.source)) is not None:
            return Colour(known)
        node = source.node
        if node.bl_idname == "ShaderNodeTexImage" and source.name == "Color" and node.image is not None:
            return self._image(node)
        if node.bl_idname in {"ShaderNodeMix", "ShaderNodeMixRGB"} and (mixed := self._mix(node)) is not None:
            return mixed
        flat = _triple(socket.default_value)
        self.guess(f"{socket.name!r} is driven by {node.bl_label!r}, which is not evaluated: the socket's own colour "
                   f"({', '.join(f'{value:g}' for value in flat)}) is used")
        return Colour(flat)

    def sum(self, first: Colour, second: Colour) -> Colour:
        """Two colours added; of two images, or an image and a flat colour, the brighter one stays."""
        if first.image is None and second.image is None:
            r, g, b = (float(x + y) for x, y in zip(first.factor, second.factor, strict=True))
            return Colour((r, g, b))
        if first.is_black or second.is_black:
            return second if first.is_black else first
        self.guess("adds an image to another colour: the brighter one alone is used")
        return first if luminance(first) >= luminance(second) else second

    def _mix(self, node: Any) -> Colour | None:
        """The colour of a Mix node with a plain factor, where it is flat or one image times a colour; else None.

        Blender's definitions: mix (1 - f) a + f b, multiply (1 - f) a + f a b, add a + f b.
        """
        if node.bl_idname == "ShaderNodeMix" and node.data_type != "RGBA":
            return None
        inputs = [socket for socket in node.inputs if socket.enabled]
        if len(inputs) != 3 or node.blend_type not in {"MIX", "MULTIPLY", "ADD"} or self.source(inputs[0]) is not None:
            return None
        f = min(max(self.number(inputs[0]), 0.0), 1.0)
        a, b = self.colour(inputs[1]), self.colour(inputs[2])
        if node.blend_type != "MULTIPLY":
            return self.sum(a.scaled(1 - f) if node.blend_type == "MIX" else a, b.scaled(f))
        if b.image is None:
            r, g, blue = (x * (1 - f + f * y) for x, y in zip(a.factor, b.factor, strict=True))
            return Colour((r, g, blue), a.image)
        if a.image is None and f == 1:
            r, g, blue = (x * y for x, y in zip(a.factor, b.factor, strict=True))
            return Colour((r, g, blue), b.image)
        return None

    def _image(self, node: Any) -> Colour:
        if node.projection != "FLAT":
            self.guess(f"image {node.image.name!r} is projected as {node.projection.lower()}: it is laid out by UV")
        if node.extension != "REPEAT":
            self.guess(f"image {node.image.name!r} is not repeated beyond its edges ({node.extension.lower()}): it is")
        if node.outputs["Alpha"].is_linked and node.image.alpha_mode in ASSOCIATED:
            # Cycles then divides the colour by alpha, and leaves it multiplied where alpha is not asked for.
            self.guess(f"image {node.image.name!r} gives its alpha too: its colour is used as it is stored")
        if node.image.is_float and node.image.alpha_mode == "STRAIGHT" and node.image.channels == 4:
            # Some versions of Cycles multiply it by alpha once more.
            self.guess(f"image {node.image.name!r} has floats with straight alpha: its colour is used as it is stored")
        if node.image.source == "TILED":
            self.guess(f"image {node.image.name!r} has UDIM tiles: the first alone is used")
        uv_map, matrix = self._coordinates(node.inputs["Vector"])
        return Colour((1.0, 1.0, 1.0), ImageUse(node.image.original, uv_map, matrix))

    def _coordinates(self, socket: Any) -> tuple[str, NDArray[np.float64]]:
        """The UV map's name and the (2, 3) matrix of a vector socket."""
        matrix = np.array([[1.0, 0, 0], [0, 1, 0]])
        for _ in range(LONGEST_CHAIN):
            source = self.source(socket)
            if source is None or not source.is_output:
                return "", matrix
            node = source.node
            if node.bl_idname == "ShaderNodeUVMap":
                return node.uv_map, matrix
            if node.bl_idname == "ShaderNodeAttribute":
                return node.attribute_name, matrix
            if node.bl_idname == "ShaderNodeTexCoord" and source.name == "UV":
                return "", matrix
            if node.bl_idname != "ShaderNodeMapping":
                break
            step = self._mapping(node)
            matrix = np.column_stack([matrix[:, :2] @ step[:, :2], matrix[:, :2] @ step[:, 2] + matrix[:, 2]])
            socket = node.inputs["Vector"]
        self.guess(f"an image is laid out by {source.node.bl_label!r} {source.name!r}: the active UV map is used")
        return "", matrix

    def _mapping(self, node: Any) -> NDArray[np.float64]:
        """(2, 3) matrix of a Mapping node: p -> R S p + T as a point, R^-1 S^-1 (p - T) as a texture."""
        values = {name: np.zeros(3) for name in ("Location", "Rotation", "Scale")}
        for name in values:
            if name in node.inputs and node.inputs[name].enabled:
                values[name] = np.array(node.inputs[name].default_value, float)
                if node.inputs[name].is_linked:
                    self.guess(f"the {name.lower()} of its Mapping node is linked: the node's own value is used")
        if abs(values["Rotation"][:2]).max() > 0:
            self.guess("its Mapping node turns about X or Y: the turn about Z alone is used")
        angle, scale = values["Rotation"][2], values["Scale"][:2]
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        linear, offset = turn @ np.diag(scale), values["Location"][:2]
        if node.vector_type == "TEXTURE":
            linear = np.linalg.inv(np.where(np.eye(2) == 1, np.diag(np.where(scale == 0, 1.0, scale)), 0.0)) @ turn.T
            offset = -linear @ offset
        elif node.vector_type != "POINT":
            offset = np.zeros(2)
        return np.column_stack([linear, offset])


def _same(sockets: Any, socket: Any) -> Any:
    """The socket of a group's other side that belongs to this one."""
    return next(other for other in sockets if other.identifier == socket.identifier)


def _triple(value: Any) -> Triple:
    if hasattr(value, "__len__"):
        return float(value[0]), float(value[1]), float(value[2])
    return float(value), float(value), float(value)

"""Colours and numbers behind the sockets of shader nodes: flat, or one image; anything else by a flat value."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..solver.quantities import LUMINANCE
from . import constants
from .constants import Triple
from .warn import Warnings, warn

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

    def tinted(self, tint: Triple) -> Colour:
        """The colour times another, channel by channel."""
        (r, g, b), (red, green, blue) = self.factor, tint
        return Colour((r * red, g * green, b * blue), self.image if any(tint) else None)

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
    if r == g == b:
        return r  # the weights' sum is rounded
    return float(LUMINANCE @ np.array(colour.factor))


class Reader:
    """Reads sockets of one node tree, and tells in its owner's name what it could not read."""

    def __init__(self, material: str, warnings: Warnings) -> None:
        self.material = material
        self.warnings = warnings
        # The group nodes, outermost first, that lead to where is read.
        self._groups: tuple[Any, ...] = ()

    def warn(self, message: str) -> None:
        """A warning about the material."""
        warn(self.warnings, self.material, "material", message)

    def guess(self, message: str) -> None:
        """A value was guessed, since nodes would have to be evaluated to know it."""
        self.warn(message)

    def source(self, socket: Any) -> Any:
        """What feeds an input, through reroutes, groups and muted nodes; None if nothing does.

        An output socket; or an unlinked input of a group node, or of a group's output, which has a value of its own.
        """
        return self._traced(socket)[0]

    @contextmanager
    def at(self, socket: Any) -> Iterator[Any]:
        """`source`, whose node's sockets are to be read meanwhile: one group may be met in several places."""
        before = self._groups
        source, self._groups = self._traced(socket)
        try:
            yield source
        finally:
            self._groups = before

    def _traced(self, socket: Any) -> tuple[Any, tuple[Any, ...]]:
        """The source, and the group nodes that lead to it."""
        groups, own = self._groups, None
        for _ in range(LONGEST_CHAIN):
            output = feeding(socket)
            if output is None:
                return own, groups
            node = output.node
            if node.bl_idname == "ShaderNodeGroup" and node.node_tree is not None:
                outputs = (inner for inner in node.node_tree.nodes if inner.bl_idname == "NodeGroupOutput")
                end = next((inner for inner in outputs if inner.is_active_output), None)
                if end is None:
                    return own, groups
                groups = (*groups, node)
                socket = _same(end.inputs, output)
                own = _valued(socket)
            elif node.bl_idname == "NodeGroupInput" and groups:
                socket, groups = _same(groups[-1].inputs, output), groups[:-1]
                own = _valued(socket)
            else:
                return output, groups
        return None, groups

    def constant(self, socket: Any) -> Triple | None:
        """The value of an input that is known without evaluating nodes, else None."""
        with self.at(socket) as source:
            return constants.triple(socket.default_value) if source is None else constants.of(source, self.constant)

    def number(self, socket: Any) -> float:
        """The value of a number socket; one fed by other nodes than a plain value counts by its own setting."""
        if (known := self.constant(socket)) is not None:
            return luminance(Colour(known))
        self.guess(f"{socket.name!r} is driven by {self.source(socket).node.bl_label!r}, which is not evaluated: "
                   f"{float(socket.default_value):g} is used")
        return float(socket.default_value)

    def colour(self, socket: Any) -> Colour:
        """The value of a colour socket: flat, or an image."""
        if (known := self.constant(socket)) is not None:
            return Colour(known)
        with self.at(socket) as source:
            node = source.node
            if node.bl_idname == "ShaderNodeTexImage" and source.name == "Color" and node.image is not None:
                return self._image(node)
            if node.bl_idname in {"ShaderNodeMix", "ShaderNodeMixRGB"} and (mixed := self._mix(node)) is not None:
                return mixed
        flat = constants.triple(socket.default_value)
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
        new = node.bl_idname == "ShaderNodeMix"
        if node.clamp_result if new else node.use_clamp:
            return None
        inputs = [socket for socket in node.inputs if socket.enabled]
        if len(inputs) != 3 or node.blend_type not in {"MIX", "MULTIPLY", "ADD"} or self.source(inputs[0]) is not None:
            return None
        f = self.number(inputs[0])
        if not new or node.clamp_factor:
            f = min(max(f, 0.0), 1.0)
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
        if node.image.source in {"SEQUENCE", "MOVIE"}:
            self.guess(f"image {node.image.name!r} is a {node.image.source.lower()}, whose frames Cycles alone reads")
        if node.image.source == "TILED":
            self.guess(f"image {node.image.name!r} has UDIM tiles: the first alone is used")
        uv_map, matrix = self._coordinates(node.inputs["Vector"])
        return Colour((1.0, 1.0, 1.0), ImageUse(node.image.original, uv_map, matrix))

    def _coordinates(self, socket: Any) -> tuple[str, NDArray[np.float64]]:
        """The UV map's name and the (2, 3) matrix of a vector socket."""
        plain = np.array([[1.0, 0, 0], [0, 1, 0]])
        with self.at(socket) as source:
            if source is None or not source.is_output:
                return "", plain
            node = source.node
            if node.bl_idname == "ShaderNodeUVMap":
                return node.uv_map, plain
            if node.bl_idname == "ShaderNodeAttribute" and node.attribute_type == "GEOMETRY" and source.type != "VALUE":
                return node.attribute_name, plain
            if node.bl_idname == "ShaderNodeTexCoord" and source.name == "UV":
                return "", plain
            if node.bl_idname == "ShaderNodeMapping":
                uv_map, matrix = self._coordinates(node.inputs["Vector"])
                step = self._mapping(node)
                return uv_map, np.column_stack([step[:, :2] @ matrix[:, :2], step[:, :2] @ matrix[:, 2] + step[:, 2]])
        self.guess(f"an image is laid out by {node.bl_label!r} {source.name!r}: the active UV map is used")
        return "", plain

    def _mapping(self, node: Any) -> NDArray[np.float64]:
        """(2, 3) matrix of a Mapping node: p -> R S p + T as a point, S^-1 R^-1 (p - T) as a texture."""
        source = self.source(node.inputs["Vector"])
        if source is None or not source.is_output:
            self.guess("its Mapping node has one place for all of an image: the active UV map is used")
        if node.vector_type == "NORMAL":
            self.guess("its Mapping node makes unit vectors: they are used before that")
        values = {name: np.zeros(3) for name in ("Location", "Rotation", "Scale")}
        for name in values:
            if name in node.inputs and node.inputs[name].enabled:
                values[name] = np.array(node.inputs[name].default_value, float)
                if self.source(node.inputs[name]) is not None:
                    self.guess(f"the {name.lower()} of its Mapping node is linked: the node's own value is used")
        if abs(values["Rotation"][:2]).max() > 0:
            self.guess("its Mapping node turns about X or Y: the turn about Z alone is used")
        angle, scale = values["Rotation"][2], values["Scale"][:2]
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        linear, offset = turn @ np.diag(scale), values["Location"][:2]
        if node.vector_type == "TEXTURE":
            if not scale.all():
                self.guess("its Mapping node has scale 0, which nothing can be divided by: 1 is used")
            linear = np.linalg.inv(np.where(np.eye(2) == 1, np.diag(np.where(scale == 0, 1.0, scale)), 0.0)) @ turn.T
            offset = -linear @ offset
        elif node.vector_type != "POINT":
            offset = np.zeros(2)
        return np.column_stack([linear, offset])


def is_live(link: Any) -> bool:
    """Whether a link passes anything on."""
    return bool(link.is_valid and not link.is_muted and link.from_socket.enabled and link.to_socket.enabled)


def feeding(socket: Any) -> Any:
    """The output that feeds an input in its own tree, through reroutes and past what is muted; None if nothing does."""
    for _ in range(LONGEST_CHAIN):
        # Blender looks for a socket's links among all of the tree's.
        link = next(filter(is_live, socket.links), None) if socket.is_linked else None
        if link is None:
            return None
        node = link.from_node
        if node.mute:
            inside = next((inside for inside in node.internal_links if inside.to_socket == link.from_socket), None)
            if inside is None:
                return None
            socket = inside.from_socket
        elif node.bl_idname == "NodeReroute":
            socket = node.inputs[0]
        else:
            return link.from_socket
    return None


def _same(sockets: Any, socket: Any) -> Any:
    """The socket of a group's other side that belongs to this one."""
    return next(other for other in sockets if other.identifier == socket.identifier)


def _valued(socket: Any) -> Any:
    """The socket, if it has a value of its own; a shader's has none."""
    return socket if hasattr(socket, "default_value") else None

"""Materials rewritten so that they shine with what the solver wants to know of them: a bake of their light reads it.

Every shader node is replaced by an emission of one of its properties (what it reflects, sends out, lets through, or
does that diffuse light can't know). Mix and Add Shader stay: they mix emissions as they mix shaders. What is computed
is what `materials` computes from flat colours, by nodes.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

from .constants import (
    DIFFUSE_RAY,
    VIEW_DEPENDENT,
    Triple,
    coat_exponent,
    mean_coat,
    mean_fresnel,
    of,
    triple,
)
from .materials import specular_ior
from .named_values import MISSING, Named
from .sockets import feeding

# A number, a colour, or the output socket of a node.
Value = Any
WHITE = (1.0, 1.0, 1.0)


class _Tree:
    """Adds arithmetic to a node tree; numbers are computed right away."""

    def __init__(self, tree: Any) -> None:
        self.tree = tree

    def value(self, node: Any, name: str) -> Value:
        """What an input of a node is fed with, or its own value."""
        socket = node.inputs[name]
        if socket.is_linked:
            return socket.links[0].from_socket
        value = socket.default_value
        return tuple(value[:3]) if hasattr(value, "__len__") else float(value)

    def times(self, a: Value, b: Value) -> Value:
        """a b of numbers."""
        if isinstance(a, float) and isinstance(b, float):
            return a * b
        if 0.0 in (a, b) or 1.0 in (a, b):
            return 0.0 if 0.0 in (a, b) else (b if a == 1.0 else a)
        return self._math("MULTIPLY", a, b)

    def plus(self, a: Value, b: Value) -> Value:
        """a + b of numbers."""
        if isinstance(a, float) and isinstance(b, float):
            return a + b
        return b if a == 0.0 else a if b == 0.0 else self._math("ADD", a, b)

    def rest(self, a: Value) -> Value:
        """1 - a of a number."""
        return 1 - a if isinstance(a, float) else self._math("SUBTRACT", 1.0, a)

    def unit(self, a: Value) -> Value:
        """A number held to 0 ... 1, as shaders hold their weights."""
        if isinstance(a, float):
            return min(max(a, 0.0), 1.0)
        node = self._math("ADD", a, 0.0).node
        node.use_clamp = True
        return node.outputs[0]

    def grey(self, colour: Value) -> Value:
        """The mean of a colour's channels."""
        if isinstance(colour, tuple):
            return sum(colour) / 3
        node = self.tree.nodes.new("ShaderNodeVectorMath")
        node.operation = "DOT_PRODUCT"
        self.feed(node.inputs[0], colour)
        node.inputs[1].default_value = (1 / 3, 1 / 3, 1 / 3)
        return node.outputs["Value"]

    def product(self, a: Value, b: Value) -> Value:
        """a b of colours, channel by channel."""
        if isinstance(a, tuple) and isinstance(b, tuple):
            return tuple(x * y for x, y in zip(a, b, strict=True))
        if WHITE in (a, b):
            return b if a == WHITE else a
        return self._mix("MULTIPLY", 1.0, a, b)

    def coat(self, node: Any) -> Value:
        """What a Principled's coat tints the light from below with; see `constants.mean_coat`."""
        weight, tint = self.unit(self.value(node, "Coat Weight")), self.value(node, "Coat Tint")
        ior = float(node.inputs["Coat IOR"].default_value)
        if weight == 0.0:
            return WHITE
        if isinstance(weight, float) and isinstance(tint, tuple):
            return mean_coat(weight, tint, ior)
        power = self.tree.nodes.new("ShaderNodeGamma")
        self.feed(power.inputs["Color"], tint)
        power.inputs["Gamma"].default_value = coat_exponent(ior)
        return self._mix("MIX", weight, WHITE, power.outputs[0])

    def feed(self, socket: Any, value: Value) -> None:
        """Set or link an input."""
        if isinstance(value, float):
            socket.default_value = (value, value, value, 1.0) if socket.type == "RGBA" else value
        elif isinstance(value, tuple):
            socket.default_value = (*value, 1.0)
        else:
            self.tree.links.new(value, socket)

    def emission(self, colour: Value, strength: Value) -> Any:
        """The output of a new Emission node."""
        node = self.tree.nodes.new("ShaderNodeEmission")
        self.feed(node.inputs["Color"], colour)
        self.feed(node.inputs["Strength"], strength)
        return node.outputs[0]

    def _mix(self, kind: str, factor: Value, a: Value, b: Value) -> Any:
        node = self.tree.nodes.new("ShaderNodeMix")
        node.data_type, node.blend_type = "RGBA", kind
        for socket, value in zip([socket for socket in node.inputs if socket.enabled], (factor, a, b), strict=True):
            self.feed(socket, value)
        return next(socket for socket in node.outputs if socket.enabled)

    def _math(self, operation: str, a: Value, b: Value) -> Any:
        node = self.tree.nodes.new("ShaderNodeMath")
        node.operation = operation
        self.feed(node.inputs[0], a)
        self.feed(node.inputs[1], b)
        return node.outputs[0]


BLACK = ((0.0, 0.0, 0.0), 0.0)
View = Callable[[_Tree, Any], tuple[Value, Value]]


def _colour(name: str = "Color") -> View:
    return lambda tree, node: (tree.value(node, name), 1.0)


def _mean_colour(tree: _Tree, node: Any) -> tuple[Value, Value]:
    return (1.0, 1.0, 1.0), tree.grey(tree.value(node, "Color"))


def _solid(tree: _Tree, node: Any) -> tuple[Value, Value]:
    """Principled's alpha, and its transmission."""
    metallic = tree.unit(tree.value(node, "Metallic"))
    transmission = tree.times(tree.unit(tree.value(node, "Transmission Weight")), tree.rest(metallic))
    return tree.unit(tree.value(node, "Alpha")), transmission


def _principled_reflectance(tree: _Tree, node: Any) -> tuple[Value, Value]:
    alpha, transmission = _solid(tree, node)
    return (tree.product(tree.value(node, "Base Color"), tree.coat(node)),
            tree.times(alpha, tree.rest(transmission)))


def _principled_emission(tree: _Tree, node: Any) -> tuple[Value, Value]:
    strength = tree.times(tree.value(node, "Emission Strength"), tree.unit(tree.value(node, "Alpha")))
    return tree.product(tree.value(node, "Emission Color"), tree.coat(node)), strength


def _principled_passing(tree: _Tree, node: Any) -> tuple[Value, Value]:
    alpha, transmission = _solid(tree, node)
    return (1.0, 1.0, 1.0), tree.rest(tree.times(alpha, tree.rest(transmission)))


def _principled_lost(tree: _Tree, node: Any) -> tuple[Value, Value]:
    alpha, transmission = _solid(tree, node)
    metallic = tree.unit(tree.value(node, "Metallic"))
    ior = specular_ior(*(float(node.inputs[name].default_value) for name in ("IOR", "Specular IOR Level")))
    gloss = tree.times(tree.rest(metallic), mean_fresnel(ior))
    metal = tree.times(metallic, tree.grey(tree.value(node, "Base Color")))
    return (1.0, 1.0, 1.0), tree.unit(tree.times(alpha, tree.plus(tree.plus(metal, gloss), transmission)))


def _emission(tree: _Tree, node: Any) -> tuple[Value, Value]:
    return tree.value(node, "Color"), tree.value(node, "Strength")


def _metal(tree: _Tree, node: Any) -> tuple[Value, Value]:
    if getattr(node, "fresnel_type", "F82") == "F82":
        return tree.value(node, "Base Color"), 1.0
    pairs = zip(node.inputs["IOR"].default_value[:3], node.inputs["Extinction"].default_value[:3], strict=True)
    return tuple(((n - 1) ** 2 + k**2) / ((n + 1) ** 2 + k**2) for n, k in pairs), 1.0


# What each shader node shines with, by part; a part that is not there is black.
VIEWS: dict[str, dict[str, View]] = {
    "ShaderNodeBsdfPrincipled": {
        "reflectance": _principled_reflectance, "emission": _principled_emission, "passing": _principled_passing,
        "lost": _principled_lost},
    "ShaderNodeBsdfDiffuse": {"reflectance": _colour()},
    "ShaderNodeSubsurfaceScattering": {"reflectance": _colour()},
    "ShaderNodeBsdfMetallic": {"reflectance": _metal, "lost": _metal},
    "ShaderNodeEmission": {"emission": _emission},
    "ShaderNodeBsdfTransparent": {"passing": _mean_colour},
    **{kind: {"reflectance": _colour(), "lost": _colour()} for kind in (
        "ShaderNodeBsdfGlossy", "ShaderNodeBsdfAnisotropic", "ShaderNodeBsdfSheen", "ShaderNodeBsdfToon",
        "ShaderNodeBsdfTranslucent")},
    **{kind: {"passing": _mean_colour, "lost": _mean_colour} for kind in (
        "ShaderNodeBsdfGlass", "ShaderNodeBsdfRefraction")},
}


def show_part(material: Any, part: str, random: float, named: Named) -> list[Any]:
    """Rewrite a material, a copy of the user's, to shine with one part; the node groups that were copied for it.

    Parameters
    ----------
    part : one of `materials.PARTS`.
    random : what its Object Info nodes say is random about the object.
    named : what its Attribute nodes ask of the object by name.
    """
    output = material.node_tree.get_output_node("CYCLES")
    for name in ("Displacement", "Volume"):
        for link in list(output.inputs[name].links):
            material.node_tree.links.remove(link)
    return _rewritten(material.node_tree, partial(_show_node, part=part, random=random, named=named))


def show_to_diffuse_rays(tree: Any) -> list[Any]:
    """Rewrite a node tree, a copy, to look to every ray as it does to a diffuse one; the groups copied for it."""
    return _rewritten(tree, _fix_light_path)


def show_to_lit_surfaces(tree: Any, random: float) -> list[Any]:
    """Rewrite a lamp's node tree, a copy, so that it looks alike from any distance; the groups copied for it.

    `random` is what its Object Info nodes say is random about the object.
    """
    return _rewritten(tree, partial(_fix_lamp, random=random))


def _rewritten(tree: Any, change: Callable[[Any, Any], None]) -> list[Any]:
    """Change the nodes of a tree and of copies of its groups; these copies."""
    groups: dict[Any, Any] = {}

    def rewrite(tree: Any) -> None:
        _drop_muted(tree)
        for node in list(tree.nodes):
            if node.bl_idname == "ShaderNodeGroup" and node.node_tree is not None:
                original = node.node_tree
                if original not in groups:
                    groups[original] = original.copy()
                    rewrite(groups[original])
                node.node_tree = groups[original]
            else:
                change(tree, node)

    rewrite(tree)
    return list(groups.values())


def _drop_muted(tree: Any) -> None:
    """Take away the links that pass nothing on: what they lead to has its own value."""
    # All are found before any is gone: which input a muted node hands on depends on its links.
    for link in [link for link in tree.links if feeding(link.to_socket) is None]:
        tree.links.remove(link)


def _show_node(tree: Any, node: Any, part: str, random: float, named: Named) -> None:
    if node.bl_idname in VIEWS and not node.mute:
        view = VIEWS[node.bl_idname].get(part)
        shown = _Tree(tree)
        _replace(tree, node.outputs[0], shown.emission(*(view(shown, node) if view is not None else BLACK)))
    elif node.bl_idname in VIEW_DEPENDENT:
        _replace_constants(tree, node)
    elif node.bl_idname == "ShaderNodeObjectInfo":
        _replace(tree, node.outputs["Random"], _number(tree, random))
    elif node.bl_idname == "ShaderNodeAttribute" and node.attribute_type != "GEOMETRY":
        _put_named(tree, node, named.get((node.attribute_type, node.attribute_name), MISSING))
    else:
        _fix_light_path(tree, node)


def _fix_lamp(tree: Any, node: Any, random: float) -> None:
    if node.bl_idname == "ShaderNodeObjectInfo":
        _replace(tree, node.outputs["Random"], _number(tree, random))
    elif node.bl_idname == "ShaderNodeLightPath":
        _replace(tree, node.outputs["Ray Length"], _number(tree, DIFFUSE_RAY["Ray Length"]))


def _put_named(tree: Any, node: Any, value: tuple[float, ...]) -> None:
    colour = tree.nodes.new("ShaderNodeRGB").outputs[0]
    colour.default_value = (*value[:3], 1.0)
    for name in ("Color", "Vector"):
        _replace(tree, node.outputs[name], colour)
    _replace(tree, node.outputs["Fac"], _number(tree, sum(value[:3]) / 3))
    _replace(tree, node.outputs["Alpha"], _number(tree, value[3]))


def _fix_light_path(tree: Any, node: Any) -> None:
    if node.bl_idname == "ShaderNodeLightPath":
        _replace_constants(tree, node)


def _known(socket: Any) -> Triple | None:
    """The value of an input that no node has to be evaluated for, else None."""
    return of(socket.links[0].from_socket, _known) if socket.is_linked else triple(socket.default_value)


def _replace_constants(tree: Any, node: Any) -> None:
    """Put the values that diffuse light sees in place of a node that depends on the ray."""
    for output in node.outputs:
        known = of(output, _known)
        if known is not None and output.is_linked:
            _replace(tree, output, _number(tree, known[0]))


def _number(tree: Any, value: float) -> Any:
    node = tree.nodes.new("ShaderNodeValue")
    node.outputs[0].default_value = value
    return node.outputs[0]


def _replace(tree: Any, old: Any, new: Any) -> None:
    for link in list(old.links):
        tree.links.new(new, link.to_socket)

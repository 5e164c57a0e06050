"""A user's material as it looks by its baked light alone: a copy in which every shader that reflects light emits
its own colour times the baked light. What mixes, lets light through or shines by itself stays as it is.
"""

from __future__ import annotations

from typing import Any

import bpy

from . import compat
from .baked_light import VIEW_MARK, add
from .materials import DEFAULT_GREY, PASSES_LIGHT

# Shaders that reflect light, and their input that holds the colour.
COLOURS = {
    "ShaderNodeBsdfPrincipled": "Base Color", "ShaderNodeBsdfDiffuse": "Color", "ShaderNodeBsdfGlossy": "Color",
    "ShaderNodeBsdfAnisotropic": "Color", "ShaderNodeBsdfMetallic": "Base Color", "ShaderNodeBsdfSheen": "Color",
    "ShaderNodeBsdfToon": "Color", "ShaderNodeBsdfTranslucent": "Color", "ShaderNodeSubsurfaceScattering": "Color",
    "ShaderNodeEeveeSpecular": "Base Color",
}


class Unlit:
    """Makes and keeps the copies for one baked light.

    Parameters
    ----------
    light : node group with the output "Light", radiance of a white surface.
    has_colour : whether the light holds the surface's own colour already (quantity radiosity).
    """

    def __init__(self, light: Any, has_colour: bool) -> None:
        self._light, self._has_colour = light, has_colour
        self._materials: dict[str, Any] = {}
        self._groups: dict[str, Any] = {}

    def material(self, original: Any) -> Any:
        """The copy of a material; None stands for an empty slot, which Blender draws grey."""
        name = original.name_full if original is not None else ""
        if name not in self._materials:
            if original is not None and compat.uses_nodes(original):
                made = original.copy()
                self._change(made.node_tree)
            else:
                made = bpy.data.materials.new("Radiosity Preview")
                grey = (DEFAULT_GREY,) * 3 if original is None else tuple(original.diffuse_color[:3])
                only_shader(made, lambda tree: self._emission(tree, None, grey))
            made.name = f"Radiosity {name or 'Preview'}"
            made[VIEW_MARK] = True
            made.use_fake_user = False
            made.cycles.emission_sampling = "NONE"
            self._materials[name] = made
        return self._materials[name]

    def _change(self, tree: Any) -> None:
        for node in list(tree.nodes):
            if node.bl_idname == "ShaderNodeGroup" and node.node_tree is not None and reflects(node.node_tree):
                node.node_tree = self._group(node.node_tree)
            elif node.bl_idname in COLOURS and not _lets_light_through(node):
                self._replace(tree, node)

    def _group(self, original: Any) -> Any:
        name = original.name_full
        if name not in self._groups:
            made = original.copy()
            made[VIEW_MARK] = True
            made.use_fake_user = False
            self._groups[name] = made
            self._change(made)
        return self._groups[name]

    def _replace(self, tree: Any, node: Any) -> None:
        """Put an emission of the same colour in a shader's place."""
        source, value = _value(node.inputs[COLOURS[node.bl_idname]])
        shader = self._emission(tree, source, value)
        if node.bl_idname == "ShaderNodeBsdfPrincipled":
            shader = _with_own_light(tree, node, shader)
            shader = _with_alpha(tree, node, shader)
        targets = [link.to_socket for output in node.outputs for link in output.links]
        for target in targets:
            tree.links.new(shader, target)
        tree.nodes.remove(node)

    def _emission(self, tree: Any, source: Any, value: tuple[float, ...]) -> Any:
        """The output of an emission of colour times light."""
        group = add(tree, "ShaderNodeGroup", node_tree=self._light)
        emission = add(tree, "ShaderNodeEmission")
        if self._has_colour:
            tree.links.new(group.outputs["Light"], emission.inputs["Color"])
            return emission.outputs["Emission"]
        product = add(tree, "ShaderNodeVectorMath", operation="MULTIPLY")
        product.inputs[0].default_value = value
        if source is not None:
            tree.links.new(source, product.inputs[0])
        tree.links.new(group.outputs["Light"], product.inputs[1])
        tree.links.new(product.outputs["Vector"], emission.inputs["Color"])
        return emission.outputs["Emission"]


def only_shader(material: Any, make: Any) -> None:
    """Give a new material a tree with one shader: `make(tree)` returns its output."""
    if material.node_tree is None:
        material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    tree.links.new(make(tree), add(tree, "ShaderNodeOutputMaterial", 300).inputs["Surface"])


def reflects(tree: Any) -> bool:
    """Whether a tree, or a group in it, holds a shader that is replaced."""
    return any(node.bl_idname in COLOURS or (node.bl_idname == "ShaderNodeGroup" and node.node_tree is not None
                                             and reflects(node.node_tree)) for node in tree.nodes)


def _lets_light_through(node: Any) -> bool:
    """Whether the surface is mostly clear: such faces are left out of a bake."""
    weight = node.inputs.get("Transmission Weight") if node.bl_idname == "ShaderNodeBsdfPrincipled" else None
    return weight is not None and not weight.is_linked and weight.default_value > PASSES_LIGHT


def _value(socket: Any) -> tuple[Any, tuple[float, ...]]:
    """What feeds a colour socket: the output it is linked to or None, and its own value."""
    source = socket.links[0].from_socket if socket.is_linked else None
    return source, tuple(socket.default_value[:3])


def _with_own_light(tree: Any, node: Any, shader: Any) -> Any:
    """A Principled shader's own emission on top."""
    strength = node.inputs["Emission Strength"]
    if not strength.is_linked and strength.default_value == 0:
        return shader
    emission, total = add(tree, "ShaderNodeEmission"), add(tree, "ShaderNodeAddShader")
    for name, target in (("Emission Color", "Color"), ("Emission Strength", "Strength")):
        emission.inputs[target].default_value = node.inputs[name].default_value
        if node.inputs[name].is_linked:
            tree.links.new(node.inputs[name].links[0].from_socket, emission.inputs[target])
    tree.links.new(shader, total.inputs[0])
    tree.links.new(emission.outputs["Emission"], total.inputs[1])
    return total.outputs["Shader"]


def _with_alpha(tree: Any, node: Any, shader: Any) -> Any:
    """A Principled shader's cut-outs."""
    alpha = node.inputs["Alpha"]
    if not alpha.is_linked and alpha.default_value == 1:
        return shader
    clear, mixed = add(tree, "ShaderNodeBsdfTransparent"), add(tree, "ShaderNodeMixShader")
    mixed.inputs[0].default_value = alpha.default_value
    if alpha.is_linked:
        tree.links.new(alpha.links[0].from_socket, mixed.inputs[0])
    tree.links.new(clear.outputs["BSDF"], mixed.inputs[1])
    tree.links.new(shader, mixed.inputs[2])
    return mixed.outputs["Shader"]

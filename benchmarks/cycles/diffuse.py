"""Materials reduced to what a radiosity solution knows: a base colour (flat or image) and an emission."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

# What Cycles gives a mesh without any material: its default surface, a diffuse grey.
DEFAULT_COLOUR = (0.8, 0.8, 0.8, 1.0)


@dataclass(frozen=True)
class Reduced:
    """What became of a material: "flat", "image" or "transmissive"; and a note where something was lost."""

    kind: str
    note: str = ""


def reduce_material(bpy: Any, material: Any) -> Reduced:
    """Rebuild a material in place as Diffuse BSDF, plus Emission where it emits.

    A material that light passes through (transmission, or an alpha that is linked or below 1) is left as it is and
    called "transmissive": the caller takes its faces out.
    """
    shader = _principled(material)
    if shader is None:
        raise ValueError(f"material {material.name!r} has no Principled BSDF: this benchmark can't reduce it")
    if _lets_light_through(shader):
        return Reduced("transmissive")
    base, image, note = _colour_of(shader.inputs["Base Color"])
    emission, strength = shader.inputs["Emission Color"], shader.inputs["Emission Strength"]
    if emission.is_linked or strength.is_linked:
        raise ValueError(f"material {material.name!r} has a linked emission: this benchmark keeps flat emission only")
    light = [value * strength.default_value for value in emission.default_value[:3]]
    _rebuild(material.node_tree, base, image, light)
    return Reduced("image" if image else "flat", note)


def default_material(bpy: Any) -> Any:
    """The material for meshes that have none."""
    material = bpy.data.materials.new("Benchmark default")
    # From Blender 6 on every material has nodes; until then this makes the tree.
    if material.node_tree is None:
        material.use_nodes = True
    _rebuild(material.node_tree, DEFAULT_COLOUR, None, [0.0, 0.0, 0.0])
    return material


def _principled(material: Any) -> Any:
    nodes = material.node_tree.nodes if material.node_tree else []
    return next((node for node in nodes if node.bl_idname == "ShaderNodeBsdfPrincipled"), None)


def _lets_light_through(shader: Any) -> bool:
    alpha, transmission = shader.inputs["Alpha"], shader.inputs["Transmission Weight"]
    return bool(alpha.is_linked or alpha.default_value < 1 or transmission.is_linked or transmission.default_value > 0)


def _colour_of(socket: Any) -> tuple[tuple[float, ...], Any, str]:
    """(flat colour, image node or None, note) of a colour input."""
    if not socket.is_linked:
        return tuple(socket.default_value), None, ""
    source = socket.links[0].from_node
    if source.bl_idname == "ShaderNodeTexImage" and source.image is not None:
        if source.inputs["Vector"].is_linked:
            raise ValueError(f"image {source.image.name!r} has linked coordinates: this benchmark can't keep them")
        return DEFAULT_COLOUR, source, ""
    note = f"base colour is linked to {source.bl_idname}: its socket's own value is taken"
    return tuple(socket.default_value), None, note


def _rebuild(tree: Any, colour: tuple[float, ...], image: Any, light: list[float]) -> None:
    nodes, links = tree.nodes, tree.links
    for node in list(nodes):
        if node != image:
            nodes.remove(node)
    output, diffuse = nodes.new("ShaderNodeOutputMaterial"), nodes.new("ShaderNodeBsdfDiffuse")
    diffuse.inputs["Color"].default_value = colour
    diffuse.inputs["Roughness"].default_value = 0.0
    if image is not None:
        links.new(image.outputs["Color"], diffuse.inputs["Color"])
    surface = diffuse.outputs["BSDF"]
    if any(light):
        emission, both = nodes.new("ShaderNodeEmission"), nodes.new("ShaderNodeAddShader")
        emission.inputs["Color"].default_value = (*light, 1.0)
        emission.inputs["Strength"].default_value = 1.0
        links.new(surface, both.inputs[0])
        links.new(emission.outputs["Emission"], both.inputs[1])
        surface = both.outputs["Shader"]
    links.new(surface, output.inputs["Surface"])

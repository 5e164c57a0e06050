"""The materials of a diffuse twin, in the Blender that builds it (see `compare_child.py`)."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.floating[Any]]

# Layers of the twin's mesh: where lumels lie, where textures lie, and the reflectance.
LUMELS, TEXTURE, REFLECTANCE = "lumels", "texture", "reflectance"
# The node that makes what a camera ray meets whole.
WHOLE = "whole"


class TwinMaterials:
    """The twin's materials: a diffuse surface of the mesh's reflectance times a texture, and what it emits."""

    def __init__(self, arrays: dict[str, NDArray[Any]], pages: dict[tuple[int, int], Any]) -> None:
        self._rows, self._pages = arrays["materials"], pages
        self._textures: dict[int, Any] = {}
        self._pixels = {int(name.rpartition("_")[2]): value for name, value in arrays.items()
                        if name.startswith("texture_")}
        self._made = {index: self._make(index) for index in range(len(self._rows))}

    def __getitem__(self, index: int) -> Any:
        return self._made[index]

    def _make(self, index: int) -> Any:
        emission, (opacity, *indices) = self._rows[index][:3], self._rows[index][3:].tolist()
        reflectance_texture, emission_texture, opacity_texture, page, group = (int(value) for value in indices)
        material = bpy.data.materials.new(f"twin {index}")
        if material.node_tree is None:
            material.use_nodes = True
        tree = material.node_tree
        tree.nodes.clear()
        output = tree.nodes.new("ShaderNodeOutputMaterial")
        diffuse = tree.nodes.new("ShaderNodeBsdfDiffuse")
        diffuse.inputs["Roughness"].default_value = 0.0
        tree.links.new(self._colour(tree, reflectance_texture), diffuse.inputs["Color"])
        surface = diffuse.outputs["BSDF"]
        if emission.any():
            surface = _added(tree, surface, self._emission(tree, emission, emission_texture))
        if opacity < 1 or opacity_texture >= 0:
            surface = self._holed(tree, surface, opacity, opacity_texture)
        tree.links.new(surface, output.inputs["Surface"])
        if page >= 0:
            node = tree.nodes.new("ShaderNodeTexImage")
            node.name, node.image = "page", self._pages[group, page]
            tree.nodes.active = node
        return material

    def _colour(self, tree: Any, texture: int) -> Any:
        """The output that says how much a surface reflects."""
        attribute = tree.nodes.new("ShaderNodeAttribute")
        attribute.name, attribute.attribute_name = "reflectance", REFLECTANCE
        if texture < 0:
            return attribute.outputs["Color"]
        product = tree.nodes.new("ShaderNodeVectorMath")
        product.operation, product.name = "MULTIPLY", "colour"
        tree.links.new(attribute.outputs["Color"], product.inputs[0])
        tree.links.new(self._texture(tree, texture), product.inputs[1])
        return product.outputs[0]

    def _emission(self, tree: Any, colour: Float, texture: int) -> Any:
        """The output of an Emission shader: radiance `colour`, times a texture where there is one."""
        node = tree.nodes.new("ShaderNodeEmission")
        # A colour above 1 counts as it stands.
        node.inputs["Strength"].default_value = 1.0
        if texture < 0:
            node.inputs["Color"].default_value = (*(float(value) for value in colour), 1.0)
        else:
            product = tree.nodes.new("ShaderNodeVectorMath")
            product.operation = "MULTIPLY"
            product.inputs[0].default_value = [float(value) for value in colour]
            tree.links.new(self._texture(tree, texture), product.inputs[1])
            tree.links.new(product.outputs[0], node.inputs["Color"])
        return node.outputs["Emission"]

    def _holed(self, tree: Any, surface: Any, opacity: float, texture: int) -> Any:
        """The output of a surface that lets part of the light go straight on.

        What is baked is seen by camera rays, and is whole: Cycles would bake its light times its opacity.
        """
        clear, mix = tree.nodes.new("ShaderNodeBsdfTransparent"), tree.nodes.new("ShaderNodeMixShader")
        product, whole = tree.nodes.new("ShaderNodeMath"), tree.nodes.new("ShaderNodeMath")
        product.operation, whole.operation = "MULTIPLY", "MULTIPLY_ADD"
        product.inputs[0].default_value, product.inputs[1].default_value = 1.0, opacity
        if texture >= 0:
            # The texture's three channels are the same, or its first one counts.
            first = tree.nodes.new("ShaderNodeSeparateXYZ")
            tree.links.new(self._texture(tree, texture), first.inputs[0])
            tree.links.new(first.outputs[0], product.inputs[0])
        whole.name, whole.use_clamp, whole.inputs[1].default_value = WHOLE, True, 1.0
        tree.links.new(tree.nodes.new("ShaderNodeLightPath").outputs["Is Camera Ray"], whole.inputs[0])
        tree.links.new(product.outputs[0], whole.inputs[2])
        tree.links.new(whole.outputs[0], mix.inputs["Fac"])
        tree.links.new(clear.outputs["BSDF"], mix.inputs[1])
        tree.links.new(surface, mix.inputs[2])
        return mix.outputs["Shader"]

    def show_holes(self) -> None:
        """Let cameras look through holes, too: for a render, after all bakes."""
        for material in self._made.values():
            whole = material.node_tree.nodes.get(WHOLE)
            if whole is not None:
                whole.inputs[1].default_value = 0.0

    def _texture(self, tree: Any, index: int) -> Any:
        node, place = tree.nodes.new("ShaderNodeTexImage"), tree.nodes.new("ShaderNodeUVMap")
        if index not in self._textures:
            pixels = self._pixels[index]
            image = bpy.data.images.new(f"texture {index}", pixels.shape[1], pixels.shape[0], float_buffer=True,
                                        is_data=True)
            rgba = np.ones((*pixels.shape[:2], 4), np.float32)
            rgba[..., :3] = pixels
            image.pixels.foreach_set(rgba.ravel())
            image.update()
            self._textures[index] = image
        node.image, place.uv_map = self._textures[index], TEXTURE
        tree.links.new(place.outputs["UV"], node.inputs["Vector"])
        return node.outputs["Color"]

    def show_baked(self) -> None:
        """Replace the diffuse surface by an emission of lightmap times reflectance; no lightmap, no light."""
        for material in self._made.values():
            tree = material.node_tree
            diffuse = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeBsdfDiffuse")
            colour, target = diffuse.inputs["Color"].links[0].from_socket, diffuse.outputs["BSDF"].links[0].to_socket
            shine = tree.nodes.new("ShaderNodeEmission")
            shine.inputs["Strength"].default_value = 1.0
            page = tree.nodes.get("page")
            if page is None:
                shine.inputs["Color"].default_value = (0.0, 0.0, 0.0, 1.0)
            else:
                place, product = tree.nodes.new("ShaderNodeUVMap"), tree.nodes.new("ShaderNodeVectorMath")
                place.uv_map, product.operation = LUMELS, "MULTIPLY"
                tree.links.new(place.outputs["UV"], page.inputs["Vector"])
                tree.links.new(page.outputs["Color"], product.inputs[0])
                tree.links.new(colour, product.inputs[1])
                tree.links.new(product.outputs[0], shine.inputs["Color"])
            tree.links.new(shine.outputs["Emission"], target)
            tree.nodes.remove(diffuse)


def _added(tree: Any, first: Any, second: Any) -> Any:
    node = tree.nodes.new("ShaderNodeAddShader")
    tree.links.new(first, node.inputs[0])
    tree.links.new(second, node.inputs[1])
    return node.outputs["Shader"]

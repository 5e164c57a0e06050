"""Run by Blender: `blender -b --factory-startup --python node_furnace.py -- SCENE.blend` saves a furnace made by nodes.

A cube of 2 m with its normals inward. Reflectance 1/2 and radiance 1 of every wall come out of nodes that have to be
evaluated: 2^-1 by Math, 1 by a colour ramp over a noise, white at both ends. E / pi is exactly 1 / (1 - 1/2) = 2. The
sockets' own values, which count where nodes are not evaluated, would give 1 / (1 - 1/5) = 1.25.
"""

from __future__ import annotations

import sys

import bpy


def build() -> None:
    """Empty the open file and put the furnace into it."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    corners = [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    # Inward by the right-hand rule.
    faces = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    mesh = bpy.data.meshes.new("Furnace")
    mesh.from_pydata(corners, [], faces)
    material = bpy.data.materials.new("Wall")
    material.use_nodes = True
    tree = material.node_tree
    shader = tree.nodes["Principled BSDF"]
    half, noise, ramp = (tree.nodes.new(f"ShaderNode{kind}") for kind in ("Math", "TexNoise", "ValToRGB"))
    half.operation = "POWER"
    half.inputs[0].default_value, half.inputs[1].default_value = 2.0, -1.0
    ramp.color_ramp.elements[0].color = (1, 1, 1, 1)
    tree.links.new(noise.outputs[0], ramp.inputs[0])
    tree.links.new(half.outputs[0], shader.inputs["Base Color"])
    tree.links.new(ramp.outputs[0], shader.inputs["Emission Color"])
    shader.inputs["Base Color"].default_value = (0.2, 0.2, 0.2, 1)
    shader.inputs["Emission Color"].default_value = (1, 1, 1, 1)
    shader.inputs["Emission Strength"].default_value = 1.0
    mesh.materials.append(material)
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("Furnace", mesh))


if __name__ == "__main__":
    build()
    bpy.ops.wm.save_as_mainfile(filepath=sys.argv[-1])

"""Run by Blender: `blender -b --factory-startup --python furnace.py -- SCENE.blend` saves a closed furnace.

A cube of 2 m with its normals inward; every wall has reflectance 1/2 and radiance 1 of its own. The light is the same
everywhere and in all directions, B = E / (1 - rho), so each lumel's E / pi is exactly 1 / (1 - 1/2) = 2.
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
    shader = material.node_tree.nodes["Principled BSDF"]
    shader.inputs["Base Color"].default_value = (0.5, 0.5, 0.5, 1)
    shader.inputs["Emission Color"].default_value = (1, 1, 1, 1)
    shader.inputs["Emission Strength"].default_value = 1.0
    mesh.materials.append(material)
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("Furnace", mesh))
    bpy.context.view_layer.update()
    inward = [polygon.normal.dot(polygon.center) < 0 for polygon in mesh.polygons]
    if not all(inward):
        raise SystemExit(f"the furnace's normals point {inward}, not all inward")


if __name__ == "__main__":
    build()
    bpy.ops.wm.save_as_mainfile(filepath=sys.argv[-1])

"""Run by Blender: `blender -b --factory-startup --python node_furnace.py -- SCENE.blend` saves a furnace made by nodes.

The closed furnace of tests/package/furnace.py. Reflectance 1/2 and radiance 1 of every wall come out of nodes that
have to be evaluated: 2^-1 by Math, 1 by a colour ramp over a noise, white at both ends. E / pi is exactly 1 / (1 - 1/2)
= 2. The sockets' own values, which count where nodes are not evaluated, would give 1 / (1 - 1/5) = 1.25.
"""

from __future__ import annotations

import sys
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).parents[1] / "package"))
import furnace  # type: ignore[import-not-found]


def build() -> None:
    """Empty the open file and put the furnace into it."""
    furnace.build()
    material = bpy.data.materials["Wall"]
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


if __name__ == "__main__":
    build()
    bpy.ops.wm.save_as_mainfile(filepath=sys.argv[-1])

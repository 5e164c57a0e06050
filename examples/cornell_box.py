"""A Cornell box of our own: five walls, two blocks, one emissive panel.

    python examples/cornell_box.py PATH.blend        with Blender as a Python module (the bpy wheel)
    blender -b --factory-startup --python examples/cornell_box.py -- PATH.blend

The script is the source: a .blend opens in the Blender that saved it and in later ones, so it is made where it is used.
"""

from __future__ import annotations

import math
import os
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

# The room, metres: x to the right, y away from the camera, z up; open towards the camera.
SIDE = 2.0
# The panel hangs so far under the ceiling, metres, and is so large.
PANEL_GAP, PANEL_SIDE = 0.01, 0.5
# Radiance of the panel, W / (m2 sr).
PANEL_RADIANCE = (14.0, 12.0, 9.0)

WHITE, RED, GREEN = (0.73, 0.72, 0.70), (0.60, 0.08, 0.06), (0.12, 0.42, 0.14)

Point = tuple[float, float, float]


def build(bpy: Any) -> None:
    """Fill an empty file with the box, a camera and a dark world."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.world = bpy.data.worlds.new("Dark")
    scene.world.color = (0.0, 0.0, 0.0)
    for node in scene.world.node_tree.nodes if scene.world.node_tree else ():
        if node.bl_idname == "ShaderNodeBackground":
            node.inputs["Strength"].default_value = 0.0
    s = SIDE
    corner = [(x, y, z) for z in (0.0, s) for y in (0.0, s) for x in (0.0, s)]
    white, red, green = (_material(bpy, name, colour) for name, colour in
                         (("White", WHITE), ("Red", RED), ("Green", GREEN)))
    for name, order, material in (("Floor", (0, 1, 3, 2), white), ("Ceiling", (4, 6, 7, 5), white),
                                  ("Back Wall", (2, 3, 7, 6), white), ("Left Wall", (0, 2, 6, 4), red),
                                  ("Right Wall", (1, 5, 7, 3), green)):
        _object(bpy, name, [corner[index] for index in order], [(0, 1, 2, 3)], material)
    _block(bpy, "Tall Block", (0.66, 1.32), 0.58, 1.20, 17.0, white)
    _block(bpy, "Short Block", (1.34, 0.66), 0.60, 0.60, -16.0, white)
    _panel(bpy)
    _camera(bpy)


def _material(bpy: Any, name: str, colour: Point, radiance: Point | None = None) -> Any:
    material = bpy.data.materials.new(name)
    if material.node_tree is None:
        material.use_nodes = True
    shader = next(node for node in material.node_tree.nodes if node.bl_idname == "ShaderNodeBsdfPrincipled")
    shader.inputs["Base Color"].default_value = (*colour, 1.0)
    shader.inputs["Roughness"].default_value = 1.0
    shader.inputs["Specular IOR Level"].default_value = 0.0
    if radiance is not None:
        shader.inputs["Emission Color"].default_value = (*radiance, 1.0)
        shader.inputs["Emission Strength"].default_value = 1.0
    return material


def _object(bpy: Any, name: str, points: Sequence[Point], faces: Sequence[tuple[int, ...]], material: Any) -> Any:
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(points, [], faces)
    mesh.materials.append(material)
    made = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(made)
    return made


def _block(bpy: Any, name: str, centre: tuple[float, float], side: float, height: float, degrees: float,
           material: Any) -> None:
    """A block on the floor, turned about its own axis; it has no bottom, which no light could reach."""
    half = side / 2
    ring = [(-half, -half), (half, -half), (half, half), (-half, half)]
    points = [(x, y, z) for z in (0.0, height) for x, y in ring]
    faces = [(4, 5, 6, 7), *((side, (side + 1) % 4, (side + 1) % 4 + 4, side + 4) for side in range(4))]
    made = _object(bpy, name, points, faces, material)
    made.location = (*centre, 0.0)
    made.rotation_euler.z = math.radians(degrees)


def _panel(bpy: Any) -> None:
    """The lamp: a face that looks down and shines to both sides, as Blender's emission does."""
    low, high, z = (SIDE - PANEL_SIDE) / 2, (SIDE + PANEL_SIDE) / 2, SIDE - PANEL_GAP
    points = [(low, low, z), (low, high, z), (high, high, z), (high, low, z)]
    _object(bpy, "Panel", points, [(0, 1, 2, 3)], _material(bpy, "Panel", (0.0, 0.0, 0.0), PANEL_RADIANCE))


def _camera(bpy: Any) -> None:
    data = bpy.data.cameras.new("Camera")
    data.sensor_width, data.lens = 36.0, 50.0
    camera = bpy.data.objects.new("Camera", data)
    camera.location = (SIDE / 2, -3.2, SIDE / 2)
    camera.rotation_euler = (math.pi / 2, 0.0, 0.0)
    scene = bpy.context.scene
    scene.collection.objects.link(camera)
    scene.camera = camera
    scene.render.resolution_x = scene.render.resolution_y = 800


def main() -> None:
    """Build the box and save it."""
    arguments = sys.argv[sys.argv.index("--") + 1:] if "--" in sys.argv else sys.argv[1:]
    path = Path(arguments[0] if arguments else "cornell_box.blend").absolute()
    with tempfile.TemporaryDirectory(prefix="radiosity-") as folder:
        # The user's extensions stay out of it; has no effect inside a Blender program, which has started already.
        os.environ.setdefault("BLENDER_USER_RESOURCES", folder)
        import bpy

        build(bpy)
        bpy.ops.wm.save_as_mainfile(filepath=str(path), compress=True)


if __name__ == "__main__":
    main()

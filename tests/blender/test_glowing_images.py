"""A glowing image on a mesh against Cycles (see `stage`)."""

import bpy
import numpy as np
import pytest
from radiosity import radiosity_addon, solver
from radiosity.radiosity_addon.export import export_scene
from radiosity.tests.blender.stage import cycles_irradiance, footprint_points, material, mesh


def test_a_screen_lights_by_its_image(stage):
    # A screen of one quad, red in its left quarter and blue in a patch; open and shaded receivers, to 1 %.
    pixels = np.zeros((16, 32, 4), np.float32)
    pixels[..., 3] = 1
    pixels[:, :8, :3] = (4, 2, 1)
    pixels[4:10, 20:28, :3] = (0.2, 1, 6)
    image = bpy.data.images.new("Picture", 32, 16, float_buffer=True)
    image.colorspace_settings.name = "Non-Color"
    image.pixels.foreach_set(pixels.ravel())
    image.pack()
    glow = material("Glow", "ShaderNodeEmission", Strength=3)
    tree = glow.node_tree
    node = tree.nodes.new("ShaderNodeTexImage")
    node.image = image
    tree.links.new(node.outputs["Color"],
                   next(node for node in tree.nodes if node.bl_idname == "ShaderNodeEmission").inputs["Color"])
    screen = mesh("Screen", [(-1, -0.4, 1.5), (1, -0.4, 1.5), (1, 0.6, 1.5), (-1, 0.6, 1.5)], [(0, 1, 2, 3)], glow)
    screen.data.uv_layers.new(name="UVMap").data.foreach_set("uv", [0, 0, 1, 0, 1, 1, 0, 1])
    # Black for us, so that there is direct light alone; Cycles bakes that apart.
    paint = bpy.data.objects["Receiver"].data.materials[0].node_tree.nodes["Diffuse BSDF"].inputs["Color"]
    white, paint.default_value = tuple(paint.default_value), (0, 0, 0, 1)
    radiosity_addon.register()
    try:
        scene = export_scene(bpy.context.scene, bpy.context.view_layer, solver.Settings(), []).scene
    finally:
        radiosity_addon.unregister()
    paint.default_value = white
    points = np.concatenate([footprint_points(left)[:, :2].reshape(-1, 3) for left in (-1.5, 0.5)])
    up = np.tile(np.float32([0, 0, 1]), (len(points), 1))
    ours = solver.irradiance(scene, solver.Settings(error=0.005), points, up).reshape(2, -1, 3).mean(axis=1)
    assert ours == pytest.approx(cycles_irradiance().mean(axis=1), rel=0.01)

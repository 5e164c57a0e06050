"""What Cycles makes of a world: a map of all directions, and close looks at some of them.

The map is rendered strip by strip, each a part for a window that waits. Cycles draws its samples by a pixel's place in
the whole map, so the strips are that map to the bit.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np
from mathutils import Matrix
from numpy.typing import NDArray

from . import cycles
from .parts import ENDLESS, Parts
from .shader_views import show_to_diffuse_rays

Float = NDArray[np.floating[Any]]


@dataclass(frozen=True)
class Map:
    """Size of a map of all directions, pixels, and samples of each."""

    width: int
    height: int
    samples: int


# .35 degrees a pixel for a bake, .7 for a world without anything small in it, 1.4 for a first look.
FINE, SMOOTH, COARSE = Map(1024, 512, 4), Map(512, 256, 1), Map(256, 128, 1)
# What nodes a world without anything small may have; a sky texture only without its sun, which these have not.
SUNLESS = {"PREETHAM", "HOSEK_WILKIE"}
SMOOTH_NODES = {
    "ShaderNodeOutputWorld", "ShaderNodeBackground", "ShaderNodeTexSky", "ShaderNodeTexGradient", "ShaderNodeTexCoord",
    "ShaderNodeMapping", "ShaderNodeRGB", "ShaderNodeValue", "ShaderNodeBlackbody", "ShaderNodeHueSaturation",
    "ShaderNodeGamma", "ShaderNodeAddShader"}
# Rows of the first strip, which tells how many the next may have, and of the smallest.
FIRST_ROWS, LEAST_ROWS = 32, 8
# Pixels along a side of a close look at a part of the world, and samples of each.
WINDOW_SIDE, WINDOW_SAMPLES = 128, 16


def map_parts(world: Any, size: Map = FINE, part_seconds: float = ENDLESS) -> Parts[Float]:
    """Radiance from every direction, (height, width, 3) float32, rows from straight down to straight up.

    The middle column looks along +x, the one a quarter to its left along +y (see `solver.sky`).

    Parameters
    ----------
    part_seconds : how long a strip may take, about.

    Raises
    ------
    SceneError
        If Cycles is not there or can't render the world.
    """
    strips: list[Float] = []
    low, rows = 0, size.height if part_seconds == ENDLESS else FIRST_ROWS
    while low < size.height:
        high = min(low + rows, size.height)
        start = time.perf_counter()
        strips.append(_strip(world, size, low, high))
        taken = time.perf_counter() - start
        rows = int(np.clip((high - low) * part_seconds / max(taken, 1e-6), LEAST_ROWS, size.height))
        low = high
        yield
    return np.concatenate(strips)


def fine_map(world: Any) -> Map:
    """The map that a bake needs of a world."""
    return SMOOTH if all(_is_smooth(node) for node in world.node_tree.nodes) else FINE


def _is_smooth(node: Any) -> bool:
    if node.bl_idname == "ShaderNodeTexSky" and node.sky_type not in SUNLESS and node.sun_disc:
        return False
    return node.bl_idname in SMOOTH_NODES


def window(world: Any, axis: Float, right: Float, up: Float, half: float) -> Float:
    """Radiance through a square window, (128, 128, 3) float32, row 0 at the bottom.

    Parameters
    ----------
    axis, right, up : (3,) unit, at right angles, right x up = -axis; columns grow to the right, rows up.
    half : tangent of half of the window's angle.

    Raises
    ------
    SceneError
        If Cycles is not there or can't render the world.
    """
    with _scene(world, Map(WINDOW_SIDE, WINDOW_SIDE, WINDOW_SAMPLES)) as scene:
        camera = scene.camera
        camera.data.type = "PERSP"
        camera.data.angle = 2 * float(np.arctan(half))
        camera.rotation_euler = Matrix(np.stack([right, up, -axis], axis=1).tolist()).to_euler()
        return cycles.rendered(scene, world.name)


def _strip(world: Any, size: Map, low: int, high: int) -> Float:
    """Some rows of the map."""
    with _scene(world, size) as scene:
        render = scene.render
        render.use_border = render.use_crop_to_border = True
        render.border_min_x, render.border_max_x = 0.0, 1.0
        render.border_min_y, render.border_max_y = low / size.height, high / size.height
        return cycles.rendered(scene, world.name)


@contextmanager
def _scene(world: Any, size: Map) -> Iterator[Any]:
    """A scene of its own with nothing but the world and a panoramic camera; gone afterwards."""
    scene = bpy.data.scenes.new("radiosity world")
    camera = bpy.data.cameras.new("radiosity world")
    viewer = bpy.data.objects.new("radiosity world", camera)
    copy = world.copy()
    groups: list[Any] = []
    try:
        scene.collection.objects.link(viewer)
        camera.type, camera.panorama_type = "PANO", "EQUIRECTANGULAR"
        # Level, looking along +x.
        viewer.rotation_euler = (np.pi / 2, 0.0, -np.pi / 2)
        scene.camera = viewer
        scene.world = copy
        groups = show_to_diffuse_rays(copy.node_tree)
        # A world hidden from cameras lights the scene all the same.
        copy.cycles_visibility.camera = True
        # Nothing here is lit by it: Cycles need not build its map for sampling, which takes seconds.
        copy.cycles.sampling_method = "NONE"
        cycles.set_up_render(scene, size.width, size.height, size.samples)
        yield scene
    finally:
        cycles.remove_scene(scene)
        bpy.data.objects.remove(viewer)
        bpy.data.cameras.remove(camera)
        bpy.data.worlds.remove(copy)
        for group in groups:
            bpy.data.node_groups.remove(group)

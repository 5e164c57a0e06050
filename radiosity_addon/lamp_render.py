"""What Cycles makes of a lamp's nodes, by rendering a white box with the lamp in its middle.

    radiance of the wall = I(direction) cos / (pi d^2)

with no noise, since a point lamp without radius throws light in one way only. So any node tree is read as Cycles reads
it: IES profiles, blackbodies, textures, mathematics.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from . import compat, cycles

Float = NDArray[np.floating[Any]]

# Half of the box's side, metres.
HALF = 1.0
CORNERS = [(x, y, z) for z in (-HALF, HALF) for y in (-HALF, HALF) for x in (-HALF, HALF)]
FACES = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
# Size of the map of a lamp's directions, pixels: .7 degrees each, between which it is interpolated.
PATTERN_WIDTH, PATTERN_HEIGHT = 512, 256
# Pixels along the longer side of an area lamp's picture.
FACE_SIDE = 64


def intensity_pattern(data: Any) -> tuple[Float, Float]:
    """What a lamp's nodes multiply its light with, by direction away from it in its own axes.

    Returns
    -------
    (256, 512, 3) float32 factors, laid out as `solver.scene.Sky` lays out its map, and the distance (256, 512) in
    metres that each was seen at.

    Raises
    ------
    SceneError
        If Cycles is not there or can't render it.
    """
    with _plain_copy(data, "POINT") as bulb, _scene(bulb, PATTERN_WIDTH, PATTERN_HEIGHT) as scene:
        # I = 1 W/sr without nodes.
        bulb.energy = 4 * np.pi
        bulb.shadow_soft_size = 0.0
        bulb.use_soft_falloff = True
        camera = scene.camera
        camera.data.type, camera.data.panorama_type = "PANO", "EQUIRECTANGULAR"
        camera.rotation_euler = (np.pi / 2, 0.0, -np.pi / 2)
        with _box(scene):
            seen = cycles.rendered(scene, data.name)
    height, width = seen.shape[:2]
    nearest = _box_distance(height, width)
    # cos = HALF / d on every wall.
    return np.asarray(seen * (np.pi * nearest**3 / HALF)[..., None], np.float32), nearest


def face_pattern(data: Any) -> Float:
    """What an area lamp's nodes multiply its light with, over its face: (h, w, 3) float32.

    Columns grow along its x, rows along its y.
    """
    with _plain_copy(data, "AREA") as face, _scene(face, FACE_SIDE, FACE_SIDE) as scene:
        face.shape, face.size, face.size_y = "RECTANGLE", 1.0, 1.0
        # A radiance of 1 without nodes.
        face.energy = np.pi
        scene.objects["radiosity lamp"].visible_camera = True
        camera = scene.camera
        camera.data.type, camera.data.ortho_scale = "ORTHO", 1.0
        camera.location, camera.rotation_euler = (0.0, 0.0, -1.0), (0.0, np.pi, 0.0)
        # Seen from below, x runs to the left.
        return np.ascontiguousarray(cycles.rendered(scene, data.name)[:, ::-1])


def _box_distance(height: int, width: int) -> Float:
    """(h, w) metres from the middle of the box to its walls, along the directions of the map's texels."""
    polar = np.pi * (1 - (np.arange(height) + 0.5) / height)[:, None]
    azimuth = 2 * np.pi * (0.5 - (np.arange(width) + 0.5) / width)[None, :]
    sides = (np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar) + 0 * azimuth)
    return np.asarray(HALF / np.max(np.abs(sides), axis=0), np.float32)


@contextmanager
def _plain_copy(data: Any, kind: str) -> Iterator[Any]:
    """A lamp of one kind with the nodes of another, and nothing else of it; gone afterwards."""
    copy = data.copy()
    name = copy.name
    copy.type = kind
    copy = bpy.data.lights[name]  # its class has changed
    try:
        copy.color = (1.0, 1.0, 1.0)
        copy.use_shadow = True
        compat.reset_light(copy)
        yield copy
    finally:
        bpy.data.lights.remove(copy)


@contextmanager
def _scene(lamp: Any, width: int, height: int) -> Iterator[Any]:
    """A scene of its own with the lamp at its origin and a camera there; gone afterwards."""
    scene = bpy.data.scenes.new("radiosity lamp")
    camera = bpy.data.cameras.new("radiosity lamp")
    placed = [bpy.data.objects.new("radiosity lamp", lamp), bpy.data.objects.new("radiosity camera", camera)]
    try:
        for item in placed:
            scene.collection.objects.link(item)
        scene.camera = placed[1]
        camera.clip_start = 1e-3
        cycles.set_up_render(scene, width, height, samples=1)
        scene.cycles.max_bounces = 0
        # Rays through the pixels' middles alone.
        scene.cycles.filter_width = 0.01
        scene.cycles.light_sampling_threshold = 0.0
        yield scene
    finally:
        cycles.remove_scene(scene)
        for item in placed:
            bpy.data.objects.remove(item)
        bpy.data.cameras.remove(camera)


@contextmanager
def _box(scene: Any) -> Iterator[None]:
    """A white box around the origin."""
    mesh = bpy.data.meshes.new("radiosity box")
    mesh.from_pydata(CORNERS, [], FACES)
    white = bpy.data.materials.new("radiosity box")
    if white.node_tree is None:
        white.use_nodes = True
    tree = white.node_tree
    tree.nodes.clear()
    diffuse, output = tree.nodes.new("ShaderNodeBsdfDiffuse"), tree.nodes.new("ShaderNodeOutputMaterial")
    diffuse.inputs["Color"].default_value = (1.0, 1.0, 1.0, 1.0)
    tree.links.new(diffuse.outputs[0], output.inputs["Surface"])
    mesh.materials.append(white)
    box = bpy.data.objects.new("radiosity box", mesh)
    scene.collection.objects.link(box)
    try:
        yield
    finally:
        bpy.data.objects.remove(box)
        bpy.data.meshes.remove(mesh)
        bpy.data.materials.remove(white)

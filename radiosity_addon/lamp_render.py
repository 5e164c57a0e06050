"""What Cycles makes of a lamp's nodes, by rendering a white box with the lamp in its middle.

    radiance of the wall = I(direction) cos / (pi d^2)

with no noise, since a point lamp without radius throws light in one way only. So a node tree is read as Cycles reads
it: IES profiles, blackbodies, textures, mathematics. Suns shine into the box through its walls, which cast no shadow.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ..solver.finish import dilate
from . import compat, cycles
from .lamp_places import Place
from .shader_views import show_to_lit_surfaces

Float = NDArray[np.floating[Any]]

# Half of the box's side, metres.
HALF = 1.0
CORNERS = [(x, y, z) for z in (-HALF, HALF) for y in (-HALF, HALF) for x in (-HALF, HALF)]
FACES = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
# Size of the map of a lamp's directions, pixels: .7 degrees each, between which it is interpolated.
PATTERN_WIDTH, PATTERN_HEIGHT = 512, 256
# Pixels along each side of an area lamp's picture.
FACE_SIDE = 64
# Pixels along each side of what a sun lights: as few as Blender renders.
SUN_SIDE = 4
# Texels beyond a spot's cone that interpolation inside of it may read.
RIM = 2
# A lamp at the origin, its axes those of the world.
ORIGIN = Place(tuple(np.eye(4).ravel().tolist()), (1.0, 1.0, 1.0, 1.0), 0, 0.0)


def intensity_pattern(data: Any, place: Place, *, as_spot: bool) -> tuple[Float, Float]:
    """What a lamp's nodes multiply its light with, by direction away from it in the world.

    Parameters
    ----------
    data : a bpy point or spot light.
    place : where it stands; at `ORIGIN` directions are those of the lamp's own axes.
    as_spot : whether it is a spot; else it is seen as a point lamp, which shines everywhere.

    Returns
    -------
    (256, 512, 3) float32 factors, laid out as `solver.scene.Sky` lays out its map, and the distance (256, 512) in
    metres that each was seen at. Of a spot's, those outside of its cone are 0.

    Raises
    ------
    SceneError
        If Cycles is not there or can't render it.
    """
    with (_plain_copy(data, "SPOT" if as_spot else "POINT", place) as bulb,
          _scene(bulb, PATTERN_WIDTH, PATTERN_HEIGHT, place) as scene):
        # I = 1 W/sr without nodes.
        bulb.energy = 4 * np.pi
        bulb.shadow_soft_size = 0.0
        bulb.use_soft_falloff = True
        if as_spot:
            bulb.spot_blend = 0.0
        camera = scene.camera
        camera.data.type, camera.data.panorama_type = "PANO", "EQUIRECTANGULAR"
        camera.location = _matrix(place)[:3, 3]
        camera.rotation_euler = (np.pi / 2, 0.0, -np.pi / 2)
        with _box(scene) as box:
            box.location = camera.location
            seen = cycles.rendered(scene, data.name)
    height, width = seen.shape[:2]
    nearest = HALF / np.abs(_directions(height, width)).max(axis=-1)
    # cos = HALF / d on every wall.
    return np.asarray(seen * (np.pi * nearest**3 / HALF)[..., None], np.float32), np.asarray(nearest, np.float32)


def beyond_the_cone(pattern: Float, place: Place, spot_size: float) -> Float:
    """A spot's pattern with its rim continued beyond the cone, and its mean farther out, where no light goes."""
    local = _directions(*pattern.shape[:2]) @ np.linalg.inv(_matrix(place)[:3, :3]).T
    inside = -local[..., 2] > np.cos(spot_size / 2) * np.linalg.norm(local, axis=-1)
    mean = pattern[inside].mean(axis=0) if inside.any() else np.zeros(3)
    rim = dilate(inside[..., None].astype(np.float32), inside, RIM)[..., 0] > 0
    return np.asarray(np.where(rim[..., None], dilate(pattern, inside, RIM), mean), np.float32)


def sun_factor(data: Any, place: Place) -> Float:
    """(3,) what a sun's nodes multiply its light with, by what it sends along its axis."""
    with _plain_copy(data, "SUN", place) as sun, _scene(sun, SUN_SIDE, SUN_SIDE, place) as scene:
        # A radiance of 1 on a white surface that faces it, without nodes.
        sun.energy, sun.angle = np.pi, 0.0
        view = _view(place, backwards=False)
        scene.camera.data.type, scene.camera.data.ortho_scale = "ORTHO", HALF
        scene.camera.matrix_world = view.T.tolist()
        with _box(scene) as box:
            box.matrix_world = view.T.tolist()
            box.visible_shadow = False
            return np.asarray(cycles.rendered(scene, data.name).mean(axis=(0, 1)))


def face_pattern(data: Any, place: Place | None) -> Float:
    """What an area lamp's nodes multiply its light with, over its face: (h, w, 3) float32.

    Columns grow along its x, rows along its y. It has its own size where it has a place, else 1 m.
    """
    at = place or ORIGIN
    with _plain_copy(data, "AREA", at) as face, _scene(face, FACE_SIDE, FACE_SIDE, at) as scene:
        size = data.size, data.size_y if data.shape in {"RECTANGLE", "ELLIPSE"} else data.size
        face.shape, (face.size, face.size_y) = "RECTANGLE", size if place is not None else (1.0, 1.0)
        width, height = np.linalg.norm(_matrix(at)[:3, :2], axis=0) * (face.size, face.size_y)
        # A radiance of 1 without nodes.
        face.energy = np.pi * width * height
        scene.objects["radiosity lamp"].visible_camera = True
        camera, render = scene.camera, scene.render
        camera.data.type, camera.data.ortho_scale = "ORTHO", max(width, height)
        render.pixel_aspect_x, render.pixel_aspect_y = max(width / height, 1.0), max(height / width, 1.0)
        view = _view(at, backwards=True)
        view[:3, 3] += view[:3, 2]
        camera.matrix_world = view.T.tolist()
        # Seen from below, x runs to the left.
        return np.ascontiguousarray(cycles.rendered(scene, data.name)[:, ::-1])


def _matrix(place: Place) -> Float:
    return np.reshape(place.matrix, (4, 4))


def _view(place: Place, *, backwards: bool) -> Float:
    """(4, 4) of a camera at a lamp that looks along its axis, or backwards; its up is the lamp's y."""
    matrix, view = _matrix(place), np.eye(4)
    back = matrix[:3, 2] * (-1 if backwards else 1)
    right = np.cross(matrix[:3, 1], back)
    axes = np.stack([right, np.cross(back, right), back], axis=1)
    view[:3, :3], view[:3, 3] = axes / np.linalg.norm(axes, axis=0), matrix[:3, 3]
    return view


def _directions(height: int, width: int) -> Float:
    """(h, w, 3) unit directions of the map's texels."""
    polar = np.pi * (1 - (np.arange(height) + 0.5) / height)[:, None]
    azimuth = 2 * np.pi * (0.5 - (np.arange(width) + 0.5) / width)[None, :]
    return np.stack([np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar) + 0 * azimuth],
                    axis=-1)


@contextmanager
def _plain_copy(data: Any, kind: str, place: Place) -> Iterator[Any]:
    """A lamp of one kind with the nodes of another, as they look there, and nothing else of it; gone afterwards."""
    copy = data.copy()
    groups: list[Any] = []
    name = copy.name
    copy.type = kind
    copy = bpy.data.lights[name]  # its class has changed
    try:
        copy.color = (1.0, 1.0, 1.0)
        copy.use_shadow = True
        compat.reset_light(copy)
        groups = show_to_lit_surfaces(copy.node_tree, place.random)
        yield copy
    finally:
        bpy.data.lights.remove(copy)
        for group in groups:
            bpy.data.node_groups.remove(group)


@contextmanager
def _scene(lamp: Any, width: int, height: int, place: Place) -> Iterator[Any]:
    """A scene of its own with the lamp in its place and a camera at the origin; gone afterwards."""
    scene = bpy.data.scenes.new("radiosity lamp")
    camera = bpy.data.cameras.new("radiosity lamp")
    placed = [bpy.data.objects.new("radiosity lamp", lamp), bpy.data.objects.new("radiosity camera", camera)]
    try:
        for item in placed:
            scene.collection.objects.link(item)
        placed[0].matrix_world = _matrix(place).T.tolist()
        placed[0].color, placed[0].pass_index = place.colour, place.index
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
def _box(scene: Any) -> Iterator[Any]:
    """A white box around the origin; gone afterwards."""
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
        yield box
    finally:
        bpy.data.objects.remove(box)
        bpy.data.meshes.remove(mesh)
        bpy.data.materials.remove(white)

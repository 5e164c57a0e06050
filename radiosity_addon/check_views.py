"""Findings on what the camera sees: backs of faces, which are not baked."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..solver.geometry import Geometry
from .warn import Warnings, warn

Float = NDArray[np.floating[Any]]

# Rays through the picture, across and down.
ACROSS, DOWN = 128, 72
# Backs that fill less than this part of the picture are not worth a line.
WORTH = 0.02


def check_views(geometry: Geometry, scene: Any, warnings: Warnings) -> None:
    """Tell of all surfaces whose backs the scene's camera sees; what was told to be flipped is not told twice."""
    camera = scene.camera
    if camera is None or camera.type != "CAMERA" or camera.data.type == "PANO":
        return
    origins, directions = view_rays(camera, scene)
    relative = np.asarray(origins - geometry.scene.origin, np.float32)
    hits = geometry.visibility.hits(relative, directions)
    backs = hits.triangle[(hits.triangle >= 0) & ~hits.front]
    share = np.bincount(geometry.surface[backs], minlength=len(geometry.scene.surfaces)) / len(directions)
    flipped = {entry["object"] for entry in warnings if entry["code"] == "flipped"}
    for item, part in zip(geometry.scene.surfaces, share, strict=True):
        if part >= WORTH and item.receives and item.name not in flipped:
            warn(warnings, item.name, "back_seen", f"its backs fill {part:.0%} of what {camera.name!r} sees, and only "
                 "the fronts of faces are baked: flip its normals (Mesh > Normals > Flip), or give it a thickness "
                 "(Solidify)")


def view_rays(camera: Any, scene: Any) -> tuple[Float, Float]:
    """Rays through the middles of ACROSS x DOWN parts of a camera's picture: origins (n, 3) float64 metres, from where
    the camera begins to see, and unit directions (n, 3) float32."""
    _, right_low, left_low, left_top = np.array(camera.data.view_frame(scene=scene), np.float64)
    x, y = ((np.arange(count) + 0.5) / count for count in (ACROSS, DOWN))
    frame = (left_low + (right_low - left_low) * x[:, None] + ((left_top - left_low) * y[:, None])[:, None])
    frame = frame.reshape(-1, 3)
    ahead = np.array([0.0, 0.0, -1.0])
    if camera.data.type == "ORTHO":
        ways, starts = np.broadcast_to(ahead, frame.shape), frame * [1, 1, 0]
    else:
        ways, starts = frame / -frame[:, 2:], np.zeros_like(frame)
    turn = camera.matrix_world.to_quaternion().to_matrix()
    matrix, place = np.array(turn, np.float64), np.array(camera.matrix_world.translation, np.float64)
    origins = (starts + ways * camera.data.clip_start) @ matrix.T + place
    directions = ways @ matrix.T
    return origins, np.asarray(directions / np.linalg.norm(directions, axis=1, keepdims=True), np.float32)

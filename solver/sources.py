"""Which emissive triangles are lamps (shadow rays end on them), and which are left to the gather."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .geometry import Geometry
from .lights import Light
from .mesh_emitter import group_emitters

Float = NDArray[np.floating[Any]]

# Triangles that emit more than this many times the scene's mean exitance are lamps. Below it, gather rays find them
# often enough, and a furnace, where everything emits alike, has no lamp at all.
LAMP_CONTRAST = 8.0


def light_sources(geometry: Geometry) -> tuple[tuple[Light, ...], NDArray[np.bool_]]:
    """The scene's lamps about its origin, emissive triangles among them, and a mask (t,) of those triangles."""
    scene = geometry.scene
    lamps = tuple(light.translated(-scene.origin) for light in scene.lights if np.any(light.colour))
    exitance = triangle_exitance(geometry)
    brightness = exitance.mean(axis=1)
    total_area = float(geometry.area.sum())
    if not brightness.any():
        return lamps, np.zeros(len(brightness), bool)
    mean = float((brightness * geometry.area).sum() / max(total_area, 1e-30))
    is_lamp = (brightness > LAMP_CONTRAST * mean) & (geometry.area > 0)
    corners = geometry.corners[is_lamp].astype(np.float64)
    return lamps + group_emitters(corners, exitance[is_lamp]), is_lamp


def triangle_exitance(geometry: Geometry) -> Float:
    """(t, 3) mean exitance of each triangle, W/m2; textures by their value at the middle."""
    count = len(geometry.area)
    third = np.full(count, 1 / 3, np.float32)
    return geometry.emission(np.arange(count), third, third)

"""How much of what a point sees is backs of faces: most of it, where the point lies inside a closed object."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .geometry import Geometry
from .scene import Scene

Float = NDArray[np.floating[Any]]

# Rays of a point, all around.
RAYS = 32
CHUNK_RAYS = 2**17


def sees_backs(scene: Scene, points: Float) -> Float:
    """The part (n,) float32 of the rays from points (n, 3) metres that meet the back of a face."""
    visibility = Geometry(scene).visibility
    directions = _all_around(RAYS)
    share = np.empty(len(points), np.float32)
    step = CHUNK_RAYS // RAYS
    for start in range(0, len(points), step):
        origins = np.asarray(points[start:start + step] - scene.origin, np.float32)
        hits = visibility.hits(np.repeat(origins, RAYS, axis=0), np.tile(directions, (len(origins), 1)))
        backs = (hits.triangle >= 0) & ~hits.front
        share[start:start + step] = backs.reshape(-1, RAYS).mean(axis=1)
    return share


def _all_around(count: int) -> Float:
    """(count, 3) float32 unit vectors evenly over the sphere, a Fibonacci lattice (Swinbank and Purser 2006)."""
    number = np.arange(count)
    height = 1 - (2 * number + 1) / count
    angle = np.pi * (3 - np.sqrt(5)) * number
    radius = np.sqrt(1 - height**2)
    return np.asarray(np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=1), np.float32)

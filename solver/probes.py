"""Receivers that are no lumels: points anywhere, and the middles of triangles."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .errors import SceneError
from .geometry import Geometry
from .receivers import Receivers
from .scene import Scene

Float = NDArray[np.floating[Any]]


def probes(scene: Scene, points: ArrayLike, normals: ArrayLike, surfaces: ArrayLike | None = None) -> Receivers:
    """Receivers at points (n, 3) metres that face along normals (n, 3), of any length above zero; as if they were of
    surfaces (n,) of the scene, -1 for none."""
    place, facing = (np.atleast_2d(np.asarray(each, np.float64)) if np.size(each) else np.zeros((0, 3))
                     for each in (points, normals))
    if place.shape != facing.shape or place.ndim != 2 or place.shape[1] != 3:
        raise SceneError(f"points {place.shape} and normals {facing.shape} must both be (n, 3)")
    length = np.linalg.norm(facing, axis=1, keepdims=True)
    if not (np.isfinite(place).all() and np.isfinite(facing).all() and (length > 0).all()):
        raise SceneError("a probe's point is not finite, or its normal has no length")
    owner = np.broadcast_to(np.asarray(-1 if surfaces is None else surfaces, np.int32), len(place))
    if len(owner) and not (-1 <= owner.min() and owner.max() < len(scene.surfaces)):
        raise SceneError(f"probes name surfaces {owner.min()} ... {owner.max()} of {len(scene.surfaces)}: -1 is none")
    return free_receivers(np.asarray(place - scene.origin, np.float32), np.asarray(facing / length, np.float32), owner)


def free_receivers(points: Float, normals: Float, surface: NDArray[np.int32]) -> Receivers:
    """Receivers at points (n, 3) about the scene's origin, facing along unit normals (n, 3), on no triangle; lit as the
    surfaces (n,) are."""
    count = len(points)
    return Receivers(points, normals, np.full(count, -1, np.int32), np.zeros((count, 2), np.float32),
                     np.zeros((count, 2, 2), np.float32), surface)


def triangle_middles(geometry: Geometry) -> Receivers:
    """One receiver in the middle of every triangle's front; its footprint is the whole triangle."""
    count = len(geometry.area)
    triangle = np.arange(count, dtype=np.int32)
    third = np.full(count, 1 / 3, np.float32)
    footprint = np.broadcast_to(np.eye(2, dtype=np.float32), (count, 2, 2)).copy()
    return Receivers(geometry.point(triangle, third, third), geometry.shading_normal(triangle, third, third), triangle,
                     np.stack([third, third], axis=1), footprint)

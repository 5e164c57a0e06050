"""Normals of triangles and of their corners."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .scene import Scene

Float = NDArray[np.floating[Any]]

# Shorter than any length that is not zero: vectors of none stay zero.
SHORTEST = 1e-300


def normals(positions: Float) -> Float:
    """(t, 3) normals of triangles (t, 3, 3), as long as twice the area."""
    return np.asarray(np.cross(positions[:, 1] - positions[:, 0], positions[:, 2] - positions[:, 0]))


def unit(vectors: Float) -> Float:
    """Vectors (n, 3) float64 of length 1; zero stays zero."""
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), SHORTEST))


def corner_normals(scene: Scene, triangle: NDArray[np.integer[Any]] | slice) -> Float:
    """(t, 3, 3) unit shading normals at the corners; a flat triangle's own where the scene has none."""
    if scene.corner_normals is not None:
        return np.asarray(scene.corner_normals[triangle])
    return np.repeat(unit(normals(scene.vertices[scene.triangles[triangle]]))[:, None], 3, axis=1)

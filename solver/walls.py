"""Whether a wall stands between two places of one surface: then they do not see the same light, near as they may be."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .visibility import Visibility

Float = NDArray[np.floating[Any]]

# Places are compared if they face alike to this cosine and lie in one plane to this sine; of curved surfaces the patch
# itself is as good a guide.
ALIKE_COSINE, LEVEL_SINE = 0.98, 0.1
# What is looked over, as parts of the patch's box: a wall stands higher than both, a skirting board or a leg's foot
# does not. Never higher than this part of the room in front.
HEIGHTS = (0.5, 0.05)
ROOM = 0.5


def walled(visibility: Visibility, points: Float, normals: Float, room: Float, others: Float, height: Float
           ) -> NDArray[np.bool_]:
    """Whether neither of the straight lines above the surface between pairs of places is free.

    Parameters
    ----------
    points, normals : (n, 3) places, and the way they face.
    room : (n,) free distance in front of both places of a pair, metres.
    others : (n, 3) what they are compared with, about in the same plane.
    height : (n,) the highest that a line may be, before HEIGHTS, metres.
    """
    blocked = np.ones(len(points), bool)
    for part in HEIGHTS:
        rows = np.flatnonzero(blocked)
        if not len(rows):
            break
        lift = normals[rows] * np.minimum(height[rows] * part, room[rows] * ROOM)[:, None]
        start, way = points[rows] + lift, others[rows] - points[rows]
        length = np.linalg.norm(way, axis=1)
        way /= np.maximum(length, 1e-30)[:, None]
        blocked[rows] = visibility.occluded(np.asarray(start, np.float32), np.asarray(way, np.float32),
                                            np.asarray(length, np.float32))
    return blocked


def comparable(points: Float, normals: Float, others: Float, other_normals: Float) -> NDArray[np.bool_]:
    """(n,) bool: pairs of places that face alike and lie about in one plane."""
    way = others - points
    length = np.linalg.norm(way, axis=1)
    level = np.abs(np.einsum("ij,ij->i", way, normals)) <= LEVEL_SINE * length
    return np.asarray((length > 0) & level & (np.einsum("ij,ij->i", normals, other_normals) > ALIKE_COSINE))

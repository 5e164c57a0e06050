"""Whether a polygon stands between two others: not at all, wholly, or in part (shaft culling, Haines and Wallace 1991).

If two convex polygons lie on opposite sides of an occluder's plane, every line between them meets that plane inside
the convex hull of where the lines between their corners meet it. So the corners alone decide.
"""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from .convex_pieces import plane_tolerance, unit_normal

Float = NDArray[np.floating[Any]]


def blocking(a: Float, b: Float, occluder: Float) -> Literal["none", "part", "all"]:
    """How much of the lines between two convex polygons a convex occluder cuts; "part" also if that isn't clear."""
    tolerance = plane_tolerance(a, b, occluder)
    normal = unit_normal(occluder)
    height_a, height_b = (_snapped((p - occluder[0]) @ normal, tolerance) for p in (a, b))
    heights = np.concatenate([height_a, height_b])
    if heights.min() >= 0 or heights.max() <= 0 or _apart(a, b, occluder):
        return "none"
    if not (height_a.min() > 0 > height_b.max() or height_b.min() > 0 > height_a.max()):
        return "part"
    fraction = height_a[:, None] / (height_a[:, None] - height_b)
    crossings = (a[:, None] + fraction[..., None] * (b - a[:, None])).reshape(-1, 3)
    inward = np.cross(normal, np.roll(occluder, -1, axis=0) - occluder)
    inward /= np.linalg.norm(inward, axis=1)[:, None]
    depth = _snapped(np.einsum("pek,ek->pe", crossings[:, None] - occluder, inward), tolerance)
    if (depth <= 0).all(axis=0).any():
        return "none"
    return "all" if (depth >= 0).all() else "part"


def _apart(a: Float, b: Float, occluder: Float) -> bool:
    """Whether the boxes around the occluder and around both polygons are apart."""
    both = np.concatenate([a, b])
    return bool((both.max(axis=0) <= occluder.min(axis=0)).any() or (both.min(axis=0) >= occluder.max(axis=0)).any())


def _snapped(height: Float, tolerance: float) -> Float:
    return np.where(np.abs(height) <= tolerance, 0, height)

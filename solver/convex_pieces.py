"""Any simple planar polygon as convex pieces, or a refusal that says what is wrong with it.

Convex polygons stay whole; others are cut into triangles by their ears (Meisters 1975).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .errors import SceneError

Float = NDArray[np.floating[Any]]

# All relative to the polygon's size. Corners from a float32 mesh lie off their plane by a few 1e-7.
PLANARITY = 1e-5
SAME_POINT = 1e-12
# Least area, relative to the square of the size: a needle of 1 : 10,000,000 is still a polygon.
LEAST_AREA = 1e-9
# A corner nearer to a plane than this part of the size of what is looked at lies in it; and as far off as this many
# rounding errors of the largest coordinate.
IN_PLANE = 1e-13
COORDINATE_ROUNDING = 32.0
# Sine of an angle that still counts as straight.
STRAIGHT = 1e-9


def convex_pieces(polygon: ArrayLike, name: str) -> list[Float]:
    """Cut a polygon into convex ones with the same front.

    Parameters
    ----------
    polygon : (n, 3) corners in order, metres; planar and simple (its outline doesn't cross itself).
    name : what messages call it.

    Returns
    -------
    float64 polygons (m, 3); just the polygon itself if it is convex.

    Raises
    ------
    SceneError
        If it has a wrong shape, a value that isn't finite, no area, repeated corners, a bend or a crossing outline.
    """
    corners = _checked(polygon, name)
    flat = _in_plane(corners)
    if _is_convex(flat):
        return [corners]
    if _crosses_itself(flat):
        raise SceneError(f"{name}: its outline crosses itself: give the corners in order, once around")
    return [corners[list(triangle)] for triangle in _ears(flat)]


def unit_normal(polygon: Float) -> Float:
    """(3,) unit normal of a polygon (n, 3) by the right-hand rule (Newell's area vector)."""
    fan = polygon[1:] - polygon[0]
    area = np.cross(fan[:-1], fan[1:]).sum(axis=0)
    return np.asarray(area / np.linalg.norm(area))


def plane_tolerance(*corners: Float) -> float:
    """Metres within which a corner lies in a plane: what is lost to rounding, in the geometry and in the coordinates.

    Surfaces that touch or coincide are common in scenes; far from the origin their corners differ by the coordinates'
    last digits, and would shadow one another.
    """
    largest = max(float(np.abs(c).max()) for c in corners)
    low, high = np.min([c.min(axis=0) for c in corners], axis=0), np.max([c.max(axis=0) for c in corners], axis=0)
    return IN_PLANE * float((high - low).max()) + COORDINATE_ROUNDING * float(np.finfo(np.float64).eps) * largest


def _checked(polygon: ArrayLike, name: str) -> Float:
    try:
        corners = np.array(polygon, np.float64)
    except (TypeError, ValueError):
        raise SceneError(f"{name} is not an array of numbers: give (n, 3) corners in metres") from None
    if corners.ndim != 2 or corners.shape[1] != 3 or len(corners) < 3:
        raise SceneError(f"{name} has shape {corners.shape}: give (n, 3) corners, n >= 3")
    if not np.isfinite(corners).all():
        row = int(np.flatnonzero(~np.isfinite(corners).all(axis=1))[0])
        raise SceneError(f"{name}: corner {row} is at {corners[row].tolist()}: every coordinate must be finite")
    edges = np.roll(corners, -1, axis=0) - corners
    size = float(np.ptp(corners, axis=0).max())
    short = np.flatnonzero(np.linalg.norm(edges, axis=1) <= SAME_POINT * size)
    if len(short):
        raise SceneError(f"{name}: corner {(int(short[0]) + 1) % len(corners)} repeats the one before it: leave it out")
    fan = corners[1:] - corners[0]
    area = np.linalg.norm(np.cross(fan[:-1], fan[1:]).sum(axis=0)) / 2
    if area <= LEAST_AREA * size**2:
        raise SceneError(f"{name} has no area: its corners lie on one line, or its outline crosses itself")
    bend = float(np.abs(fan @ unit_normal(corners)).max())
    if bend > PLANARITY * size:
        raise SceneError(f"{name} is not planar: a corner lies {bend:.3g} m off its plane; split it into triangles")
    return corners


def _in_plane(corners: Float) -> Float:
    """(n, 2) coordinates in which the outline runs counter-clockwise."""
    normal = unit_normal(corners)
    first = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
    first /= np.linalg.norm(first)
    return np.asarray((corners - corners[0]) @ np.stack([first, np.cross(normal, first)], axis=1))


def _cross2(a: Float, b: Float) -> Float:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def _is_convex(flat: Float) -> bool:
    """Only left turns, and once around (a pentagram turns left too, but twice)."""
    edges = np.roll(flat, -1, axis=0) - flat
    edges /= np.linalg.norm(edges, axis=1)[:, None]
    following = np.roll(edges, -1, axis=0)
    turn = np.arctan2(_cross2(edges, following), (edges * following).sum(axis=1))
    return bool((turn >= -STRAIGHT).all() and turn.sum() < 3 * np.pi)


def _crosses_itself(flat: Float) -> bool:
    n = len(flat)
    i, j = np.triu_indices(n, 2)
    apart = (j + 1) % n != i
    i, j = i[apart], j[apart]
    p, q, r, s = flat[i], flat[(i + 1) % n], flat[j], flat[(j + 1) % n]
    side = [_cross2(q - p, r - p), _cross2(q - p, s - p), _cross2(s - r, p - r), _cross2(s - r, q - r)]
    return bool(((side[0] * side[1] < 0) & (side[2] * side[3] < 0)).any())


def _ears(flat: Float) -> list[tuple[int, int, int]]:
    left = list(range(len(flat)))
    triangles = []
    while len(left) > 3:
        place = next((k for k in range(len(left)) if _is_ear(flat, left, k)), None)
        if place is None:  # only straight corners are left: they cut off nothing
            break
        around = (left[place - 1], left[place], left[(place + 1) % len(left)])
        triangles.append(around)
        del left[place]
    if _cross2(flat[left[1]] - flat[left[0]], flat[left[2]] - flat[left[0]]) > 0:
        triangles.append((left[0], left[1], left[2]))
    return triangles


def _is_ear(flat: Float, left: list[int], k: int) -> bool:
    """Whether the corner's triangle turns left and holds no other corner."""
    around = [left[k - 1], left[k], left[(k + 1) % len(left)]]
    a, b, c = flat[around]
    if _cross2(b - a, c - b) <= STRAIGHT * np.linalg.norm(b - a) * np.linalg.norm(c - b):
        return False
    others = flat[[v for v in left if v not in around]]
    others = others[~(others[:, None] == flat[around]).all(axis=2).any(axis=1)]
    inside = (_cross2(b - a, others - a) >= 0) & (_cross2(c - b, others - b) >= 0) & (_cross2(a - c, others - c) >= 0)
    return not inside.any()

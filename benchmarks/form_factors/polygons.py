"""What the classical methods share: polygons cut into small patches, and rays against polygons."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from radiosity.solver.convex_pieces import convex_pieces, unit_normal

Float = NDArray[np.floating[Any]]


@dataclass(frozen=True, eq=False)
class Patches:
    """Small patches of one polygon: centres (n, 3), areas (n,), the polygon's unit normal (3,)."""

    centre: Float
    area: Float
    normal: Float


def patches(polygon: Float, side: int) -> Patches:
    """A quadrilateral as side x side patches; any other polygon as its fan of triangles, side^2 patches each."""
    u = (np.arange(side) + 0.5) / side
    s, t = (grid.ravel()[:, None] for grid in np.meshgrid(u, u))
    normal = unit_normal(polygon)
    if len(polygon) == 4:
        p0, p1, p2, p3 = polygon
        centre = (1 - s) * (1 - t) * p0 + s * (1 - t) * p1 + s * t * p2 + (1 - s) * t * p3
        along = (1 - t) * (p1 - p0) + t * (p2 - p3)
        across = (1 - s) * (p3 - p0) + s * (p2 - p1)
        return Patches(centre, np.cross(along, across) @ normal / side**2, normal)
    first, second = polygon[1:-1] - polygon[0], polygon[2:] - polygon[0]
    centre = np.concatenate([polygon[0] + s * (p + t * (q - p)) for p, q in zip(first, second, strict=True)])
    areas = np.cross(first, second) @ normal
    return Patches(centre, (areas[:, None] * s[:, 0] / side**2).ravel(), normal)


def kernel(a: Patches, b: Patches) -> tuple[Float, Float]:
    """cos cos' and r^2 between all centres, (n, m) each; negative cosines count as zero."""
    d = b.centre - a.centre[:, None]
    distance2 = (d**2).sum(axis=2)
    cosines = np.maximum(d @ a.normal, 0) * np.maximum(-(d @ b.normal), 0) / distance2
    return cosines, distance2


def blocked(start: Float, end: Float, occluders: Sequence[Float]) -> NDArray[np.bool_]:
    """Whether an occluder cuts the lines from start (..., 3) to end (..., 3)."""
    start, end = np.broadcast_arrays(start, end)
    hidden = np.zeros(start.shape[:-1], bool)
    for occluder in occluders:
        for piece in convex_pieces(occluder, "occluder"):
            fraction = hit(start, end - start, piece)
            hidden |= (fraction > 0) & (fraction < 1)
    return hidden


def hit(origin: Float, direction: Float, convex: Float) -> Float:
    """Where rays meet a convex polygon, in lengths of `direction`; inf where they miss it."""
    normal = unit_normal(convex)
    with np.errstate(divide="ignore", invalid="ignore"):
        fraction = (convex[0] - origin) @ normal / (direction @ normal)
        place = origin + np.where(np.isfinite(fraction), fraction, 0)[..., None] * direction
    inward = np.cross(normal, np.roll(convex, -1, axis=0) - convex)
    inside = np.ones(fraction.shape, bool)
    for corner, side in zip(convex, inward, strict=True):
        inside &= (place - corner) @ side >= 0
    return np.where(inside & np.isfinite(fraction), fraction, np.inf)


def rays_that_arrive(origin: Float, direction: Float, target: Float, occluders: Sequence[Float]) -> NDArray[np.bool_]:
    """Whether rays meet the target's front before any occluder."""
    distance = np.full(origin.shape[0], np.inf)
    for piece in convex_pieces(target, "target"):
        t = hit(origin, direction, piece)
        distance = np.where((t > 0) & (t < distance) & (direction @ unit_normal(target) < 0), t, distance)
    reached = np.isfinite(distance)
    end = origin + np.where(reached, distance, 0)[:, None] * direction
    return np.asarray(reached & ~blocked(origin, end, occluders))


def frame(normal: Float) -> Float:
    """(3, 3): rows tangent, tangent, normal."""
    tangent = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
    tangent /= np.linalg.norm(tangent)
    return np.stack([tangent, np.cross(normal, tangent), normal])


def rays_from(polygon: Float, square: Float) -> tuple[Float, Float]:
    """Origins spread evenly over a convex polygon and directions by the cosine (Malley), from (n, 4) in [0, 1)."""
    fan = np.cross(polygon[1:-1] - polygon[0], polygon[2:] - polygon[0])
    share = np.cumsum(np.linalg.norm(fan, axis=1))
    place = square[:, 0] * share[-1]
    triangle = np.minimum(np.searchsorted(share, place, side="right"), len(share) - 1)
    below = np.concatenate([[0], share])[triangle]
    u = np.sqrt((place - below) / (share[triangle] - below))[:, None]
    v = square[:, 1:2]
    first, second = polygon[1 + triangle] - polygon[0], polygon[2 + triangle] - polygon[0]
    radius, angle = np.sqrt(square[:, 2]), 2 * np.pi * square[:, 3]
    local = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.sqrt(1 - square[:, 2])], axis=1)
    return polygon[0] + u * (first + v * (second - first)), local @ frame(unit_normal(polygon))

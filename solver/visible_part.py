"""What differential elements see of a polygon past polygons in the way: exact, as convex pieces.

From a point, an occluding convex polygon darkens the cone over it. Cutting the target along the planes through the
point and the occluder's edges leaves convex pieces outside of the cone (the view-dependent half of Nishita and
Nakamae 1985), and Lambert's closed form of the pieces adds up to the exact form factor: no ray, no noise.

All points are cut at once: pieces are padded to the same number of corners by repeating the last one, which Lambert's
sum doesn't notice, and each remembers the point that it belongs to. The last occluder needs no cutting: what it hides
of a convex piece is bounded by the piece's edges inside of its cone and by its own edges inside of the piece's cone,
and Lambert's sum doesn't ask in which order edges come.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .convex_pieces import plane_tolerance, unit_normal
from .polygon import lambert_sum, paired_form_factor

Float = NDArray[np.floating[Any]]

# A corner nearer than this to a cutting plane through a point, relative to the size of the piece, lies in it.
ON_PLANE = 1e-13
# Corners times planes worked on at once: 8 bytes each, half a dozen arrays of them.
HEIGHTS_AT_ONCE = 2**19


@dataclass(frozen=True)
class _Pieces:
    """Convex polygons seen from their points: corners (k, m, 3) relative to the point, padded; owner (k,) the point."""

    corners: Float
    owner: NDArray[np.intp]

    def take(self, index: NDArray[Any]) -> _Pieces:
        return _Pieces(self.corners[index], self.owner[index])


def visible_form_factor(points: Float, normals: Float, polygon: Float, occluders: Sequence[Float]) -> Float:
    """Form factors (n,) of elements to the part of one convex polygon that they see past convex occluders.

    Parameters
    ----------
    points, normals : (n, 3) float64, metres.
    polygon : (m, 3) float64, planar, convex; it faces where its corners turn counter-clockwise.
    occluders : (m_k, 3) each, planar and convex, blocking from both sides.
    """
    pieces = _Pieces(polygon[None] - points[:, None], np.arange(len(points)))
    pieces = pieces.take(np.flatnonzero(_plane_distance(pieces.corners) < 0))
    above, index = _clip(pieces.corners, np.einsum("kmi,ki->km", pieces.corners, normals[pieces.owner]))
    pieces = _Pieces(above, pieces.owner[index])
    tolerance = plane_tolerance(points, polygon, *occluders)
    target = _Target(points, polygon[0], unit_normal(polygon), tolerance)
    ordered = sorted(occluders, key=len)  # the one with the most corners last: it isn't cut with
    for occluder in ordered[:-1]:
        pieces = _without(pieces, target, occluder)
    values = paired_form_factor(np.zeros((len(pieces.owner), 3)), normals[pieces.owner], pieces.corners)
    for occluder in ordered[-1:]:
        values = np.maximum(values - _hidden(pieces, target, occluder, normals), 0)
    return np.asarray(np.bincount(pieces.owner, values, len(points)), np.float64)


@dataclass(frozen=True)
class _Target:
    """Whence and whereto: points (n, 3); a corner and the normal of the polygon that they look at; and within how many
    metres something lies in a plane."""

    points: Float
    corner: Float
    normal: Float
    tolerance: float


def _cone(pieces: _Pieces, target: _Target, occluder: Float) -> tuple[Float, NDArray[np.bool_]]:
    """The occluder as each piece's point sees it, turned so that the planes over its edges lean inwards.

    Returns corners (k, e, 3) relative to the points, of the part on this side of the target, e = 0 if there is none;
    and whether it hides anything at all (k,), which it doesn't if seen edge-on.
    """
    height = (occluder - target.corner) @ target.normal
    height[np.abs(height) <= target.tolerance] = 0
    nearer = _clip(occluder[None], height[None])[0]
    if not len(nearer):
        return np.empty((len(pieces.owner), 0, 3)), np.zeros(len(pieces.owner), bool)
    seen = nearer[0] - target.points[pieces.owner][:, None]
    distance = _plane_distance(seen)
    seen[distance < 0] = seen[distance < 0][:, ::-1]
    return seen, np.abs(distance) > target.tolerance


def _without(pieces: _Pieces, target: _Target, occluder: Float) -> _Pieces:
    """The pieces outside of the cone over the occluder."""
    seen, blocking = _cone(pieces, target, occluder)
    remaining, shadowed = [pieces.take(np.flatnonzero(~blocking))], pieces.take(np.flatnonzero(blocking))
    planes = np.cross(seen, np.roll(seen, -1, axis=1))[blocking]
    whole, cut = shadowed, []
    origin = np.arange(len(shadowed.owner))
    for edge in range(planes.shape[1]):
        height = np.einsum("kmi,ki->km", shadowed.corners, planes[origin, edge])
        outside, index = _clip(shadowed.corners, -height)
        cut.append((_Pieces(outside, shadowed.owner[index]), origin[index]))
        inside, index = _clip(shadowed.corners, height)
        shadowed, origin = _Pieces(inside, shadowed.owner[index]), origin[index]
    touched = np.zeros(len(whole.owner), bool)
    touched[origin] = True  # the others never enter the cone: they stay in one piece
    remaining.append(whole.take(np.flatnonzero(~touched)))
    remaining += [piece.take(np.flatnonzero(touched[source])) for piece, source in cut]
    return _joined(remaining)


def _hidden(pieces: _Pieces, target: _Target, occluder: Float, normals: Float) -> Float:
    """Form factors (k,) of the parts of the pieces inside of the cone over the occluder."""
    hidden = np.zeros(len(pieces.owner))
    if not len(hidden):
        return hidden
    at_once = max(1, HEIGHTS_AT_ONCE // (pieces.corners.shape[1] * len(occluder)))
    for start in range(0, len(hidden), at_once):
        some = pieces.take(np.arange(start, min(start + at_once, len(hidden))))
        seen, blocking = _cone(some, target, occluder)
        if not blocking.any():
            continue
        some, seen = some.take(np.flatnonzero(blocking)), seen[blocking]
        piece, shadow, up = _columns(some.corners), _columns(seen), np.ascontiguousarray(normals[some.owner].T)
        over_piece, over_shadow = -_planes(piece), _planes(shadow)
        # An edge of both counts once, with the piece's; the shadow's edges run the other way around.
        part = _sum_inside(piece, over_piece, over_shadow, up, True)
        part -= _sum_inside(shadow, over_shadow, over_piece, up, False)
        hidden[start : start + at_once][blocking] = part
    return hidden


def _sum_inside(corners: Float, own: Float, planes: Float, normals: Float, with_boundary: bool) -> Float:
    """Lambert's sum (k,) over the parts of the edges of polygons inside of cones (Cyrus and Beck 1978).

    corners (3, m, k) and the planes over their edges, `own`; the cones' `planes` (3, e, k), leaning inwards; normals
    (3, k). An edge that lies in one of the planes counts if `with_boundary`, and both lie on the same side of it.
    """
    height = _dots(corners, planes)
    size = np.sqrt(_dots(corners, corners, same=True))[:, None] * np.sqrt(_dots(planes, planes, same=True))
    height[np.abs(height) <= ON_PLANE * size] = 0
    height_end = np.roll(height, -1, axis=0)
    outside = (np.minimum(height, height_end) < 0) & (np.maximum(height, height_end) <= 0)
    on_boundary = (height == 0) & (height_end == 0) & (size > 0)
    outside |= (on_boundary & (_dots(own, planes) <= 0)) if with_boundary else on_boundary
    crosses = height * height_end < 0
    fraction = height / np.where(crosses, height - height_end, 1)
    first = np.where(crosses & (height < 0), fraction, 0).max(axis=1)
    last = np.where(crosses & (height > 0), fraction, 1).min(axis=1)
    kept = ~outside.any(axis=1) & (last > first)
    edges = (np.roll(corners, -1, axis=1) - corners) * kept
    return lambert_sum(corners + first * edges, corners + last * edges, (last - first) * edges, normals)


def _columns(corners: Float) -> Float:
    """(k, m, 3) as (3, m, k): sums over a few corners then run along long rows."""
    return np.ascontiguousarray(corners.transpose(2, 1, 0))


def _planes(corners: Float) -> Float:
    """Normals (3, m, k) of the planes through the point and each edge."""
    return np.cross(corners, np.roll(corners, -1, axis=1), axis=0)


def _dots(a: Float, b: Float, same: bool = False) -> Float:
    """(m, e, k) products of all of a (3, m, k) with all of b (3, e, k); (m, k) of each with the same one of b."""
    if same:
        return np.asarray(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])
    return np.asarray(a[0, :, None] * b[0] + a[1, :, None] * b[1] + a[2, :, None] * b[2])


def _clip(corners: Float, height: Float) -> tuple[Float, NDArray[np.intp]]:
    """Convex polygons (k, m, 3) cut to where `height` (k, m) of their corners is >= 0 (Sutherland, Hodgman 1974).

    Returns the polygons with something left, padded, and their indices.
    """
    if not len(corners):
        return corners, np.empty(0, np.intp)
    size = np.abs(height).max(axis=1, keepdims=True)
    height = np.where(np.abs(height) <= ON_PLANE * size, 0, height)
    index = np.flatnonzero((height > 0).any(axis=1))
    corners, height = corners[index], height[index]
    if not (height < 0).any():
        return corners, index
    count = len(height)
    end, height_end = np.roll(corners, -1, axis=1), np.roll(height, -1, axis=1)
    crosses = height * height_end < 0
    with np.errstate(divide="ignore", invalid="ignore"):
        fraction = np.where(crosses, height / (height - height_end), 0)
    candidates = np.stack([corners, corners + fraction[..., None] * (end - corners)], axis=2).reshape(count, -1, 3)
    kept = np.stack([height >= 0, crosses], axis=2).reshape(count, -1)
    place = np.cumsum(kept, axis=1) - 1
    total = place[:, -1] + 1
    order = np.argsort(~kept, axis=1, kind="stable")[:, : total.max()]
    order = np.where(np.arange(order.shape[1]) < total[:, None], order, order[np.arange(count), total - 1][:, None])
    return np.take_along_axis(candidates, order[..., None], axis=1), index


def _joined(parts: list[_Pieces]) -> _Pieces:
    width = max(part.corners.shape[1] for part in parts)
    padded = [np.pad(part.corners, ((0, 0), (0, width - part.corners.shape[1]), (0, 0)), mode="edge")
              for part in parts if len(part.owner)]
    if not padded:
        return parts[0].take(np.empty(0, np.intp))
    return _Pieces(np.concatenate(padded), np.concatenate([part.owner for part in parts]))


def _plane_distance(seen: Float) -> Float:
    """Height (k,) of the planes of polygons (k, m, 3) above their points: negative if the front is seen."""
    fan = seen[:, 1:] - seen[:, :1]
    area = np.cross(fan[:, :-1], fan[:, 1:]).sum(axis=1)
    length = np.maximum(np.linalg.norm(area, axis=1), np.finfo(np.float64).tiny)
    return np.asarray((area * seen[:, 0]).sum(axis=1) / length)

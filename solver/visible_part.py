"""What differential elements see of a polygon past polygons in the way: exact, as convex pieces.

From a point, an occluding convex polygon darkens the cone over it. Cutting the target along the planes through the
point and the occluder's edges leaves convex pieces outside of the cone (the view-dependent half of Nishita and
Nakamae 1985), and Lambert's closed form of the pieces adds up to the exact form factor: no ray, no noise.

All points are cut at once: pieces are padded to the same number of corners by repeating the last one, which Lambert's
sum doesn't notice, and each remembers the point that it belongs to.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .convex_pieces import unit_normal
from .polygon import paired_form_factor

Float = NDArray[np.floating[Any]]

# A corner nearer than this to a cutting plane, relative to the size of the piece, lies in it.
ON_PLANE = 1e-13
# A polygon seen edge-on this closely (distance of its plane over its distance) blocks nothing.
EDGE_ON = 1e-12


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
    target = unit_normal(polygon)
    for occluder in occluders:
        pieces = _without(pieces, points, occluder, polygon[0], target)
    values = paired_form_factor(np.zeros((len(pieces.owner), 3)), normals[pieces.owner], pieces.corners)
    return np.asarray(np.bincount(pieces.owner, values, len(points)), np.float64)


def _without(pieces: _Pieces, points: Float, occluder: Float, on_target: Float, target: Float) -> _Pieces:
    """The pieces outside of the cone over the part of the occluder that is on the points' side of the target."""
    height = (occluder - on_target) @ target
    height[np.abs(height) <= ON_PLANE * (np.abs(occluder - on_target).max() + np.abs(points - on_target).max())] = 0
    nearer = _clip(occluder[None], height[None])[0]
    if not len(nearer):
        return pieces
    seen = nearer[0] - points[pieces.owner][:, None]
    distance = _plane_distance(seen)
    seen[distance < 0] = seen[distance < 0][:, ::-1]  # now every plane's normal leans into the cone
    blocking = np.abs(distance) > EDGE_ON * np.abs(seen).max(axis=(1, 2))
    planes = np.cross(seen, np.roll(seen, -1, axis=1))
    planes[~blocking] = 0
    remaining, shadowed = [pieces.take(np.flatnonzero(~blocking))], pieces.take(np.flatnonzero(blocking))
    planes = planes[blocking]
    whole, cut = shadowed, []
    origin = np.arange(len(shadowed.owner))
    for edge in range(planes.shape[1]):
        normal = planes[origin, edge]
        height = np.einsum("kmi,ki->km", shadowed.corners, normal)
        outside, index = _clip(shadowed.corners, -height)
        cut.append((_Pieces(outside, shadowed.owner[index]), origin[index]))
        inside, index = _clip(shadowed.corners, height)
        shadowed, origin = _Pieces(inside, shadowed.owner[index]), origin[index]
    touched = np.zeros(len(whole.owner), bool)
    touched[origin] = True  # the others never enter the cone: they stay in one piece
    remaining.append(whole.take(np.flatnonzero(~touched)))
    remaining += [piece.take(np.flatnonzero(touched[source])) for piece, source in cut]
    return _joined(remaining)


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

"""Form factor of a differential element to a planar convex polygon, in closed form and clipped at the horizon.

Lambert's formula (Photometria, 1760; Baum, Rushmeier and Winget 1989) for a polygon with corners a_i as seen from
the element, counter-clockwise seen from its front, and an element with normal n:

    F = - 1/(2 pi)  sum_i  theta_i  n . (a_i x a_i+1) / |a_i x a_i+1|        theta_i the angle from a_i to a_i+1

Where we leave the textbook:

1. theta is atan2(|a x b|, a . b): the arc cosine loses half of the digits on small angles.
2. The polygon is clipped at the element's horizon edge by edge. The one edge that clipping adds lies in the horizon
   itself, where the summand is plus or minus theta, so no list of corners is ever rebuilt.
3. a x b is taken as a x (b - a): the edge is known exactly, the difference of two long products is not.
4. Far away the sum cancels (its digits go as distance / size), and Gauss points on the area take over.
5. On the boundary the value is the limit from straight in front of the polygon: a point in its plane gets 0 outside
   of it, and up to 1 inside; a point on an edge gets what the points just before that edge get.

F is positive on the side that the polygon faces (outward by the right-hand rule) and negative behind it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.floating[Any]]
Sides = Literal["front", "both", "signed"]

# Pairs (point, polygon) worked on at once: the dozen temporary arrays of a chunk then stay in a core's cache.
CHUNK = 8192
# Heights and distances below this many rounding errors of the pair's own size count as zero.
ROUNDING = 8.0
# Gauss points take over from Lambert's sum beyond this many polygon radii, by the bytes of the float. Both sides of
# the switch are then good to a few (4 bytes) or a few hundred (8 bytes) rounding errors.
FAR_RADII = {4: 16.0, 8: 200.0}

# Radon's 7 points on a triangle, exact to degree 5 (Radon 1948; Stroud 1971, T2:5-1): barycentrics and weights.
_ROOT15 = np.sqrt(15.0)
_RADON_INNER, _RADON_OUTER = (6 - _ROOT15) / 21, (6 + _ROOT15) / 21
_RADON_POINTS = np.array(
    [[1 / 3, 1 / 3, 1 / 3]]
    + [np.roll([1 - 2 * s, s, s], i).tolist() for s in (_RADON_INNER, _RADON_OUTER) for i in range(3)]
)
_RADON_WEIGHTS = np.array([9 / 40] + [(155 - _ROOT15) / 1200] * 3 + [(155 + _ROOT15) / 1200] * 3)


def polygon_form_factor(points: Float, normals: Float, polygon: Float, sides: Sides = "front") -> Float:
    """Form factors of differential elements to one planar convex polygon, without occluders.

    Parameters
    ----------
    points : (n, 3) float32 or float64, metres.
    normals : (n, 3) unit normals.
    polygon : (m, 3) corners, metres, m >= 3, convex; it faces where its corners turn counter-clockwise.
    sides : "front" is zero behind the polygon, "both" is positive on either side, "signed" negative behind it.

    Returns
    -------
    (n,) of the points' dtype, in [0, 1] ([-1, 1] if signed).
    """
    shapes = Shapes.of(np.asarray(polygon)[None], _float_type(points))
    points, normals = _columns(points, shapes), _columns(normals, shapes)
    result = np.empty(points.shape[1], points.dtype)
    for part in _chunks(len(result), CHUNK):
        result[part] = _form_factor(points[:, part], normals[:, part], shapes, sides)
    return result


def paired_form_factor(points: Float, normals: Float, polygons: Float) -> Float:
    """As `polygon_form_factor`, each point with a polygon of its own: polygons (n, m, 3) -> (n,)."""
    shapes = Shapes.of(np.asarray(polygons), _float_type(points))
    points, normals = _columns(points, shapes), _columns(normals, shapes)
    result = np.empty(points.shape[1], points.dtype)
    for part in _chunks(len(result), CHUNK):
        pairs = shapes.take(np.arange(part.start, part.stop))
        result[part] = _form_factor(points[:, part], normals[:, part], pairs, "front")
    return result


def indexed_form_factor(points: Float, normals: Float, shapes: Shapes, index: NDArray[Any],
                        sides: Sides = "front") -> Float:
    """As `paired_form_factor`, each point with one of some polygons that were made ready before: index (n,) -> (n,)."""
    points, normals = _columns(points, shapes), _columns(normals, shapes)
    result = np.empty(points.shape[1], points.dtype)
    for part in _chunks(len(result), CHUNK):
        result[part] = _form_factor(points[:, part], normals[:, part], shapes.take(index[part]), sides)
    return result


def polygons_form_factor(
    points: Float, normals: Float, polygons: Float, weights: Float | None = None, sides: Sides = "front"
) -> Float:
    """Form factors of elements to many polygons, summed over the polygons.

    Parameters
    ----------
    points, normals : (n, 3).
    polygons : (k, m, 3), each planar and convex, metres.
    weights : (k, c), what each polygon counts for in each of c channels (its radiosity, say); None counts all once.
    sides : see `polygon_form_factor`.

    Returns
    -------
    (n,), or (n, c) with weights.
    """
    shapes = Shapes.of(np.asarray(polygons), _float_type(points))
    points, normals = _columns(points, shapes), _columns(normals, shapes)
    count, k = points.shape[1], shapes.normal.shape[1]
    factors = np.ones((k, 1), points.dtype) if weights is None else np.asarray(weights, points.dtype)
    result = np.zeros((count, factors.shape[1]), points.dtype)
    polygons_at_once = max(1, CHUNK // max(count, 1))
    for part in _chunks(count, CHUNK):
        width = part.stop - part.start
        for some in _chunks(k, polygons_at_once):
            polygon_of_pair = np.repeat(np.arange(some.start, some.stop), width)
            pairs = shapes.take(polygon_of_pair) if k > 1 else shapes
            repeat = (1, some.stop - some.start)
            value = _form_factor(np.tile(points[:, part], repeat), np.tile(normals[:, part], repeat), pairs, sides)
            result[part] += value.reshape(-1, width).T @ factors[some]
    return result if weights is not None else result[:, 0]


@dataclass(frozen=True)
class Shapes:
    """Polygons as columns, with what can be known of them before any point: corners (3, m, k), edges (3, m, k),
    unit normal (3, k), centre (3, k), radius (k,), areas (m - 2, k) of the fan of triangles around corner 0."""

    corners: Float
    edges: Float
    normal: Float
    centre: Float
    radius: Float
    areas: Float

    @classmethod
    def of(cls, polygons: Float, dtype: Any) -> Shapes:
        """Of (k, m, 3) polygons; computed in float64, kept in `dtype`."""
        corners = np.ascontiguousarray(np.moveaxis(np.asarray(polygons, np.float64), 0, 2).swapaxes(0, 1))
        edges = np.roll(corners, -1, axis=1) - corners
        fan = corners[:, 1:] - corners[:, :1]
        crosses = np.cross(fan[:, :-1], fan[:, 1:], axis=0) / 2
        area = crosses.sum(axis=1)
        normal = area / np.maximum(np.sqrt((area**2).sum(axis=0)), np.finfo(np.float64).tiny)
        centre = corners.mean(axis=1)
        radius = np.sqrt(((corners - centre[:, None]) ** 2).sum(axis=0).max(axis=0))
        areas = (crosses * normal[:, None]).sum(axis=0)
        return cls(*(array.astype(dtype) for array in (corners, edges, normal, centre, radius, areas)))

    def take(self, index: NDArray[Any]) -> Shapes:
        """One polygon for each pair; a lone polygon stays as it is and broadcasts."""
        if self.normal.shape[1] == 1:
            return self
        return Shapes(*(np.take(array, index, axis=-1) for array in (
            self.corners, self.edges, self.normal, self.centre, self.radius, self.areas)))


def _form_factor(points: Float, normals: Float, shapes: Shapes, sides: Sides) -> Float:
    """Form factors (n,) of the elements (3, n) to their polygons: each by the cheapest method that is exact for it."""
    seen = shapes.corners - points[:, None]
    height = _dot(seen, normals[:, None])
    middle = shapes.centre - points
    distance = np.sqrt(_dot(middle, middle))
    tolerance = ROUNDING * np.finfo(points.dtype).eps * (distance + shapes.radius)
    highest, lowest = height.max(axis=0), height.min(axis=0)
    above, crossing = lowest >= -tolerance, lowest < -tolerance
    # A point in the polygon's plane that looks straight at it has all corners in its horizon.
    visible = (highest > tolerance) | (above & (_dot(normals, shapes.normal) < 0))
    if sides == "front":
        visible &= _dot(middle, shapes.normal) <= tolerance
    far = above & visible & (distance > FAR_RADII[points.dtype.itemsize] * shapes.radius)
    whole, cut = above & visible & ~far, crossing & visible
    result = np.zeros(points.shape[1], points.dtype)
    if whole.all():  # the usual case, without copies
        return _sided(_lambert(seen, normals, shapes, tolerance), sides)
    for chosen, method in ((far, _area_rule), (whole, _lambert), (cut, _clipped_lambert)):
        index = np.flatnonzero(chosen)
        if len(index):
            result[index] = method(np.take(seen, index, axis=-1), np.take(normals, index, axis=-1), shapes.take(index),
                                   tolerance[index])
    return _sided(result, sides)


def _lambert(seen: Float, normals: Float, shapes: Shapes, tolerance: Float) -> Float:
    """Lambert's sum over the edges of polygons that lie above the horizon."""
    seen = _before_the_edge(seen, shapes, tolerance)
    return lambert_sum(seen, np.roll(seen, -1, axis=1), shapes.edges, normals)


def _clipped_lambert(seen: Float, normals: Float, shapes: Shapes, tolerance: Float) -> Float:
    """Lambert's sum over the part of each polygon that lies above the horizon."""
    seen = _before_the_edge(seen, shapes, tolerance)
    front = -_dot(seen[:, 0], shapes.normal) >= -tolerance
    height = _dot(seen, normals[:, None])
    height[np.abs(height) <= tolerance] = 0
    height_end, end = np.roll(height, -1, axis=0), np.roll(seen, -1, axis=1)
    leaves, enters = (height >= 0) & (height_end < 0), (height < 0) & (height_end >= 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        fraction = height / (height - height_end)
    crossing = seen + np.where(leaves | enters, fraction, 0) * shapes.edges
    start = np.where(enters, crossing, seen)
    end = np.where(leaves, crossing, end)
    below = (height < 0) & (height_end < 0)
    edges = np.where(below, 0, end - start)
    exit_, entry = (crossing * leaves).sum(axis=1), (crossing * enters).sum(axis=1)
    along_horizon = np.arctan2(_length(_cross(exit_, entry)), _dot(exit_, entry)) / (2 * np.pi)
    return np.asarray(lambert_sum(start, end, edges, normals) + np.where(front, along_horizon, -along_horizon))


def lambert_sum(start: Float, end: Float, edges: Float, normals: Float) -> Float:
    """-1/(2 pi) sum of theta n . (a x b) / |a x b| over the edges (3, m, n); an edge seen end-on adds nothing."""
    cross = _cross(start, edges)
    length = _length(cross)
    angle = np.arctan2(length, _dot(start, end))
    upward = _dot(cross, normals[:, None])
    return np.asarray(-(angle * upward / np.maximum(length, np.finfo(length.dtype).tiny)).sum(axis=0) / (2 * np.pi))


def _before_the_edge(seen: Float, shapes: Shapes, tolerance: Float) -> Float:
    """The same corners; from a point that lies on an edge, as seen from a hair's breadth in front of the polygon.

    The hair is the square root of the rounding error: the value's error and the direction's are then alike.
    """
    # Points that lie well off the polygon's plane lie on no edge.
    near = np.abs(_dot(seen[:, 0], shapes.normal)) <= 2 * tolerance
    if not near.any():
        return seen
    along = -_dot(seen, shapes.edges)
    squared = _dot(shapes.edges, shapes.edges)
    nearest = np.clip(along / np.maximum(squared, np.finfo(seen.dtype).tiny), 0, 1)
    gap = seen + nearest * shapes.edges
    touching = (_dot(gap, gap) <= tolerance**2).any(axis=0)
    if not touching.any():
        return seen
    hair = np.sqrt(np.finfo(seen.dtype).eps) * shapes.radius * touching
    return np.asarray(seen - (hair * shapes.normal)[:, None])


def _area_rule(seen: Float, normals: Float, shapes: Shapes, tolerance: Float) -> Float:
    """Gauss points on the fan of triangles, for polygons that are small as seen from the points.

    cos cos' dA / (pi r^2), where r cos' is the distance from the polygon's plane: the same for all of its points.
    """
    total = np.zeros(seen.shape[2], seen.dtype)
    for triangle in range(seen.shape[1] - 2):
        corners = seen[:, [0, triangle + 1, triangle + 2]]
        part = np.zeros_like(total)
        for weights, weight in zip(_RADON_POINTS.astype(seen.dtype), _RADON_WEIGHTS.astype(seen.dtype), strict=True):
            node = weights[0] * corners[:, 0] + weights[1] * corners[:, 1] + weights[2] * corners[:, 2]
            part += weight * _dot(node, normals) / _dot(node, node) ** 2
        total += part * shapes.areas[triangle]
    return np.asarray(-_dot(seen.mean(axis=1), shapes.normal) * total / np.pi)


def _sided(signed: Float, sides: Sides) -> Float:
    if sides == "signed":
        return signed
    return np.asarray(np.abs(signed) if sides == "both" else np.maximum(signed, 0))


def _float_type(points: Float) -> Any:
    dtype = np.asarray(points).dtype
    return dtype if dtype in (np.float32, np.float64) else np.dtype(np.float64)


def _columns(rows: Float, shapes: Shapes) -> Float:
    return np.ascontiguousarray(np.asarray(rows, shapes.normal.dtype).T)


def _chunks(count: int, size: int) -> Iterator[slice]:
    return (slice(start, min(start + size, count)) for start in range(0, count, size))


def _dot(a: Float, b: Float) -> Float:
    return np.asarray(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])


def _cross(a: Float, b: Float) -> Float:
    return np.stack([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def _length(a: Float) -> Float:
    return np.asarray(np.sqrt(_dot(a, a)))

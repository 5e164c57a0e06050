"""Form factor of one planar convex polygon to another, without occluders, to ten digits and more.

Stokes' theorem twice turns the area integrals into contour integrals (Sparrow 1963), of which the inner is known:

    A_a F_ab = 1/(2 pi)  sum_i sum_j  e_i . e_j  int_i int_j ln r dt ds

    int ln r dt over an edge = [ u ln r + p atan(u / p) ],   u along the edge, p away from its line
                                                             (the "- u" of ln's integral cancels around a polygon)

(Mitalas and Stephenson 1966 integrate the outer one with plain nodes: that loses all digits but three where polygons
touch at 179 degrees, and F is infinite with ln r at nodes on both.) Here the outer integral is cut where the inner
one is nearly singular, which is known: opposite the ends of edge j and where the two lines pass each other; each
piece gets double-exponential nodes (Takahasi and Mori 1974), which crowd at both ends. Edges far apart get Gauss nodes.

Where the polygons are small beside their distance the contour sums cancel, and averaging Lambert's closed form of a
differential element (`solver.polygon`) over Gauss points is exact instead.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .convex_pieces import plane_tolerance, unit_normal
from .polygon import polygon_form_factor

Float = NDArray[np.floating[Any]]

# The element's form factor is analytic up to the other polygon's edges. With the nearest edge this many radii away
# from the centre, Gauss nodes converge like 6^(-2 n): to rounding with the number of nodes below.
AREA_RULE_RADII = 3.0
AREA_RULE_NODES = 12
# Step and reach of the double-exponential rule: 1e-15 of the interval is left out, and halving the step changes
# nothing above 1e-13 on the catalogue's cases.
STEP, REACH = 0.0625, 3.2
# Edges whose middles are further apart than this many of the longer one's lengths get Gauss nodes, which then converge
# like 5.8^(-2 n): round outlines have thousands of such pairs.
APART, APART_NODES = 2.0, 10


def convex_form_factor(a: Float, b: Float) -> float:
    """Form factor F_ab of two planar convex polygons (n, 3), (m, 3) float64; each sees with its front only."""
    area = polygon_area(a)
    a, b = clip_to_front(a, b), clip_to_front(b, a)
    if len(a) < 3 or len(b) < 3:
        return 0.0
    roominess_a, roominess_b = _roominess(a, b), _roominess(b, a)
    if max(roominess_a, roominess_b) > AREA_RULE_RADII:
        average = _mean_element_form_factor(a, b) if roominess_a >= roominess_b else _mean_element_form_factor(b, a)
        exchanged = average * (polygon_area(a) if roominess_a >= roominess_b else polygon_area(b))
    else:
        exchanged = _contour_sum(a, b)
    return float(max(exchanged, 0.0) / area)


def clip_to_front(polygon: Float, other: Float) -> Float:
    """The part (m, 3) of a convex polygon before the front of another one's plane; (0, 3) if there is none."""
    normal = unit_normal(other)
    height = (polygon - other[0]) @ normal
    height[np.abs(height) <= plane_tolerance(polygon, other)] = 0
    if height.max() <= 0:
        return np.empty((0, 3))
    next_height, following = np.roll(height, -1), np.roll(polygon, -1, axis=0)
    kept = []
    for corner, end, h, k in zip(polygon, following, height, next_height, strict=True):
        if h >= 0:
            kept.append(corner)
        if h * k < 0:
            kept.append(corner + (end - corner) * (h / (h - k)))
    return np.array(kept)


def triangle_nodes(polygon: Float, count: int) -> tuple[Float, Float]:
    """Gauss points (k, 3) and weights (k,), summing to the area, on a convex polygon's fan of triangles: count^2 each.

    The square is collapsed on a triangle (Duffy 1982).
    """
    x, w = np.polynomial.legendre.leggauss(count)
    x, w = (x + 1) / 2, w / 2
    u, v = (grid.ravel() for grid in np.meshgrid(x, x, indexing="ij"))
    weight = np.outer(w, w).ravel() * u
    points, weights = [], []
    for first, second in zip(polygon[1:-1] - polygon[0], polygon[2:] - polygon[0], strict=True):
        points.append(polygon[0] + u[:, None] * (first + v[:, None] * (second - first)))
        weights.append(weight * np.linalg.norm(np.cross(first, second)))
    return np.concatenate(points), np.concatenate(weights)


def _roominess(polygon: Float, other: Float) -> float:
    """Distance from a polygon's centre to the other one's edges, in radii of the polygon."""
    centre = polygon.mean(axis=0)
    edges = np.roll(other, -1, axis=0) - other
    along = ((centre - other) * edges).sum(axis=1) / (edges**2).sum(axis=1)
    nearest = other + np.clip(along, 0, 1)[:, None] * edges
    radius = np.linalg.norm(polygon - centre, axis=1).max()
    return float(np.linalg.norm(nearest - centre, axis=1).min() / radius)


def _mean_element_form_factor(polygon: Float, other: Float) -> float:
    points, weights = triangle_nodes(polygon, AREA_RULE_NODES)
    values = polygon_form_factor(points, np.broadcast_to(unit_normal(polygon), points.shape), other)
    return float(weights @ values / weights.sum())


def _contour_sum(a: Float, b: Float) -> float:
    """A_a F_ab by the contours: one edge of `a` against all of `b` at a time, so that memory stays small."""
    origin = a.mean(axis=0)
    scale = np.sqrt(np.ptp(a, axis=0).max() * np.ptp(b, axis=0).max())  # logarithms near 0 keep their digits
    a, b = (a - origin) / scale, (b - origin) / scale
    ends_b = np.roll(b, -1, axis=0)
    terms = [_edge_terms(start, end, b, ends_b) for start, end in zip(a, np.roll(a, -1, axis=0), strict=True)]
    return float(np.concatenate(terms).sum() / (2 * np.pi) * scale**2)


def _edge_terms(start: Float, end: Float, begins: Float, ends: Float) -> Float:
    """(m,) e_i . e_j times the double integral of ln r, of one edge i and each edge j from begins to ends (m, 3)."""
    length_i, lengths_j = np.linalg.norm(end - start), np.linalg.norm(ends - begins, axis=1)
    direction_i, directions_j = (end - start) / length_i, (ends - begins) / lengths_j[:, None]
    cosine = directions_j @ direction_i
    between = np.linalg.norm((start + end) / 2 - (begins + ends) / 2, axis=1)
    apart = between > APART * np.maximum(length_i, lengths_j)
    result = np.zeros(len(begins))
    for some, rule in ((apart, _gauss()), (~apart, _double_exponential())):
        if not some.any():
            continue
        j = begins[some], ends[some], directions_j[some]
        cuts = np.tile([0, length_i], (len(j[0]), 1)) if some is apart else _cuts(start, direction_i, length_i, *j)
        widths = np.diff(cuts, axis=1)
        positions = cuts[:, :-1, None] + widths[:, :, None] * rule[0]
        points = start + positions[..., None] * direction_i
        inner = _logarithm_integral(points, *(array[:, None, None] for array in j))
        result[some] = ((inner * rule[1]).sum(axis=2) * widths).sum(axis=1)
    return np.asarray(cosine * result)


def _cuts(start: Float, direction_i: Float, length_i: Any, begins: Float, ends: Float, directions_j: Float) -> Float:
    """(m, 5) places along edge i, in order: its ends, opposite both ends of edge j, and where the lines are nearest."""
    opposite_begin, opposite_end = (begins - start) @ direction_i, (ends - start) @ direction_i
    cosine = directions_j @ direction_i
    sine2 = np.maximum(1 - cosine**2, np.finfo(np.float64).tiny)
    between = begins - start
    nearest = (between @ direction_i - (between * directions_j).sum(axis=1) * cosine) / sine2
    inside = np.clip(np.stack([opposite_begin, opposite_end, nearest], axis=1), 0, length_i)
    lowest, highest = np.zeros((len(begins), 1)), np.full((len(begins), 1), length_i)
    return np.sort(np.concatenate([lowest, inside, highest], axis=1), axis=1)


def _logarithm_integral(points: Float, begins: Float, ends: Float, directions: Float) -> Float:
    """int ln r dt over edges from points (..., 3), without the edge's length (which cancels around a polygon)."""
    from_begin, from_end = begins - points, ends - points
    u0, u1 = (from_begin * directions).sum(axis=-1), (from_end * directions).sum(axis=-1)
    p = np.linalg.norm(np.cross(from_begin, directions), axis=-1)
    angle = np.arctan2(p * (u1 - u0), p * p + u0 * u1)
    return np.asarray(_times_log(u1, p) - _times_log(u0, p) + p * angle)


def _times_log(u: Float, p: Float) -> Float:
    """u ln sqrt(u^2 + p^2), 0 at u = 0."""
    squared = u * u + p * p
    return np.asarray(u * np.log(np.where(squared > 0, squared, 1)) / 2)


def _gauss() -> tuple[Float, Float]:
    """Gauss's nodes and weights on [0, 1]."""
    x, w = np.polynomial.legendre.leggauss(APART_NODES)
    return (x + 1) / 2, w / 2


def _double_exponential() -> tuple[Float, Float]:
    """Nodes and weights on [0, 1]: x = 1 / (1 + exp(-pi sinh t)), evenly spaced in t."""
    t = np.arange(-REACH, REACH + STEP / 2, STEP)
    decay = np.exp(-np.pi * np.sinh(t))
    weights = np.pi * np.cosh(t) * decay / (1 + decay) ** 2 * STEP
    return 1 / (1 + decay), weights / weights.sum()


def polygon_area(polygon: Float) -> float:
    """Of a flat polygon (m, 3), m2."""
    fan = polygon[1:] - polygon[0]
    return float(np.linalg.norm(np.cross(fan[:-1], fan[1:]).sum(axis=0)) / 2)

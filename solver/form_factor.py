"""Form factors between polygons, and from a point to a polygon: exact values for tests, and for anybody who asks.

Nothing in a bake goes through here: rows of form factors are counted with rays (METHODS in docs/). This is the exact
answer that the rays are held against.

    no occluders            contour integral, or Gauss points on the area when far apart (`solver.contour`); 1e-10
    a point, occluders      the polygon minus the occluders' shadows, in closed form (`solver.visible_part`)
    two polygons, occluders the mean of the latter over one of them: a randomly shifted lattice, with standard error
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .contour import clip_to_front, convex_form_factor, polygon_area
from .convex_pieces import convex_pieces, unit_normal
from .errors import SceneError
from .polygon import polygon_form_factor
from .shaft import blocking
from .visible_part import visible_form_factor

Float = NDArray[np.floating[Any]]

# Independent random shifts of each lattice: their scatter is the standard error (Cranley and Patterson 1976).
SHIFTS = 16
# Sizes of the Fibonacci lattices tried in turn, as (points, second generator), until the error is small enough.
LATTICES = ((987, 610), (4181, 2584), (10946, 6765))
# A standard error below this part of the value is small enough to stop.
WANTED_RELATIVE_ERROR = 2e-6
# Scatter below this part of the unoccluded value is rounding: then every point saw all, or none.
ROUNDING = 1e-13
# Points handled at once by the exact visibility: a few hundred bytes each, times the pieces.
CHUNK = 16384


@dataclass(frozen=True)
class Estimate:
    """A value and its standard error, which is 0 where the value is exact to rounding."""

    value: float
    standard_error: float = 0.0


def form_factor(a: ArrayLike, b: ArrayLike, occluders: Sequence[ArrayLike] = (), seed: int = 0) -> Estimate:
    """Form factor F_ab: the part of what a diffuse polygon `a` sends out that arrives at `b` directly.

    Parameters
    ----------
    a, b : (n, 3) corners, metres; planar, simple, outward by the right-hand rule. Each works on its front only,
        also if the plane of one cuts the other.
    occluders : (n, 3) polygons that block from both sides.
    seed : of the lattice's shifts; used only if an occluder stands partly in the way.

    Returns
    -------
    Estimate
        Exact (standard error 0, good to about 1e-10) unless an occluder stands partly in the way.

    Raises
    ------
    SceneError
        If a polygon is not finite, has no area, is not planar or crosses itself.
    """
    pieces_a, pieces_b = convex_pieces(a, "polygon a"), convex_pieces(b, "polygon b")
    blockers = _occluder_pieces(occluders)
    generator = np.random.default_rng(seed)
    exchanged = [_exchange(p, q, blockers, generator) for p in pieces_a for q in pieces_b]
    area = sum(polygon_area(piece) for piece in pieces_a)
    value = sum(part.value for part in exchanged) / area
    return Estimate(value, float(np.sqrt(sum(part.standard_error**2 for part in exchanged)) / area))


def element_form_factor(
    point: ArrayLike, normal: ArrayLike, polygon: ArrayLike, occluders: Sequence[ArrayLike] = ()
) -> Estimate:
    """Form factor of a differential element to a polygon, clipped at the element's horizon; exact.

    Parameters
    ----------
    point, normal : (3,), metres; the normal need not have unit length.
    polygon : (n, 3) corners, metres; planar, simple. What counts is what the element sees of it, be it the front or
        the back: the catalogues' configuration factors know no sides (`solver.polygon` has the one-sided one).
    occluders : (n, 3) polygons that block from both sides.

    Raises
    ------
    SceneError
        If a polygon, the point or the normal can't be used.
    """
    points, normals = _vector(point, "point")[None], _vector(normal, "normal")[None]
    length = np.linalg.norm(normals)
    if not length > 0:
        raise SceneError("normal is [0, 0, 0]: give a direction")
    blockers = _occluder_pieces(occluders)
    pieces = convex_pieces(polygon, "polygon")
    if (points[0] - pieces[0][0]) @ unit_normal(pieces[0]) < 0:
        pieces = [piece[::-1] for piece in pieces]
    return Estimate(float(sum(visible_form_factor(points, normals / length, p, blockers)[0] for p in pieces)))


def _exchange(a: Float, b: Float, occluders: list[Float], generator: np.random.Generator) -> Estimate:
    """A_a F_ab of two convex polygons."""
    front_a, front_b = clip_to_front(a, b), clip_to_front(b, a)
    if min(len(front_a), len(front_b)) < 3:
        return Estimate(0.0)
    between = []
    for occluder in occluders:
        answer = blocking(front_a, front_b, occluder)
        if answer == "all":
            return Estimate(0.0)
        if answer == "part":
            between.append(occluder)
    if not between:
        return Estimate(convex_form_factor(a, b) * polygon_area(a))
    smaller, other = (front_a, front_b) if polygon_area(front_a) <= polygon_area(front_b) else (front_b, front_a)
    return _lattice_mean(smaller, other, between, generator)


def _lattice_mean(polygon: Float, other: Float, occluders: list[Float], generator: np.random.Generator) -> Estimate:
    """Integral over `polygon` of the exact form factor of its points to what they see of `other`.

    Either summed as it is, or as the exact whole less what is hidden, whichever scatters less: where the polygons touch
    the visible part is steep, but nothing is hidden there.
    """
    shifts = generator.random((SHIFTS, 1, 2))
    whole = convex_form_factor(polygon, other) * polygon_area(polygon)
    for count, generating in LATTICES:
        lattice = np.arange(count)[:, None] * np.array([1, generating]) / count
        square = 1 - np.abs(2 * ((lattice + shifts) % 1) - 1)  # the tent makes a periodic function of any: N^-2
        points, weights = _spread(polygon, square.reshape(-1, 2))
        visible, hidden = _visible_and_hidden(points, unit_normal(polygon), other, occluders)
        sums = [(values * weights).reshape(SHIFTS, count).mean(axis=1) for values in (visible, hidden)]
        error, mean = min(_standard_error_and_mean(sums[0]), _standard_error_and_mean(whole - sums[1]))
        if ROUNDING * whole < error <= WANTED_RELATIVE_ERROR * mean:
            break
    if error <= ROUNDING * whole:  # every point saw all, or none: what is left is less than a point's share
        error = whole / len(points)
    return Estimate(max(mean, 0.0), error)


def _standard_error_and_mean(values: Float) -> tuple[float, float]:
    return float(values.std(ddof=1) / np.sqrt(len(values))), float(values.mean())


def _visible_and_hidden(points: Float, normal: Float, polygon: Float, occluders: list[Float]) -> tuple[Float, Float]:
    normals = np.broadcast_to(normal, points.shape)
    visible = np.concatenate([
        visible_form_factor(points[start : start + CHUNK], normals[start : start + CHUNK], polygon, occluders)
        for start in range(0, len(points), CHUNK)
    ])
    return visible, polygon_form_factor(points, normals, polygon) - visible


def _spread(polygon: Float, square: Float) -> tuple[Float, Float]:
    """The square's points (n, 2) on the polygon, and what each counts for: its area times the map's stretch.

    A parallelogram takes them as they are. In others the first coordinate goes from the centre to the outline, and the
    second around the outline, in step with the area swept.
    """
    sides = polygon[1:] - polygon[0]
    if len(polygon) == 4 and np.allclose(sides[0] + sides[2], sides[1], rtol=0, atol=1e-12 * np.abs(sides).max()):
        area = polygon_area(polygon)
        return polygon[0] + square[:, :1] * sides[0] + square[:, 1:] * sides[2], np.full(len(square), area)
    centre = polygon.mean(axis=0)
    around = np.concatenate([polygon, polygon[:1]]) - centre
    swept = np.cumsum(np.linalg.norm(np.cross(around[:-1], around[1:]), axis=1))
    angle = square[:, 1] * swept[-1]
    outline = np.stack([np.interp(angle, np.concatenate([[0], swept]), around[:, k]) for k in range(3)], axis=1)
    return centre + square[:, :1] * outline, 2 * polygon_area(polygon) * square[:, 0]


def _occluder_pieces(occluders: Sequence[ArrayLike]) -> list[Float]:
    return [piece for k, polygon in enumerate(occluders) for piece in convex_pieces(polygon, f"occluder {k}")]


def _vector(value: ArrayLike, name: str) -> Float:
    vector = np.array(value, np.float64)
    if vector.shape != (3,) or not np.isfinite(vector).all():
        raise SceneError(f"{name} is {vector.tolist()}: give three finite numbers")
    return vector

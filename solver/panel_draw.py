"""Where shadow rays to flat emitters end: evenly over a panel or, from near by, where most of its light comes from.

From nearer than a panel is wide, most light comes from the part right in front of a point. Points spread evenly hardly
find that part, so that all of them may pass a thing that hides it. There, samples crowd as 1 / r^2 about the foot of
the perpendicular across the panel's first side, and as 1 / r^3 along the second, both by inverted integrals: nearly as
the solid angle does (of rectangles alone: Urena, Fajardo & King, An Area-Preserving Parametrization for Spherical
Rectangles, 2013), of triangles and parallelograms alike. An ellipse takes those of its parallelogram, of which some
miss it.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import cap
from .lights import dot

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]

# A point is near a panel that it is nearer to than this part of its diagonal.
NEAR = 0.35
# Heights count as no less than this part of the diagonal: a density without bound has no use.
LEAST_HEIGHT = 1e-4
# Keeps 0 / 0 away where a panel has no area.
TINY = 1e-60


class PanelDraw:
    """Samples on panels.

    Parameters
    ----------
    corner, first, second : (k, 3) metres: a corner of each and the two sides from it.
    square : (k,) bool, whether it is the parallelogram of the two sides, not the triangle.
    ellipses : whether all are the ellipses that touch the sides of their parallelograms.
    """

    def __init__(self, corner: Float, first: Float, second: Float, square: NDArray[np.bool_], *,
                 ellipses: bool = False) -> None:
        self._ellipses = ellipses
        self._exact = np.stack([corner, first, second]).astype(np.float64)
        self._corner, self._first, self._second = self._exact.astype(np.float32)
        self._square, self._all_square = square, bool(square.all())
        part = np.where(square, 2, 3)[:, None]
        self._middle = (self._exact[0] + (self._exact[1] + self._exact[2]) / part).astype(np.float32)
        # No point that is near lies further from the middle.
        self._reach = ((self._exact[1:] ** 2).sum(axis=(0, 2)) * (1 + NEAR) ** 2).astype(np.float32)

    def targets(self, points: Float, panel: Int, u: Float, v: Float) -> tuple[Float, Float]:
        """One sample a point, of `panel` (n,), by u and v (n,) in [0, 1).

        Returns
        -------
        (n, 3) float32 metres, and (n,) float32 what weights of evenly spread samples are multiplied by.
        """
        even = u, v
        if self._ellipses:
            u, v = (np.float32(0.5) + np.float32(0.5) * across for across in cap.disc(np.stack([u, v], axis=1)))
        elif not self._all_square:
            square, root = self._square[panel], np.sqrt(u)
            u, v = np.where(square, u, 1 - root), np.where(square, v, root * v)
        scale = np.ones(len(points), np.float32)
        away = points - np.take(self._middle, panel, axis=0)
        near = np.flatnonzero(dot(away, away) < np.take(self._reach, panel))
        if len(near):
            view = _View(np.take(self._exact, panel[near], axis=1), points[near])
            rows, near = np.flatnonzero(view.near), near[view.near]
            u, v = u.copy(), v.copy()
            u[near], v[near], scale[near] = view.crowded(rows, self._square[panel[near]], even[0][near], even[1][near])
            if self._ellipses:
                inside = (u[near] - 0.5) ** 2 + (v[near] - 0.5) ** 2 < 0.25
                scale[near] *= np.where(inside, np.float32(4 / np.pi), 0)
        target = np.take(self._corner, panel, axis=0)
        target += np.take(self._first, panel, axis=0) * u[:, None]
        target += np.take(self._second, panel, axis=0) * v[:, None]
        return target, scale


class _View:
    """Points (n, 3) before the planes of panels (3, n, 3), a corner and two sides each.

    foot : (2, n) where the perpendiculars from the points stand, in steps along the two sides.
    near : (n,) which points are near.
    """

    def __init__(self, panel: Float, points: Float) -> None:
        corner, first, second = panel
        offset = points - corner
        along, across = dot(offset, first), dot(offset, second)
        self._first, self._second = np.maximum(dot(first, first), TINY), np.maximum(dot(second, second), TINY)
        self._both = dot(first, second)
        self._gram = np.maximum(self._first * self._second - self._both**2, TINY)
        self.foot = np.stack([along * self._second - across * self._both,
                              across * self._first - along * self._both]) / self._gram
        diagonal = self._first + self._second
        height = dot(offset, offset) - self.foot[0] * along - self.foot[1] * across
        u, v = self.foot - np.clip(self.foot, 0, 1)
        aside = u * u * self._first + 2 * u * v * self._both + v * v * self._second
        self.near = height + aside < NEAR**2 * diagonal
        self._height = np.sqrt(np.maximum(height, LEAST_HEIGHT**2 * diagonal))

    def crowded(self, rows: Int, square: NDArray[np.bool_], u: Float, v: Float) -> tuple[Float, Float, Float]:
        """How far along the two sides samples of some points lie, and what their weights are multiplied by."""
        foot_u, foot_v = self.foot[:, rows]
        height, gram, second, both = (of_all[rows] for of_all in (self._height, self._gram, self._second, self._both))
        # How far a step along the first side leads from a line along the second.
        stride, side = np.sqrt(gram / second), np.sqrt(second)
        low, high = np.arctan(-stride * foot_u / height), np.arctan(stride * (1 - foot_u) / height)
        slope = np.tan(low + u * (high - low))
        step = slope * height / stride
        there = np.clip(foot_u + step, 0, 1)
        density = stride / (height * (high - low) * (1 + slope**2))
        line = height * np.sqrt(1 + slope**2)
        start = foot_v - step * both / second
        end = np.where(square, 1, 1 - there)
        low, high = (_sine(side * (limit - start) / line) for limit in (0, end))
        sine = low + v * (high - low)
        ratio = sine / np.sqrt(np.maximum(1 - sine**2, TINY))
        beyond = np.clip(start + ratio * line / side, 0, end)
        density *= side / (line * np.maximum(high - low, TINY) * (1 + ratio**2) ** 1.5)
        return there, beyond, np.where(square, 1, 2) / density


def _sine(tangent: Float) -> Float:
    return np.asarray(tangent / np.hypot(1, tangent))

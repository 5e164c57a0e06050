"""Surfaces with holes: rays go on where a triangle's opacity lets them.

A ray that meets a triangle of opacity a stops with probability a. Whether it does follows from the ray's own bits and
the triangle, so that the same bake has the same bits; where a is 0 or 1 there is no chance in it. The expected value is
that of a renderer with transparent surfaces (Enderton, Sintorn, Shirley & Luebke, Stochastic Transparency, 2010).
Scenes without such triangles never come here.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .sheet_layers import sheet_layers
from .visibility import SHORTEN, Hits, Visibility

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]
Opacity = Callable[[Int, Float, Float], Float]

# Surfaces that a ray may go through; it stops at the next one.
MOST_SHEETS = 256


@dataclass(frozen=True, eq=False)
class _Layer:
    """Sheets of which none lies on another: their triangles (n,), and rays against them."""

    triangles: Int
    caster: Visibility

    @classmethod
    def of(cls, corners: Float, triangles: Int, embree: bool) -> _Layer:
        return cls(triangles, Visibility(corners[triangles], embree))

    def hits(self, origins: Float, directions: Float) -> Hits:
        """As `Visibility.hits`, with the scene's triangles."""
        found = self.caster.hits(origins, directions)
        met = np.where(found.triangle >= 0, self.triangles[found.triangle], -1).astype(np.int32)
        return replace(found, triangle=met)


class CutoutVisibility(Visibility):
    """Rays against the scene's triangles, some of which have holes.

    Parameters
    ----------
    corners : (t, 3, 3) float32, metres.
    offset : (t,) float32, metres: how far behind a triangle a ray goes on.
    holed : (t,) bool: triangles whose opacity is not 1 everywhere.
    opacity : from triangles and barycentric u, v to opacities (n,).
    embree : False forces the NumPy caster (for tests).
    """

    def __init__(self, corners: Float, offset: Float, holed: NDArray[np.bool_], opacity: Opacity,
                 embree: bool = True) -> None:
        layer = sheet_layers(corners, offset, holed, embree)
        # What is in a later layer has no area in the caster of all else.
        super().__init__(np.where((layer > 0)[:, None, None], corners[:, :1], corners), embree)
        self._offset, self._holed, self._opacity = offset, holed, opacity
        self._solid_caster = Visibility(corners[~holed], embree)
        self._first, *self._further = (_Layer.of(corners, np.flatnonzero(holed & (layer == number)), embree)
                                       for number in range(int(layer.max(initial=0)) + 1))
        self._any_further = Visibility(corners[layer > 0], embree)

    def hits(self, origins: Float, directions: Float) -> Hits:
        """The nearest triangle along each ray that stops it."""
        found = self._first_stop(super().hits, origins, directions)
        if self._further:
            rows = np.flatnonzero(self._any_further.occluded(origins, directions, found.distance))
            for layer in self._further:
                sheet = self._first_stop(layer.hits, origins[rows], directions[rows])
                nearer = sheet.distance < found.distance[rows]
                for all_rays, these in zip(found.arrays(), sheet.arrays(), strict=True):
                    all_rays[rows[nearer]] = these[nearer]
        return found

    def _first_stop(self, cast: Callable[[Float, Float], Hits], origins: Float, directions: Float) -> Hits:
        """The nearest of what is met that stops each ray."""
        found = Hits(*(array.copy() for array in cast(origins, directions).arrays()))
        triangle, u, v, distance, front = found.arrays()
        rows = self._passing(triangle, u, v, np.arange(len(triangle)), origins, directions)
        start = np.zeros(len(triangle), np.float32)
        for _ in range(MOST_SHEETS):
            if not len(rows):
                break
            start[rows] = self._behind(triangle[rows], distance[rows])
            further = cast(origins[rows] + directions[rows] * start[rows, None], directions[rows])
            triangle[rows], u[rows], v[rows] = further.triangle, further.u, further.v
            distance[rows], front[rows] = further.distance + start[rows], further.front
            rows = self._passing(triangle, u, v, rows, origins, directions)
        return found

    def occluded(self, origins: Float, directions: Float, distances: Float) -> NDArray[np.bool_]:
        """Whether anything within the distances stops the ray: (n,) bool."""
        blocked = self._solid_caster.occluded(origins, directions, distances)
        rows = np.flatnonzero(~blocked)
        blocked[rows] = self._stopped(self._first, origins[rows], directions[rows], distances[rows])
        if self._further:
            rows = rows[~blocked[rows]]
            rows = rows[self._any_further.occluded(origins[rows], directions[rows], distances[rows])]
            for layer in self._further:
                blocked[rows] |= self._stopped(layer, origins[rows], directions[rows], distances[rows])
        return blocked

    def _stopped(self, layer: _Layer, origins: Float, directions: Float, distances: Float) -> NDArray[np.bool_]:
        """Whether a sheet of a layer within the distances stops the ray: (n,) bool."""
        blocked = np.zeros(len(origins), bool)
        rows = np.arange(len(origins))
        start = np.zeros(len(origins), np.float32)
        for _ in range(MOST_SHEETS):
            if not len(rows):
                break
            met = layer.hits(origins[rows] + directions[rows] * start[rows, None], directions[rows])
            distance = met.distance + start[rows]
            reached = (met.triangle >= 0) & (distance < distances[rows])
            rows, distance = rows[reached], distance[reached]
            triangle = met.triangle[reached]
            stops = self._stops(triangle, met.u[reached], met.v[reached], origins[rows], directions[rows])
            blocked[rows[stops]] = True
            rows = rows[~stops]
            start[rows] = self._behind(triangle[~stops], distance[~stops])
        blocked[rows] = True
        return blocked

    def _passing(self, triangle: Int, u: Float, v: Float, rows: Int, origins: Float, directions: Float) -> Int:
        """Those of the rows whose ray goes on through the triangle that it met."""
        met = triangle[rows]
        rows = rows[(met >= 0) & self._holed[met]]
        return rows[~self._stops(triangle[rows], u[rows], v[rows], origins[rows], directions[rows])]

    def _stops(self, triangle: Int, u: Float, v: Float, origins: Float, directions: Float) -> NDArray[np.bool_]:
        return np.asarray(_chance(triangle, origins, directions) < self._opacity(triangle, u, v))

    def _behind(self, triangle: Int, distance: Float) -> Float:
        """Distances just behind the triangles met."""
        return np.asarray(distance + np.maximum(self._offset[triangle], distance * np.float32(STEP)), np.float32)


# Part of its length that a ray goes on behind a surface at least: float32 can't tell less.
STEP = SHORTEN * 1e-2


def _chance(triangle: Int, origins: Float, directions: Float) -> Float:
    """(n,) float32 in [0, 1) from the bits of rays and triangles (mixing as in Steele & Vigna, SplitMix64, 2014)."""
    state = triangle.astype(np.uint64)
    with np.errstate(over="ignore"):
        for vectors in (origins, directions):
            bits = np.ascontiguousarray(vectors, np.float32).view(np.uint32)
            for axis in range(3):
                state = (state + bits[:, axis] + np.uint64(0x9E3779B97F4A7C15)) * np.uint64(0xBF58476D1CE4E5B9)
                state ^= state >> np.uint64(29)
    return np.asarray((state >> np.uint64(40)).astype(np.float32) * np.float32(2.0**-24))

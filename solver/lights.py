"""Lamps: what each sends to a point when nothing is in the way, and where on it a shadow ray should end.

Every lamp answers the same two questions, for any list of points:

    irradiance(points, normals)          the unoccluded irradiance in closed form, or None if it has none
    sample(points, normals, uv)          directions, distances and weights of shadow rays, so that the mean of
                                         weight * visible, times `colour`, is the irradiance
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.floating[Any]]

# A lamp closer than this counts as this far, metres: the irradiance of a lamp without size has no bound.
NEAREST = 1e-6


@dataclass(frozen=True, eq=False)
class LightSample:
    """Shadow rays towards a lamp.

    direction : (n, 3) float32, unit, from the point towards the lamp.
    distance : (n,) float32, metres; inf for a sun, 0 where nothing is to stop the light.
    weight : (n,) float32 >= 0, the integrand over its probability density: mean(weight * visible) * colour is
        the irradiance (W/m2). Zero where the lamp is behind the surface or the surface is behind the lamp.
    """

    direction: Float
    distance: Float
    weight: Float


@runtime_checkable
class Light(Protocol):
    """A lamp."""

    @property
    def name(self) -> str:
        """For messages."""
        ...

    @property
    def colour(self) -> Float:
        """(3,) float32: what weights are multiplied by to give W/m2; a point's intensity, an area's power."""
        ...

    def power(self) -> Float:
        """(3,) float32: flux that leaves the lamp, W; a sun's is its irradiance times the scene's disc (nan)."""
        ...

    def irradiance(self, points: Float, normals: Float) -> Float | None:
        """Unoccluded irradiance (n, 3) float32, W/m2, in closed form; None where there is none."""
        ...

    def sample(self, points: Float, normals: Float, uv: Float) -> LightSample:
        """One shadow ray a point, at `uv` (n, 2) in [0, 1)^2 of the lamp's surface."""
        ...

    def translated(self, offset: Float) -> Light:
        """The same lamp, moved by (3,) metres."""
        ...


def aimed(points: Float, normals: Float, target: Float, facing: Float, two_sided: bool | NDArray[np.bool_],
          scale: Float | None = None) -> LightSample:
    """Shadow rays to points of a flat source, weighted by cos cos' / distance^2.

    points, normals, target : (n, 3) float32; facing : (n, 3) or (3,) float32 unit, where the source shines;
    two_sided : whether it shines backwards too, for all or for each (n,); scale : (n,) even density of points over
    theirs, None for 1.
    """
    towards = target - points
    squared = np.maximum(dot(towards, towards), np.float32(NEAREST**2))
    distance = np.sqrt(squared)
    direction = towards / distance[:, None]
    leaving = -dot(direction, facing)
    leaving = np.where(two_sided, np.abs(leaving), np.maximum(leaving, 0))
    weight = np.maximum(dot(direction, normals), 0) * leaving / squared
    if scale is not None:
        weight *= scale
    return LightSample(direction, distance, np.asarray(weight))


def inside_box(points: Float, low: Float, high: Float) -> NDArray[np.bool_]:
    """(n,) whether points (n, 3) lie in a box from `low` to `high`, (3,), or each in its own, (3, n)."""
    inside = np.ones(len(points), bool)
    for axis in range(3):
        inside &= (points[:, axis] >= low[axis]) & (points[:, axis] <= high[axis])
    return inside


def dot(a: Float, b: Float) -> Float:
    """Row by row: (n, 3) and (n, 3) or (3,) -> (n,); not by BLAS, see `sampling.combined`."""
    return np.asarray(a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1] + a[..., 2] * b[..., 2])

"""Lamps seen as a round patch of constant radiance: sun and point (spots are in spot.py, area lamps in area_lamp.py).

Each follows what Cycles does with Blender's lamp of that name, so that baked and rendered light agree:

1. A sun of angular diameter `angle` is a disc of directions whose irradiance on a surface facing it is given.
2. A point lamp of radius r sends the intensity power / (4 pi) everywhere. By default it is a disc that faces each
   receiver (Blender's "soft falloff"); with `sphere` it is a true sphere. Inside a sphere the irradiance is constant.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import cap
from .lamp_checks import put, spectrum, unit_vector, vector, within
from .lights import NEAREST, LightSample, dot
from .sampling import cosine_directions

Float = NDArray[np.floating[Any]]


@dataclass(frozen=True, eq=False)
class Sun:
    """A far lamp: parallel light, or a disc of directions.

    Parameters
    ----------
    name : for messages.
    direction : (3,) the direction in which its light travels; any length but zero.
    irradiance_facing : (3,) W/m2 on a surface that faces it.
    angle : angular diameter, radians, from 0 to pi.
    """

    name: str
    direction: Float
    irradiance_facing: Float
    angle: float = 0.0

    def __post_init__(self) -> None:
        put(self, direction=unit_vector(self.name, "direction", self.direction))
        put(self, irradiance_facing=spectrum(self.name, "irradiance", self.irradiance_facing))
        put(self, angle=within(self.name, "angle", self.angle, 0.0, np.pi))

    @property
    def colour(self) -> Float:
        """(3,) float32: irradiance facing the sun, W/m2."""
        return self.irradiance_facing

    @property
    def _sine_squared(self) -> float:
        return float(np.sin(self.angle / 2) ** 2)

    def power(self) -> Float:
        """(3,) float32, nan: a sun has no flux of its own."""
        return np.full(3, np.nan, np.float32)

    def irradiance(self, points: Float, normals: Float) -> Float:
        """Unoccluded irradiance (n, 3) float32, W/m2; the disc is cut at the surface's horizon."""
        cosine = -dot(normals, self.direction.astype(np.float32))
        return _round_irradiance(cosine, self._sine_squared)[:, None] * self.colour

    def sample(self, points: Float, normals: Float, uv: Float) -> LightSample:
        """Directions spread evenly over the disc; the distance is inf."""
        axis = -self.direction.astype(np.float32)[None]
        direction, _, _ = cap.directions(axis, np.asarray(self._sine_squared, np.float32), uv)
        weight = np.maximum(dot(direction, normals), 0) * _cap_over_disc(self._sine_squared)
        return LightSample(direction, np.full(len(points), np.inf, np.float32), np.asarray(weight, np.float32))

    def translated(self, offset: Float) -> Sun:
        """The sun itself: it stands nowhere."""
        return self


@dataclass(frozen=True, eq=False)
class Point:
    """A lamp that shines alike in all directions.

    Parameters
    ----------
    name : for messages.
    position : (3,) float64, metres.
    flux : (3,) W, sent into the whole sphere.
    radius : metres; 0 is a mathematical point.
    sphere : a true sphere, not a disc that faces each receiver.
    """

    name: str
    position: Float
    flux: Float
    radius: float = 0.0
    sphere: bool = False

    def __post_init__(self) -> None:
        put(self, position=vector(self.name, "position", self.position))
        put(self, flux=spectrum(self.name, "power", self.flux))
        put(self, radius=within(self.name, "radius", self.radius, 0.0, np.inf))

    @property
    def colour(self) -> Float:
        """(3,) float32: intensity, W/sr."""
        return np.asarray(self.flux / np.float32(4 * np.pi))

    def power(self) -> Float:
        """(3,) float32: flux that leaves the lamp, W."""
        return self.flux

    def irradiance(self, points: Float, normals: Float) -> Float:
        """Unoccluded irradiance (n, 3) float32, W/m2; the lamp is cut at the surface's horizon."""
        return self.unit_irradiance(View.of(self, points, normals))[:, None] * self.colour

    def unit_irradiance(self, view: View) -> Float:
        """(n,) float32, 1/m2: irradiance an intensity of 1 W/sr."""
        return view.unit_irradiance()

    def sample(self, points: Float, normals: Float, uv: Float) -> LightSample:
        """Directions spread evenly over the lamp's outline; from inside a sphere, over the surface's hemisphere."""
        return View.of(self, points, normals).sample(self.radius, self.sphere, uv)

    def translated(self, offset: Float) -> Point:
        """The same lamp, moved by (3,) metres."""
        return replace(self, position=self.position + offset)


@dataclass(frozen=True, eq=False)
class View:
    """How receivers see a round lamp: axis (n, 3) towards it, distance (n,), sin^2 of its half angle (n,), whether
    they are inside of it (n,), and the squared reach (n,): intensity / reach^2 is the irradiance facing it."""

    normals: Float
    axis: Float
    distance: Float
    sine_squared: Float
    inside: NDArray[np.bool_]
    reach_squared: Float

    @classmethod
    def of(cls, lamp: Point, points: Float, normals: Float) -> View:
        """Of one lamp."""
        return cls.around(lamp.position.astype(np.float32), lamp.radius, lamp.sphere, points, normals)

    @classmethod
    def around(cls, position: Float, radius: Float | float, sphere: NDArray[np.bool_] | bool, points: Float,
               normals: Float) -> View:
        """Of one lamp, or of a lamp for each point: position (3,) or (n, 3) float32, radius and sphere one or (n,)."""
        towards = position - points
        distance = np.sqrt(dot(towards, towards))
        known = distance > 0
        axis = np.where(known[:, None], towards / np.where(known, distance, 1)[:, None], normals)
        squared, radius_squared = distance**2, np.float32(1) * np.asarray(radius, np.float32) ** 2
        ball = np.asarray(sphere) & (radius_squared > 0)
        inside = ball & (squared <= radius_squared)
        reach = np.where(ball, np.maximum(squared, radius_squared), squared + radius_squared)
        reach = np.maximum(reach, np.float32(NEAREST**2))
        sine_squared = np.minimum(radius_squared / reach, 1)
        return cls(normals, np.asarray(axis, np.float32), distance, sine_squared, inside, reach)

    def unit_irradiance(self) -> Float:
        """(n,) float32, 1/m2: irradiance an intensity of 1 W/sr."""
        outside = _round_irradiance(dot(self.axis, self.normals), self.sine_squared) / self.reach_squared
        return np.asarray(np.where(self.inside, 1 / self.reach_squared, outside), np.float32)

    def sample(self, radius: Float | float, sphere: NDArray[np.bool_] | bool, uv: Float) -> LightSample:
        """See `Point.sample`; radius and sphere as for `around`."""
        normals = self.normals
        direction, cosine, sine_squared = cap.directions(self.axis, self.sine_squared, uv)
        weight = np.maximum(dot(direction, normals), 0) * _cap_over_disc(self.sine_squared) / self.reach_squared
        half_chord = np.sqrt(np.maximum(np.asarray(radius) ** 2 - self.distance**2 * sine_squared, 0))
        distance = np.where(sphere, np.maximum(self.distance * cosine - half_chord, 0),
                            self.distance / np.maximum(cosine, np.finfo(np.float32).tiny))
        within_lamp = np.flatnonzero(self.inside)
        if len(within_lamp):
            some = cosine_directions(normals[within_lamp], uv[within_lamp, :1], uv[within_lamp, 1:])[:, 0]
            direction[within_lamp] = some
            weight[within_lamp] = 1 / self.reach_squared[within_lamp]
            distance[within_lamp] = self._to_shell(some, np.broadcast_to(radius, len(uv))[within_lamp], within_lamp)
        return LightSample(direction, np.asarray(distance, np.float32), np.asarray(weight, np.float32))

    def _to_shell(self, direction: Float, radius: Float, rows: NDArray[Any]) -> Float:
        """Distance from points inside the sphere to the sphere."""
        along = dot(direction, self.axis[rows]) * self.distance[rows]
        return np.asarray(along + np.sqrt(np.maximum(radius**2 - self.distance[rows] ** 2 + along**2, 0)))


def _round_irradiance(cosine: Float, sine_squared: Float | float) -> Float:
    """Irradiance of a cap, in units of what it sends to a surface that faces it."""
    sine_squared = np.asarray(sine_squared, np.float32)
    tiny = sine_squared <= cap.SMALLEST_CUT**2
    whole = cap.projected_solid_angle(cosine, sine_squared) / (np.pi * np.where(tiny, 1, sine_squared))
    return np.asarray(np.where(tiny, np.maximum(cosine, 0), whole), np.float32)


def _cap_over_disc(sine_squared: Float | float) -> Float:
    """Solid angle over projected solid angle of a cap that faces the surface: 2 / (1 + cos alpha)."""
    return np.asarray(2 / (1 + np.sqrt(np.maximum(1 - np.asarray(sine_squared), 0))), np.float32)

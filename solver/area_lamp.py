"""Area lamps: a parallelogram or an ellipse that shines from one side, with Cycles' spread."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import cap
from .lamp_checks import put, spectrum, vector, within
from .lights import LightSample, aimed, dot
from .panel_draw import PanelDraw
from .polygon import polygon_form_factor
from .sampling import combined

Float = NDArray[np.floating[Any]]

# Corners of the polygon of equal area that stands for an ellipse in the closed form, between so many of its longer
# radii. With 64 the outline strays by 1.2e-3 of the radius, inward and outward in turn, which only points within a
# tenth of the radius of the rim can tell; 16 from four radii on are good to 1e-5 of the irradiance, and 8
# from 16 on to 2e-5.
ELLIPSE_CORNERS = ((0.0, 4.0, 64), (4.0, 16.0, 16), (16.0, np.inf, 8))
# Half of the narrowest spread, radians: a beam (spread 0) is as wide as this, where float32 still tells its angles.
NARROWEST_SPREAD = 1e-3


@dataclass(frozen=True, eq=False)
class Area:
    """A flat lamp that shines from one side, the one that axis_u x axis_v points to.

    Parameters
    ----------
    name : for messages.
    centre : (3,) float64, metres.
    axis_u, axis_v : (3,) metres, along the two sides and as long as they are; the diameters of an ellipse.
    flux : (3,) W that leave it.
    round : an ellipse, not a parallelogram.
    spread : full angle, radians, 0 to pi, beyond which nothing leaves (a grid of slats; Cycles' model): radiance goes
        as 1 - tan(angle) / tan(spread / 2), normalised so that the flux stays.
    """

    name: str
    centre: Float
    axis_u: Float
    axis_v: Float
    flux: Float
    round: bool = False
    spread: float = np.pi

    def __post_init__(self) -> None:
        put(self, **{word: vector(self.name, word, getattr(self, word)) for word in ("centre", "axis_u", "axis_v")})
        put(self, flux=spectrum(self.name, "power", self.flux))
        put(self, spread=within(self.name, "spread", self.spread, 0.0, np.pi))

    @property
    def area(self) -> float:
        """Square metres."""
        rectangle = float(np.linalg.norm(np.cross(self.axis_u, self.axis_v)))
        return rectangle * np.pi / 4 if self.round else rectangle

    @property
    def normal(self) -> Float:
        """(3,) float64 unit: where the light leaves; zero if the lamp has no area."""
        cross = np.cross(self.axis_u, self.axis_v)
        return np.asarray(cross / max(float(np.linalg.norm(cross)), float(np.finfo(np.float64).tiny)))

    @property
    def colour(self) -> Float:
        """(3,) float32: flux / pi."""
        return np.asarray(self.flux / np.float32(np.pi)) if self.area > 0 else np.zeros(3, np.float32)

    def power(self) -> Float:
        """(3,) float32: flux that leaves the lamp, W; 0 if it has no area."""
        return self.flux if self.area > 0 else np.zeros(3, np.float32)

    def outline(self, corners: int) -> Float:
        """(corners, 3) float64, counter-clockwise seen from the side that shines; an ellipse's has its area."""
        if not self.round:
            across = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) / 2
        else:
            step = 2 * np.pi / corners
            radius = np.sqrt(step / np.sin(step)) / 2
            angle = step * np.arange(corners)
            across = radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        return np.asarray(self.centre + across @ np.stack([self.axis_u, self.axis_v]))

    def irradiance(self, points: Float, normals: Float) -> Float | None:
        """Unoccluded irradiance (n, 3) float32, W/m2; None with a spread below pi, which has no closed form."""
        if self.spread < np.pi:
            return None
        if self.area == 0:
            return np.zeros((len(points), 3), np.float32)
        factor = self._ellipse_factor(points, normals) if self.round else polygon_form_factor(
            points, normals, self.outline(4))
        return np.asarray(factor[:, None] * (self.flux / np.float32(self.area)), np.float32)

    def _ellipse_factor(self, points: Float, normals: Float) -> Float:
        away = points - self.centre.astype(np.float32)
        radii = np.sqrt(dot(away, away)) * (2 / max(np.linalg.norm(self.axis_u), np.linalg.norm(self.axis_v)))
        factor = np.zeros(len(points), np.float32)
        for low, high, corners in ELLIPSE_CORNERS:
            some = np.flatnonzero((radii >= low) & (radii < high))
            if len(some):
                factor[some] = polygon_form_factor(points[some], normals[some], self.outline(corners))
        return factor

    def sample(self, points: Float, normals: Float, uv: Float) -> LightSample:
        """Points spread over the lamp, or over the part of its plane that the spread lets a receiver see."""
        if self.spread == np.pi and self.area > 0:
            corner = self.centre - (self.axis_u + self.axis_v) / 2
            draw = PanelDraw(corner[None], self.axis_u[None], self.axis_v[None], np.ones(1, bool), ellipses=self.round)
            near, scale = draw.targets(points, np.zeros(len(points), np.intp), uv[:, 0], uv[:, 1])
            return aimed(points, normals, near, self.normal.astype(np.float32), False, scale)
        across = np.stack(cap.disc(uv), axis=1) / 2 if self.round else uv - np.float32(0.5)
        axes = np.stack([self.axis_u, self.axis_v]).astype(np.float32)
        target = self.centre.astype(np.float32) + combined(across, axes)
        if self.area == 0:
            return aimed(points, normals, target, self.normal.astype(np.float32), two_sided=False)
        target, scale = self._narrowed(points, uv, target)
        rays = aimed(points, normals, target, self.normal.astype(np.float32), two_sided=False)
        return LightSample(rays.direction, rays.distance,
                           np.asarray(rays.weight * scale * self._slats(rays.direction), np.float32))

    @property
    def _tangent(self) -> float:
        return float(np.tan(max(self.spread / 2, NARROWEST_SPREAD)))

    @property
    def _slat_norm(self) -> float:
        half = max(self.spread / 2, NARROWEST_SPREAD)
        # Two terms of its series below .05 rad, where the difference of tangent and angle loses its digits.
        return 1 / (self._tangent - half) if half > 0.05 else 3 / half**3 * (1 - 0.4 * half**2)

    @property
    def gathering(self) -> float:
        """The highest radiance, straight ahead, over the mean radiance flux / (pi area)."""
        return 1.0 if self.spread == np.pi else self._tangent * self._slat_norm

    def _slats(self, towards_lamp: Float) -> Float:
        """Radiance in each direction over the mean radiance flux / (pi area)."""
        normal = self.normal.astype(np.float32)
        cosine = -dot(towards_lamp, normal)
        # Not from 1 - cosine^2, which has no digits left on narrow beams.
        across = towards_lamp + cosine[:, None] * normal
        tangent = np.sqrt(dot(across, across)) / np.maximum(cosine, np.float32(1e-6))
        return np.asarray(np.maximum((self._tangent - tangent) * self._slat_norm, 0))

    def _narrowed(self, points: Float, uv: Float, target: Float) -> tuple[Float, Float]:
        """Targets on the part of the lamp about the circle of its plane that the spread lets each point see, cut along
        the lamp's axes, where that is smaller than the lamp; and that part over the lamp's area (0 off the lamp)."""
        normal = self.normal.astype(np.float32)
        height = dot(points - self.centre.astype(np.float32), normal)
        reach = np.maximum(height, 0) * np.float32(self._tangent)
        axes = np.stack([self.axis_u, self.axis_v])
        dual = np.linalg.pinv(axes).astype(np.float32)
        centre = self.centre.astype(np.float32)
        middle = combined(points - height[:, None] * normal - centre, dual)
        half = reach[:, None] * np.linalg.norm(dual, axis=0)
        low, high = np.clip(middle - half, -0.5, 0.5), np.clip(middle + half, -0.5, 0.5)
        across = low + (high - low) * uv
        on_lamp = (across**2).sum(axis=1) <= 0.25 if self.round else np.ones(len(points), bool)
        part = (high - low).prod(axis=1) * np.float32(4 / np.pi if self.round else 1)
        narrow = part < 1
        return (np.where(narrow[:, None], centre + combined(across, axes.astype(np.float32)), target),
                np.asarray(np.where(narrow, np.where(on_lamp, part, 0), 1), np.float32))

    def translated(self, offset: Float) -> Area:
        """The same lamp, moved by (3,) metres."""
        return replace(self, centre=self.centre + offset)

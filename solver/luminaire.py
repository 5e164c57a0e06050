"""Lamps whose light depends on the direction (IES profiles and other patterns), or falls off in a way of its own."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from .area_lamp import Area
from .errors import SceneError
from .lamp_checks import put
from .lamp_of import LampOf
from .lamps import Point
from .lights import LightSample, dot
from .spot import Spot

Float = NDArray[np.floating[Any]]
Fade = Literal["quadratic", "linear", "constant"]

# Directions of the flux.
FLUX_DIRECTIONS = 4096
# By which power of the distance light falls more slowly than by its square.
SLOWER = {"quadratic": 0, "linear": 1, "constant": 2}


@dataclass(frozen=True, eq=False)
class Falloff:
    """How light falls off with the distance d: Cycles' Light Falloff node.

    Parameters
    ----------
    fade : as 1 / d^2, as light does; as 1 / d; or not at all.
    smooth : m2; times d^2 / (smooth + d^2), so that near surfaces are not too bright.
    """

    fade: Fade = "quadratic"
    smooth: float = 0.0

    def factor(self, distance: Float) -> Float:
        """What is multiplied with the falloff of real light: (n,) from metres (n,)."""
        squared = np.square(distance)
        damped = squared / np.maximum(self.smooth + squared, np.float32(1e-30)) if self.smooth > 0 else 1.0
        return np.asarray(distance ** SLOWER[self.fade] * damped)


# As real light falls off.
NATURAL = Falloff()


@dataclass(frozen=True, eq=False)
class Luminaire(LampOf):
    """A point, spot or area lamp times a pattern of directions and a falloff.

    Parameters
    ----------
    lamp : what shines.
    pattern : (h, w) factors from 0 by direction away from the lamp, laid out as `scene.Sky` lays out its map, in the
        lamp's own axes; None: 1 everywhere. An area lamp has none.
    frame : (3, 3) whose columns are the lamp's axes, scale included. As in Cycles, a direction d of the world is
        frame^T d in the pattern.
    falloff : with distance.
    """

    lamp: Point | Spot | Area
    pattern: Float | None = None
    frame: Float = field(default_factory=lambda: np.eye(3))
    falloff: Falloff = NATURAL

    def __post_init__(self) -> None:
        put(self, frame=np.array(self.frame, np.float64))
        if self.frame.shape != (3, 3) or not np.isfinite(self.frame).all():
            raise SceneError(f"lamp {self.name!r}: its axes {self.frame.tolist()} must be (3, 3), finite")
        if self.pattern is not None:
            pattern = np.array(self.pattern, np.float32)
            if pattern.ndim != 2 or not np.isfinite(pattern).all() or pattern.min() < 0:
                raise SceneError(f"lamp {self.name!r}: its pattern {pattern.shape} must be (h, w), finite, from 0")
            if isinstance(self.lamp, Area):
                raise SceneError(f"lamp {self.name!r}: an area lamp has no pattern of directions")
            put(self, pattern=pattern)

    @property
    def is_dimmed(self) -> bool:
        """Whether it gives nowhere more than the lamp alone would."""
        return self.falloff.fade == "quadratic" and (self.pattern is None or float(self.pattern.max()) <= 1)

    def power(self) -> Float:
        """(3,) float32: flux that leaves the lamp, W, as what it gives at a distance of 1 m would tell."""
        fade = float(self.falloff.factor(np.ones(1))[0])
        if self.pattern is None or isinstance(self.lamp, Area):
            return np.asarray(self.lamp.power() * np.float32(fade))
        z = 1 - (2 * np.arange(FLUX_DIRECTIONS) + 1) / FLUX_DIRECTIONS
        angle = np.arange(FLUX_DIRECTIONS) * np.pi * (3 - np.sqrt(5))
        away = np.stack([np.sqrt(1 - z * z) * np.cos(angle), np.sqrt(1 - z * z) * np.sin(angle), z], axis=1)
        factor = self._pattern_at(away.astype(np.float32))
        if isinstance(self.lamp, Spot):
            factor = factor * self.lamp.attenuation(-away.astype(np.float32))
        return np.asarray(self.lamp.flux * np.float32(factor.mean() * fade))

    def irradiance(self, points: Float, normals: Float) -> Float | None:
        """None: a steep pattern says little in the few places of a lumel at which closed forms are asked for (measured:
        2 to 4 % of noise on lumels of 12 cm, 2 m below the lamp), whereas its shadow rays go everywhere in it.
        """
        return None

    def sample(self, points: Float, normals: Float, uv: Float) -> LightSample:
        """The lamp's, each weight times pattern and falloff."""
        rays = self.lamp.sample(points, normals, uv)
        return replace(rays, weight=np.asarray(rays.weight * self._factor(points, rays), np.float32))

    def translated(self, offset: Float) -> Luminaire:
        """The same lamp, moved by (3,) metres."""
        return replace(self, lamp=self.lamp.translated(offset))

    def _factor(self, points: Float, rays: LightSample) -> Float:
        factor = self.falloff.factor(rays.distance)
        # By the shadow ray, on spheres too, as in Cycles.
        return factor if self.pattern is None else np.asarray(factor * self._pattern_at(-rays.direction))

    def _pattern_at(self, away: Float) -> Float:
        """The pattern in unit directions of the world (n, 3): (n,) float32, bilinear."""
        assert self.pattern is not None
        local = away @ self.frame.astype(np.float32)
        local = local / np.maximum(np.sqrt(dot(local, local)), np.float32(1e-30))[:, None]
        height, width = self.pattern.shape
        x = (0.5 - np.arctan2(local[:, 1], local[:, 0]) / np.float32(2 * np.pi)) * width - np.float32(0.5)
        y = (1 - np.arccos(np.clip(local[:, 2], -1, 1)) / np.float32(np.pi)) * height - np.float32(0.5)
        left, low = np.floor(x).astype(np.int64), np.floor(y).astype(np.int64)
        part_x, part_y = x - left, y - low
        left, right = left % width, (left + 1) % width
        low, high = np.clip(low, 0, height - 1), np.clip(low + 1, 0, height - 1)
        bottom = self.pattern[low, left] * (1 - part_x) + self.pattern[low, right] * part_x
        top = self.pattern[high, left] * (1 - part_x) + self.pattern[high, right] * part_x
        return np.asarray(bottom * (1 - part_y) + top * part_y, np.float32)

"""A lamp whose light nothing stops."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .lights import Light, LightSample

Float = NDArray[np.floating[Any]]


@dataclass(frozen=True, eq=False)
class Shadowless:
    """A lamp that casts no shadows: its shadow rays have no length, so that nothing can be in their way.

    Parameters
    ----------
    lamp : what shines.
    """

    lamp: Light

    @property
    def name(self) -> str:
        """The lamp's."""
        return self.lamp.name

    @property
    def colour(self) -> Float:
        """The lamp's."""
        return self.lamp.colour

    def power(self) -> Float:
        """The lamp's."""
        return self.lamp.power()

    def irradiance(self, points: Float, normals: Float) -> Float | None:
        """The lamp's."""
        return self.lamp.irradiance(points, normals)

    def sample(self, points: Float, normals: Float, uv: Float) -> LightSample:
        """The lamp's, of length 0."""
        rays = self.lamp.sample(points, normals, uv)
        return replace(rays, distance=np.zeros_like(rays.distance))

    def translated(self, offset: Float) -> Shadowless:
        """The same lamp, moved by (3,) metres."""
        return Shadowless(self.lamp.translated(offset))

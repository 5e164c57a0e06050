"""Pictures of the sky: the whole of it as an equirectangular map, or a close look through a square window."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from .sampling import frames

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]


@dataclass(frozen=True, eq=False)
class Texels:
    """Some texels of a picture: direction (k, 3) unit, sides across and along (k, 3), solid angle (k,) sr."""

    direction: Float
    across: Float
    along: Float
    solid_angle: Float


class Picture(Protocol):
    """Radiance by direction: `radiance` (h, w, 3), W / (m2 sr)."""

    radiance: Float

    def texels(self, row: Int, column: Int) -> Texels:
        """Where texels look."""
        ...


class SkyMap:
    """The whole sky, laid out as `scene.Sky` says.

    Parameters
    ----------
    radiance : (h, w, 3) W / (m2 sr).
    """

    def __init__(self, radiance: Float) -> None:
        self.radiance = np.asarray(radiance, np.float64)
        self.height, self.width = self.radiance.shape[:2]

    @property
    def texel_angle(self) -> float:
        """The longer side of a texel at the horizon, radians."""
        return max(np.pi / self.height, 2 * np.pi / self.width)

    def solid_angle(self) -> Float:
        """(h, 1) sr of the texels of each row."""
        edge = np.cos(np.pi * np.arange(self.height + 1) / self.height)
        return np.asarray((edge[:-1] - edge[1:])[:, None] * (2 * np.pi / self.width))

    def texels(self, row: Int, column: Int) -> Texels:
        """See Picture."""
        polar = np.pi * (1 - (row + 0.5) / self.height)
        azimuth = 2 * np.pi * (0.5 - (column + 0.5) / self.width)
        sine, zero = np.sin(polar), np.zeros(len(row))
        direction = np.stack([sine * np.cos(azimuth), sine * np.sin(azimuth), np.cos(polar)], axis=1)
        # Azimuth falls as the column grows, the polar angle as the row grows.
        across = np.stack([np.sin(azimuth), -np.cos(azimuth), zero], axis=1)
        along = np.stack([-np.cos(polar) * np.cos(azimuth), -np.cos(polar) * np.sin(azimuth), sine], axis=1)
        return Texels(direction, across * (2 * np.pi / self.width * sine)[:, None], along * (np.pi / self.height),
                      self.solid_angle()[row, 0])

    def place(self, direction: Float) -> tuple[Int, Int]:
        """Row and column of the texels that directions (k, 3) lie in."""
        azimuth = np.arctan2(direction[:, 1], direction[:, 0])
        polar = np.arccos(np.clip(direction[:, 2], -1, 1))
        row = np.minimum(((1 - polar / np.pi) * self.height).astype(np.int64), self.height - 1)
        return row, ((0.5 - azimuth / (2 * np.pi)) * self.width).astype(np.int64) % self.width


class Window:
    """A close look through a square window in the plane at distance 1.

    Parameters
    ----------
    axis, right, up : (3,) unit, at right angles: the window's middle, and where columns and rows grow to.
    half : half of the window's side, in the plane: the tangent of half of its angle.
    radiance : (h, w, 3) W / (m2 sr), row 0 at the bottom.
    """

    def __init__(self, axis: Float, right: Float, up: Float, half: float, radiance: Float) -> None:
        self.axis, self.right, self.up = (np.asarray(x, np.float64) for x in (axis, right, up))
        self.half = half
        self.radiance = np.asarray(radiance, np.float64)
        self.height, self.width = self.radiance.shape[:2]

    @staticmethod
    def sides(axis: Float) -> tuple[Float, Float]:
        """A right and an up for an axis, right x up = -axis (as a camera's)."""
        first, second = frames(np.asarray(axis, np.float64)[None])
        return first[0], -second[0]

    def texels(self, row: Int, column: Int) -> Texels:
        """See Picture."""
        x = self.half * (2 * (column + 0.5) / self.width - 1)
        y = self.half * (2 * (row + 0.5) / self.height - 1)
        towards = self.axis + x[:, None] * self.right + y[:, None] * self.up
        length = np.sqrt(1 + x * x + y * y)
        step_x, step_y = 2 * self.half / self.width, 2 * self.half / self.height
        scale = 1 / length[:, None]
        return Texels(towards * scale, self.right * step_x * scale, self.up * step_y * scale,
                      step_x * step_y / length**3)

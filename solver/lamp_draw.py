"""One of many lamps at random, for each point of a path: by what lamps could give where the point lies, or by power."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .blocks import Blocks
from .geometry import Geometry
from .light_bounds import LightBounds
from .lights import Light
from .linking import Reach

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]

# Boxes that space is cut into, along its longest side, and times lamps.
MOST_BOXES, MOST_ENTRIES = 24, 2**22
# Part of the draws that goes by power alone, so that no lamp is ever without a chance.
BY_POWER = 0.1
# A block's spread that any way of facing is within.
ANY_WAY = 2.0


class LampDraw:
    """Draws lamps.

    Parameters
    ----------
    lights : about the scene's origin.
    geometry : whose bounding box is cut into cubes; each has chances of its own.
    reach : which lamps reach which kind of surface; each kind has chances of its own too.
    """

    def __init__(self, lights: Sequence[Light], geometry: Geometry, reach: Reach) -> None:
        corners = geometry.corners.reshape(-1, 3)
        self._low = corners.min(axis=0) if len(corners) else np.zeros(3, np.float32)
        extent = np.maximum(np.ptp(corners, axis=0) if len(corners) else np.ones(3), 1e-20)
        # By kind, box and lamp.
        reached = reach.lamps.T[:, None]
        power = _shares(np.array([brightness(light, geometry) for light in lights]) * reached, 1 / max(len(lights), 1))
        number = MOST_BOXES
        while number > 1 and np.ceil(extent / extent.max() * number).prod() * reached.size > MOST_ENTRIES:
            number -= 1
        self._edge = float(extent.max()) * (1 + 1e-6) / number
        self._shape = np.maximum(np.ceil(extent / self._edge), 1).astype(np.int64)
        given = LightBounds.of(lights).of_all(self._boxes())[0].astype(np.float64)
        chance = (1 - BY_POWER) * _shares(given * reached, power) + BY_POWER * power
        self._chance = chance.reshape(-1, len(lights))
        limit = np.cumsum(self._chance, axis=1)
        limit /= limit[:, -1:]
        self._limit = (limit + np.arange(len(limit))[:, None]).reshape(-1)

    def _boxes(self) -> Blocks:
        place = np.stack(np.unravel_index(np.arange(self._shape.prod()), self._shape), axis=1)
        centre = self._low + (place + 0.5) * self._edge
        count = len(centre)
        return Blocks(np.arange(count), np.arange(count + 1), np.asarray(centre, np.float32),
                      np.full(count, self._edge * np.sqrt(0.75), np.float32), np.zeros((count, 3), np.float32),
                      np.full(count, ANY_WAY, np.float32), np.zeros(count, np.int64))

    def draw(self, points: Float, kind: Int, number: Float) -> tuple[Int, Float]:
        """A lamp for each point on a kind of surface (n,), from random numbers in [0, 1) (n,), and the probability that
        it was drawn with."""
        place = np.clip(((points - self._low) / self._edge).astype(np.int64), 0, self._shape - 1)
        box = np.ravel_multi_index(tuple(place.T), tuple(self._shape)) + kind * self._shape.prod()
        lamps = self._chance.shape[1]
        lamp = np.searchsorted(self._limit, box + number.astype(np.float64), side="right") - box * lamps
        lamp = np.clip(lamp, 0, lamps - 1)
        return lamp, self._chance[box, lamp]


def _shares(values: Float, otherwise: Float | float) -> Float:
    """Parts of the sum along the last axis; where that is 0, something else."""
    total = values.sum(axis=-1, keepdims=True)
    return np.where(total > 0, values / np.where(total > 0, total, 1), otherwise)


def brightness(light: Light, geometry: Geometry) -> float:
    """A lamp's power for drawing one of many; a sun counts with what it sends through the scene's middle section."""
    power = float(np.mean(light.power()))
    if np.isfinite(power):
        return power
    extent = np.ptp(geometry.corners.reshape(-1, 3), axis=0) if len(geometry.corners) else np.ones(3)
    return float(np.mean(light.colour)) * float(np.pi * (extent**2).sum() / 4)

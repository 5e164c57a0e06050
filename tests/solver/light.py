"""Light that tests ask for at points, many times over, and means of it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from radiosity.solver import Scene, Settings, irradiance
from radiosity.tests.solver.rooms import Shape

Place = tuple[Sequence[float], Sequence[float]]

# How many times a point is asked for, and how many triangles of a sphere are.
TIMES = 24
SOME = 96


def at(scene: Scene, error: float, places: Sequence[Place], **more: Any) -> np.ndarray:
    """(TIMES, n): the first channel of the irradiance at (point, normal) pairs."""
    points, normals = (np.tile(np.array(each, float), (TIMES, 1)) for each in zip(*places, strict=True))
    return irradiance(scene, Settings(error=error, **more), points, normals)[:, 0].reshape(TIMES, -1)


def over(ball: Shape, scene: Scene, error: float, **more: Any) -> np.ndarray:
    """(SOME, 1): the same at the middles of SOME of the triangles of a sphere or bowl."""
    rows = np.linspace(0, len(ball.area) - 1, SOME).astype(int)
    return irradiance(scene, Settings(error=error, **more), ball.middle[rows], ball.normal[rows])[:, :1]


def mean(values: np.ndarray, some: Shape) -> float:
    """Area-weighted mean of a value a triangle (t, 3) over a shape's triangles, the first of them."""
    return float(np.average(values[:len(some.area), 0], weights=some.area))

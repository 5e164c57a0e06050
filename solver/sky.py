"""The light that comes from where no surface is."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .scene import Sky

Float = NDArray[np.floating[Any]]


def radiance(sky: Sky, directions: Float) -> Float:
    """Radiance from unit directions (n, 3): (n, 3) float32, W / (m2 sr). Nearest texel of the map."""
    if sky.radiance.ndim == 1:
        return np.broadcast_to(sky.radiance, directions.shape)
    height, width = sky.radiance.shape[:2]
    azimuth = np.arctan2(directions[:, 1], directions[:, 0])
    column = ((0.5 - azimuth / np.float32(2 * np.pi)) * width).astype(np.int32) % width
    polar = np.arccos(np.clip(directions[:, 2], -1.0, 1.0))
    row = np.minimum(((1.0 - polar / np.float32(np.pi)) * height).astype(np.int32), height - 1)
    return sky.radiance.reshape(-1, 3)[row * width + column]

"""Where the light goes: what is emitted is absorbed or escapes. What is missing says how good the form factors are."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .cells import NOTHING
from .sampling import kronecker
from .transport import Transport

Float = NDArray[np.floating[Any]]

# Points of a cell whose mean opacity counts; leaves are solid in the middle, so the middle alone would not do.
OPACITY_SAMPLES = 16


@dataclass(frozen=True)
class EnergyBalance:
    """Flux in watts, the mean of the three channels, over all surfaces that light reaches from the receivers' side.

    emitted : what lamps and sky send onto these surfaces, and what the surfaces emit themselves.
    absorbed : what the surfaces keep.
    escaped : what leaves them towards the sky.
    imbalance : 1 - (absorbed + escaped) / emitted.
    """

    emitted: float
    absorbed: float
    escaped: float

    @property
    def imbalance(self) -> float:
        """The part of what is emitted that is neither absorbed nor escapes."""
        return 1 - (self.absorbed + self.escaped) / self.emitted if self.emitted > 0 else 0.0


def energy_balance(transport: Transport) -> EnergyBalance:
    """Add up the solved patches."""
    area = _solid_area(transport)
    count = len(transport.patches)
    patch = transport.cell_patch
    size = np.bincount(patch, area, count)

    def total(values: Float) -> Float:
        return np.asarray(np.bincount(patch, area * values.mean(axis=1), count), np.float64)

    solved = ~np.isnan(transport.irradiance[:, 0])
    indirect = np.nan_to_num(transport.irradiance)[patch]
    emission = total(transport.met.emission)
    landed = total(transport.met.incident)
    absorbed = total((1 - transport.cell_reflectance) * (transport.met.incident + indirect))
    leaving = total(transport.leaving()[:-1])
    sky = np.zeros(count)
    free = np.zeros(count)
    for rows in transport.rows:
        sky[rows.patch] = rows.mean_sky().mean(axis=1) * size[rows.patch]
        free[rows.patch] = (rows.hits == NOTHING).mean(axis=1)
    part = [float(values[solved].sum()) for values in (emission + landed + sky, absorbed, leaving * free)]
    return EnergyBalance(*part)


def _solid_area(transport: Transport) -> Float:
    """(cells,) m2 of every met side of a cell, less what lets light through: its mean opacity at `OPACITY_SAMPLES`."""
    side = transport.cells.side
    area = np.asarray(transport.cells.area(side))
    scene = transport.geometry.scene
    if (np.asarray(scene.opacity) == 1).all() and (np.asarray(scene.opacity_texture) < 0).all():
        return area
    opacity = np.zeros(len(side), np.float32)
    for x, y in kronecker(OPACITY_SAMPLES, 2):
        triangle, u, v, _ = transport.cells.places(side, np.full(len(side), x), np.full(len(side), y))
        opacity += transport.geometry.opacity(triangle, u, v)
    return area * opacity / OPACITY_SAMPLES

"""Where the light goes: what is emitted is absorbed or escapes. What is missing says how good the form factors are."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .cells import NOTHING, Cells
from .footprints import CellFootprints
from .met_cells import CELL_CLOSED, CELL_SMALL_SHARE
from .parallel import Run, slices
from .receivers import Receivers
from .sampling import kronecker, uniform
from .transport import Transport

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]

# Cells whose opacity is asked for at once.
CHUNK = 2**16

# Places at which direct light is added up, and shadow rays from each to a lamp.
DRAWS, RAYS = 2**15, 8
# Where cells seem dark, places are as dense as if they had this part of the mean light.
LEAST_SHARE = 0.1

# Points of a cell whose mean opacity counts; leaves are solid in the middle, so the middle alone would not do.
OPACITY_SAMPLES = 16


@dataclass(frozen=True)
class EnergyBalance:
    """Flux in watts, the mean of the three channels, over all surfaces that light reaches from the receivers' side, and
    the receivers' own.

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


def energy_balance(transport: Transport, receivers: Receivers, light: Float, seed: int, run: Run) -> EnergyBalance:
    """Add up the solved patches, and of the receivers with their `light` (n, 3) W/m2 those that no surface sees.

    Cells know the direct light of those parts of them that are seen. Here all of their area counts, so direct light is
    asked for anew, at places that are spread evenly over each. Of many cells some are drawn, in proportion to what they
    seem to get.
    """
    met, patch, count = transport.met, transport.cell_patch, len(transport.patches)
    alone = _unseen(transport, receivers, light)
    if not count:
        return EnergyBalance(*alone)
    area = _solid_area(transport)
    solved = ~np.isnan(transport.irradiance[:, 0])
    drawn, weight = _drawn(area * (met.incident.mean(axis=1) + LEAST_SHARE * met.incident.mean()), seed)
    weight = weight * area[drawn]
    places = _Draws(transport.cells, met.cells.side[drawn])
    landing = met.light.apart(places, run, pilot=RAYS, small_share=CELL_SMALL_SHARE, closed=CELL_CLOSED)[:, :3]

    def landed(part: Float | float = 1.0) -> Float:
        return np.asarray(np.bincount(patch[drawn], weight * (landing * part).mean(axis=1), count), np.float64)

    reflectance = met.reflectance[drawn]
    emitted, reflected, kept = transport.sums_of_patches(3, partial(_figures, transport), area)
    leaving = emitted + reflected + landed(reflectance)
    size = np.bincount(patch, area, count)
    sky, free = np.zeros(count), np.zeros(count)
    for rows in transport.rows:
        sky[rows.patch] = rows.mean_sky().mean(axis=1) * size[rows.patch]
        free[rows.patch] = (rows.hits == NOTHING).mean(axis=1)
    absorbed = kept + landed(1 - reflectance)
    part = [float(values[solved].sum()) for values in (emitted + landed() + sky, absorbed, leaving * free)]
    return EnergyBalance(*np.add(part, alone))


def _unseen(transport: Transport, receivers: Receivers, light: Float) -> tuple[float, float, float]:
    """What is emitted at, absorbed at and escapes from those triangles of receiving surfaces of which no front was met,
    but from behind: hardly any surface sees them, so that all that leaves them escapes."""
    geometry, cells = transport.geometry, transport.cells
    side = cells.side[~cells.are_held(cells.side)]
    receiving = np.bincount(geometry.surface[receivers.triangle], minlength=len(geometry.scene.surfaces)) > 0
    unseen = receiving[geometry.surface]
    unseen[cells.triangle_of(side[side & 1 == 1])] = False
    own = np.flatnonzero(unseen[receivers.triangle])
    if not len(own):
        return 0.0, 0.0, 0.0
    triangle, (u, v) = receivers.triangle[own], receivers.barycentric[own].T
    area = geometry.area[triangle] / np.bincount(triangle)[triangle]
    # Those too small for a receiver of their own are like the others.
    area *= geometry.area[unseen].sum() / area.sum() * geometry.opacity(triangle, u, v)
    glow = np.where(transport.met.sampled_emitter[triangle, None], 0, geometry.emission(triangle, u, v))
    reflected = geometry.reflectance(triangle, u, v) * light[own]
    emitted, absorbed, escaped = (float((area * values.mean(axis=1)).sum(dtype=np.float64))
                                  for values in (light[own] + glow, light[own] - reflected, reflected + glow))
    return emitted, absorbed, escaped


def _figures(transport: Transport, part: slice) -> list[Float]:
    """Of some cells, (m,) each, W/m2, mean of the channels: what they emit, and what they reflect and absorb of their
    patches' irradiance."""
    met = transport.met
    indirect = np.nan_to_num(np.take(transport.irradiance, transport.cell_patch[part], axis=0))
    reflected = met.reflectance[part] * indirect
    return [values.mean(axis=1) for values in (met.emission[part], reflected, indirect - reflected)]


def _drawn(share: Float, seed: int) -> tuple[Int, Float]:
    """Cells drawn systematically in proportion to their shares, and for how many cells each stands."""
    running = np.cumsum(share, dtype=np.float64)
    if running[-1] <= 0:
        return np.empty(0, np.int64), np.empty(0)
    place = (np.arange(DRAWS) + uniform(np.zeros(1, np.int64), 0, seed + 71)) / DRAWS * running[-1]
    drawn = np.minimum(np.searchsorted(running, place, side="right"), len(share) - 1)
    return drawn, running[-1] / np.maximum(share[drawn], 1e-30) / DRAWS


class _Draws(CellFootprints):
    """Cells of which some stand there more than once, each time with places of its own."""

    def __init__(self, cells: Cells, sides: NDArray[np.int64]) -> None:
        super().__init__(cells, sides)
        self.identity = np.arange(len(sides), dtype=np.int64)


def _solid_area(transport: Transport) -> Float:
    """(cells,) m2 of every met side of a cell, less what lets light through: its mean opacity at `OPACITY_SAMPLES`."""
    met, cells, geometry = transport.met, transport.cells, transport.geometry
    scene, area = geometry.scene, met.own_area
    solid = (np.asarray(scene.opacity) == 1) & (np.asarray(scene.opacity_texture) < 0)
    thin = np.flatnonzero(~solid[met.spots.triangle])
    for some in (thin[part] for part in slices(len(thin), CHUNK)):
        opacity = np.zeros(len(some), np.float32)
        for x, y in kronecker(OPACITY_SAMPLES, 2):
            triangle, u, v, _ = cells.places(cells.side[some], np.full(len(some), x), np.full(len(some), y))
            opacity += geometry.opacity(triangle, u, v)
        area[some] *= opacity / OPACITY_SAMPLES
    return area

"""Where the light goes: what is emitted is absorbed or escapes. What is missing says how good the form factors are."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .cells import NOTHING
from .footprints import CellFootprints
from .parallel import Run, slices
from .sampling import cosine_directions, kronecker, shifted, shifts, uniform
from .tables import mean_over_rays
from .transport import Transport

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]

# Places at which light is added up, and rays of each (shadow rays to a lamp, and rays that gather).
DRAWS, RAYS = 2**15, 8
CHUNK = 2**17
# Where cells seem dark, places are as dense as if they had this part of the mean light.
LEAST_SHARE = 0.1

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


def energy_balance(transport: Transport, seed: int, run: Run) -> EnergyBalance:
    """Add up what lands on the met cells and leaves them, at points spread evenly over each.

    Cells and patches know the light of those parts of them that are seen. Here all of their area counts, so every term
    is estimated anew: direct light by shadow rays, indirect light by rays that read the solution where they land. Of
    many cells some are drawn, in proportion to what they seem to carry.
    """
    met = transport.met
    if not len(met):
        return EnergyBalance(0.0, 0.0, 0.0)
    carried = (met.incident + met.emission + np.nan_to_num(transport.irradiance)[transport.cell_patch]).mean(axis=1)
    area = _solid_area(transport)
    weight = area * (carried + LEAST_SHARE * np.average(carried, weights=np.maximum(area, 1e-30)))
    running = np.cumsum(weight, dtype=np.float64)
    if running[-1] <= 0:
        return EnergyBalance(0.0, 0.0, 0.0)
    place = (np.arange(DRAWS) + uniform(np.zeros(1, np.int64), 0, seed + 71)) / DRAWS * running[-1]
    drawn = np.minimum(np.searchsorted(running, place, side="right"), len(met) - 1)
    counts = area[drawn] * running[-1] / np.maximum(weight[drawn], 1e-30) / DRAWS
    places = _Flat(transport.cells, met.cells.side[drawn])
    # Each draw is a place of its own, though several may fall into one cell.
    places.identity = np.arange(DRAWS, dtype=np.int64)
    incident = met.light.irradiance(places, run, pilot=RAYS)
    parts = run.map(lambda part: _gathered(transport, places, part, seed), slices(DRAWS, CHUNK // RAYS))
    indirect, sky, free = (np.concatenate([part[index] for part in parts]) for index in range(3))
    reflectance, emission = met.reflectance[drawn], met.emission[drawn]
    leaving = emission + reflectance * (incident + indirect)

    def total(values: Float) -> float:
        return float((counts * values.mean(axis=1)).sum())

    return EnergyBalance(total(emission + incident + sky), total((1 - reflectance) * (incident + indirect)),
                         total(leaving * free[:, None]))


def _gathered(transport: Transport, places: _Flat, part: slice, seed: int) -> tuple[Float, Float, Float]:
    """Indirect irradiance with the sky's (n, 3), the sky's alone (n, 3), and the part of the rays that meet nothing."""
    rows = np.arange(part.start, part.stop)
    points = kronecker(RAYS, 4)
    move = shifts(places.identity[rows], 4, seed + 73)
    x, y, u, v = (shifted(points[:, axis], move[:, axis]).reshape(-1) for axis in range(4))
    start, normals = places.sample(np.repeat(rows, RAYS), x, y)
    met = transport.trace(start, cosine_directions(normals, u[:, None], v[:, None])[:, 0])
    brought = np.take(transport.table(), transport.cells.rows(met.sides), axis=0)
    sky = np.zeros((len(start), 3), np.float32)
    sky[met.missed] = met.sky
    free = (met.sides == NOTHING).reshape(-1, RAYS).mean(axis=1)
    sky = sky.reshape(-1, RAYS, 3).mean(axis=1)
    return mean_over_rays(brought, RAYS) + sky, sky, free


class _Flat(CellFootprints):
    """Cells without their shading normals, which do not keep energy."""

    def sample(self, rows: Int, x: Float, y: Float) -> tuple[Float, Float]:
        """See Footprints."""
        triangle, u, v, front = self.cells.places(self.sides[rows], x, y)
        geometry = self.cells.geometry
        normals = geometry.normal[triangle]
        points = geometry.lifted(geometry.point(triangle, u, v), triangle, front)
        return points, np.where(front[:, None], normals, -normals)


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

"""Small bright places, a sunlit spot on a dim floor, that cosine-distributed rays find too seldom.

Rays are aimed at them too, at cells drawn in proportion to the flux that leaves them, and both kinds of rays are
combined by the balance heuristic (Veach & Guibas 1995): every ray counts its radiance times cosine over the sum of
both densities, N p_cosine + M p_bright.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .cells import NOTHING
from .transport import Transport

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]

# A cell is bright if its radiosity is above this many times the mean of what the receivers' rays meet.
CONTRAST = 3.0
# Bright cells are left to the cosine rays unless they bring at least this part of the light that rays meet.
LEAST_SHARE = 0.05


class BrightCells:
    """The bright sides of cells of a solved Transport.

    Parameters
    ----------
    transport : solved.
    seen : (m,) int32 rows of cells that a fair sample of the receivers' rays met (NOTHING allowed).
    """

    def __init__(self, transport: Transport, seen: Int) -> None:
        radiosity = transport.leaving().mean(axis=1)
        mean = float(radiosity[seen].mean()) if len(seen) else 0.0
        bright = radiosity > CONTRAST * mean
        share = float(radiosity[seen][bright[seen]].sum()) / max(float(radiosity[seen].sum()), 1e-30) if len(seen) else 0.0
        self._density = np.zeros(len(radiosity), np.float32)
        self.cells = np.flatnonzero(bright[:-1]) if share >= LEAST_SHARE else np.empty(0, np.intp)
        if len(self.cells):
            sides = transport.cells.side[self.cells]
            self.cells = self.cells[np.argsort(_along_a_curve(transport, sides), kind="stable")]
            area = transport.cells.area(transport.cells.side[self.cells]).astype(np.float64)
            flux = area * radiosity[self.cells]
            self._running = np.cumsum(flux) / flux.sum()
            self._density[self.cells] = flux / flux.sum() / area

    def __len__(self) -> int:
        return len(self.cells)

    def density_of(self, cell: Int) -> Float:
        """Probability density of aiming at a point of each cell (n,) 1/m2: zero if it is not bright, or met only now."""
        known = np.where(cell < len(self._density) - 1, cell, NOTHING)
        return self._density[known]

    def draw(self, place: Float) -> NDArray[np.int32]:
        """Rows of cells for numbers in [0, 1), in proportion to flux; near numbers draw near cells."""
        chosen = np.searchsorted(self._running, place, side="right")
        return self.cells[np.minimum(chosen, len(self.cells) - 1)].astype(np.int32)


def _along_a_curve(transport: Transport, sides: NDArray[np.int64]) -> NDArray[np.int64]:
    """A Morton code (10 bits an axis) of each side's middle: near codes are near in space."""
    third = np.full(len(sides), 1 / 3, np.float32)
    triangle, u, v, _ = transport.cells.places(sides, third, third)
    points = transport.geometry.point(triangle, u, v)
    low = points.min(axis=0)
    scale = 1023 / max(float(np.ptp(points, axis=0).max()), 1e-30)
    steps = ((points - low) * np.float32(scale)).astype(np.int64)
    code = np.zeros(len(sides), np.int64)
    for bit in range(10):
        for axis in range(3):
            code |= ((steps[:, axis] >> bit) & 1) << (3 * bit + axis)
    return code

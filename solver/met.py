"""What rays met, before anybody asks for its light."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .cells import NOTHING, Cells
from .seen import Seen
from .visibility import Hits

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]


@dataclass(frozen=True, eq=False)
class Met:
    """What rays met: sides of cells (n,), NOTHING for the sky; the rays that met the sky (m,), and the irradiance that
    each of those stands for (m, 3) W/m2 (none under a black sky)."""

    hits: Hits
    sides: NDArray[np.int64]
    missed: Int
    sky: Float

    def fresh(self, cells: Cells) -> Seen:
        """Where cells that have no row yet were met: a few points of each."""
        return self.at(np.flatnonzero(cells.are_new(self.sides)))

    def at(self, rays: Int) -> Seen:
        """Where some of the rays met cells: a few points of each."""
        return Seen(self.sides[rays], self.hits.u[rays], self.hits.v[rays]).few()

    def where_above(self, directions: Float, normals: Float) -> Met:
        """Without what came from under the surfaces (n, 3) that rays started on: a shading normal may lead there."""
        below = np.einsum("ij,ij->i", directions, normals) <= 0
        if not below.any():
            return self
        kept = ~below[self.missed]
        return Met(self.hits, np.where(below, NOTHING, self.sides), self.missed[kept], self.sky[kept])

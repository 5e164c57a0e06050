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
    """What rays met: sides of cells (n,), NOTHING for the sky, and the rows that these had then (n,), NOTHING for none;
    the rays that met the sky (m,), and the irradiance that each of those stands for (m, 3) W/m2 (none under a black
    sky)."""

    hits: Hits
    sides: NDArray[np.int64]
    known: NDArray[np.int32]
    missed: Int
    sky: Float

    def fresh(self, directions: Float, normal: Float) -> Seen:
        """Where cells that had no row were met: a few points of each.

        Parameters
        ----------
        directions : (n, 3) of the rays.
        normal : (t, 3) of the triangles.
        """
        rays = self._unknown()
        cosine = np.einsum("ij,ij->i", directions[rays], np.take(normal, self.hits.triangle[rays], axis=0))
        return self._seen(rays, self.hits.distance[rays] * np.abs(cosine))

    def rows(self, cells: Cells) -> NDArray[np.int32]:
        """The rows that the cells have by now."""
        unknown = self._unknown()
        if not len(unknown):
            return self.known
        rows = self.known.copy()
        rows[unknown] = cells.rows(self.sides[unknown])
        return rows

    def _unknown(self) -> Int:
        without = np.flatnonzero(self.known == NOTHING)
        return np.asarray(without[self.sides[without] != NOTHING])

    def at(self, rays: Int) -> Seen:
        """Where some of the rays met cells: a few points of each."""
        return self._seen(rays, np.full(len(rays), np.inf, np.float32))

    def _seen(self, rays: Int, height: Float) -> Seen:
        return Seen(self.sides[rays], self.hits.u[rays], self.hits.v[rays], height).few()

    def where_above(self, directions: Float, normals: Float) -> Met:
        """Without what came from under the surfaces (n, 3) that rays started on: a shading normal may lead there."""
        below = np.einsum("ij,ij->i", directions, normals) <= 0
        if not below.any():
            return self
        kept = ~below[self.missed]
        sides, known = (np.where(below, NOTHING, of_cells) for of_cells in (self.sides, self.known))
        return Met(self.hits, sides, known, self.missed[kept], self.sky[kept])

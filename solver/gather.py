"""Final gather: the indirect and sky light of any list of footprints, from what cells and patches send back.

    E_indirect = mean over cosine-distributed rays of  rho(hit) (E_direct(hit) + H_patch(hit)) + emission(hit)

Rays that meet something nearer than a patch is wide would see the patch's mean where its detail matters (contact
shadows): they go one bounce further before they ask a patch.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .footprints import Footprints
from .parallel import Run, slices
from .sampling import cosine_directions, kronecker, shifted, shifts
from .transport import Transport

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]

CHUNK_RAYS = 2**17
# Rays between two looks at what cells are new.
PASS_RAYS = 2**22
# Hits nearer than this many patch sizes go one bounce further.
NEAR_PATCHES = 1.0
# Rays of a patch that was met only now.
LATE_RAYS = 64


class Gather:
    """Gathers light from a solved Transport.

    Parameters
    ----------
    transport : cells, patches, rows, solved.
    rays : of each footprint.
    seed : of the shifts.
    """

    def __init__(self, transport: Transport, rays: int, seed: int) -> None:
        self.transport, self.count, self.seed = transport, rays, seed
        # Direction (0, 1), footprint (2, 3), direction of the second bounce (4, 5).
        self._points = kronecker(rays, 6)
        self._near = np.float32(NEAR_PATCHES * transport.patches.size)

    def light(self, places: Footprints, run: Run) -> tuple[Float, Float]:
        """Irradiance from sky and gathered emitters, and from light that surfaces reflect: (n, 3) float32, W/m2."""
        first, bounced = [], []
        passes = slices(len(places), max(1, PASS_RAYS // self.count))
        for number, part in enumerate(passes):
            rows = np.arange(part.start, part.stop)
            pieces = run.map(lambda piece, rows=rows: self._trace(places, rows[piece]),  # type: ignore[misc]
                             slices(len(rows), max(1, CHUNK_RAYS // self.count)))
            self.transport.meet(np.concatenate([side for piece in pieces for side in (piece[0], piece[3])]))
            self.transport.late(LATE_RAYS)
            self.transport.leaving()
            results = run.map(self._collect, pieces)
            first += [piece[1] + result[0] for piece, result in zip(pieces, results, strict=True)]
            bounced += [result[1] for result in results]
            run.report((number + 1) / len(passes))
        return np.concatenate(first), np.concatenate(bounced)

    def meet(self, places: Footprints, rows: Int, run: Run) -> None:
        """Let the rays of some footprints find cells, without asking for light."""
        pieces = run.map(lambda piece: self._trace(places, rows[piece]),
                         slices(len(rows), max(1, CHUNK_RAYS // self.count)))
        self.transport.meet(np.concatenate([side for piece in pieces for side in (piece[0], piece[3])]))

    def _trace(self, places: Footprints, rows: Int) -> tuple[Any, ...]:
        """Sides met (n * rays), the sky's irradiance (n, 3), and the second bounces: which rays, sides, sky."""
        transport = self.transport
        move = shifts(places.identity[rows], 6, self.seed)
        points = [shifted(self._points[:, axis], move[:, axis]).reshape(-1) for axis in range(6)]
        origins, normals = places.sample(np.repeat(rows, self.count), points[2], points[3])
        directions = cosine_directions(normals, points[0][:, None], points[1][:, None])[:, 0]
        hits, sides, sky = transport.trace(origins, directions)
        near = np.flatnonzero((sides >= 0) & (hits.distance < self._near))
        geometry = transport.geometry
        triangle, front = hits.triangle[near], hits.front[near]
        start = geometry.lifted(geometry.point(triangle, hits.u[near], hits.v[near]), triangle, front)
        normal = geometry.normal[triangle]
        normal = np.where(front[:, None], normal, -normal)
        again = cosine_directions(normal, points[4][near, None], points[5][near, None])[:, 0]
        _, next_sides, next_sky = transport.trace(start, again)
        mean_sky = np.float32(np.pi) * sky.reshape(-1, self.count, 3).mean(axis=1)
        return sides, mean_sky, near, next_sides, np.float32(np.pi) * next_sky

    def _collect(self, piece: tuple[Any, ...]) -> tuple[Float, Float]:
        """Mean emission, and mean reflected radiosity, of what the rays met: (n, 3) each."""
        sides, _, near, next_sides, next_sky = piece
        transport = self.transport
        table, emission = transport.leaving(), transport.emission()
        rows = transport.cells.rows(sides)
        value = np.take(table, rows, axis=0)
        if len(near):
            cell = rows[near]
            incoming = np.take(table, transport.cells.rows(next_sides), axis=0) + next_sky
            value[near] = transport.cell_direct[cell] + transport.cell_reflectance[cell] * incoming
        everything = value.reshape(-1, self.count, 3).mean(axis=1)
        if emission is None:
            return np.zeros_like(everything), everything
        emitted = np.take(emission, rows, axis=0).reshape(-1, self.count, 3).mean(axis=1)
        return emitted, everything - emitted

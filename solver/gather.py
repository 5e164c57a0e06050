"""Final gather: the indirect and sky light of any list of footprints, from what cells and patches send back.

    E_indirect = mean over cosine-distributed rays of  rho(hit) (E_direct(hit) + H_patch(hit)) + emission(hit)

Where we leave the textbook:
1. A ray that meets something nearer than its patch is wide would see the patch's mean where its detail matters
   (contact shadows, the gap behind a board): it goes on, bounce by bounce, until it asks a patch from afar.
2. Rays are aimed at small bright places too (`bright.py`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .bright import BrightCells
from .cells import NOTHING
from .footprints import CellFootprints, Footprints
from .parallel import Run, slices
from .sampling import cosine_directions, kronecker, shifted, shifts
from .transport import Transport
from .visibility import SHORTEN, Hits

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]

CHUNK_RAYS = 2**17
# Rays between two looks at what cells are new.
PASS_RAYS = 2**22
# Rays that meet a patch nearer than this many edges of its box go on, this often at most.
NEAR_PATCHES = 1.0
MOST_BOUNCES = 8
# Rays of a patch that was met only now.
LATE_RAYS = 64


@dataclass
class _Rays:
    """The rays of a run of footprints, while they are followed (all (n * rays,) but where said)."""

    rows: Int  # (n,) footprints
    sides: NDArray[np.int64]  # of the first hits
    sky: Float  # (n, 3) mean irradiance
    cosine: Float | None  # at the receiver
    spread: Float | None  # distance^2 / cosine at the hit: turns a density per area into one per angle
    hits: Hits  # the last hits of the rays that go on
    last: NDArray[np.int64]  # their sides
    going: Int  # which rays they are
    lit: NDArray[np.bool_] | None  # whether light can arrive at the ray's start; None: everywhere
    carried: Float | None = None  # (going, 3) reflectance so far
    value: Float | None = None  # (n * rays, 3) radiosity brought so far


class Gather:
    """Gathers light from a solved Transport.

    Parameters
    ----------
    transport : cells, patches, rows, solved.
    rays : of each footprint.
    bright, bright_rays : where to aim that many more rays; None for nowhere.
    seed : of the shifts.
    """

    def __init__(self, transport: Transport, rays: int, seed: int, bright: BrightCells | None = None,
                 bright_rays: int = 0) -> None:
        self.transport, self.count, self.seed = transport, rays, seed
        self.bright = bright if bright is not None and len(bright) and bright_rays else None
        self.bright_count = bright_rays if self.bright else 0
        # Direction (0, 1), footprint (2, 3).
        self._points = kronecker(rays, 4)
        # Cell (0), place in it (1, 2), footprint (3, 4).
        self._aims = kronecker(self.bright_count, 5)

    def meet(self, places: Footprints, rows: Int, run: Run) -> NDArray[np.int32]:
        """Let the rays of some footprints find cells; return the cells' rows, NOTHING for the sky."""
        pieces = self._map(run, lambda part: self._trace(places, part).sides, rows)
        sides = np.concatenate(pieces)
        self.transport.meet(sides)
        return self.transport.cells.rows(sides)

    def light(self, places: Footprints, rows: Int, run: Run) -> tuple[Float, Float]:
        """Irradiance from sky and gathered emitters, and from light that surfaces reflect, of footprints `rows`: (n, 3)
        float32 each, W/m2."""
        first, bounced = [], []
        passes = slices(len(rows), max(1, PASS_RAYS // (self.count + self.bright_count)))
        for number, part in enumerate(passes):
            pieces = self._map(run, lambda some: self._trace(places, some), rows[part])
            for bounce in range(MOST_BOUNCES):
                self._meet([piece.last for piece in pieces])
                run.map(lambda piece, bounce=bounce: self._go_on(piece, bounce), pieces)  # type: ignore[misc]
            self.transport.leaving()
            for emitted, reflected in run.map(lambda rays: self._collect(places, rays, run), pieces):
                first.append(emitted)
                bounced.append(reflected)
            run.report((number + 1) / len(passes))
        return np.concatenate(first), np.concatenate(bounced)

    def _map(self, run: Run, work: Any, rows: Int) -> list[Any]:
        return run.map(lambda part: work(rows[part]),
                       slices(len(rows), max(1, CHUNK_RAYS // (self.count + self.bright_count))))

    def _meet(self, sides: list[NDArray[np.int64]]) -> None:
        self.transport.meet(np.concatenate(sides))
        self.transport.late(LATE_RAYS)

    def _trace(self, places: Footprints, rows: Int) -> _Rays:
        transport = self.transport
        move = shifts(places.identity[rows], 4, self.seed)
        u, v, x, y = (shifted(self._points[:, axis], move[:, axis]).reshape(-1) for axis in range(4))
        origins, normals = places.sample(np.repeat(rows, self.count), x, y)
        directions = cosine_directions(normals, u[:, None], v[:, None])[:, 0]
        hits, sides, sky = transport.trace(origins, directions)
        lit = None if normals.any(axis=1).all() else normals.any(axis=1)
        if lit is not None:
            sky *= lit[:, None]
        mean_sky = np.float32(np.pi) * sky.reshape(-1, self.count, 3).mean(axis=1)
        cosine = spread = None
        if self.bright:
            cosine = np.sqrt(1 - u)
            facing = np.abs(np.einsum("ij,ij->i", transport.geometry.normal[hits.triangle], directions))
            spread = np.minimum(hits.distance, np.float32(1e15)) ** 2 / np.maximum(facing, np.float32(1e-6))
        return _Rays(rows, sides, mean_sky, cosine, spread, hits, sides, np.arange(len(sides)), lit)

    def _go_on(self, rays: _Rays, bounce: int) -> None:
        """Let rays that met something far ask its patch, and the others look further."""
        transport, geometry = self.transport, self.transport.geometry
        table = transport.leaving()
        cell = transport.cells.rows(rays.last)
        size = np.append(transport.patches.size()[transport.cell_patch], np.float32(0))[cell]
        near = np.flatnonzero(rays.hits.distance < np.float32(NEAR_PATCHES) * size)
        if bounce == MOST_BOUNCES - 1:
            near = near[:0]
        brought = np.take(table, cell, axis=0)
        brought[near] = transport.cell_direct[cell[near]]
        if rays.carried is None:
            rays.value = brought
            rays.carried = transport.cell_reflectance[cell[near]]
        else:
            rays.value[rays.going] += rays.carried * brought  # type: ignore[index]
            rays.carried = rays.carried[near] * transport.cell_reflectance[cell[near]]
        triangle, front = rays.hits.triangle[near], rays.hits.front[near]
        start = geometry.lifted(geometry.point(triangle, rays.hits.u[near], rays.hits.v[near]), triangle, front)
        normal = geometry.normal[triangle]
        normal = np.where(front[:, None], normal, -normal)
        rays.going = rays.going[near]
        identity = rays.rows[rays.going // self.count] * np.int64(self.count) + rays.going % self.count
        u, v = shifts(identity, 2, self.seed + 5 + bounce).T
        rays.hits, rays.last, sky = transport.trace(start, cosine_directions(normal, u[:, None], v[:, None])[:, 0])
        rays.value[rays.going] += rays.carried * (np.float32(np.pi) * sky)  # type: ignore[index]

    def _collect(self, places: Footprints, rays: _Rays, run: Run) -> tuple[Float, Float]:
        """Irradiance from sky and gathered emitters, and from reflected light: (n, 3) each."""
        transport = self.transport
        table, emission = transport.leaving(), transport.emission()
        cell = transport.cells.rows(rays.sides)
        value = rays.value
        assert value is not None
        weight = None if rays.lit is None else np.asarray(rays.lit, np.float32)[:, None]
        if self.bright:
            cosine = rays.cosine * np.float32(self.count / np.pi)
            aimed = self.bright_count * self.bright.density_of(cell) * rays.spread
            share = (cosine / (cosine + aimed))[:, None]
            weight = share if weight is None else weight * share
        if weight is not None:
            value *= weight
        total = value.reshape(-1, self.count, 3).mean(axis=1)
        emitted = np.zeros_like(total)
        if emission is not None:
            seen = np.take(emission, cell, axis=0)
            if weight is not None:
                seen *= weight
            emitted = seen.reshape(-1, self.count, 3).mean(axis=1)
        if self.bright:
            more, more_emitted = self._aim(places, rays.rows, table, emission, run)
            total, emitted = total + more, emitted + more_emitted
        return rays.sky + emitted, total - emitted

    def _aim(self, places: Footprints, rows: Int, table: Float, emission: Float | None, run: Run) -> tuple[Float, Float]:
        """What rays aimed at bright cells bring, all of it and its emitted part: (n, 3) each."""
        transport, bright = self.transport, self.bright
        assert bright is not None
        move = shifts(places.identity[rows], 5, self.seed + 13)
        pick, a, b, x, y = (shifted(self._aims[:, axis], move[:, axis]).reshape(-1) for axis in range(5))
        origins, normals = places.sample(np.repeat(rows, self.bright_count), x, y)
        cell = bright.draw(pick)
        targets, facing = CellFootprints(transport.cells, transport.cells.side[cell]).sample(np.arange(len(cell)), a, b)
        towards = targets - origins
        squared = np.einsum("ij,ij->i", towards, towards)
        distance = np.sqrt(np.maximum(squared, np.float32(1e-20)))
        towards /= distance[:, None]
        cosine = np.einsum("ij,ij->i", towards, normals)
        other = -np.einsum("ij,ij->i", towards, facing)
        lit = np.flatnonzero((cosine > 0) & (other > 0))
        free = ~transport.geometry.visibility.occluded(origins[lit], towards[lit], distance[lit] * np.float32(1 - SHORTEN))
        run.count(len(lit))
        lit = lit[free]
        density = bright.density_of(cell[lit]) * squared[lit] / other[lit]
        weight = np.zeros(len(cell), np.float32)
        weight[lit] = cosine[lit] / np.pi / (self.count * cosine[lit] / np.pi + self.bright_count * density)

        def brought(source: Float) -> Float:
            return np.asarray((np.take(source, cell, axis=0) * weight[:, None]).reshape(-1, self.bright_count, 3).sum(axis=1))

        return brought(table), np.zeros((len(rows), 3), np.float32) if emission is None else brought(emission)

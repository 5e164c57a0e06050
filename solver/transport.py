"""The transport side: cells with direct light, patches with indirect light, and the form factors between them.

Nothing here knows a lumel. Whoever has rays asks `light_from(hits)`: what met cells have no value yet get one.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import sky as skies
from .cells import NOTHING, Cells
from .direct import DirectLight
from .footprints import CellFootprints
from .geometry import Geometry
from .linear import LinearResult, solve_linear
from .parallel import Run, slices
from .patches import Patches, Spots
from .sampling import cosine_directions, kronecker, shifted, shifts, uniform
from .visibility import Hits

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]

CHUNK_RAYS = 2**17
# Samples of reflectance, emission and direct light in a cell.
CELL_SAMPLES = 4
# Lamps that give less than this part of the unoccluded light at a cell are drawn with a probability.
CELL_SMALL_SHARE = 0.1
# A patch is only split where its eighths differ this many times as much (in variance) as noise would make them.
NOISE_LEVEL = 5.0
# Generations of patches that see patches that see ... before what is newly met is left to an average.
MOST_WAVES = 8


@dataclass(frozen=True, eq=False)
class Rows:
    """Form factors of a run of patches as ray hits, kept raw.

    patch : (p,) int32.
    hits : (p, rays) int32 rows of `cells`, NOTHING for the sky: F_ij is the part of row i that hits cells of j.
    part : (p, rays) uint8, the eighth of the patch's box that each ray starts in.
    sky : (p, rays, 3) float32, irradiance from the sky that each ray stands for, W/m2; None for a black sky.
    """

    patch: NDArray[np.int32]
    hits: NDArray[np.int32]
    part: NDArray[np.uint8]
    sky: Float | None

    def take(self, index: NDArray[Any]) -> Rows:
        """Some of the rows."""
        sky = None if self.sky is None else self.sky[index]
        return Rows(self.patch[index], self.hits[index], self.part[index], sky)

    def mean_sky(self) -> Float:
        """(p, 3) W/m2."""
        if self.sky is None:
            return np.zeros((len(self.patch), 3), np.float32)
        return np.asarray(self.sky.mean(axis=1))


class Transport:
    """Cells, patches and rows, growing as rays meet them.

    Attributes
    ----------
    cell_direct : (cells, 3) float32, radiosity that does not come from patches: rho E_direct + emission, W/m2.
    cell_reflectance : (cells, 3) float32.
    cell_patch : (cells,) int32.
    irradiance : (patches, 3) float32, indirect irradiance H of each patch with the sky's in it; nan where unsolved.
    """

    # What `_unsettle` forgets.
    _settled: int
    _leaving: Float
    _extent: Float | None
    _width: Float

    def __init__(self, geometry: Geometry, direct: DirectLight, sampled_emitter: NDArray[np.bool_], cells: Cells,
                 patches: Patches, seed: int, run: Run) -> None:
        self.geometry, self.direct, self.cells, self.patches = geometry, direct, cells, patches
        self._sampled_emitter = sampled_emitter
        self._seed, self._run = seed, run
        self.cell_direct = np.empty((0, 3), np.float32)
        self.cell_incident = np.empty((0, 3), np.float32)
        self.cell_emission = np.empty((0, 3), np.float32)
        self.cell_reflectance = np.empty((0, 3), np.float32)
        self.cell_patch = np.empty(0, np.int32)
        self.cell_middle = np.empty((0, 3), np.float32)
        self.irradiance = np.empty((0, 3), np.float32)
        self.rows: list[Rows] = []
        self._unsettle()

    # --- cells ---------------------------------------------------------------------------------------------------
    def meet(self, sides: NDArray[np.int64]) -> None:
        """Give every met side of a cell its direct light, reflectance and patch."""
        new = self.cells.meet(sides)
        if new.start == new.stop:
            return
        fresh = self.cells.side[new]
        reflectance, emission = self._materials(fresh)
        incident = self.direct.irradiance(CellFootprints(self.cells, fresh), self._run, pilot=CELL_SAMPLES,
                                          small_share=CELL_SMALL_SHARE)
        self.cell_incident = np.concatenate([self.cell_incident, incident])
        self.cell_emission = np.concatenate([self.cell_emission, emission])
        self.cell_reflectance = np.concatenate([self.cell_reflectance, reflectance])
        self.cell_direct = np.concatenate([self.cell_direct, reflectance * incident + emission])
        spots = self._spots(fresh)
        self.cell_middle = np.concatenate([self.cell_middle, spots.points])
        self.cell_patch = np.concatenate([self.cell_patch, self.patches.of(spots)])
        more = len(self.patches) - len(self.irradiance)
        self.irradiance = np.concatenate([self.irradiance, np.full((more, 3), np.nan, np.float32)])

    def _spots(self, sides: NDArray[np.int64]) -> Spots:
        third = np.full(len(sides), 1 / 3, np.float32)
        self._run.count(len(sides))
        return Spots.at(self.geometry, *self.cells.places(sides, third, third))

    def _materials(self, sides: NDArray[np.int64]) -> tuple[Float, Float]:
        """Mean reflectance and mean emission that is gathered (not sampled as a lamp) of each side."""
        points = kronecker(CELL_SAMPLES, 2)

        def work(part: slice) -> tuple[Float, Float]:
            these = sides[part]
            move = shifts(these, 2, self._seed + 31)
            x = shifted(points[:, 0], move[:, 0]).reshape(-1)
            y = shifted(points[:, 1], move[:, 1]).reshape(-1)
            triangle, u, v, _ = self.cells.places(np.repeat(these, CELL_SAMPLES), x, y)
            reflectance = self.geometry.reflectance(triangle, u, v).reshape(-1, CELL_SAMPLES, 3).mean(axis=1)
            emission = self.geometry.emission(triangle, u, v).reshape(-1, CELL_SAMPLES, 3).mean(axis=1)
            emission[self._sampled_emitter[triangle[::CELL_SAMPLES]]] = 0
            return reflectance, emission

        parts = self._run.map(work, slices(len(sides), CHUNK_RAYS // CELL_SAMPLES))
        return np.concatenate([part[0] for part in parts]), np.concatenate([part[1] for part in parts])

    def _extents(self) -> Float:
        """(patches,) float32: how wide each patch is, from the spread of its cells, metres.

        The longest side of a box that is evenly filled is sqrt(12) standard deviations; the octree's box may be far
        wider than what of a patch lies in it.
        """
        count = len(self.patches)
        number = np.maximum(np.bincount(self.cell_patch, minlength=count), 1)
        square = np.zeros(count)
        for axis in range(3):
            place = self.cell_middle[:, axis].astype(np.float64)
            mean = np.bincount(self.cell_patch, place, count) / number
            deviation = (place - mean[self.cell_patch]) ** 2
            square = np.maximum(square, np.bincount(self.cell_patch, deviation, count) / number)
        return np.asarray(np.minimum(np.sqrt(12 * square), self.patches.size()), np.float32)

    # --- rays ----------------------------------------------------------------------------------------------------
    def trace(self, origins: Float, directions: Float) -> tuple[Hits, NDArray[np.int64], Float]:
        """Hits, sides of cells met (NOTHING for the sky), and the sky's radiance where nothing is met (n, 3)."""
        hits = self.geometry.visibility.hits(origins, directions)
        sides = self.cells.sides(hits.triangle, hits.u, hits.v, hits.front)
        sky = np.zeros((len(sides), 3), np.float32)
        missed = np.flatnonzero(sides == NOTHING)
        if len(missed) and not self.geometry.scene.sky.is_black:
            sky[missed] = skies.radiance(self.geometry.scene.sky, directions[missed])
        self._run.count(len(sides))
        return hits, sides, sky

    def leaving(self) -> Float:
        """(cells + 1, 3) float32: radiosity of every met side of a cell, B = E + rho H; the last row is nothing."""
        fresh = slice(self._settled, len(self.cell_patch))
        if fresh.start < fresh.stop or len(self._leaving) != fresh.stop + 1:
            irradiance = self.irradiance[self.cell_patch[fresh]]
            added = self.cell_direct[fresh] + self.cell_reflectance[fresh] * np.nan_to_num(irradiance)
            self._leaving = np.concatenate([self._leaving[: fresh.start], added, np.zeros((1, 3), np.float32)])
            unsolved = np.flatnonzero(np.isnan(irradiance[:, 0]))
            self._settled = fresh.start + int(unsolved[0]) if len(unsolved) else fresh.stop
        return self._leaving

    def width(self) -> Float:
        """(cells + 1,) float32: how wide the patch of every met side of a cell is, metres; the last entry is nothing.

        Patches that were met after the last solve count as wide as their boxes.
        """
        if self._extent is None:
            self._extent, self._width = self._extents(), np.empty(0, np.float32)
        if len(self._width) != len(self.cell_patch) + 1:
            known = len(self._extent)
            self._extent = np.concatenate([self._extent, self.patches.size()[known:]])
            old = self._width[:-1]
            self._width = np.concatenate([old, self._extent[self.cell_patch[len(old):]], np.zeros(1, np.float32)])
        return self._width

    def _unsettle(self) -> None:
        """Forget what was derived from the patches and their light."""
        self._settled, self._leaving = 0, np.zeros((1, 3), np.float32)
        self._extent = None

    def emission(self) -> Float | None:
        """(cells + 1, 3): the part of `leaving` that is emitted; None if all emitters are lamps."""
        if not self.cell_emission.any():
            return None
        return np.concatenate([self.cell_emission, np.zeros((1, 3), np.float32)])

    # --- rows ----------------------------------------------------------------------------------------------------
    def trace_rows(self, patches: NDArray[np.int32], rays: int) -> list[Rows]:
        """Trace the rows of some patches; cells that are met on the way get their light, and may make new patches."""
        traced = []
        for part in slices(len(patches), max(1, 2**22 // rays)):
            these = patches[part]
            start = partial(self._row_rays, these, rays, *self._members(these))
            pieces = self._run.map(start, slices(len(these), max(1, CHUNK_RAYS // rays)))
            sides = np.concatenate([piece[0] for piece in pieces])
            self.meet(sides.reshape(-1))
            hits = self.cells.rows(sides.reshape(-1)).reshape(sides.shape)
            sky = None if self.geometry.scene.sky.is_black else np.concatenate([piece[1] for piece in pieces])
            traced.append(Rows(these, hits, np.concatenate([piece[2] for piece in pieces]), sky))
        return traced

    def _members(self, patches: NDArray[np.int32]) -> tuple[Int, Float, Int]:
        """Met cells of some patches in the patches' order, the running sum of their areas, and where each begins."""
        place = np.full(len(self.patches), -1, np.int32)
        place[patches] = np.arange(len(patches))
        cells = np.flatnonzero(place[self.cell_patch] >= 0)
        order = cells[np.argsort(place[self.cell_patch[cells]], kind="stable")]
        area = self.cells.area(self.cells.side[order]).astype(np.float64)
        running = np.concatenate([[0.0], np.cumsum(area)])
        begins = np.searchsorted(place[self.cell_patch[order]], np.arange(len(patches) + 1))
        return order, running, begins

    def _row_rays(self, patches: NDArray[np.int32], rays: int, order: Int, running: Float, begins: Int,
                  part: slice) -> tuple[NDArray[np.int64], Float, NDArray[np.uint8]]:
        """Of some rows' rays (p, rays): sides met, the sky's irradiance (.., 3), the eighth they start in."""
        first, last = begins[:-1][part], begins[1:][part]
        low, high = running[first], running[last]
        # A patch is known by its first member's side: the same points whatever its number.
        identity = self.cells.side[order[first]]
        move = shifts(identity, 4, self._seed + 57)
        points = kronecker(rays, 4)
        place, x, azimuth, height = (shifted(points[:, axis], move[:, axis]) for axis in range(4))
        where = low[:, None] + place.astype(np.float64) * (high - low)[:, None]
        member = np.searchsorted(running, where.reshape(-1), side="right") - 1
        member = np.clip(member, np.repeat(first, rays), np.repeat(last - 1, rays))
        side = self.cells.side[order[member]]
        index = np.arange(len(side))
        y = uniform(np.repeat(identity, rays) + index % rays * 7907, 5, self._seed)
        points3, normals = CellFootprints(self.cells, side).sample(index, x.reshape(-1), y)
        directions = cosine_directions(normals, height.reshape(-1, 1), azimuth.reshape(-1, 1))[:, 0]
        _, sides, sky = self.trace(points3, directions)
        eighth = self.patches.part(points3, np.repeat(patches[part], rays))
        return sides.reshape(-1, rays), np.float32(np.pi) * sky.reshape(-1, rays, 3), eighth.reshape(-1, rays)

    # --- solve ---------------------------------------------------------------------------------------------------
    def discover(self, rays: int) -> None:
        """Trace the rows of all patches that have none, then of those that they met, and so on until none is new."""
        for wave in range(MOST_WAVES):
            wanted = np.zeros(len(self.patches), bool)
            wanted[self.cell_patch] = True
            for rows in self.rows:
                wanted[rows.patch] = False
            if not wanted.any():
                break
            self.rows += self.trace_rows(np.flatnonzero(wanted).astype(np.int32), rays)
            self._run.report((wave + 1) / MOST_WAVES)

    def refine(self, tolerance: float, weight: Float) -> int:
        """Split the patches inside which the solution varies; return how many.

        Parameters
        ----------
        tolerance : a patch is split where weight * (root mean square of its eighths' deviation) is above this.
        weight : (p,) what a deviation of 1 W/m2 of a patch matters.
        """
        chosen = np.zeros(len(self.patches), bool)
        table = self.leaving().mean(axis=1)
        for rows in self.rows:
            chosen[rows.patch] = self._deviation(rows, table) * weight[rows.patch] > tolerance
        chosen &= self.patches.level < self.patches.depth
        if chosen.any():
            self.patches.split(np.flatnonzero(chosen))
            moved = np.flatnonzero(chosen[self.cell_patch])
            self.cell_patch[moved] = self.patches.of(self._spots(self.cells.side[moved]))
            more = len(self.patches) - len(self.irradiance)
            self.irradiance = np.concatenate([self.irradiance, np.full((more, 3), np.nan, np.float32)])
            self.rows = [rows.take(~chosen[rows.patch]) for rows in self.rows if not chosen[rows.patch].all()]
            self._unsettle()
        return int(chosen.sum())

    def _deviation(self, rows: Rows, table: Float) -> Float:
        """(p,) RMS deviation of the irradiance between the eighths of each patch, its noise taken out, W/m2."""
        value = table[rows.hits]
        if rows.sky is not None:
            value = value + rows.sky.mean(axis=2)
        count = len(rows.patch)
        group = (np.arange(count)[:, None] * 8 + rows.part).reshape(-1)
        number = np.bincount(group, minlength=count * 8).reshape(-1, 8)
        total = np.bincount(group, value.reshape(-1), count * 8).reshape(-1, 8)
        squares = np.bincount(group, np.square(value, dtype=np.float64).reshape(-1), count * 8).reshape(-1, 8)
        mean = total / np.maximum(number, 1)
        inside = (squares - number * mean**2).sum(axis=1) / np.maximum(number.sum(axis=1) - (number > 0).sum(axis=1), 1)
        overall = (total.sum(axis=1) / number.sum(axis=1))[:, None]
        groups = np.maximum((number > 0).sum(axis=1) - 1, 1)
        between = (number * (mean - overall) ** 2).sum(axis=1) / groups
        # One-way analysis of variance: without a difference, `between` is `inside` times F(groups, rays) about 1.
        excess = np.maximum(between - NOISE_LEVEL * inside, 0)
        return np.asarray(np.sqrt(excess * groups / number.sum(axis=1)))

    def solve(self, tolerance: float) -> LinearResult:
        """Solve H = q + F (rho H) to a relative residual; patches without a row count as black until `late`."""
        count = len(self.patches)
        source = np.zeros((count, 3), np.float32)
        table = np.concatenate([self.cell_direct, np.zeros((1, 3), np.float32)])
        for rows in self.rows:
            source[rows.patch] = rows.mean_sky() + self._mean(table, rows.hits)

        def apply(irradiance: Float) -> Float:
            out = np.zeros((count, 3), np.float32)
            reflected = np.zeros((len(self.cell_patch) + 1, 3), np.float32)
            reflected[:-1] = self.cell_reflectance * irradiance.astype(np.float32)[self.cell_patch]
            for rows in self.rows:
                out[rows.patch] = self._mean(reflected, rows.hits)
            return out

        result = solve_linear(apply, source, tolerance, self._run.check)
        solved = np.zeros(count, bool)
        for rows in self.rows:
            solved[rows.patch] = True
        self.irradiance = np.where(solved[:, None], result.value, np.nan).astype(np.float32)
        self._unsettle()
        return result

    def _mean(self, table: Float, hits: NDArray[np.int32]) -> Float:
        """(p, 3): mean over each row's rays of a table of cells."""
        size = max(1, 2**19 // hits.shape[1])
        parts = self._run.map(lambda part: np.take(table, hits[part], axis=0).mean(axis=1, dtype=np.float32),
                              slices(len(hits), size))
        return np.concatenate(parts)

    def late(self, rays: int) -> None:
        """Give patches that were met after the solve their light: one gather each from what is solved."""
        unknown = np.unique(self.cell_patch[self._settled:])
        unknown = unknown[np.isnan(self.irradiance[unknown, 0])]
        if not len(unknown):
            return
        traced = self.trace_rows(unknown, rays)
        known = np.append(~np.isnan(self.irradiance[self.cell_patch, 0]), True)
        direct = np.concatenate([self.cell_direct, np.zeros((1, 3), np.float32)])
        reflected = np.zeros_like(direct)
        reflected[:-1] = self.cell_reflectance * np.nan_to_num(self.irradiance[self.cell_patch])
        for rows in traced:
            part = known[rows.hits].mean(axis=1, dtype=np.float32)[:, None]
            indirect = self._mean(reflected, rows.hits) / np.maximum(part, 1 / rows.hits.shape[1])
            self.irradiance[rows.patch] = rows.mean_sky() + self._mean(direct, rows.hits) + indirect

"""The transport side: cells with direct light, patches with indirect light, and the form factors between them.

Nothing here knows a lumel. Whoever has rays asks `trace` what they meet; cells that have no value yet get one (`meet`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from . import sky as skies
from .cells import NOTHING, Cells
from .direct import DirectLight
from .geometry import Geometry
from .growing import Growing
from .linear import LinearResult
from .met import Met
from .met_cells import MetCells
from .parallel import Run, shares, slices
from .patches import Patches, eighths
from .row_starts import RowStarts
from .row_system import RowSystem
from .rows import Rows, level_noise
from .sampling import cosine_directions, kronecker, shifted, shifts
from .seen import PLACES, Seen
from .tables import mean_of_channels, mean_of_hits, padded

if TYPE_CHECKING:
    from .path_keeper import PathKeeper

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]

CHUNK_RAYS = 2**17
# Fewer rays than this are not worth a thread.
LEAST_RAYS = 2**13
# Cells whose light is worked out at once, and fewer than are worth a thread.
CHUNK_CELLS, LEAST_CELLS = 2**16, 2**13
# Cells whose figures are added up at once.
SUMMED_CELLS = 2**16
# Generations of patches that see patches that see ... before what is newly met is left to an average.
MOST_WAVES = 8
# A patch lies in a gap if all rays of its row end nearer than this part of its width.
GAP = 0.25
# What is a peak counts as so many times as wide as its patch: rays that meet it look further from further away.
PEAK_WIDTH = np.float32(4.0)
# A cell's light is asked for anew where this many rays meet it for each point at which it was.
AGAIN = 16


class Transport:
    """Cells, patches and rows, growing as rays meet them.

    Attributes
    ----------
    met : what is known of the cells that rays have met.
    irradiance : (patches, 3) float32, indirect irradiance H of each patch with the sky's in it; nan where unsolved.
    apart : (groups, patches, 3) float32, the same of each light group, after `solve_apart`.
    rows, late_rows : form factors of the patches that were solved, and of those that were met afterwards.
    starts : where rows start, and how many rays they have.
    keeper : takes down the ways of gather rays, if given.
    peak : radiosity far beyond the usual, W/m2 (mean of the channels).
    """

    # What `_unsettle` forgets: cells up to `_settled` are in the tables; of these, those at `_stale` have to be worked
    # out again.
    _settled: int
    _stale: Int
    _table: Growing
    _tables: list[Growing]
    _extent: Float | None

    def __init__(self, geometry: Geometry, direct: DirectLight, sampled_emitter: NDArray[np.bool_], cells: Cells,
                 patches: Patches, seed: int, run: Run) -> None:
        self.geometry, self.cells, self.patches = geometry, cells, patches
        self.met = MetCells(geometry, direct, sampled_emitter, cells, seed, run)
        self._seed, self.run = seed, run
        self._cell_patch = Growing((), np.int32)
        self.irradiance = np.empty((0, 3), np.float32)
        self.split = direct.split
        self.apart = np.empty((0 if self.split is None else len(self.split), 0, 3), np.float32)
        self.rows: list[Rows] = []
        self.late_rows: list[Rows] = []
        self.starts = RowStarts(cells, patches, self.met, self._cell_patch)
        self.keeper: PathKeeper | None = None
        self.peak = np.inf
        # Patches below `_solved` were there at the last solve; `_unsolved` of them have cells and no row.
        self._solved, self._unsolved = 0, np.empty(0, np.int64)
        self._unsettle()

    # --- cells ---------------------------------------------------------------------------------------------------
    @property
    def cell_direct(self) -> Float:
        """(cells, 3) radiosity that does not come from patches: rho E_direct + emission, W/m2."""
        return self.met.direct

    @property
    def cell_reflectance(self) -> Float:
        """(cells, 3)."""
        return self.met.reflectance

    @property
    def cell_patch(self) -> NDArray[np.int32]:
        """(cells,) int32."""
        return self._cell_patch.values

    def meet(self, seen: Sequence[Seen]) -> None:
        """Give every met side of a cell its direct light, reflectance and patch."""
        self._settle_in(self.met.meet(seen))

    def look_again(self, some: Sequence[Met]) -> list[NDArray[np.int32]]:
        """Ask anew for the light of cells that many rays meet, where it was asked for at fewer points than could be.

        A ray from afar may have met such a cell first, in a part of it that is hidden from those that meet it now.
        Return the rows of the cells that were met, NOTHING for the sky.
        """
        rows = self.run.map(lambda met: met.rows(self.cells), some)
        every = np.concatenate(rows)
        hits = np.bincount(every[every >= 0], minlength=len(self.cells))
        few = (self.met.places < PLACES) & (hits >= AGAIN * self.met.places)
        if few.any():
            few = np.append(few, False)  # the last entry is NOTHING's
            renewed = self.met.renew(self.run.map(lambda job: job[0].at(np.flatnonzero(few[job[1]])),
                                                  list(zip(some, rows, strict=True))))
            self._forget(renewed)
        return rows

    def meet_whole(self, sides: NDArray[np.int64]) -> None:
        """The same for cells that no ray met."""
        self._settle_in(self.met.meet_whole(sides))

    def _settle_in(self, new: slice) -> None:
        if new.start < new.stop:
            self._cell_patch.append(self.patches.of(self.met.spots.take(new), self.run))
            self._make_room()

    def _make_room(self) -> None:
        """New patches have no light yet."""
        more = len(self.patches) - len(self.irradiance)
        self.irradiance = np.concatenate([self.irradiance, np.full((more, 3), np.nan, np.float32)])
        self.apart = np.concatenate([self.apart, np.full((len(self.apart), more, 3), np.nan, np.float32)], axis=1)

    def sums_of_patches(self, kinds: int, figures: Callable[[slice], Sequence[Float]], area: Float) -> Float:
        """(kinds, patches) float64: what figures of the cells, times their `area` (cells,), add up to; `figures` gives
        (m,) of each kind for a part of the cells, for all at once would take much memory."""
        sums = np.zeros((kinds, len(self.patches)))
        for part in slices(len(self.cell_patch), SUMMED_CELLS):
            for kind, values in enumerate(figures(part)):
                sums[kind] += np.bincount(self.cell_patch[part], area[part] * values, len(self.patches))
        return sums

    # --- rays ----------------------------------------------------------------------------------------------------
    def trace(self, origins: Float, directions: Float, behind: NDArray[np.bool_] | None = None) -> Met:
        """What rays meet; `behind` (n,) are those that start at the back of a triangle."""
        hits = self.geometry.visibility.hits(origins, directions)
        self.run.count(len(origins))
        sides = self.cells.sides(hits.triangle, hits.u, hits.v, hits.front, behind)
        known = self.cells.rows(sides)
        if self.geometry.scene.sky.is_black:
            return Met(hits, sides, known, np.empty(0, np.int64), np.empty((0, 3), np.float32))
        missed = np.flatnonzero(sides == NOTHING)
        sky = np.float32(np.pi) * skies.radiance(self.geometry.scene.sky, directions[missed])
        return Met(hits, sides, known, missed, sky)

    def table(self) -> Float:
        """(cells + 1, 4) float32: radiosity of every met side of a cell, B = E + rho H, and the width in metres that it
        counts as, that of its patch or, for peaks, PEAK_WIDTH times as much; the last row is nothing.
        """
        if self._settled < len(self.cells) or not len(self._table):
            # The row of nothing stays the last.
            for table in (self._table, *self._tables):
                table.cut(self._settled)
                table.append(np.zeros((len(self.cells) + 1 - self._settled, 4), np.float32))
        stale = np.concatenate([self._stale, np.arange(self._settled, len(self.cells))])
        parts = [stale[part] for part in shares(len(stale), CHUNK_CELLS, LEAST_CELLS)]
        settle = partial(self._settle, self._widths())
        self._stale = np.concatenate([np.empty(0, np.int64), *self.run.map(settle, parts)])
        self._settled = len(self.cells)
        return self._table.values

    def _widths(self) -> Float:
        """(p,) how wide each patch is, metres; what was met after the last solve counts as wide as its box."""
        if self._extent is None:
            self._extent = self.patches.widths(self.cell_patch, self.met.spots.points, self.met.area)
        self._extent = np.concatenate([self._extent, self.patches.size()[len(self._extent):]])
        return self._extent

    def _settle(self, width_of_patch: Float, rows: Int) -> Int:
        """Work out the tables' rows of some cells; return those whose patches have no light yet."""
        patch = self.cell_patch[rows]
        irradiance = np.take(self.irradiance, patch, axis=0)
        reflectance = np.take(self.cell_reflectance, rows, axis=0)
        direct = np.take(self.cell_direct, rows, axis=0)
        self._table.values[rows, :3] = direct + reflectance * np.nan_to_num(irradiance)
        width = width_of_patch[patch]
        width[mean_of_channels(self._table.values[rows]) > self.peak] *= PEAK_WIDTH
        self._table.values[rows, 3] = width
        for group, table in enumerate(self._tables):
            direct = np.take(self.met.direct_of(group), rows, axis=0)
            table.values[rows, :3] = direct + reflectance * np.nan_to_num(np.take(self.apart[group], patch, axis=0))
        return np.asarray(rows[np.isnan(irradiance[:, 0])])

    def table_of(self, group: int) -> Float:
        """(cells + 1, 4) float32: what of it is a light group's, as of the last call of `table`."""
        return self._tables[group].values

    def leaving(self) -> Float:
        """(cells + 1, 3) float32: radiosity of every met side of a cell; the last row is nothing."""
        return self.table()[:, :3]

    def _forget(self, cells: Int) -> None:
        """The rows of some cells in the tables have to be worked out again."""
        self._stale = np.union1d(self._stale, cells[cells < self._settled])

    def _unsettle(self) -> None:
        """Forget what was derived from the patches and their light."""
        self._settled, self._stale, self._table = 0, np.empty(0, np.int64), Growing((4,))
        self._tables = [Growing((4,)) for _ in range(len(self.apart))]
        self._extent = None

    def emission_of(self, group: int) -> Float | None:
        """(cells + 1, 4): the part of `table_of` that is emitted; None if there is none."""
        emission = self.met.emission_of(group)
        return None if emission is None else padded(emission)

    def emission(self) -> Float | None:
        """(cells + 1, 4): the part of `table` that is emitted; None if all emitters are lamps."""
        return padded(self.met.emission) if self.met.emission.any() else None

    # --- rows ----------------------------------------------------------------------------------------------------
    def trace_rows(self, patches: NDArray[np.int32], rays: int) -> list[Rows]:
        """Trace the rows of some patches; cells that are met on the way get their light, and may make new patches."""
        traced = []
        for part in slices(len(patches), max(1, 2**22 // rays)):
            these = patches[part]
            start = partial(self._row_rays, self.patches.size()[these], rays, *self.starts.members(these))
            pieces = self.run.map(start, shares(len(these), max(1, CHUNK_RAYS // rays), LEAST_RAYS // rays))
            sides = np.concatenate([piece[0] for piece in pieces])
            self.meet([piece[3] for piece in pieces])
            hits = self.cells.rows(sides.reshape(-1)).reshape(sides.shape)
            sky = None if self.geometry.scene.sky.is_black else np.concatenate([piece[1] for piece in pieces])
            traced.append(Rows(these, hits, np.concatenate([piece[2] for piece in pieces]), sky))
        return traced

    def _row_rays(self, width: Float, rays: int, order: Int, running: Float, begins: Int, part: slice
                  ) -> tuple[NDArray[np.int64], Float, NDArray[np.uint8], Seen]:
        """Of some rows' rays (p, rays): sides met, the sky's irradiance (.., 3), the eighth they start in;
        and where new cells were met. `width` (p,) of each patch, metres.

        That no ray found the way out of a gap does not mean that there is none: Laplace's rule of succession gives one
        in so many to it. Between white surfaces light would go round a thousand times else.
        """
        first, last = begins[:-1][part], begins[1:][part]
        low, high = running[first], running[last]
        # A patch is known by its first member's side: the same points whatever its number.
        identity = self.cells.side[order[first]]
        move = shifts(identity, 3, self._seed + 57)
        points = kronecker(rays, 3)
        place, azimuth, height = (shifted(points[:, axis], move[:, axis]) for axis in range(3))
        where = low[:, None] + place.astype(np.float64) * (high - low)[:, None]
        member = np.searchsorted(running, where.reshape(-1), side="right") - 1
        member = np.clip(member, np.repeat(first, rays), np.repeat(last - 1, rays))
        start = np.take(self.met.start, order[member], axis=0)
        points3, normals = start[:, :3], start[:, 4:7]
        directions = cosine_directions(normals, height.reshape(-1, 1), azimuth.reshape(-1, 1))[:, 0]
        spots = self.met.spots
        met = self.trace(points3, directions, ~spots.front[order[member]])
        met = met.where_above(directions, np.take(spots.normals, order[member], axis=0))
        sky = np.zeros((0 if self.geometry.scene.sky.is_black else len(met.sides), 3), np.float32)
        sky[met.missed] = met.sky
        sides = met.sides.reshape(-1, rays).copy()
        gap = np.flatnonzero((met.hits.distance.reshape(-1, rays) < GAP * width[part, None]).all(axis=1))
        absorbed = 1 - self.cell_reflectance[order[member.reshape(-1, rays)[gap]]].mean(axis=1).max(axis=1)
        sides[gap[absorbed * rays < 1], -1] = NOTHING
        return (sides, sky.reshape(-1, rays, 3), eighths(points3.reshape(-1, rays, 3)),
                met.fresh(directions, self.geometry.normal))

    # --- solve ---------------------------------------------------------------------------------------------------
    def discover(self, rays: int) -> None:
        """Trace the rows of all patches that have none, then of those that they met, and so on until none is new.

        `rays` is what a row of usual importance has: the errors of those that receivers see most of are seen most.
        """
        for wave in range(MOST_WAVES):
            wanted = np.zeros(len(self.patches), bool)
            wanted[self.cell_patch] = True
            for rows in self.rows:
                wanted[rows.patch] = False
            if not wanted.any():
                break
            for patches, count in self.starts.allotted(np.flatnonzero(wanted).astype(np.int32), rays):
                self.rows += self.trace_rows(patches, count)
            self.run.report((wave + 1) / MOST_WAVES)

    def refine(self, tolerance: float, weight: Float, wide: Int, since: int = 0) -> int:
        """Split the patches inside which the solution varies, and those that are too wide; return how many. Until their
        rows are traced, new patches have the light of those that they come from.

        Parameters
        ----------
        tolerance : a patch is split where weight * (root mean square of its eighths' deviation) is above this.
        weight : (p,) what a deviation of 1 W/m2 of a patch matters.
        wide : patches, see `wide`; they are split down to what the receivers see at once.
        since : patches from this number on are looked at.
        """
        chosen = np.zeros(len(self.patches), bool)
        table = mean_of_channels(self.leaving())
        some = self._rows_since(since)
        for rows, deviation in zip(some, self.run.map(lambda rows: rows.deviation(table), some), strict=True):
            chosen[rows.patch] = deviation * weight[rows.patch] > tolerance
        chosen[wide] = True
        chosen &= self.patches.level < self.patches.depth
        if chosen.any():
            moved = np.flatnonzero(chosen[self.cell_patch])
            spots, before = self.met.spots.take(moved), self.cell_patch[moved]
            width = self._widths().copy()
            width[wide] = np.minimum(width[wide], self.patches.view)
            self.patches.split(spots, before, width)
            self.cell_patch[moved] = self.patches.of(spots, self.run)
            self._make_room()
            self.irradiance[self.cell_patch[moved]] = self.irradiance[before]
            self.rows = [rows.take(~chosen[rows.patch]) for rows in self.rows if not chosen[rows.patch].all()]
            self._extent = None
            self._forget(moved)
        return int(chosen.sum())

    def relax(self, since: int) -> None:
        """Give patches from this number on the light that their rows find in what is solved."""
        table = self.table()
        changed = np.zeros(len(self.patches), bool)
        for rows in self._rows_since(since):
            self.irradiance[rows.patch] = rows.mean_sky() + mean_of_hits(table, rows.hits, self.run)
            changed[rows.patch] = True
        self._forget(np.flatnonzero(changed[self.cell_patch]))

    def _rows_since(self, since: int) -> list[Rows]:
        """The runs of rows in which patches from this number on are."""
        return [rows for rows in self.rows if rows.patch.max(initial=-1) >= since]

    def wide(self, most: int) -> Int:
        """At most so many patches that hold cells of several places, in some of which lamps make peaks (see
        `Patches.uneven`); what bounces there differs too."""
        return self.patches.uneven(self.cell_patch, self.cell_direct.mean(axis=1, dtype=np.float64), self.peak,
                                   self._widths())[:most]

    def level_noise(self, weight: Float) -> float:
        """About the standard deviation that the rows' noise gives a mean of the patches' irradiance, W/m2; `weight`
        (p,) of each patch in that mean."""
        leaving, direct = mean_of_channels(self.leaving()), mean_of_channels(padded(self.cell_direct))
        return level_noise(self.rows, weight, leaving, direct)

    def retrace(self, rays: int) -> None:
        """Trace all rows anew, with what the old ones told of the patches' importance."""
        self.starts.follow(self.rows)
        self.rows = []
        self.discover(rays)

    def solve(self, tolerance: float) -> LinearResult:
        """Solve H = q + F (rho H) to a relative residual, from what is known of it by now; patches without a row are
        black until `late`."""
        count = len(self.patches)
        known = None if np.isnan(self.irradiance).all() else np.nan_to_num(self.irradiance)
        result = self._solved_for(self.cell_direct, Rows.mean_sky, tolerance, known)
        solved = np.zeros(count, bool)
        for rows in self.rows:
            solved[rows.patch] = True
        self.irradiance = np.where(solved[:, None], result.value, np.nan).astype(np.float32)
        lived_in = np.zeros(count, bool)
        lived_in[self.cell_patch] = True
        self._solved, self._unsolved = count, np.flatnonzero(lived_in & ~solved)
        self._unsettle()
        return result

    def _solved_for(self, direct: Float, sky: Callable[[Rows], Float], tolerance: float,
                    start: Float | None = None) -> LinearResult:
        """H of patches for the direct radiosity of cells (cells, 3) and the sky's irradiance of rows."""
        system = RowSystem(self.rows, self.cell_reflectance, self.cell_patch, len(self.patches))
        return system.solve(direct, sky, tolerance, self.run, start)

    def solve_apart(self, tolerance: float) -> None:
        """Solve for each light group, after the last `solve`, to the same relative residual of its own."""
        if self.split is None:
            return
        solved = ~np.isnan(self.irradiance)
        for group in range(len(self.split)):
            value = self._solved_for(self.met.direct_of(group), partial(self._sky, group=group), tolerance).value
            self.apart[group] = np.where(solved, value, np.nan)
        self._unsettle()

    def _sky(self, rows: Rows, group: int) -> Float:
        """(p, 3) irradiance of rows from the sky, if it belongs to a light group."""
        assert self.split is not None
        return self.split.white(group, rows.mean_sky()) * np.float32(group == self.split.sky_group)

    def late(self, rays: int) -> None:
        """Give patches that were met after the solve their light: one gather each from what is solved."""
        fresh = np.flatnonzero(np.isnan(self.irradiance[self._solved:, 0])) + self._solved
        unknown = np.concatenate([self._unsolved, fresh]).astype(np.int32)
        self._unsolved = np.empty(0, np.int64)
        late = self.trace_rows(unknown, rays)
        self.late_rows += late
        for rows in late:
            seen = rows.hits.reshape(-1)
            irradiance = np.take(self.irradiance, self.cell_patch[seen], axis=0)
            met = (seen != NOTHING)[:, None]
            known = ~(met & np.isnan(irradiance))
            shape = (*rows.hits.shape, 3)
            reflectance = np.take(self.cell_reflectance, seen, axis=0)
            reflected = (met * reflectance * np.nan_to_num(irradiance)).reshape(shape).mean(axis=1)
            part = np.maximum(known.reshape(shape).mean(axis=1), 1 / shape[1])
            straight = (met * np.take(self.cell_direct, seen, axis=0)).reshape(shape).mean(axis=1)
            self.irradiance[rows.patch] = rows.mean_sky() + straight + reflected / part
            for group, light in enumerate(self.apart):
                indirect = met * reflectance * np.nan_to_num(light[self.cell_patch[seen]])
                straight = (met * self.met.direct_of(group)[seen]).reshape(shape).mean(axis=1)
                light[rows.patch] = self._sky(rows, group) + straight + indirect.reshape(shape).mean(axis=1) / part

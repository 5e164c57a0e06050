"""What is known of the cells that rays have met: direct light, reflectance, emission, and where they lie."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .cells import Cells
from .direct import DirectLight
from .geometry import Geometry
from .growing import Growing
from .parallel import Run, shares
from .patches import Spots
from .plan import CELL_SAMPLES
from .sampling import kronecker, shifted, shifts
from .seen import Seen, SeenFootprints

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]

CHUNK_CELLS = 2**15
# Fewer cells than this are not worth a thread.
LEAST_CELLS = 2**11
# Points at which cells that no ray met are taken to be seen.
WHOLE_POINTS = 4
# Places of a cell at which the closed forms of many lamps are asked for (at 4 a bake of pandora took longer and was no
# better).
CELL_CLOSED = 2
# Lamps that give less than this part of the unoccluded light at a cell are drawn with a probability.
CELL_SMALL_SHARE = 0.1


class MetCells:
    """Tables of the met sides of cells, a row each, in the order in which they were met.

    Attributes
    ----------
    steep : radiosity, W/m2; cells in which that of lamps varies by more are divided (standard deviation, where nothing
        is hidden).
    """

    def __init__(self, geometry: Geometry, direct: DirectLight, sampled_emitter: NDArray[np.bool_], cells: Cells,
                 seed: int, run: Run) -> None:
        self.geometry, self.cells = geometry, cells
        self.light, self.sampled_emitter = direct, sampled_emitter
        self._seed, self._run = seed, run
        self.steep, self.samples = np.inf, CELL_SAMPLES[0]
        columns = 3 if direct.split is None else direct.split.columns
        self._incident, self._direct = Growing((columns,)), Growing((columns,))
        self._emission, self._reflectance, self._points, self._normals = (Growing((3,)) for _ in range(4))
        self._places = Growing((), np.uint8)
        self._tables = (self._incident, self._direct, self._emission, self._reflectance, self._places)
        self._start, self._gap, self._triangle = Growing((8,)), Growing(), Growing((), np.int32)
        self._area = Growing()
        self._front = Growing((), np.bool_)

    def __len__(self) -> int:
        return len(self.cells)

    @property
    def incident(self) -> Float:
        """(n, 3) direct irradiance of lamps, W/m2."""
        return self._incident.values[:, :3]

    def incident_of(self, group: int) -> Float:
        """(n, 3) the same of a light group."""
        return self._incident.values[:, 3 * group + 3:3 * group + 6]

    @property
    def emission(self) -> Float:
        """(n, 3) radiant exitance that no lamp stands for, W/m2."""
        return self._emission.values

    @property
    def reflectance(self) -> Float:
        """(n, 3)."""
        return self._reflectance.values

    @property
    def direct(self) -> Float:
        """(n, 3) radiosity that does not come from patches: rho E_direct + emission, W/m2."""
        return self._direct.values[:, :3]

    def direct_of(self, group: int) -> Float:
        """(n, 3) the same of a light group."""
        return self._direct.values[:, 3 * group + 3:3 * group + 6]

    def emission_of(self, group: int) -> Float | None:
        """(n, 3) radiant exitance of a light group that no lamp stands for, W/m2; None if there is none."""
        split = self.light.split
        assert split is not None
        own = split.triangle_group[self._triangle.values] == group
        return split.white(group, self.emission) * own[:, None] if self.emission[own].any() else None

    @property
    def start(self) -> Float:
        """(n, 8) where rays of a cell start: its lifted middle and shading normal, each padded to four."""
        return self._start.values

    @property
    def spots(self) -> Spots:
        """The cells' middles."""
        return Spots(self._points.values, self._normals.values, self._triangle.values, self._gap.values,
                     self._front.values)

    @property
    def area(self) -> Float:
        """(n,) float32, m2 of each, those that others hold included."""
        return self._area.values

    @property
    def own_area(self) -> Float:
        """(n,) the same, 0 for those that others hold: together the area of what was met."""
        return np.where(self.cells.are_held(self.cells.side), np.float32(0), self.area)

    @property
    def places(self) -> NDArray[np.uint8]:
        """(n,) points of each cell that its light was asked for at."""
        return self._places.values

    def meet(self, seen: Sequence[Seen]) -> slice:
        """Fill in the cells that are new; return their rows."""
        fresh = Seen.join(seen)
        fresh = fresh.take(self.cells.are_new(fresh.side)).few()
        new = self.cells.meet(fresh.side)
        if new.start < new.stop:
            places = SeenFootprints(self.geometry, self.cells, fresh, self._run)
            rows, varied = self._asked(places)
            for table, values in zip(self._tables, rows, strict=True):
                table.append(values)
            self._place(places)
            self._divide(np.arange(new.start, new.stop), varied)
        return new

    def renew(self, seen: Sequence[Seen]) -> NDArray[np.int32]:
        """Ask anew for the light of cells that have been met, at other points; return their rows."""
        places = SeenFootprints(self.geometry, self.cells, Seen.join(seen).few(), self._run)
        own = self.cells.rows(places.identity)
        rows, varied = self._asked(places)
        for table, values in zip(self._tables, rows, strict=True):
            table.values[own] = values
        self._divide(own, varied)
        return own

    def _asked(self, places: SeenFootprints) -> tuple[tuple[NDArray[Any], ...], Float]:
        """A row of `_tables` for each cell, and by how much the lamps' light varies in it (n,) W/m2."""
        reflectance, emission = self._materials(places)
        varied = np.zeros(len(places))
        incident = self.light.apart(places, self._run, pilot=self.samples, small_share=CELL_SMALL_SHARE,
                                    closed=CELL_CLOSED, varied=varied)
        leaving = self._leaving(places.identity, reflectance, incident, emission)
        return (incident, leaving, emission, reflectance, places.count), varied

    def _divide(self, rows: Int, varied: Float) -> None:
        self.cells.divide(rows[varied * self.reflectance[rows].mean(axis=1) > self.steep])

    def meet_whole(self, sides: NDArray[np.int64]) -> slice:
        """Fill in cells that no ray met, as if they were seen all over; return their rows."""
        points = kronecker(WHOLE_POINTS, 2)
        move = shifts(sides, 2, self._seed + 31)
        every = np.repeat(sides, WHOLE_POINTS)
        x, y = (shifted(points[:, axis], move[:, axis]).reshape(-1) for axis in (0, 1))
        _, u, v, _ = self.cells.places(every, x, y)
        return self.meet([Seen(every, u, v, np.full(len(u), np.inf, np.float32))])

    def _leaving(self, sides: NDArray[np.int64], reflectance: Float, incident: Float, emission: Float) -> Float:
        """Radiosity that does not come from patches, of all light and of every group."""
        split = self.light.split
        if split is None:
            return reflectance * incident + emission
        out = np.tile(reflectance, split.columns // 3) * incident
        out[:, :3] += emission
        owner = split.triangle_group[self.cells.triangle_of(sides)]
        for group in np.unique(owner[emission.any(axis=1)]):
            own = owner == group
            out[own, 3 * group + 3:3 * group + 6] += split.white(int(group), emission[own])
        return out

    def _place(self, places: SeenFootprints) -> None:
        """Where a cell is seen first stands for it."""
        def work(part: slice) -> tuple[Spots, Float]:
            return (Spots.at(self.geometry, *places.first_places(part), places.front[part]),
                    self.cells.area(places.identity[part], of_each=True))

        parts = self._run.map(work, shares(len(places), CHUNK_CELLS, LEAST_CELLS))
        spots = Spots.join([spots for spots, _ in parts])
        self._run.count(len(places))
        self._area.append(np.concatenate([area for _, area in parts]))
        self._points.append(spots.points)
        self._normals.append(spots.normals)
        self._triangle.append(spots.triangle)
        self._gap.append(spots.gap)
        self._front.append(spots.front)
        start = np.zeros((len(places), 8), np.float32)
        start[:, :3], start[:, 4:7] = places.start[places.first], places.normal[places.first]
        self._start.append(start)

    def _materials(self, places: SeenFootprints) -> tuple[Float, Float]:
        """Mean reflectance and mean emission that is gathered (not sampled as a lamp) of each cell."""
        emission = places.mean(self.geometry.emission)
        emission[self.sampled_emitter[places.triangle]] = 0
        return places.mean(self.geometry.reflectance), emission

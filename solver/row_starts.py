"""Where the rays of rows start, and how many a row has: by what patches matter to the receivers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .cells import Cells
from .growing import Growing
from .met_cells import MetCells
from .patches import Patches
from .rows import Rows
from .tables import mean_of_channels

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]

# Rays that a patch's whole area counts for, beside those of the receivers that met it.
AREA_RAYS = 0.1
# A row has up to 2^MORE times the usual rays where receivers see much of its patch, and 2^LESS times where little.
MORE, LESS = 3, -1
# Reflections over which importance is followed back from the receivers.
REFLECTIONS = 5


class RowStarts:
    """The importance of cells (Smits, Arvo & Salesin 1992), and what follows from it for rows.

    Parameters
    ----------
    cells, patches, met : of the transport.
    cell_patch : the patch of each cell, growing.

    Attributes
    ----------
    straight : (some of the first cells,) how many rays of the receivers met each.
    matters : the same, or how often receivers met each over other surfaces, too, after `follow`.
    """

    def __init__(self, cells: Cells, patches: Patches, met: MetCells, cell_patch: Growing) -> None:
        self._cells, self._patches, self._met, self._cell_patch = cells, patches, met, cell_patch
        self.straight = self.matters = np.zeros(0)

    def see(self, cell: Int) -> None:
        """Take down the cells that rays of the receivers met, NOTHING for the sky."""
        self.straight = np.bincount(cell[cell >= 0], minlength=len(self._cells)).astype(np.float64)
        self.matters = self.straight

    def follow(self, rows: Sequence[Rows]) -> None:
        """Count how often receivers meet cells over other surfaces, too, as some rows found it.

        The mean light of the receivers is then right to first order though each patch has one light for whoever sees
        it: errors inside a patch add up to nothing where they are weighted by the whole adjoint solution.
        """
        wave = self._of_all_cells(self.straight)
        total = wave.copy()
        for _ in range(REFLECTIONS):
            passed_on, wave = self._passed_on(wave), np.zeros(len(total))
            for some in rows:
                rays = some.hits.shape[1]
                each = np.repeat(passed_on[some.patch] / rays, rays)
                # NOTHING is the last entry.
                wave += np.bincount(some.hits.reshape(-1) % (len(wave) + 1), each, len(wave) + 1)[:-1]
            total += wave
        self.matters = total

    def allotted(self, patches: NDArray[np.int32], rays: int) -> list[tuple[NDArray[np.int32], int]]:
        """Patches by the number of rays of their rows: `rays` or, for those that matter more, up to 2^MORE times as
        many, for those that matter less 2^LESS times."""
        matters = self._passed_on(self.matters)
        usual = matters.sum() / max(np.count_nonzero(matters), 1)
        level = np.log2(np.maximum(matters[patches], 1e-30) / max(usual, 1e-30))
        level = np.clip(np.round(level), LESS, MORE)
        return [(patches[level == one], max(1, int(rays * 2.0**one))) for one in np.unique(level)]

    def members(self, patches: NDArray[np.int32]) -> tuple[Int, Float, Int]:
        """Met cells of some patches in the patches' order, the running sum of what they count, and where each begins.

        What receivers see of a patch may be another part of it than most of its area: of a curtain rather the side
        towards the room than the one towards the pane. A patch has one light, and it has to be that of the part that is
        seen, or all that is seen of it errs the same way.
        """
        cell_patch, side = self._cell_patch.values, self._cells.side
        place = np.full(len(self._patches), -1, np.int32)
        place[patches] = np.arange(len(patches))
        cells = np.flatnonzero(place[cell_patch] >= 0)
        # Neighbours on a triangle stand together, so that points spread over the sum are spread over the patch.
        order = cells[np.lexsort((side[cells], place[cell_patch[cells]]))]
        row = place[cell_patch[order]]
        area = self._met.area[order].astype(np.float64)
        counts = AREA_RAYS * area / np.maximum(np.bincount(row, area, len(patches)), 1e-30)[row]
        early = np.flatnonzero(order < len(self.matters))
        counts[early] += self.matters[order[early]]
        begins = np.searchsorted(row, np.arange(len(patches) + 1))
        return order, np.concatenate([[0.0], np.cumsum(counts)]), begins

    def _of_all_cells(self, importance: Float) -> Float:
        """(cells,) importance; of those that were met since, none."""
        return np.pad(importance, (0, len(self._cells) - len(importance)))

    def _passed_on(self, importance: Float) -> Float:
        """(patches,) how much of the importance of its cells (the first,) a patch passes on: its reflected part."""
        some = slice(len(importance))
        reflected = importance * mean_of_channels(self._met.reflectance[some])
        return np.asarray(np.bincount(self._cell_patch.values[some], reflected, len(self._patches)), np.float64)

"""What the receivers see of a solved transport, by the few rays that they sent out first."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .tables import mean_of_channels
from .transport import Transport

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]


@dataclass(frozen=True, eq=False)
class Sight:
    """Rays of receivers, and what the transport knows by now of the cells that they met.

    cell : (n,) rows of the cells, NOTHING for the sky.
    """

    transport: Transport
    cell: Int

    def light(self) -> float:
        """Mean radiosity that the rays meet, the sky's rays counted as dark, W/m2."""
        return float(mean_of_channels(self.transport.leaving())[self.cell].mean())

    def share(self) -> Float:
        """(p,) the share of the rays that meet each patch, times what it reflects."""
        patch = self.transport.cell_patch[self.cell[self.cell >= 0]]
        share = np.bincount(patch, minlength=len(self.transport.patches)) / max(len(self.cell), 1)
        return np.asarray(share * self._reflectance())

    def matters(self) -> Float:
        """(p,) what it matters that the solution differs by 1 W/m2 inside a patch."""
        return np.asarray(np.sqrt(self.share() * self._reflectance()))

    def _reflectance(self) -> Float:
        """(p,) mean of each patch."""
        transport = self.transport
        total, number = (np.bincount(transport.cell_patch, weight, len(transport.patches))
                         for weight in (mean_of_channels(transport.cell_reflectance), None))
        return np.asarray(total / np.maximum(number, 1))

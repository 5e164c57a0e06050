"""The radiosity system of patches whose form factors are rows of ray hits: H = q + F (rho H)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .linear import LinearResult, solve_linear
from .parallel import Run, shares
from .rows import Rows
from .tables import CHUNK, LEAST, mean_of_hits, padded

Float = NDArray[np.floating[Any]]


@dataclass(frozen=True, eq=False)
class RowSystem:
    """F and rho of patches.

    rows : of the patches; those without a row get nothing.
    reflectance, patch : of every cell, (cells, 3), and (cells,) its patch.
    count : of the patches.
    """

    rows: Sequence[Rows]
    reflectance: Float
    patch: NDArray[np.int32]
    count: int

    def solve(self, direct: Float, sky: Callable[[Rows], Float], tolerance: float, run: Run,
              start: Float | None = None) -> LinearResult:
        """The indirect irradiance of patches, the sky's light in it.

        Parameters
        ----------
        direct : (cells, 3) radiosity that does not come from patches, W/m2.
        sky : (p, 3) irradiance of rows from the sky, W/m2.
        tolerance : relative residual.
        start : (count, 3) about what it will be, W/m2, if that is known.

        Returns
        -------
        LinearResult, its value (count, 3) W/m2.
        """
        source = np.zeros((self.count, 3), np.float32)
        table = padded(direct)
        for some in self.rows:
            source[some.patch] = sky(some) + mean_of_hits(table, some.hits, run)
        factor, place = padded(self.reflectance), np.append(self.patch, 0)
        reflected = np.empty_like(factor)

        def apply(irradiance: Float) -> Float:
            out, arriving = np.zeros((self.count, 3), np.float32), padded(irradiance)

            def reflect(part: slice) -> None:
                np.multiply(factor[part], np.take(arriving, place[part], axis=0), out=reflected[part])

            run.map(reflect, shares(len(place), CHUNK, LEAST))
            for some in self.rows:
                out[some.patch] = mean_of_hits(reflected, some.hits, run)
            return out

        return solve_linear(apply, source, tolerance, run.check, start)

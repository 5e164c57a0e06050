"""What a solver of the radiosity system returns, and the residual that all of them are judged by."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.floating[Any]]


@dataclass(frozen=True, eq=False)
class Result:
    """What a solver found.

    radiosity : (n,) W/m2.
    residuals : max|E - (I - rho F) B| over max|E|, one after every product or sweep.
    products : matrix-vector products spent; a shot from one patch is 1/n of one.
    """

    radiosity: Float
    residuals: tuple[float, ...]
    products: float

    def converged(self, tolerance: float) -> bool:
        """Whether the last residual is below the tolerance."""
        return bool(self.residuals[-1] <= tolerance)


def residual(F: Float, reflectance: Float, emission: Float, radiosity: Float) -> Float:
    """E - (I - rho F) B, (n,): one matrix-vector product."""
    return np.asarray(emission - radiosity + reflectance * (F @ radiosity))


def relative(residuals: Float, emission: Float) -> float:
    """The largest residual, over the largest emission."""
    return float(np.abs(residuals).max() / np.abs(emission).max())

"""Southwell's relaxation, known as progressive refinement: the patch with the most unshot flux shoots it.

Cost      a column of F a shot; the residuals are kept, so a product is n shots.
Accuracy  fast first pictures: the bright patches shoot first; then slow as Gauss-Seidel.
Fails     towards rho = 1 as Gauss-Seidel does. With overshooting (a patch shoots the light that it will get back as
          well, by an ambient estimate) it is faster in dark rooms, but from rho = .9 the same few patches shoot back
          and forth for ever. Choosing the patch by what it would shoot, not by what is left on it, mends that; two
          rooms that hardly see each other stay slow, for the estimate knows one mean for both.
Reference Cohen, Chen, Wallace and Greenberg 1988; Gortler, Cohen and Slusallek 1994 (Southwell); Feda and
          Purgathofer 1992 (overshooting).
"""

from __future__ import annotations

from functools import partial
from typing import Literal

import numpy as np

from .result import Float, Result, relative


def _shoot(overshoot: Literal["no", "textbook", "mended"], F: Float, reflectance: Float, emission: Float, areas: Float,
           tolerance: float, cap: int) -> Result:
    n = len(emission)
    columns = np.ascontiguousarray(F.T)
    B, unshot = np.zeros(n), emission.astype(np.float64)
    mean_reflectance = float(areas @ reflectance / areas.sum())
    residuals: list[float] = []
    for shot in range(cap * n):
        extra = np.zeros(n)
        if overshoot != "no":
            ambient = float(areas @ unshot / areas.sum()) / (1 - mean_reflectance)
            extra = reflectance * ambient
        i = int(np.argmax(np.abs((unshot + extra if overshoot == "mended" else unshot) * areas)))
        amount = unshot[i] + extra[i]
        B[i] += amount
        unshot += reflectance * columns[i] * amount
        unshot[i] -= amount
        if (shot + 1) % n == 0 or relative(unshot, emission) <= tolerance:
            residuals.append(relative(unshot, emission))
            if residuals[-1] <= tolerance or not residuals[-1] < 1e6:
                return Result(B, tuple(residuals), (shot + 1) / n)
    return Result(B, tuple(residuals), float(cap))


solve = partial(_shoot, "no")
solve_overshooting = partial(_shoot, "textbook")
solve_overshooting_mended = partial(_shoot, "mended")

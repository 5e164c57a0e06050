"""Conjugate gradients, right and wrong.

Right: A_i F_ij is symmetric, so with y = sqrt(A / rho) (B - E) the system (I - S) y = sqrt(A rho) F E has the
symmetric S_ij = sqrt(rho_i / A_i) A_i F_ij sqrt(rho_j / A_j), and is positive definite for rho < 1. Patches with
rho = 0 drop out.
Wrong: the same steps on I - rho F as it stands, which is symmetric only if all areas and reflectances are equal.

Cost      one product and two inner products a step.
Accuracy  as good as the Krylov space is: nine steps at any reflectance in a closed cube, 14 with two rooms.
Fails     rows counted by rays are not symmetric: then GMRES. The wrong one gets away with a cube of equal patches,
          and stalls or wanders off when areas and reflectances differ from patch to patch.
Reference Hestenes and Stiefel 1952; Neumann and Tobler 1994 symmetrise so.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .result import Float, Result, relative, residual


def solve(F: Float, reflectance: Float, emission: Float, areas: Float, tolerance: float, cap: int) -> Result:
    """The right one. The first product is spent on the right-hand side."""
    to_y, from_y = np.sqrt(areas * reflectance), np.sqrt(reflectance / areas)

    def operator(y: Float) -> Float:
        return np.asarray(y - to_y * (F @ (from_y * y)))

    def radiosity(y: Float) -> Float:
        return np.asarray(emission + from_y * y)

    def judged(r: Float) -> float:
        # Residuals of y back as residuals of B: r_B = sqrt(rho / A) r_y.
        return relative(from_y * r, emission)

    y, residuals = _descend(operator, to_y * (F @ emission), judged, tolerance, cap - 1)
    return Result(radiosity(y), tuple(residuals), len(residuals))


def solve_unsymmetrised(F: Float, reflectance: Float, emission: Float, areas: Float, tolerance: float,
                        cap: int) -> Result:
    """The wrong one; judged by its true residual, not by the one that it believes in."""
    def operator(B: Float) -> Float:
        return np.asarray(B - reflectance * (F @ B))

    B, believed = _descend(operator, emission, lambda r: relative(r, emission), tolerance, cap)
    true = relative(residual(F, reflectance, emission, B), emission)
    return Result(B, (*believed[:-1], true), len(believed))


def _descend(operator: Callable[[Float], Float], right: Float, judged: Callable[[Float], float], tolerance: float,
             cap: int) -> tuple[Float, list[float]]:
    x, r = np.zeros_like(right), right.copy()
    direction, squared = r.copy(), float(r @ r)
    residuals = [judged(r)]
    while residuals[-1] > tolerance and len(residuals) <= cap and residuals[-1] < 1e6:
        image = operator(direction)
        step = squared / float(direction @ image)
        x, r = x + step * direction, r - step * image
        previous, squared = squared, float(r @ r)
        direction = r + squared / previous * direction
        residuals.append(judged(r))
    return x, residuals

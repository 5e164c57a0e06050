"""Jacobi: B <- E + rho F B, one bounce of light a sweep.

Cost      one product a sweep.
Accuracy  the error falls by rho lambda_1 a sweep: ln(tolerance) / ln(rho) sweeps in a closed room.
Fails     slowly towards rho = 1: 916 sweeps for 1e-4 at rho = .99.
Reference Cohen and Greenberg 1985 gather so.
"""

from __future__ import annotations

from .result import Float, Result, relative, residual


def solve(F: Float, reflectance: Float, emission: Float, areas: Float, tolerance: float, cap: int) -> Result:
    """Sweep until the residual is below the tolerance, `cap` sweeps at most."""
    B = emission.copy()
    residuals: list[float] = []
    for _ in range(cap):
        r = residual(F, reflectance, emission, B)
        residuals.append(relative(r, emission))
        if residuals[-1] <= tolerance:
            break
        B = B + r
    return Result(B, tuple(residuals), len(residuals))

"""Ours: restarted GMRES on H = F E + F (rho H), as `solver.linear` ships it.

Cost      one product a step, and as many inner products as there were steps.
Accuracy  as conjugate gradients, give or take a step, and rows need not be symmetric.
Fails     a closed scene that reflects all has no solution: it stalls, and says so.
Reference Saad and Schultz 1986; see solver/linear.py.
"""

from __future__ import annotations

from radiosity.solver.linear import solve_linear

from .result import Float, Result, relative, residual


def solve(F: Float, reflectance: Float, emission: Float, areas: Float, tolerance: float, cap: int) -> Result:
    """Solve for the irradiance H; B = E + rho H. The shipped solver has a cap of its own."""
    answer = solve_linear(lambda H: F @ (reflectance * H), F @ emission, tolerance)
    B = emission + reflectance * answer.value
    true = relative(residual(F, reflectance, emission, B), emission)
    return Result(B, (*answer.residuals, true), answer.products + 1)

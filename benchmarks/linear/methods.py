"""All solvers by name, behind one signature.

    solve(F, reflectance, emission, areas, tolerance, cap) -> Result(radiosity, residuals, products)
"""

from __future__ import annotations

from collections.abc import Callable

from . import chebyshev, conjugate_gradients, direct_lu, gauss_seidel, jacobi, shipped, shooting
from .result import Result

Solver = Callable[..., Result]

SOLVERS: dict[str, Solver] = {
    "LU": direct_lu.solve,
    "Jacobi": jacobi.solve,
    "Gauss-Seidel": gauss_seidel.solve,
    "shooting": shooting.solve,
    "overshooting": shooting.solve_overshooting,
    "overshooting, mended": shooting.solve_overshooting_mended,
    "Chebyshev": chebyshev.solve,
    "CG": conjugate_gradients.solve,
    "CG, unsymmetrised": conjugate_gradients.solve_unsymmetrised,
    "ours": shipped.solve,
}

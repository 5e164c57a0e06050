"""The linear system of radiosity, for all channels and light groups at once.

    H = q + F (rho H)

GMRES (Saad & Schultz 1986) on I - F rho, restarted, with modified Gram-Schmidt. Krylov spaces find the few slow
modes (one a room) by themselves, so that the count of products hardly depends on the reflectance.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.floating[Any]]

# Stop when the residual is below this part of the right-hand side (2-norms).
TOLERANCE = 1e-6
# Steps before the Krylov space is thrown away; METHODS counts 10 to 16 for the hardest rooms.
RESTART = 30
MOST_PRODUCTS = 300
# A residual that a whole restart did not bring below this part of its start has stalled: the system is singular.
STALL = 0.9
# A whole restart that does not bring the residual below this part of its start is not worth another, once it is good
# enough: what is left is the light of gaps between white surfaces, each a mode of its own.
SLOW = 0.3
# Products are float32, so that no residual falls below some units in their last place of the solution's norm (measured
# for closed rooms of reflectance .99 to .9999, whose light is 100 to 10,000 times the direct: .8e-7 to 1.8e-7 with one
# build of NumPy, up to 4.7e-7 with another, which adds in another order). A stall there is no failure.
ROUNDING = 8 * 2.0**-23
# A stall below this part of the right-hand side is good enough for any light, one above the other for none: where
# nothing is absorbed the solution is rounding itself.
GOOD_ENOUGH, TOO_MUCH = 1e-4, 1e-2


@dataclass(frozen=True, eq=False)
class LinearResult:
    """What a solve returns.

    value : shaped like the right-hand side.
    outcome : "converged", "stalled" (a closed scene that absorbs nothing has no solution), or "capped".
    residuals : relative residual after every product.
    """

    value: Float
    outcome: str
    residuals: tuple[float, ...]

    @property
    def products(self) -> int:
        """Matrix products spent."""
        return len(self.residuals)


def solve_linear(apply: Callable[[Float], Float], right: Float, tolerance: float = TOLERANCE,
                 check: Callable[[], None] | None = None, start: Float | None = None) -> LinearResult:
    """Solve x - apply(x) = right.

    Parameters
    ----------
    apply : a linear function from and to the shape of `right`; its spectral radius is below 1.
    right : any shape; all columns share one Krylov space.
    tolerance : of the residual, in parts of `right`, wherever the solution starts.
    check : called before every product, to stop the work by an exception.
    start : about the solution, if something is known of it.
    """
    shape = right.shape
    b = np.asarray(right, np.float64).reshape(-1)
    norm = _norm(b)
    x = np.zeros_like(b)
    residuals: list[float] = []
    if norm == 0:
        return LinearResult(np.zeros(shape), "converged", ())

    def operator(vector: Float) -> Float:
        if check is not None:
            check()
        return vector - np.asarray(apply(vector.reshape(shape)), np.float64).reshape(-1)

    outcome = "capped"
    residual = b.copy()
    if start is not None:
        x = np.array(start, np.float64).reshape(-1)
        residual = b - operator(x)
        residuals.append(_norm(residual) / norm)
        if residuals[-1] <= tolerance:
            return LinearResult(x.reshape(shape), "converged", tuple(residuals))
    while len(residuals) < MOST_PRODUCTS:
        before = _norm(residual) / norm
        step, history = _cycle(operator, residual, norm, tolerance, MOST_PRODUCTS - len(residuals))
        x += step
        residuals += history
        residual = b - operator(x)
        now = _norm(residual) / norm
        residuals.append(now)
        if now <= tolerance * 1.01 or SLOW * before < now <= GOOD_ENOUGH:
            outcome = "converged"
            break
        if now > STALL * before:
            rounding = ROUNDING * _norm(x) / norm
            outcome = "converged" if now <= min(max(rounding, GOOD_ENOUGH), TOO_MUCH) else "stalled"
            break
    return LinearResult(x.reshape(shape), outcome, tuple(residuals))


def dot(first: Float, second: Float) -> float:
    """Without BLAS, whose threads wait for one another: where other programs work too, longer than the sum takes."""
    return float(np.einsum("i,i->", first, second))


def _norm(vector: Float) -> float:
    return float(np.sqrt(dot(vector, vector)))


def _cycle(operator: Callable[[Float], Float], residual: Float, norm: float, tolerance: float,
           most: int) -> tuple[Float, list[float]]:
    """One restart: the step that makes the residual smallest in the Krylov space, and its history."""
    steps = max(1, min(RESTART, most))
    beta = _norm(residual)
    basis = [residual / beta]
    hessenberg = np.zeros((steps + 1, steps))
    history: list[float] = []
    y = np.zeros(0)
    for k in range(steps):
        vector = operator(basis[k])
        for j in range(k + 1):
            hessenberg[j, k] = dot(basis[j], vector)
            vector = vector - hessenberg[j, k] * basis[j]
        hessenberg[k + 1, k] = _norm(vector)
        right = np.zeros(k + 2)
        right[0] = beta
        y = np.linalg.lstsq(hessenberg[: k + 2, : k + 1], right, rcond=None)[0]
        history.append(float(np.linalg.norm(right - hessenberg[: k + 2, : k + 1] @ y)) / norm)
        if history[-1] <= tolerance or hessenberg[k + 1, k] <= 1e-14 * beta:
            break
        basis.append(vector / hessenberg[k + 1, k])
    return np.asarray(sum(weight * vector for weight, vector in zip(y, basis, strict=False))), history

"""Ours: contour integrals with the inner one solved and the outer one cut where it is nearly singular; shadows exact.

Cost      one integral over an edge for each pair of edges, a few milliseconds in NumPy, whatever `samples` says; past
          occluders, the closed form at 16,000 points of a lattice and more.
Accuracy  ten digits and more: touching, at 179 degrees, gap .01, or 100,000 sides apart. Past occluders 2e-6, and the
          standard error is known.
Fails     it is far too slow for the millions of pairs of a scene; it isn't used for them.
Reference see solver/contour.py and solver/visible_part.py.
"""

from __future__ import annotations

from collections.abc import Sequence

from radiosity.solver.form_factor import form_factor as solver_form_factor

from .polygons import Float


def form_factor(a: Float, b: Float, samples: int, occluders: Sequence[Float] = (), seed: int = 0) -> float:
    """F_ab; `samples` has no meaning here."""
    return solver_form_factor(a, b, occluders, seed=seed).value

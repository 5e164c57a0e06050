"""Quasi-Monte Carlo rays, as our patches send them: a four-dimensional Kronecker sequence with a random shift.

Cost      a ray each; one set serves a whole row of the matrix.
Accuracy  sums over a row fall about as N^-.8; single entries less fast, for their outlines are edges in the integrand.
Fails     on single small entries, like any rays; one set for all patches would show as bands, hence the shift.
Reference Keller 1996; Cranley and Patterson 1976 (the shift); Roberts 2018 (the generalised golden ratio).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .polygons import Float, rays_from, rays_that_arrive

# The root of x^5 = x + 1: the generalised golden ratio of four dimensions.
GOLDEN = 1.1673039782614187


def form_factor(a: Float, b: Float, samples: int, occluders: Sequence[Float] = (), seed: int = 0) -> float:
    """F_ab from `samples` rays; a must be convex."""
    shift = np.random.default_rng(seed).random(4)
    square = (np.arange(samples)[:, None] * GOLDEN ** -np.arange(1.0, 5.0) + shift) % 1
    return float(rays_that_arrive(*rays_from(a, square), b, occluders).mean())

"""Monte Carlo: rays from random points of a, by the cosine, and the part of them that arrives at b.

Cost      a ray each; one set serves a whole row of the matrix.
Accuracy  sqrt((1 - F) / (N F)) relative, whatever the geometry.
Fails     slowly: a hundred times the rays for one digit more; F below 1 / N is not seen at all.
Reference Malley 1988 (the cosine); Shirley 1991.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .polygons import Float, rays_from, rays_that_arrive


def form_factor(a: Float, b: Float, samples: int, occluders: Sequence[Float] = (), seed: int = 0) -> float:
    """F_ab from `samples` rays; a must be convex."""
    square = np.random.default_rng(seed).random((samples, 4))
    return float(rays_that_arrive(*rays_from(a, square), b, occluders).mean())

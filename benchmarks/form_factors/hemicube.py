"""Hemicube at the centre of polygon a: b is drawn on five faces of pixels, each worth its share of the hemisphere.

Cost      one raster a row of the matrix, whatever the number of polygons; here every pixel is one ray.
Accuracy  the aliasing falls as 1 / resolution, towards the form factor of a's *centre*, not of a.
Fails     near contact, at any resolution: 20 % too much for unit squares one side apart; small far lights fall between
          pixels.
Reference Cohen and Greenberg 1985.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from radiosity.solver.convex_pieces import unit_normal

from .polygons import Float, frame, rays_that_arrive


def form_factor(a: Float, b: Float, samples: int, occluders: Sequence[Float] = (), seed: int = 0) -> float:
    """F_ab from about `samples` pixels: a top of n x n and four sides of n x n/2."""
    side = 2 * max(1, round((samples / 12) ** 0.5))
    directions, share = _pixels(side)
    centre = a.mean(axis=0)
    directions = directions @ frame(unit_normal(a))
    arrives = rays_that_arrive(np.broadcast_to(centre, directions.shape), directions, b, occluders)
    return float(share[arrives].sum())


def _pixels(side: int) -> tuple[Float, Float]:
    """Directions (n, 3) through the pixels' middles and their delta form factors (n,)."""
    u = (np.arange(side) + 0.5) / side * 2 - 1
    area = (2 / side) ** 2
    x, y = (grid.ravel() for grid in np.meshgrid(u, u))
    top = np.stack([x, y, np.ones_like(x)], axis=1)
    y, z = (grid.ravel() for grid in np.meshgrid(u, u[u > 0]))
    one = np.ones_like(y)
    sides = [np.stack(s, axis=1) for s in ((one, y, z), (-one, y, z), (y, one, z), (y, -one, z))]
    directions = np.concatenate([top, *sides])
    # cos at the element times cos at the face (1 / r) over pi r^2; on the top both cosines are 1 / r.
    return directions, directions[:, 2] * area / (np.pi * (directions**2).sum(axis=1) ** 2)

"""Double contour integral of ln r by Gauss-Legendre nodes on every pair of edges.

Cost      nodes^2 logarithms for each pair of edges.
Accuracy  spectral where the polygons are well apart: 3e-15 with 10 nodes at a gap of one side.
Fails     at a shared edge nodes fall on nodes, ln 0; gaps much smaller than the sides (7 % at .01); shadows: the
          integral over contours knows of no occluder. A polygon through the other's plane must be clipped first.
Reference Sparrow 1963; Walton, NISTIR 6925, 2002; Mazumder and Ravishankar 2012.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .polygons import Float


def form_factor(a: Float, b: Float, samples: int, occluders: Sequence[Float] = (), seed: int = 0) -> float:
    """F_ab from about `samples` logarithms; minus or plus infinity (or nan) where nodes coincide.

    Raises
    ------
    ValueError
        If there are occluders.
    """
    if len(occluders):
        raise ValueError("the double contour integral knows no occluders")
    count = max(1, round((samples / (len(a) * len(b))) ** 0.5))
    x, w = np.polynomial.legendre.leggauss(count)
    x, w = (x + 1) / 2, w / 2
    edges_a, edges_b = np.roll(a, -1, axis=0) - a, np.roll(b, -1, axis=0) - b
    on_a = a[:, None] + x[:, None] * edges_a[:, None]
    on_b = b[:, None] + x[:, None] * edges_b[:, None]
    distance2 = ((on_a[:, None, :, None] - on_b[None, :, None]) ** 2).sum(axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        logarithm = np.einsum("ijkl,k,l->ij", np.log(distance2) / 2, w, w)
        exchanged = (edges_a @ edges_b.T * logarithm).sum() / (2 * np.pi)
    fan = a[1:] - a[0]
    return float(exchanged / (np.linalg.norm(np.cross(fan[:-1], fan[1:]).sum(axis=0)) / 2))

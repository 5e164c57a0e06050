"""Disc to point: every patch of b stands as a disc of its area, cos cos' A_b / (pi r^2 + A_b).

Cost      as the centroid method.
Accuracy  bounded by 1, so it never explodes; exact only on the axis of a disc that faces the point.
Fails     1 to 30 % off near contact, with either sign, and hardly better with finer patches: 8 x 8 patches on unit
          squares .1 apart are still 12 % too low, for discs neither tile the square nor stay within it.
Reference Wallace, Elmquist and Haines 1989.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .polygons import Float, blocked, kernel, patches


def form_factor(a: Float, b: Float, samples: int, occluders: Sequence[Float] = (), seed: int = 0) -> float:
    """F_ab from about `samples` pairs of patches (the fourth root of it each way on both polygons)."""
    side = max(1, round(samples**0.25))
    pa, pb = patches(a, side), patches(b, side)
    cosines, distance2 = kernel(pa, pb)
    visible = ~blocked(pa.centre[:, None], pb.centre[None], occluders)
    exchanged = (pa.area[:, None] * pb.area * cosines / (np.pi * distance2 + pb.area) * visible).sum()
    return float(exchanged / pa.area.sum())

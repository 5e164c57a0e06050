"""Point to point: cos cos' A_b / (pi r^2) between the centres of patches.

Cost      one kernel a pair of patches; the cheapest there is, and what python-flux assembles its matrices from.
Accuracy  second order in (patch size / distance).
Fails     near contact, without bound: unit squares .01 apart give F = 3183 instead of .98, and 8 x 8 patches on both
          still 51 times too much. Shadows are all or nothing for each pair of centres.
Reference Goral, Torrance, Greenberg and Battaile 1984; Potter et al. 2023.
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
    exchanged = (pa.area[:, None] * pb.area * cosines / (np.pi * distance2) * visible).sum()
    return float(exchanged / pa.area.sum())

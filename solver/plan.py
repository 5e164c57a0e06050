"""How much work the wanted error asks for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

# Edge of a cell, and of the smallest patch, over the median distance that gather rays travel.
CELL_SHARE = 0.024
SMALLEST_PATCH_SHARE = 0.02

# The part of bounced light that the numbers below were found for (interiors), and the least that is planned for.
USUAL_SHARE = 0.5
LEAST_SHARE = 0.02


@dataclass(frozen=True)
class Plan:
    """What a bake spends: sizes in metres, rays by count.

    error : the wanted relative RMS error.
    patches : about how many there are before any is split for what the solution does inside it.
    gather_rays : of every receiver; where they prove too noisy, more follow.
    gather_error, direct_error : the parts of `error` that gather and direct light may each have.
    """

    error: float
    patches: int
    smallest_patch: float
    cell_size: float
    row_rays: int
    gather_rays: int
    gather_error: float
    direct_error: float
    audit_lumels: int
    audit_paths: int


def plan(error: float, distance: float, bounced: float) -> Plan:
    """The work for a wanted relative RMS error.

    Parameters
    ----------
    distance : how far the receivers usually see, metres.
    bounced : the part of their light that comes over other surfaces: patches and their rows serve only that, and may
        be as much coarser as it is less.
    """
    finer = float(np.clip(0.03 / error * max(bounced, LEAST_SHARE) / USUAL_SHARE, 0.1, 3.0))
    # A pilot that is enough where light is smooth (METHODS: 256 rays 3 %, 1,024 rays 1 % of the indirect light).
    gather = int(2 ** np.clip(np.round(np.log2(128 * 0.03 / error)), 5, 9))
    return Plan(
        error=error,
        patches=int(2000 * finer),
        smallest_patch=SMALLEST_PATCH_SHARE * distance,
        cell_size=CELL_SHARE * distance / finer**0.5,
        row_rays=int(np.clip(256 * finer, 64, 1024)),
        gather_rays=gather,
        gather_error=0.27 * error,
        direct_error=0.3 * error,
        # The audit's noise at one lumel, about 1 / sqrt(paths), may be the error that it is to see. For the same rays,
        # many paths at few lumels tell the mean square error better than few paths at many.
        audit_lumels=384,
        audit_paths=int(np.clip(0.6 / error**2, 64, 4096)),
    )

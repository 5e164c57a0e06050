"""How much work the wanted error asks for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

# Edge of a cell, and of the smallest patch, over the median distance that gather rays travel.
CELL_SHARE = 0.015
SMALLEST_PATCH_SHARE = 0.02


@dataclass(frozen=True)
class Plan:
    """What a bake spends: sizes in metres, rays by count.

    patches : about how many there are before any is split for what the solution does inside it.
    bright_rays : rays from each receiver to bright cells.
    direct_share : part of the wanted error that the direct light of a lumel may have.
    """

    patches: int
    smallest_patch: float
    cell_size: float
    row_rays: int
    gather_rays: int
    bright_rays: int
    direct_share: float
    audit_lumels: int
    audit_paths: int


def plan(error: float, distance: float) -> Plan:
    """The work for a wanted relative RMS error, from the distance of what the receivers see."""
    # Quasi-random gather: error about n^-.75 (METHODS: 256 rays 3 %, 1,024 rays 1 % of the indirect light).
    gather = int(2 ** np.clip(np.round(np.log2(256 * (0.03 / error) ** (1 / 0.75))), 5, 12))
    finer = float(np.clip(0.03 / error, 0.3, 3.0))
    return Plan(
        patches=int(1000 * finer),
        smallest_patch=SMALLEST_PATCH_SHARE * distance,
        cell_size=CELL_SHARE * distance / finer**0.5,
        row_rays=int(np.clip(gather, 128, 1024)),
        gather_rays=gather,
        bright_rays=gather // 2,
        direct_share=0.7,
        audit_lumels=512,
        # The audit's noise at one lumel, about 1 / sqrt(paths), may be three times the error that it is to see.
        audit_paths=int(np.clip(0.15 / error**2, 16, 2048)),
    )

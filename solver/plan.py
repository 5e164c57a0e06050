"""How much work the wanted error asks for."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .cells import NOTHING
from .footprints import Footprints
from .geometry import Geometry
from .sampling import cosine_directions, kronecker, shifted, shifts

Float = NDArray[np.floating[Any]]

# Rays of the pilot that looks how far things are from the receivers.
PILOT_RAYS = 2**16
# Edge of a patch and of a cell over the median distance that gather rays travel.
PATCH_SHARE = 0.12
CELL_SHARE = 0.03


@dataclass(frozen=True)
class Plan:
    """What a bake spends: sizes in metres, rays by count.

    direct_share : part of the wanted error that the direct light of a lumel may have.
    """

    patch_size: float
    cell_size: float
    row_rays: int
    gather_rays: int
    direct_share: float
    audit_lumels: int
    audit_paths: int


def look_around(geometry: Geometry, places: Footprints, seed: int) -> float:
    """The median distance that cosine-distributed rays travel from the footprints, metres."""
    count = min(len(places), PILOT_RAYS // 16)
    rows = np.linspace(0, len(places) - 1, count).astype(np.int64)
    move = shifts(places.identity[rows], 4, seed + 3)
    points = kronecker(16, 4)
    x, y, u, v = (shifted(points[:, axis], move[:, axis]).reshape(-1) for axis in range(4))
    origins, normals = places.sample(np.repeat(rows, 16), x, y)
    hits = geometry.visibility.hits(origins, cosine_directions(normals, u[:, None], v[:, None])[:, 0])
    met = hits.triangle != NOTHING
    if met.any():
        return float(np.median(hits.distance[met]))
    return float(np.linalg.norm(np.ptp(geometry.corners.reshape(-1, 3), axis=0)))


def plan(error: float, distance: float) -> Plan:
    """The work for a wanted relative RMS error, from the distance of what the receivers see."""
    # Quasi-random gather: error about n^-.75 (METHODS: 256 rays 3 %, 1,024 rays 1 % of the indirect light).
    gather = int(2 ** np.clip(np.round(np.log2(256 * (0.03 / error) ** (1 / 0.75))), 5, 12))
    size = float(np.clip(error / 0.03, 0.3, 3.0)) ** 0.5
    return Plan(
        patch_size=PATCH_SHARE * distance * size,
        cell_size=CELL_SHARE * distance * size,
        row_rays=max(64, gather),
        gather_rays=gather,
        direct_share=0.7,
        audit_lumels=512,
        # The audit's noise at one lumel, about 1 / sqrt(paths), may be three times the error that it is to see.
        audit_paths=int(np.clip(0.15 / error**2, 16, 2048)),
    )

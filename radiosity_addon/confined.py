"""Points that see no more than the inside of a solid: the part of a ceiling that sticks into a wall."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..solver.footprints import ReceiverFootprints
from ..solver.geometry import Geometry
from ..solver.probes import free_receivers
from ..solver.sampling import cosine_directions, kronecker

Float = NDArray[np.floating[Any]]

# Rays of a point, and the part of them that show a back above which it counts as inside a solid: floors and ceilings
# that run through walls show their fronts in there too.
RAYS, PART = 16, 0.5


def confined(geometry: Geometry, points: Float, normals: Float) -> NDArray[np.bool_]:
    """Whether most that points (n, 3) in metres, world space, see along unit normals (n, 3) are backs of faces."""
    count = len(points)
    if not count:
        return np.zeros(0, bool)
    facing = np.asarray(normals, np.float32)
    receivers = free_receivers(np.asarray(points - geometry.scene.origin, np.float32), facing,
                               np.full(count, -1, np.int32))
    middle = np.full(count, 0.5, np.float32)
    origins, facing = ReceiverFootprints(geometry, receivers, 0.0, 0).sample(np.arange(count), middle, middle)
    across, along = (np.broadcast_to(column, (count, RAYS)).astype(np.float32) for column in kronecker(RAYS, 2).T)
    directions = cosine_directions(facing, across, along).reshape(-1, 3)
    hits = geometry.visibility.hits(np.repeat(origins, RAYS, axis=0), directions)
    backs = (hits.triangle >= 0) & ~hits.front
    return np.asarray(backs.reshape(-1, RAYS).mean(axis=1) > PART)

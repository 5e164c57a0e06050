"""Points that see no more than the inside of a solid: the part of a ceiling that sticks into a wall."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..solver.fans import Fans
from ..solver.footprints import ReceiverFootprints
from ..solver.geometry import Geometry
from ..solver.probes import free_receivers
from ..solver.unseen import closed_rays

Float = NDArray[np.floating[Any]]

# Rays of a point, and the part of them that show a back above which it counts as inside a solid: floors and ceilings
# that run through walls show their fronts in there too.
RAYS, PART = 16, 0.5


def confined(geometry: Geometry, points: Float, normals: Float) -> NDArray[np.bool_]:
    """Whether most that points (n, 3) in metres, world space, see along unit normals (n, 3) are backs of faces."""
    receivers = free_receivers(np.asarray(points - geometry.scene.origin, np.float32), np.asarray(normals, np.float32),
                               np.full(len(points), -1, np.int32))
    fans = Fans(ReceiverFootprints(geometry, receivers, 0.0, 0))
    return np.asarray(closed_rays(fans, geometry.visibility, np.arange(len(points)), RAYS, 0).mean(axis=1) > PART)

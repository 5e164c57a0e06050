"""Surfaces that some rays pass by: those that cast no shadow, and those that bounced light does not see."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .visibility import Hits, Visibility

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]


class RayKinds(Visibility):
    """Gather rays against some triangles, shadow rays against others.

    Parameters
    ----------
    seen : what gather rays meet; its triangles are `rows` (k,) of the scene's.
    shadows : what shadow rays meet.
    """

    def __init__(self, seen: Visibility, rows: Int, shadows: Visibility) -> None:
        self._seen, self._rows, self._shadows = seen, np.asarray(rows, np.int32), shadows
        self.notice = seen.notice or shadows.notice

    def hits(self, origins: Float, directions: Float) -> Hits:
        """The nearest triangle along each ray that bounced light sees."""
        found = self._seen.hits(origins, directions)
        if not len(self._rows):
            return found
        triangle = np.where(found.triangle >= 0, self._rows[found.triangle], np.int32(-1))
        return Hits(triangle, found.u, found.v, found.distance, found.front)

    def occluded(self, origins: Float, directions: Float, distances: Float) -> NDArray[np.bool_]:
        """Whether anything that casts shadows lies within the distances: (n,) bool."""
        return self._shadows.occluded(origins, directions, distances)

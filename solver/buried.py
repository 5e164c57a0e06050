"""Points that another solid hides: where a face lies exactly on the face of what it touches.

The wall behind a beam, the floor under a box: no light comes between them. A ray that starts a hair above the wall
starts inside the beam, and what it meets there is not what the wall sees. That it starts inside a solid is what tells
this from a wall made of two faces back to back, whose either side is open.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .geometry import Geometry
from .visibility import Visibility

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]

# A face hides another if it lies nearer than this many ray offsets, and faces it to this cosine.
REACH = 4.0
OPPOSITE = -0.999


class Buried:
    """Finds faces that lie on one another, facing each other."""

    def __init__(self, geometry: Geometry) -> None:
        self._geometry = geometry
        normal = geometry.normal
        dominant = np.argmax(np.abs(normal), axis=1)
        self._positive = normal[np.arange(len(normal)), dominant] > 0
        # Faces that turn one way can only be hidden by those that turn the other.
        self._members = [np.flatnonzero((self._positive == side) & (geometry.area > 0)) for side in (False, True)]
        self._casters = [Visibility(geometry.corners[members]) for members in self._members]

    def find(self, points: Float, triangle: Int) -> NDArray[np.bool_]:
        """Whether points (n, 3) on the fronts of triangles (n,) are hidden by a face that lies on them."""
        geometry = self._geometry
        normal, offset = geometry.normal[triangle], geometry.offset[triangle]
        start = points + normal * (REACH * offset)[:, None]
        out = np.zeros(len(points), bool)
        for side in (0, 1):
            rows = np.flatnonzero(self._positive[triangle] == bool(side))
            others = self._members[1 - side]
            if not len(rows) or not len(others):
                continue
            hits = self._casters[1 - side].hits(start[rows], -normal[rows])
            near = (hits.triangle >= 0) & (hits.distance < 2 * REACH * offset[rows])
            facing = np.einsum("ij,ij->i", geometry.normal[others[np.maximum(hits.triangle, 0)]], normal[rows])
            out[rows] = near & (facing < OPPOSITE)
        touched = np.flatnonzero(out)
        out[touched] = self._inside(points[touched] + normal[touched] * offset[touched, None], normal[touched])
        return out

    def _inside(self, points: Float, normals: Float) -> NDArray[np.bool_]:
        """Whether points (n, 3) lie in a solid: what is met along the normal, if anything, shows its back."""
        if not len(points):
            return np.zeros(0, bool)
        hits = self._geometry.visibility.hits(points, normals)
        return np.asarray((hits.triangle >= 0) & ~hits.front)

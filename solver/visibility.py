"""What a ray meets. The only file that knows Embree.

Without embreex (no wheel exists for some platforms) a NumPy ray caster takes its place: exact, tested against
Embree, and slow; `Visibility.notice` then says so.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

try:
    from embreex.mesh_construction import TriangleMesh
    from embreex.rtcore_scene import EmbreeScene
except ImportError:  # no wheel for this platform: the NumPy caster below takes over, and says so
    EmbreeScene = None

Float = NDArray[np.floating[Any]]

SLOW_NOTICE = "embreex is missing on this platform: rays are cast by NumPy, which is hundreds of times slower"
# A ray that starts on a triangle starts this part of the triangle's largest coordinate above it: a few units in the
# last place of float32, the precision of Embree's intersections.
OFFSET = 2.0**-18
# A shadow ray ends this part of its length before the lamp's surface, for the same reason.
SHORTEN = 1e-4
# Triangles that Embree is given at once: embreex keeps the interpreter meanwhile, and a window with it.
MOST_AT_ONCE = 2**12
# Pairs of ray and triangle that the NumPy caster tests at once.
_PAIRS = 2**22


@dataclass(frozen=True, eq=False)
class Hits:
    """What rays met: triangle (n,) int32 (-1: nothing), u, v, distance (n,) float32, front (n,) bool."""

    triangle: NDArray[np.int32]
    u: Float
    v: Float
    distance: Float
    front: NDArray[np.bool_]

    def arrays(self) -> tuple[NDArray[Any], ...]:
        """All five, in this order."""
        return self.triangle, self.u, self.v, self.distance, self.front


class Visibility:
    """Rays against the scene's triangles.

    Parameters
    ----------
    corners : (t, 3, 3) float32, metres.
    embree : False forces the NumPy caster (for tests).
    at_once : triangles that Embree is given at once (for tests).
    """

    def __init__(self, corners: Float, embree: bool = True, at_once: int = MOST_AT_ONCE) -> None:
        self._corners = np.ascontiguousarray(corners, np.float32)
        self.notice = "" if embree and EmbreeScene is not None else SLOW_NOTICE
        self._scene = None
        if not self.notice and len(corners):
            self._scene = EmbreeScene()
            self._firsts = np.arange(0, len(corners), at_once, dtype=np.int32)
            self._meshes = [TriangleMesh(self._scene, self._corners[first:first + at_once])
                            for first in self._firsts]
            # Embree builds its tree with the first ray; do it here, before threads share it.
            self._scene.run(np.zeros((1, 3), np.float32), np.array([[0, 0, 1]], np.float32))

    def hits(self, origins: Float, directions: Float) -> Hits:
        """The nearest triangle along each ray: origins and directions (n, 3) float32."""
        if self._scene is None:
            return self._numpy_hits(origins, directions)
        found = self._scene.run(origins, directions, output=True)
        normal = found["Ng"]
        facing = np.einsum("ij,ij->i", normal, directions)
        return Hits(self._triangle(found), found["u"], found["v"], found["tfar"], facing < 0)

    def _triangle(self, found: dict[str, NDArray[Any]]) -> NDArray[np.int32]:
        """(n,) of the whole scene, from Embree's numbers of mesh and triangle in it; -1 where there is none."""
        triangle: NDArray[np.int32] = found["primID"]
        if len(self._firsts) > 1:
            first = np.take(self._firsts, found["geomID"], mode="wrap")
            first[triangle < 0] = 0
            triangle += first
        return triangle

    def occluded(self, origins: Float, directions: Float, distances: Float) -> NDArray[np.bool_]:
        """Whether anything lies within the distances: (n,) bool."""
        if self._scene is None:
            hits = self._numpy_hits(origins, directions)
            return (hits.triangle >= 0) & (hits.distance < distances)
        return np.asarray(self._scene.run(origins, directions, dists=distances, query="OCCLUDED")) >= 0

    def _numpy_hits(self, origins: Float, directions: Float) -> Hits:
        """Moeller & Trumbore 1997, every ray against every triangle."""
        count = len(origins)
        triangle = np.full(count, -1, np.int32)
        u, v = np.zeros(count, np.float32), np.zeros(count, np.float32)
        distance = np.full(count, np.inf, np.float32)
        front = np.zeros(count, bool)
        if len(self._corners):
            step = max(1, _PAIRS // len(self._corners))
            for start in range(0, count, step):
                part = slice(start, start + step)
                self._cast(origins[part], directions[part], triangle[part], u[part], v[part], distance[part],
                           front[part])
        return Hits(triangle, u, v, distance, front)

    def _cast(self, origins: Float, directions: Float, triangle: NDArray[np.int32], u: Float, v: Float,
              distance: Float, front: NDArray[np.bool_]) -> None:
        base = self._corners[:, 0].astype(np.float64)
        edge1, edge2 = self._corners[:, 1] - base, self._corners[:, 2] - base
        cross = np.cross(directions[:, None].astype(np.float64), edge2[None])
        determinant = np.einsum("tk,ntk->nt", edge1, cross)
        with np.errstate(divide="ignore", invalid="ignore"):
            inverse = 1.0 / determinant
            to_origin = origins[:, None].astype(np.float64) - base
            all_u = np.einsum("ntk,ntk->nt", to_origin, cross) * inverse
            other = np.cross(to_origin, edge1[None])
            all_v = np.einsum("nk,ntk->nt", directions.astype(np.float64), other) * inverse
            far = np.einsum("tk,ntk->nt", edge2, other) * inverse
            inside = (all_u >= 0) & (all_v >= 0) & (all_u + all_v <= 1) & (far > 0)
        far = np.where(inside, far, np.inf)
        nearest = np.argmin(far, axis=1)
        rows = np.arange(len(origins))
        met = np.isfinite(far[rows, nearest])
        triangle[:] = np.where(met, nearest, -1)
        u[:] = np.where(met, all_u[rows, nearest], 0)
        v[:] = np.where(met, all_v[rows, nearest], 0)
        distance[:] = far[rows, nearest]
        front[:] = met & (determinant[rows, nearest] > 0)

"""Where the receivers look: a few paths from them, bounce by bounce, weighted by what they would bring back."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import sky as skies
from .footprints import Footprints
from .geometry import Geometry
from .parallel import Run
from .patches import Spots
from .sampling import cosine_directions, kronecker, shifted, shifts

Float = NDArray[np.floating[Any]]

# Bounces of a path.
BOUNCES = 4
# What is usual is no less than this part of what a quarter of the rays that meet fronts exceed.
NOOKS = 0.12


@dataclass(frozen=True, eq=False)
class Importance:
    """What a few paths from the receivers met.

    spots, weight, seen_from : where they met a surface, what each matters (m,), and the distance it was seen from (m,)
        metres; the first `first` are those of the paths' first hits.
    distance : the usual one of the first hits (see `_usual`), metres.
    paths : how many paths there were.
    straight, bounced : mean irradiance of the receivers from sky and emissive surfaces, straight and over other
        surfaces, W/m2 (mean of the channels).
    glowing : what of `straight` comes from surfaces.
    """

    spots: Spots | None
    weight: Float
    seen_from: Float
    first: int
    distance: float
    paths: int
    straight: float
    bounced: float
    glowing: float


def look_around(geometry: Geometry, places: Footprints, lamp: NDArray[np.bool_], paths: int, seed: int,
                run: Run) -> Importance:
    """Follow about that many paths from all over the footprints; lamps stand for the light of triangles `lamp` (t,)."""
    each = max(1, paths // len(places))
    count = min(len(places), paths)
    rows = np.repeat(np.linspace(0, len(places) - 1, count).astype(np.int64), each)
    set_of_points = kronecker(each, 4)
    move = shifts(places.identity[rows[::each]], 4, seed + 3)
    x, y, u, v = (shifted(set_of_points[:, axis], move[:, axis]).reshape(-1) for axis in range(4))
    origins, normals = places.sample(rows, x, y)
    weight = np.ones(len(rows), np.float32)
    path = np.arange(len(rows))
    found: list[Spots] = []
    weights: list[Float] = []
    distances: list[Float] = []
    distance = 0.0
    light, glow = np.zeros((2, BOUNCES))
    for bounce in range(BOUNCES):
        directions = cosine_directions(normals, u[:, None], v[:, None])[:, 0]
        hits = geometry.visibility.hits(origins, directions)
        run.count(len(origins))
        met, missed = np.flatnonzero(hits.triangle >= 0), np.flatnonzero(hits.triangle < 0)
        sky = np.pi * skies.radiance(geometry.scene.sky, directions[missed]).mean(axis=1)
        light[bounce] += float((weight[missed] * sky).sum())
        if not len(met):
            break
        if bounce == 0:
            distance = _usual(hits.distance[met], hits.front[met])
        triangle, front = hits.triangle[met], hits.front[met]
        emission = geometry.emission(triangle, hits.u[met], hits.v[met]).mean(axis=1)
        glow[bounce] = float((weight[met] * np.where(lamp[triangle], 0, emission)).sum())
        spots = Spots.at(geometry, triangle, hits.u[met], hits.v[met], front)
        run.count(len(met))
        reflectance = geometry.reflectance(triangle, hits.u[met], hits.v[met]).mean(axis=1)
        weight = weight[met] * reflectance
        path = path[met]
        found.append(spots)
        weights.append(weight)
        distances.append(hits.distance[met])
        origins = geometry.lifted(spots.points, triangle, front)
        normals = spots.normals
        u, v = shifts(path, 2, seed + 11 * (bounce + 1)).T
    light += glow
    straight, bounced, glowing = (float(one) / len(rows) for one in (light[0], light[1:].sum(), glow[0]))
    if not found:
        extent = float(np.linalg.norm(np.ptp(geometry.corners.reshape(-1, 3), axis=0)))
        nothing = np.zeros(0, np.float32)
        return Importance(None, nothing, nothing, 0, extent, len(rows), straight, bounced, glowing)
    return Importance(Spots.join(found), np.concatenate(weights), np.concatenate(distances), len(weights[0]), distance,
                      len(rows), straight, bounced, glowing)


def _usual(distance: Float, front: NDArray[np.bool_]) -> float:
    """The median; but where most receivers lie in nooks, these do not decide for the others: little light gets there,
    so that errors are small too."""
    seen = distance[front]
    return float(max(np.median(distance), NOOKS * np.quantile(seen, 0.75) if len(seen) else 0))

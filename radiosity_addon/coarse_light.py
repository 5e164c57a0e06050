"""The light of a whole scene at a few thousand places, as fast as it can be had: what a first look shows.

    places      corners of pieces of all triangles that lie close together and face the same way; both sides of each
    rays        a few quasi-random ones from every place; what they meet stands for the nearest place there
    solve       H = q + F (rho H), all bounces; only the places that matter have rows

Where this leaves the way of a bake: places are patches and receivers at once, there are no cells, nothing is refined,
and nobody says how good it is. Works on arrays alone.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..solver import sky as skies
from ..solver.direct import DirectLight
from ..solver.errors import NothingToBake
from ..solver.footprints import ReceiverFootprints
from ..solver.geometry import Geometry
from ..solver.linear import solve_linear
from ..solver.parallel import Run
from ..solver.probes import free_receivers
from ..solver.sampling import cosine_directions, kronecker, shifted, shifts
from ..solver.settings import Settings
from ..solver.sources import light_sources

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]

# Rays of a place, and shadow rays to each lamp.
RAYS, SHADOW_RAYS = 64, 16
# Times that places are added which only others see; what is met for the first time by the last of them has its direct
# light alone.
ROUNDS = 3
# Relative residual of the linear system, far below what so few rays leave.
TOLERANCE = 1e-3
# No ray met anything.
NOTHING = -1


@dataclass(frozen=True, eq=False)
class Places:
    """Where light is asked for.

    Attributes
    ----------
    points, normals : (n, 3) metres, world space, and unit.
    surface : (n,) the surface of the scene that each lies on.
    wanted : how many of them are shown: the first ones; the others matter by what they reflect.
    nearest : (triangle, u, v) of rays' ends -> the nearest place of each.
    """

    points: Float
    normals: Float
    surface: Int
    wanted: int
    nearest: Callable[[Int, Float, Float], Int]


def coarse_light(geometry: Geometry, settings: Settings, places: Places, run: Run) -> Float:
    """Irradiance of the wanted places' fronts, (wanted, 3) W/m2.

    Raises
    ------
    NothingToBake
        If nothing in the scene shines.
    Cancelled
        If the user wants to stop.
    """
    return _Light(geometry, settings, places, run).solved()


class _Light:
    """One solution. A node is a side of a place: 2 * place, and 1 more for the back."""

    def __init__(self, geometry: Geometry, settings: Settings, places: Places, run: Run) -> None:
        scene = geometry.scene
        self._scene, self._settings, self._places, self._run = scene, settings, places, run
        self._geometry = geometry
        lights, self._is_lamp = light_sources(self._geometry)
        if not (lights or np.any(scene.emission) or not scene.sky.is_black):
            raise NothingToBake("the scene has no light: add a lamp, an emissive material or a world colour")
        self._direct = DirectLight(self._geometry, lights, settings.seed)
        # By row: the node; what its rays meet, as nodes, (n, RAYS), and what these reflect (n, RAYS, 3); the light that
        # comes straight from sky and surfaces (n, 3).
        self._nodes: list[Int] = []
        self._met: list[Int] = []
        self._reflected: list[Float] = []
        self._straight: list[Float] = []

    def solved(self) -> Float:
        """See `coarse_light`."""
        wanted = 2 * np.arange(self._places.wanted)
        known, fresh = wanted, wanted
        for step in range(ROUNDS):
            self._run.step(step / ROUNDS)
            self._trace(fresh)
            met = np.unique(self._met[-1])
            fresh = np.setdiff1d(met[met != NOTHING], known, assume_unique=True)
            known = np.concatenate([known, fresh])
            if not len(fresh):
                break
        rows = np.concatenate(self._nodes)
        self._run.check()
        lamps = self._lamps(known)
        # Nodes by their number among the known ones, which begin with those that have rows; the last is nothing.
        number = np.full(2 * len(self._places.points) + 1, len(known), np.int64)
        number[known] = np.arange(len(known))
        met, reflected = number[np.concatenate(self._met)], np.concatenate(self._reflected)
        straight = np.concatenate(self._straight)
        first = lamps.copy()
        first[:len(rows)] += straight

        def bounce(light: Float) -> Float:
            table = np.concatenate([light, np.zeros((len(known) + 1 - len(light), 3), np.float32)])
            return np.asarray(np.einsum("nrk,nrk->nk", reflected, np.take(table, met, axis=0)) / np.float32(RAYS))

        bounced = solve_linear(bounce, bounce(first), TOLERANCE, self._run.check).value[:len(wanted)]
        straight = first[:len(wanted)]
        return {"direct": straight, "indirect": bounced}.get(self._settings.passes, straight + bounced)

    def _receivers(self, nodes: Int) -> ReceiverFootprints:
        place, back = np.divmod(nodes, 2)
        points = np.asarray(self._places.points[place] - self._scene.origin, np.float32)
        normals = np.asarray(self._places.normals[place] * np.where(back, -1, 1)[:, None], np.float32)
        surface = np.asarray(self._places.surface[place], np.int32)
        return ReceiverFootprints(self._geometry, free_receivers(points, normals, surface), 0.0, self._settings.seed)

    def _lamps(self, nodes: Int) -> Float:
        """(n, 3) float32 irradiance from the lamps."""
        return self._direct.irradiance(self._receivers(nodes), self._run, pilot=SHADOW_RAYS)

    def _trace(self, nodes: Int) -> None:
        """Send the rays of some nodes, and note what they meet."""
        shift = shifts(nodes, 2, self._settings.seed + 1)
        across, along = (shifted(column, shift[:, axis]) for axis, column in enumerate(kronecker(RAYS, 2).T))
        middle = np.full(len(nodes), 0.5, np.float32)
        origins, normals = self._receivers(nodes).sample(np.arange(len(nodes)), middle, middle)
        directions = cosine_directions(normals, across, along).reshape(-1, 3)
        hits = self._geometry.visibility.hits(np.repeat(origins, RAYS, axis=0), directions)
        there = hits.triangle >= 0
        triangle, u, v = hits.triangle[there], hits.u[there], hits.v[there]
        met = np.full(len(directions), NOTHING, np.int64)
        met[there] = 2 * self._places.nearest(triangle, u, v) + ~hits.front[there]
        reflected = np.zeros((len(directions), 3), np.float32)
        reflected[there] = self._geometry.reflectance(triangle, u, v)
        straight = np.zeros((len(directions), 3), np.float32)
        # Emitters that are lamps have given their light already.
        straight[there] = np.where(self._is_lamp[triangle][:, None], 0, self._geometry.emission(triangle, u, v))
        straight[~there] = np.float32(np.pi) * skies.radiance(self._scene.sky, directions[~there])
        self._run.count(len(directions))
        self._nodes.append(nodes)
        self._met.append(met.reshape(-1, RAYS))
        self._reflected.append(reflected.reshape(-1, RAYS, 3))
        self._straight.append(straight.reshape(-1, RAYS, 3).mean(axis=1))

"""Lumels that nobody sees: inside another solid, or under a face that touches theirs.

Such a lumel is dark, and a lightmap that is filtered while it is drawn shows its darkness as teeth along every line in
which two solids stick in each other. Its texel is no better than an empty one, so the chart's margin grows over it,
from the darkest of the lumels beside: where both sides of a thin wall are one chart, no light comes through.

A solid is a surface without a gap. What is behind an open one may be as dark, but light does get there, so that
somebody may look: it keeps what it has.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .fans import Fans
from .geometry import Geometry
from .islands import Islands
from .neighbours import LumelNeighbours
from .parallel import Run, shares
from .settings import Settings
from .visibility import Hits, Visibility

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]

# Rays of a lumel, all of which must meet the back of a solid, or a back from under a face that touches: a few rule out
# most of the dark ones.
RAYS = (4, 32)
# A lumel with more light than this part of the mean is seen: some rooms have walls that face outward.
DARK = 0.03
CHUNK_RAYS = 2**17


def shown(fans: Fans, geometry: Geometry, near: LumelNeighbours, light: Float, settings: Settings,
          run: Run) -> NDArray[np.integer[Any]]:
    """(n,) the lumel whose light each one shows: its own, but where the margin grows over what nobody sees. Arguments
    as in `unseen`; near : the lumels beside one another."""
    if not settings.margin:
        return np.arange(len(light))
    seen = ~unseen(fans, geometry, light, settings.seed + 13, run)
    return stand_ins(seen, light, near.in_chart(1), settings.margin)


def unseen(fans: Fans, geometry: Geometry, light: Float, seed: int, run: Run) -> NDArray[np.bool_]:
    """(n,) which lumels nobody sees.

    Parameters
    ----------
    fans : of the lumels.
    geometry : of the scene.
    light : (n, 3) their irradiance, W/m2.
    """
    level = light.mean(axis=1)
    found = np.asarray(level <= DARK * level.mean())
    if not found.any():
        return found
    solid = Islands.of(geometry.corners, geometry.surface).solid
    for count in RAYS:
        rows = np.flatnonzero(found)
        run.count(len(rows) * count)
        look = partial(_all_inside, fans, geometry.visibility, solid, rows, count, seed)
        parts = run.map(look, shares(len(rows), CHUNK_RAYS // count))
        found[rows] = np.concatenate(parts) if parts else False
    return found


def _all_inside(fans: Fans, visibility: Visibility, solid: NDArray[np.bool_], rows: Int, count: int, seed: int,
                part: slice) -> NDArray[np.bool_]:
    hits, lit = _looks(fans, visibility, rows[part], count, seed)
    inside = _backs(hits) & (solid[hits.triangle] | ~lit)
    return np.asarray(inside.reshape(-1, count).all(axis=1))


def closed_rays(fans: Fans, visibility: Visibility, rows: Int, count: int, seed: int) -> NDArray[np.bool_]:
    """(n, count): which rays of receivers `rows` (n,) start covered or meet a back."""
    hits, lit = _looks(fans, visibility, rows, count, seed)
    return np.asarray((_backs(hits) | ~lit).reshape(-1, count))


def _looks(fans: Fans, visibility: Visibility, rows: Int, count: int, seed: int) -> tuple[Hits, NDArray[np.bool_]]:
    """What rays meet, and at which of their starts light can arrive (n * count,)."""
    origins, directions, lit = fans.rays(rows, count, seed)
    return visibility.hits(origins, directions), np.ones(len(origins), bool) if lit is None else lit


def _backs(hits: Hits) -> NDArray[np.bool_]:
    return np.asarray((hits.triangle >= 0) & ~hits.front)


def stand_ins(seen: NDArray[np.bool_], light: Float, around: Int, rings: int) -> Int:
    """(n,) the lumel whose light each one shows: of those that are seen itself, of others the darkest that is beside,
    or beside such a one, and so on for some rings; itself beyond.

    Parameters
    ----------
    seen : (n,).
    light : (n, 3) W/m2.
    around : (n, 8) the lumels beside, of the same chart; -1 for none.
    """
    level = np.append(light.mean(axis=1), np.inf)
    shown = np.arange(len(seen))
    rest = np.flatnonzero(~seen)
    known = np.append(seen, False)
    for _ in range(rings):
        beside = around[rest]
        value = np.where(known[beside], level[beside], np.inf)
        best = np.argmin(value, axis=1)
        row = np.arange(len(rest))
        found = np.isfinite(value[row, best])
        if not found.any():
            break
        fresh, source = rest[found], beside[row, best][found]
        shown[fresh], level[fresh] = shown[source], level[source]
        known[fresh] = True
        rest = rest[~found]
    return shown

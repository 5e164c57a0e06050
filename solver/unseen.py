"""Lumels that nobody sees: inside another solid, or under a face that touches theirs.

Such a lumel is dark, and a lightmap that is filtered while it is drawn shows its darkness as teeth along every line in
which two solids stick in each other. Its texel is no better than an empty one, so the chart's margin grows over it,
from the darkest of the lumels beside: where both sides of a thin wall are one chart, no light comes through.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .fans import Fans
from .parallel import Run, shares
from .visibility import Visibility

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]

# Rays of a lumel, all of which must start covered or meet a back: a few rule out most of the dark ones.
RAYS = (4, 32)
# A lumel with more light than this part of the mean is seen: some rooms have walls that face outward.
DARK = 0.03
CHUNK_RAYS = 2**17


def unseen(fans: Fans, visibility: Visibility, light: Float, seed: int, run: Run) -> NDArray[np.bool_]:
    """(n,) which lumels nobody sees.

    Parameters
    ----------
    fans : of the lumels.
    light : (n, 3) their irradiance, W/m2.
    """
    level = light.mean(axis=1)
    found = np.asarray(level <= DARK * level.mean())
    for count in RAYS:
        rows = np.flatnonzero(found)
        run.count(len(rows) * count)
        look = partial(_all_closed, fans, visibility, rows, count, seed)
        parts = run.map(look, shares(len(rows), CHUNK_RAYS // count))
        found[rows] = np.concatenate(parts) if parts else False
    return found


def _all_closed(fans: Fans, visibility: Visibility, rows: Int, count: int, seed: int,
                part: slice) -> NDArray[np.bool_]:
    return np.asarray(closed_rays(fans, visibility, rows[part], count, seed).all(axis=1))


def closed_rays(fans: Fans, visibility: Visibility, rows: Int, count: int, seed: int) -> NDArray[np.bool_]:
    """(n, count): which rays of receivers `rows` (n,) start covered or meet a back."""
    origins, directions, lit = fans.rays(rows, count, seed)
    hits = visibility.hits(origins, directions)
    closed = (hits.triangle >= 0) & ~hits.front
    if lit is not None:
        closed |= ~lit
    return np.asarray(closed.reshape(-1, count))


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

"""Takes down the paths of a bake (see `paths`) while the gather follows them: no ray is traced for it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from .cells import NOTHING
from .mixing import Layer
from .paths import KeptLook, Level, Paths, light_rows, shape_of, sky_hits
from .recolour import reflectance_of

if TYPE_CHECKING:
    from .gather import Leg, Look
    from .split import Split
    from .transport import Transport

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]

# Bytes that the hits of all receivers may take, and the fewest rays of a look that are worth to be kept.
MOST_BYTES = 2**29
LEAST_RAYS = 8


def rays_kept(receivers: int, traced: int) -> int:
    """Rays of each of the two looks that are kept of those that are traced, a power of two; 0 if too few would fit."""
    fitting = MOST_BYTES // max(8 * receivers, 1)
    if fitting < LEAST_RAYS:
        return 0
    return int(min(traced, 2 ** int(np.log2(fitting))))


class LookKeeper:
    """One look at all receivers.

    Parameters
    ----------
    receivers, rays : how many, and how many rays of each are kept. The first rays of a quasi-random set are such a set.
    """

    def __init__(self, receivers: int, rays: int) -> None:
        self._rays = rays
        self._hits = np.full((receivers, rays), NOTHING, np.int32)
        self._levels: list[list[Level]] = []

    def take(self, look: Look, lit: NDArray[np.bool_] | None, trail: Sequence[Leg]) -> None:
        """What the rays of some receivers met; called in the order of the receivers.

        lit : (n * count,) at which rays' starts light can arrive; None for all.
        trail : the bounces of these rays.
        """
        kept = np.tile(np.arange(look.count) < self._rays, len(look.rows))
        cell = trail[0].cell if lit is None else np.where(lit, trail[0].cell, NOTHING)
        self._hits[look.rows] = cell[kept].reshape(len(look.rows), self._rays)
        first = int(look.rows[0]) * self._rays
        for depth, (before, leg) in enumerate(zip(trail[:-1], trail[1:], strict=True)):
            number = np.cumsum(kept) - 1
            going = kept[before.near]
            missed = going[sky_hits(leg.cell)] if len(before.sky) else np.empty(0, bool)
            level = Level(np.asarray(number[before.near[going]] + first, np.int32), leg.cell[going],
                          float(before.factor.max(initial=0)), before.sky[missed])
            first = self._add(depth, level)
            kept = going

    def _add(self, depth: int, level: Level) -> int:
        """Append to a level; how many rays it had before."""
        if depth == len(self._levels):
            self._levels.append([])
        count = sum(len(part.cell) for part in self._levels[depth])
        self._levels[depth].append(level)
        return count

    def look(self) -> KeptLook:
        """What was taken down."""
        levels = (_joined(parts) for parts in self._levels)
        return KeptLook(self._hits, tuple(level for level in levels if len(level.cell)))


def _joined(parts: Sequence[Level]) -> Level:
    """One level of all receivers; all its rays stand for as many."""
    parent, cell, sky = (np.concatenate([getattr(part, name) for part in parts]) for name in ("parent", "cell", "sky"))
    return Level(parent, cell, max(part.factor for part in parts), sky)


class PathKeeper:
    """The first rays of a gather: both of its looks at all receivers.

    Parameters
    ----------
    receivers : how many.
    traced : rays of each look.
    """

    def __init__(self, receivers: int, traced: int) -> None:
        self._receivers, self._rays = receivers, rays_kept(receivers, traced)
        self._looks: dict[int, LookKeeper] = {}

    def take(self, look: Look, lit: NDArray[np.bool_] | None, trail: Sequence[Leg]) -> None:
        """As `LookKeeper.take`; looks are told apart by their seeds. Rays that are added to others are left out."""
        if look.start == 0:
            if look.seed not in self._looks:
                self._looks[look.seed] = LookKeeper(self._receivers, self._rays)
            self._looks[look.seed].take(look, lit, trail)

    def paths(self, transport: Transport) -> Paths:
        """All that is kept, of a solved transport that the gather has asked everything."""
        met, split, cells = transport.met, transport.split, transport.cells
        incident = ([met.incident] if split is None else [met.incident_of(group) for group in range(len(split))])
        glowing, glow, owner = _glow(transport)
        tintless = _tintless_sky(split)
        rows = (light_rows(rows.patch, rows.hits, tintless(rows.mean_sky()))
                for rows in (*transport.rows, *transport.late_rows))
        looks = (_with_sky(keeper.look(), tintless) for keeper in self._looks.values())
        return Paths(
            shape_of(transport.geometry.scene), cells.size, np.array(cells.side), np.array(transport.cell_patch),
            reflectance_of(transport.geometry, cells.size, cells.side, transport.run),
            tuple(Layer.of(light) for light in incident), glowing, glow, owner, 0 if split is None else split.sky_group,
            len(transport.patches), tuple(rows), tuple(looks))


def _glow(transport: Transport) -> tuple[NDArray[np.int32], Float, NDArray[np.int32]]:
    """Cells that emit what no lamp stands for, (k, 3) W/m2 without its tint, and whose it is."""
    met, split, cells = transport.met, transport.split, transport.cells
    glowing = np.flatnonzero(met.emission.any(axis=1)).astype(np.int32)
    glow = met.emission[glowing]
    if split is None:
        return glowing, glow, np.zeros(len(glowing), np.int32)
    owner = split.triangle_group[cells.triangle_of(cells.side[glowing])]
    for group in np.unique(owner):
        glow[owner == group] = split.white(int(group), glow[owner == group])
    return glowing, glow, owner


def _tintless_sky(split: Split | None) -> Callable[[Float], Float]:
    """What takes the sky's tint off its light (n, 3)."""
    if split is None or split.sky_group < 0:
        return lambda sky: sky
    return lambda sky: split.white(split.sky_group, sky)


def _with_sky(look: KeptLook, change: Callable[[Float], Float]) -> KeptLook:
    """The look with another sky."""
    return KeptLook(look.hits, tuple(Level(level.parent, level.cell, level.factor, change(level.sky))
                                 for level in look.levels))

"""Final gather: the indirect and sky light of any list of footprints, from what cells and patches send back.

    E_indirect = mean over cosine-distributed rays of  rho(hit) (E_direct(hit) + H_patch(hit)) + emission(hit)

Where we leave the textbook:

1. Where most rays meet something nearer than its patch is wide (the gap behind a board, the inside of a drawer), the
   patches' means say little. There, rays go on, bounce by bounce, until they ask a patch from afar. So do rays that
   meet the back of something near: what of a footprint lies inside of a solid is confined. Bright cells are near from
   further away (`Transport.table`).
2. What a ray brings beyond `peak` is kept apart: few rays meet a strip of ceiling right over a lamp, and a receiver
   that happens to has a speckle. Both parts are smoothed, each by its own noise, and add up to the whole.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .fans import Fans
from .guides import Guides, Tally
from .met import Met
from .parallel import Run, shares
from .plan import FEW_RECEIVERS
from .sampling import cosine_directions, shifts
from .seen import Seen
from .tables import mean_of_channels, mean_over_rays
from .transport import Transport

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]

CHUNK_RAYS = 2**17
# Fewer rays than this are not worth a thread.
LEAST_RAYS = 2**13
# Rays between two looks at what cells are new (some 50 bytes each); half as many where receivers take much memory.
PASS_RAYS = 2**22
# A receiver is confined if this part of its rays meet a patch nearer than NEAR_PATCHES times its width. Such rays go
# on, and so do rays of other receivers that meet a back so near; their last hit, of so many, asks its patch.
CONFINED = 0.4
NEAR_PATCHES = 0.5
MOST_BOUNCES = 4
# From this bounce on a ray goes on by chance, and then stands for those that did not: long ways lead through the dark.
ROULETTE_FROM = 1
ROULETTE = np.float32(0.5)
# Rays of a patch that was met only now.
LATE_RAYS = 64
# More than any receiver has: what tells its rays from the next one's.
MOST_RAYS = 2**24


@dataclass(frozen=True, eq=False)
class Leg:
    """One bounce of rays, kept so that every light group can follow it.

    going : which rays (m,); None for all.
    carried : (m, 3) reflectance so far; None for 1.
    cell : (m,) rows of the cells that they met.
    near, factor : which of these went on, and for how many each stands (k, 1).
    missed, ended, sky : which rays then met the sky, the reflectance along them (j, 3), and the irradiance that each
        stands for (j, 3) W/m2.
    """

    going: Int | None
    carried: Float | None
    cell: Int
    near: Int
    factor: Float
    missed: Int
    ended: Float
    sky: Float


@dataclass(frozen=True, eq=False)
class Look:
    """Rays of some receivers.

    rows : (n,) the receivers.
    count, start : rays of each, from this point of the point set on.
    seed : of the shifts.
    guides : where the rays go; None for cosine-distributed ones.
    """

    rows: Int
    count: int
    start: int
    seed: int
    guides: Guides | None = None

    def pieces(self) -> list[Look]:
        """The same in pieces, for threads."""
        parts = shares(len(self.rows), max(1, CHUNK_RAYS // self.count), LEAST_RAYS // self.count)
        return [replace(self, rows=self.rows[part]) for part in parts]


@dataclass
class _Rays:
    """The rays of a piece of a look, while they are followed."""

    look: Look  # some receivers
    fresh: Seen  # where the last hits met cells that have no row yet
    sky: Float  # (2, n, 3) mean irradiance, without peaks and these alone
    lit: NDArray[Any] | None  # (n * rays,) how many each stands for, 0 where no light arrives at its start; None: 1
    going: Int  # which rays go on,
    met: Met  # what they met last,
    carried: Float  # and the reflectance so far, (going, 3)
    value: Float  # (n * rays, 4) radiosity brought so far
    cell: Int = field(default_factory=lambda: np.empty(0, np.int32))  # rows of the cells that they met last,
    first: Int = field(default_factory=lambda: np.empty(0, np.int32))  # and (n * rays,) of those that they met first
    high: Int = field(default_factory=lambda: np.empty(0, np.int64))  # which rays have a peak in the end,
    over: Float = field(default_factory=lambda: np.empty(0, np.float32))  # and which part of what they bring it is
    trail: list[Leg] = field(default_factory=list)  # where it came from, if somebody asks for it
    from_sky: tuple[Int, Float] = (np.empty(0, np.int64), np.empty((0, 3), np.float32))  # which met the sky at once


class Gather:
    """Gathers light from a solved Transport.

    Parameters
    ----------
    transport : cells, patches, rows, solved.
    peak : radiosity, W/m2 (mean of the channels), of which more is kept apart.
    """

    def __init__(self, transport: Transport, peak: float = np.inf) -> None:
        self.transport, self._peak = transport, np.float32(peak)

    def meet(self, fans: Fans, look: Look, run: Run) -> NDArray[np.int32]:
        """Let rays find cells; return the cells' rows, NOTHING for the sky."""
        pieces = run.map(partial(self._trace, fans), look.pieces())
        self.transport.meet([piece.fresh for piece in pieces])
        return np.concatenate([piece.met.rows(self.transport.cells) for piece in pieces])

    def light(self, fans: Fans, looks: Sequence[Look], run: Run, tally: Tally | None = None) -> list[Float]:
        """What each look finds: (n, 2, 6 + 3 g) float32, W/m2. Irradiance from sky and gathered emitters, and from
        light that surfaces reflect, and what of both is wanted of each light group; without peaks, and peaks alone.

        All looks go on together, since every bounce may meet cells that have no light yet, and it takes as long to give
        it to few as to many. What those of the first find, and where, is taken down in `tally`.
        """
        pieces = [(number, piece) for number, look in enumerate(looks) for piece in look.pieces()]
        found: list[list[Float]] = [[] for _ in looks]
        at_once = PASS_RAYS if len(fans) <= FEW_RECEIVERS else PASS_RAYS // 2
        passes = _passes([len(piece.rows) * piece.count for _, piece in pieces], at_once)
        for number, part in enumerate(passes):
            traced = run.map(lambda job: self._trace(fans, job[1]), pieces[part])
            going = traced
            first = [rays for (look, _), rays in zip(pieces[part], traced, strict=True) if look == 0 and tally]
            for rays in first:
                rays.from_sky = rays.met.missed, rays.met.sky
            for bounce in range(MOST_BOUNCES):
                self.transport.meet([rays.fresh for rays in going])
                for rays, cell in zip(going, self.transport.look_again([rays.met for rays in going]), strict=True):
                    rays.cell = cell
                self.transport.late(LATE_RAYS)
                run.map(_Step(self.transport, bounce).follow, going)
                going = [rays for rays in going if len(rays.going)]
                if not going:
                    break
            if self.transport.keeper is not None:
                for rays in traced:
                    if rays.look.guides is None:
                        self.transport.keeper.take(rays.look, rays.lit, rays.trail)
            if tally is not None:
                for found_there in run.map(lambda rays: self._tallied(fans, rays, tally), first):
                    tally.add(*found_there)
            collect = partial(self._collect, shining=self._shining())
            for (look, _), light in zip(pieces[part], run.map(collect, traced), strict=True):
                found[look].append(light)
            run.report((number + 1) / len(passes))
        return [np.concatenate(parts) for parts in found]

    def _trace(self, fans: Fans, look: Look) -> _Rays:
        origins, directions, lit = fans.rays(look.rows, look.count, look.seed, look.start, look.guides)
        met = self.transport.trace(origins, directions)
        fresh = met.fresh(directions, self.transport.geometry.normal)
        nothing = np.empty((0, 4), np.float32)
        return _Rays(look, fresh, self._mean_sky(met, look, lit), lit, np.arange(len(met.sides)), met,
                     nothing, nothing)

    def _tallied(self, fans: Fans, rays: _Rays, tally: Tally) -> tuple[Int, Float]:
        """What rays brought, and from where."""
        light, (missed, sky), look = mean_of_channels(rays.value), rays.from_sky, rays.look
        light[missed] += mean_of_channels(sky)
        if rays.lit is not None:
            light *= rays.lit
        return tally.of(look.rows, *fans.coordinates(look.rows, look.count, look.seed), light)

    def _mean_sky(self, met: Met, look: Look, lit: NDArray[Any] | None) -> Float:
        """(2, n, 3) the sky's irradiance of each receiver."""
        sky = met.sky if lit is None else met.sky * lit[met.missed, None]
        high, over = self._peaks(met.sky)
        peaks = _mean_of(sky[high] * over[:, None], met.missed[high], look)
        return np.stack([_mean_of(sky, met.missed, look) - peaks, peaks])

    def _peaks(self, light: Float) -> tuple[Int, Float]:
        """Which of rays that bring `light` (n, 3 or 4) have a peak, and which part of it that is."""
        brightness = mean_of_channels(light)
        high = np.flatnonzero(brightness > self._peak)
        return high, np.asarray(1 - self._peak / brightness[high], np.float32)

    def _shining(self) -> list[Float | None]:
        """(cells + 1, 4) what the cells emit, of all light and of each light group; None for nothing."""
        split = self.transport.split
        groups = range(0 if split is None else len(split))
        return [self.transport.emission(), *(self.transport.emission_of(group) for group in groups)]

    def _collect(self, rays: _Rays, shining: Sequence[Float | None]) -> Float:
        """(n, 2, 6 + 3 g), see `light`."""
        rays.high, rays.over = self._peaks(rays.value)
        total = self._mean(rays.value, rays)
        emission, *of_groups = shining
        apart = [self._of_group(rays, group, own) for group, own in enumerate(of_groups)]
        if emission is None:
            parts = [rays.sky, total, *apart]
        else:
            seen = np.take(emission, rays.first, axis=0)
            emitted = self._mean(seen, rays)
            parts = [rays.sky + emitted, total - emitted, *apart]
        return np.asarray(np.concatenate(parts, axis=2).transpose(1, 0, 2))

    def _mean(self, values: Float, rays: _Rays) -> Float:
        """(2, n, 3) mean over the rays of each receiver, without peaks and these alone; changes the values."""
        if rays.lit is not None:
            values *= rays.lit[:, None]
        mean = mean_over_rays(values, rays.look.count)
        peaks = _mean_of(values[rays.high, :3] * rays.over[:, None], rays.high, rays.look)
        return np.stack([mean - peaks, peaks])

    def _of_group(self, rays: _Rays, group: int, emission: Float | None) -> Float:
        """(2, n, 3) what is wanted of a light group's irradiance; `emission` (cells + 1, 4) is its own."""
        split = self.transport.split
        assert split is not None
        first = split.white(group, rays.sky) if group == split.sky_group else np.zeros_like(rays.sky)
        if split.passes == "both":
            return first + self._brought(rays, group)
        emitted = np.zeros_like(first)
        if emission is not None:
            emitted = self._mean(np.take(emission, rays.first, axis=0), rays)
        return first + emitted if split.passes == "direct" else self._brought(rays, group) - emitted

    def _brought(self, rays: _Rays, group: int) -> Float:
        """(2, n, 3) what the rays brought of a light group: the way of `_Step` again, with its light."""
        transport, split = self.transport, self.transport.split
        assert split is not None
        table, direct = transport.table_of(group), transport.met.direct_of(group)
        value = np.empty((0, 4), np.float32)
        for leg in rays.trail:
            brought = np.take(table, leg.cell, axis=0)
            brought[leg.near, :3] += (direct[leg.cell[leg.near]] - brought[leg.near, :3]) * leg.factor
            if leg.going is None or leg.carried is None:
                value = brought
            else:
                value[leg.going, :3] += leg.carried * brought[:, :3]
            if group == split.sky_group:
                value[leg.missed, :3] += leg.ended * split.white(group, leg.sky)
        return self._mean(value, rays)


class _Step:
    """One bounce of all rays: those that met something far ask its patch, the others look further."""

    def __init__(self, transport: Transport, bounce: int) -> None:
        self._transport, self._bounce = transport, bounce
        self._table = transport.table()

    def follow(self, rays: _Rays) -> None:
        """Bring what is met to the receivers, and trace on where it is near."""
        transport = self._transport
        cell = rays.cell
        brought = np.take(self._table, cell, axis=0)
        reach = brought[:, 3] * np.float32(NEAR_PATCHES)
        near, factor = self._go_on(rays, np.flatnonzero(rays.met.hits.distance < reach))
        here = cell[near]
        reflectance = np.take(transport.cell_reflectance, here, axis=0)
        # A ray that goes on brings the direct light from here, and leaves the rest to what it meets.
        straight = np.take(transport.cell_direct, here, axis=0)
        brought[near, :3] += (straight - np.take(brought, near, axis=0)[:, :3]) * factor
        going, carried = (None, None) if self._bounce == 0 else (rays.going, rays.carried)
        if self._bounce == 0:
            rays.first, rays.value, rays.carried = cell, brought, reflectance * factor
        else:
            rays.value[rays.going, :3] += rays.carried * brought[:, :3]
            rays.carried = np.take(rays.carried, near, axis=0) * reflectance * factor
        rays.going = rays.going[near]
        self._trace_on(rays, near)
        if transport.split is not None or transport.keeper is not None:
            missed = rays.met.missed
            rays.trail.append(Leg(going, carried, cell, near, factor, rays.going[missed], rays.carried[missed],
                                  rays.met.sky))

    def _go_on(self, rays: _Rays, near: Int) -> tuple[Int, Float]:
        """Which of the rays near to what they met go on, and for how many each stands (n, 1)."""
        count = rays.look.count
        if self._bounce == MOST_BOUNCES - 1:
            near = near[:0]
        elif self._bounce == 0:
            stand_for = None if rays.look.guides is None or rays.lit is None else rays.lit[near]
            confined = np.bincount(near // count, stand_for, len(rays.look.rows)) >= CONFINED * count
            near = near[confined[near // count] | ~rays.met.hits.front[near]]
        elif self._bounce >= ROULETTE_FROM:
            chance = shifts(self._identity(rays, rays.going[near]), 1, rays.look.seed + 301 + self._bounce)[:, 0]
            near = near[chance < ROULETTE]
            return near, np.full((len(near), 1), 1 / ROULETTE, np.float32)
        return near, np.ones((len(near), 1), np.float32)

    def _identity(self, rays: _Rays, which: Int) -> Int:
        look = rays.look
        ray = look.start + which % look.count
        return np.asarray(look.rows[which // look.count] * np.int64(MOST_RAYS) + ray)

    def _trace_on(self, rays: _Rays, near: Int) -> None:
        geometry = self._transport.geometry
        hits = rays.met.hits
        triangle, front = hits.triangle[near], hits.front[near]
        start = geometry.lifted(geometry.point(triangle, hits.u[near], hits.v[near]), triangle, front)
        normal = np.take(geometry.normal, triangle, axis=0)
        normal = np.where(front[:, None], normal, -normal)
        u, v = shifts(self._identity(rays, rays.going), 2, rays.look.seed + 5 + self._bounce).T
        directions = cosine_directions(normal, u[:, None], v[:, None])[:, 0]
        rays.met = self._transport.trace(start, directions, ~front)
        rays.fresh = rays.met.fresh(directions, geometry.normal)
        missed = rays.met.missed
        rays.value[rays.going[missed], :3] += rays.carried[missed] * rays.met.sky


def _mean_of(light: Float, ray: Int, look: Look) -> Float:
    """(n, 3) mean over the rays of each receiver, of which only `ray` (m,) bring light (m, 3)."""
    row = ray // look.count
    columns = [np.bincount(row, light[:, axis], len(look.rows)) for axis in range(3)]
    return np.asarray(np.stack(columns, axis=1) / look.count, np.float32)


def _passes(rays: Sequence[int], most: int) -> list[slice]:
    """Runs of pieces with about `most` rays each."""
    number = (np.cumsum(rays) - 1) // most
    edges = np.append(np.flatnonzero(np.diff(number, prepend=-1)), len(number))
    return [slice(first, last) for first, last in zip(edges[:-1], edges[1:], strict=True)]

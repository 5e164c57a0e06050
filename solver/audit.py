"""An independent check of a bake: path tracing with next-event estimation at random receivers.

It shares no patch, no cell, no interpolation and no random number with the bake: the lamps' light at the receivers
themselves is taken from shadow rays of its own, everything else from paths. What it says about the bake is
freed of the audit's own noise: with d_k the deviation at receiver k and s_k the standard error of its truth,

    bias = mean(d_k)      RMS^2 = mean(d_k^2 - s_k^2)
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import count
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import sky as skies
from .banks import banks
from .direct import DirectLight
from .footprints import Footprints
from .geometry import Geometry
from .lamp_draw import LampDraw
from .light_bounds import LightBounds
from .lights import Light
from .linking import Reach, links_of
from .parallel import Run, slices
from .sampling import cosine_directions, rays_of_places, shifted
from .visibility import SHORTEN

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]

CHUNK_PATHS = 2**15
# Independent groups of paths at a receiver, from which its standard error is taken.
GROUPS = 8
# A mean square this many standard errors below zero is taken for chance all the same.
MOST_DEVIATIONS = 5.0
# By which part of itself the mean square that a bake expects may be off (one standard deviation).
EXPECTED_DOUBT = 0.5
# Standard errors to either side of an interval of 95 %.
INTERVAL = 1.96
# Shadow rays of a receiver and lamp in each group.
DIRECT_RAYS = 32
# By which part of their mean the lamps' light in each group may be off (standard deviation): beside a lamp and in
# penumbrae there are more rays.
DIRECT_ERROR = 0.1
# From this bounce on, paths end at random in proportion to what they carry, and one in so many whatever that is: those
# in boxes that absorb nothing would never. No bounce is the last for certain, or bright closed rooms would seem darker
# than they are.
ROULETTE_FROM, MOST_CHANCE = 3, 0.995
# A lamp that would fill this part of what a point sees (its form factor) is beside it.
BESIDE = 0.1
# Where light arrives at fewer than this part of the wanted number of receivers, as many are drawn once more, and so on
# until so many times that number have been: those in closed boxes that no light gets into tell nothing.
LEAST_LIT, MOST_DRAWN = 0.5, 4
# Up to this many lamps each gets a shadow ray of its own at every vertex.
FEW_LAMPS = 4


@dataclass(frozen=True, eq=False)
class Truth:
    """Irradiance at audited receivers: rows (k,), direct and indirect (k, 3) and (k, groups, 3) W/m2."""

    rows: Int
    direct: Float
    indirect: Float

    @classmethod
    def concatenate(cls, parts: Sequence[Truth]) -> Truth:
        """Of all receivers in the parts."""
        rows, direct, indirect = ([getattr(part, name) for part in parts] for name in ("rows", "direct", "indirect"))
        return cls(np.concatenate(rows), np.concatenate(direct), np.concatenate(indirect))

    def lit(self) -> int:
        """At how many receivers light arrives."""
        return int(self.groups("both").any(axis=(1, 2)).sum())

    def groups(self, passes: str) -> Float:
        """(k, groups, 3): independent estimates of what the passes ask for."""
        return {"direct": self.direct, "indirect": self.indirect, "both": self.direct + self.indirect}[passes]


@dataclass(frozen=True)
class ErrorBar:
    """Relative errors, as fractions of the mean of the audited light.

    `rms` and `bias` are freed of the audit's noise. Where that noise hides the error, `rms` leans on what the bake
    itself expects; where that is not known, it is the mean of what it may be. `p95` and `worst` are scaled down to the
    same RMS. The true RMS lies between `rms_low` and `rms_high`, the audit's own, with a probability of about 95 %.
    """

    rms: float
    rms_low: float
    rms_high: float
    p95: float
    worst: float
    bias: float
    bias_standard_error: float
    lumels_audited: int


def error_bar(baked: Float, groups: Float, expected: float | None = None) -> ErrorBar:
    """Compare baked values (k, 3) with independent estimates (k, groups, 3).

    expected : the relative RMS error that the bake itself expects; None if it does not say.

    Receivers count that are lit in either: those that the audit's few paths found lit would be the ones that it found
    too bright.
    """
    lit = groups.any(axis=(1, 2)) | baked.any(axis=1)
    baked, groups = baked[lit], groups[lit]
    if not len(baked):
        return ErrorBar(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0)
    mean = groups.mean(axis=1)
    # Where the audit finds no light at all, what the bake found is what it is off by.
    level = float(mean.mean()) or float(baked.mean())
    noise = groups.var(axis=1, ddof=1) / groups.shape[1]
    level_noise = float(np.sqrt(noise.mean(axis=1).sum())) / len(baked) / level
    deviation = baked - mean
    # As against a renderer: the largest deviations, one in a thousand, are left out; the largest beyond the audit's own
    # noise, lest its brightest paths are left out and the others taken for the truth. Of few receivers the largest is
    # left out in part: all of it would be more than one in a thousand, and what is left too good.
    order = np.argsort((deviation**2 - noise).sum(axis=1), kind="stable")
    left_out = len(baked) / 1000
    order = order[: len(baked) - int(left_out)]
    deviation, noise = deviation[order], noise[order]
    weight = np.ones(len(order))
    weight[-1] -= left_out % 1
    squares = (deviation**2 - noise).mean(axis=1) * (weight / weight.mean())
    square = max(float(squares.mean()), 0.0)
    own = float(squares.std(ddof=1)) / np.sqrt(len(squares)) if len(squares) > 1 else 0.0
    doubt = INTERVAL * own
    doubt = float(np.hypot(doubt, 2 * square * INTERVAL * level_noise))
    # Squares are skewed: a few receivers carry most of their sum, and where a sample holds too few of those, its spread
    # is too small as well. The second order of exp(doubt / square), and one more receiver like the worst, stand for it.
    skew = min(doubt**2 / (2 * square), square / 2) if square > 0 else 0.0
    tail = max(float(squares.max()), 0.0) / len(squares)
    ends = max(square - doubt, 0.0), square + doubt + skew + tail
    low, high = (float(np.sqrt(end)) / level for end in ends)
    found = float(squares.mean()), own
    if expected is not None:
        found = _weighed(*found, (expected * level) ** 2, ends)
    rms = np.sqrt(_known_positive(*found)) / level
    seen = np.sqrt(float((deviation**2).mean())) / level
    shrink = rms / seen if seen > 0 else 0.0
    size = np.abs(deviation).max(axis=1) / level
    per_lumel = deviation.mean(axis=1)
    spread = float(per_lumel.std(ddof=1)) / np.sqrt(len(deviation)) if len(deviation) > 1 else 0.0
    bias = float(per_lumel.mean()) / level
    bias_error = float(np.hypot(spread / level, bias * level_noise))
    # No RMS is below the bias. Where the audit's light is all of a few lucky paths, only the bias tells what it missed.
    high = max(high, abs(bias) + INTERVAL * bias_error)
    return ErrorBar(float(rms), low, high, float(np.quantile(size, 0.95) * shrink), float(size.max() * shrink), bias,
                    bias_error, len(baked))


def _weighed(found: float, deviation: float, expected: float, ends: tuple[float, float]) -> tuple[float, float]:
    """A mean square from what an audit found, with its standard deviation, and from what was expected: each by one over
    its variance, and the standard deviation of both together. What is expected is doubted the more, the further it
    lies outside of the audit's interval (as the variance between studies is told by DerSimonian & Laird 1986)."""
    if expected <= 0 or deviation <= 0:
        return found, deviation
    nearest = min(max(expected, ends[0]), ends[1])
    doubt = (EXPECTED_DOUBT * expected) ** 2 + (found - expected) ** 2 - (found - nearest) ** 2
    both = doubt + deviation**2
    return (found * doubt + expected * deviation**2) / both, float(np.sqrt(doubt / both)) * deviation


def _known_positive(found: float, deviation: float) -> float:
    """The mean of what a quantity that is not negative may be, found with a normal error: where the error is larger
    than the quantity, the plain value is as often 0 as far too large. `found` itself where the error is small."""
    if deviation <= 0:
        return max(found, 0.0)
    ratio = found / deviation
    if ratio < -MOST_DEVIATIONS:
        return deviation / MOST_DEVIATIONS
    density = math.exp(-ratio**2 / 2) / math.sqrt(2 * math.pi)
    return found + deviation * density / (0.5 * math.erfc(-ratio / math.sqrt(2)))


class Auditor:
    """Path traces the irradiance at footprints.

    Parameters
    ----------
    geometry, lights : the scene about its origin.
    sampled_emitter : (t,) triangles that are lamps (not counted again when a path meets them).
    seed : must differ from the bake's.
    """

    def __init__(self, geometry: Geometry, lights: Sequence[Light], sampled_emitter: NDArray[np.bool_],
                 seed: int) -> None:
        self.geometry, self.lights, self._lamp = geometry, tuple(lights), sampled_emitter
        self.seed = seed
        self._colour = np.array([light.colour for light in self.lights], np.float32).reshape(-1, 3)
        self._banks, self._bank, self._place, blockers = banks(self.lights)
        self._shadows = [geometry.shadows_of(some) for some in blockers]
        self._reach = Reach.of([links_of(light) for light in self.lights], len(geometry.scene.surfaces))
        self._bounds = LightBounds.of(self.lights)
        self._draw = LampDraw(self.lights, geometry, self._reach) if len(self.lights) > FEW_LAMPS else None
        self._seeds = np.random.SeedSequence(seed)

    def truth_at_random(self, places: Footprints, pool: Int, count: int, paths: int, run: Run) -> Truth:
        """`truth` of so many footprints of `pool` (n,), drawn at random, or more where few of them are lit."""
        order = np.random.default_rng(self._seeds.spawn(1)[0]).permutation(pool)
        parts = [self.truth(places, np.sort(order[:count]), paths, run)]
        for first in range(count, min(MOST_DRAWN * count, len(order)), count):
            if sum(part.lit() for part in parts) >= LEAST_LIT * count:
                break
            parts.append(self.truth(places, np.sort(order[first:first + count]), paths, run))
        return Truth.concatenate(parts)

    def truth(self, places: Footprints, rows: Int, paths: int, run: Run) -> Truth:
        """Irradiance of footprints `rows` by `paths` paths each (rounded up to whole groups)."""
        each = -(-paths // GROUPS) * GROUPS
        pieces = slices(len(rows), max(1, CHUNK_PATHS // each))
        seeds = self._seeds.spawn(len(pieces))
        done = run.map(lambda job: self._paths(places, rows[job[0]], each, np.random.default_rng(job[1]), run),
                       list(zip(pieces, seeds, strict=True)))
        direct = np.concatenate([one[0] for one in done]) + self._direct(places, rows, run)
        return Truth(rows, direct, np.concatenate([one[1] for one in done]))

    def _direct(self, places: Footprints, rows: Int, run: Run) -> Float:
        """The lamps' light at footprints `rows`, in independent groups: (k, groups, 3)."""
        some = _Some(places, rows)
        seeds = range(self.seed + 1, self.seed + 1 + GROUPS)
        level = float(DirectLight(self.geometry, self.lights, seeds.stop).irradiance(some, run).mean())
        return np.stack([DirectLight(self.geometry, self.lights, seed).irradiance(some, run, DIRECT_ERROR * level,
                                                                                  DIRECT_RAYS)
                         for seed in seeds], axis=1)

    def _paths(self, places: Footprints, rows: Int, each: int, generator: np.random.Generator,
               run: Run) -> tuple[Float, Float]:
        paths = len(rows) * each
        # Each group's first bounce and places are a lattice with a random shift of its own (Cranley & Patterson 1976).
        strata = each // GROUPS
        move = generator.random((len(rows) * GROUPS, 4), np.float32)
        lattice = rays_of_places(strata)
        u, v, x, y = (shifted(lattice[:, axis], move[:, axis]).reshape(-1) for axis in range(4))
        points, normals = places.sample(np.repeat(rows, each), x, y)
        direct = np.zeros((paths, 3), np.float32)
        indirect = np.zeros_like(direct)
        # A point that a touching face hides has no normal, and gets no light.
        carried = np.repeat(normals.any(axis=1)[:, None], 3, axis=1).astype(np.float32)
        alive = np.arange(paths)
        directions = cosine_directions(normals, u[:, None], v[:, None])[:, 0]
        above = np.einsum("ij,ij->i", directions, np.repeat(places.flat_normals(rows), each, axis=0)) > 0
        carried *= above[:, None]
        for bounce in count():
            run.check()
            hits = self.geometry.visibility.hits(points, directions)
            run.count(len(points))
            met = hits.triangle >= 0
            if not self.geometry.scene.sky.is_black:
                missed = np.flatnonzero(~met)
                light = np.float32(np.pi) * skies.radiance(self.geometry.scene.sky, directions[missed])
                (direct if bounce == 0 else indirect)[alive[missed]] += light * carried[missed]
            here = np.flatnonzero(met)
            if not len(here):
                break
            alive, carried = alive[here], carried[here]
            triangle, a, b, front = hits.triangle[here], hits.u[here], hits.v[here], hits.front[here]
            emission = self.geometry.emission(triangle, a, b)
            emission[self._lamp[triangle]] = 0
            (direct if bounce == 0 else indirect)[alive] += carried * emission
            carried = carried * self.geometry.reflectance(triangle, a, b)
            points = self.geometry.lifted(self.geometry.point(triangle, a, b), triangle, front)
            side = np.where(front, np.float32(1), np.float32(-1))[:, None]
            normals, flat = self.geometry.shading_normal(triangle, a, b) * side, self.geometry.normal[triangle] * side
            keep, carried = _roulette(carried, bounce, generator)
            alive, carried, points = alive[keep], carried[keep], points[keep]
            normals, flat = normals[keep], flat[keep]
            if not len(alive):
                break
            kind = self._reach.kind[self.geometry.surface[triangle[keep]]]
            indirect[alive] += carried * self._lamps(points, normals, kind, generator, run)
            u, v = generator.random((2, len(alive)), np.float32)
            directions = cosine_directions(normals, u[:, None], v[:, None])[:, 0]
            carried = carried * (np.einsum("ij,ij->i", directions, flat) > 0)[:, None]
        shape = (len(rows), GROUPS, strata, 3)
        return direct.reshape(shape).mean(axis=2), indirect.reshape(shape).mean(axis=2)

    def _lamps(self, points: Float, normals: Float, kind: Int, generator: np.random.Generator, run: Run) -> Float:
        """Direct irradiance at vertices on kinds of surface (n,), by one shadow ray to every lamp that reaches them, or
        to one lamp that is drawn: (n, 3)."""
        out = np.zeros((len(points), 3), np.float32)
        if self._draw is None:
            for number in range(len(self.lights)):
                rows = np.flatnonzero(self._reach.lamps[number, kind])
                out[rows] += self._shadow(points[rows], normals[rows], np.full(len(rows), number), generator, run)
            return out
        lamp, chance = self._draw.draw(points, kind, generator.random(len(points)))
        reached = np.flatnonzero(self._reach.lamps[lamp, kind])
        order = reached[np.argsort(self._bank[lamp[reached]], kind="stable")]
        edges = np.append(np.flatnonzero(np.diff(self._bank[lamp[order]], prepend=-1)), len(order))
        for first, last in zip(edges[:-1], edges[1:], strict=True):
            rows = order[first:last]
            given = self._shadow(points[rows], normals[rows], lamp[rows], generator, run)
            out[rows] = given / chance[rows, None]
        return out

    def _shadow(self, points: Float, normals: Float, lamp: Int, generator: np.random.Generator, run: Run) -> Float:
        """(n, 3) what one shadow ray from each point brings from its lamp; all lamps are of one bank."""
        if not len(points):
            return np.zeros((0, 3), np.float32)
        bank, place = self._banks[self._bank[lamp[0]]], self._place[lamp]
        towards = bank.sample(points, normals, generator.random((len(points), 2), np.float32), place)
        lit = np.flatnonzero(towards.weight > 0)
        free = np.zeros(len(points), bool)
        reach = np.minimum(towards.distance[lit], np.float32(1e30)) * np.float32(1 - SHORTEN)
        shadows = self._shadows[self._bank[lamp[0]]]
        free[lit] = ~shadows.occluded(points[lit], towards.direction[lit], reach)
        run.count(len(lit))
        given = np.where(free, towards.weight, 0)
        # Right beside a lamp a ray's weight goes to infinity. There the closed form is taken, and what rays find hidden
        # is taken off: on the average the same, and with no variance where nothing is.
        rows = self._beside(points, lamp)
        closed = bank.irradiance(points[rows], normals[rows], place[rows])
        given[rows] = np.where(closed > BESIDE, closed - np.where(free[rows], 0, towards.weight[rows]), given[rows])
        return np.asarray(given[:, None] * self._colour[lamp], np.float32)

    def _beside(self, points: Float, lamp: Int) -> Int:
        """Which of the points may see BESIDE of their surroundings filled by their lamps: (r / d)^2 is what a sphere
        about a lamp fills at most."""
        offset = self._bounds.centre[lamp] - points
        near = np.einsum("ij,ij->i", offset, offset) * np.float32(BESIDE) < self._bounds.radius[lamp] ** 2
        return np.flatnonzero((near & ~self._bounds.far[lamp]) | self._bounds.unknown[lamp])


class _Some:
    """Some of the footprints, as footprints."""

    def __init__(self, places: Footprints, rows: Int) -> None:
        self._places, self._rows = places, rows
        self.identity = places.identity[rows]

    def __len__(self) -> int:
        return len(self._rows)

    @property
    def surface(self) -> Int:
        """See Footprints."""
        return self._places.surface[self._rows]

    def sample(self, rows: Int, x: Float, y: Float) -> tuple[Float, Float]:
        """See Footprints."""
        return self._places.sample(self._rows[rows], x, y)

    def fan(self, rows: Int, x: Float, y: Float) -> tuple[Float, Float]:
        """See Footprints."""
        return self._places.fan(self._rows[rows], x, y)

    def flat_normals(self, rows: Int) -> Float:
        """See Footprints."""
        return self._places.flat_normals(self._rows[rows])


def _roulette(carried: Float, bounce: int, generator: np.random.Generator) -> tuple[Int, Float]:
    """Which paths go on, and what they carry then."""
    if bounce < ROULETTE_FROM:
        keep = np.flatnonzero(carried.any(axis=1))
        return keep, carried
    chance = np.minimum(carried.max(axis=1), np.float32(MOST_CHANCE))
    stays = generator.random(len(carried), np.float32) < chance
    carried = carried / np.maximum(chance, np.float32(1e-30))[:, None]
    return np.flatnonzero(stays), carried

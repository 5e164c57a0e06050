"""Direct light: what the lamps give, unoccluded, times the part of it that shadow rays find to arrive.

    E = sum over lamps of  E_unoccluded * (sum w_k V_k / sum w_k)          (Heitz, Hill & McGuire 2018)

w_k is the form-factor kernel at the k-th point of lamp and footprint (four dimensions, together), V_k whether the
ray between them is free. A uniform visible fraction in place of the weighted one is biased.

Where we leave the paper:
1. Rays are spent by absolute error: a pilot finds the penumbrae, and only those get more (up to MOST_RAYS).
2. Of many lamps, those that give little are drawn by chance (`many_lights.py`), not looped over. Rays to a lamp that
   looks small have about one weight: their plain mean is taken, which needs no closed form.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .banks import banks
from .blocks import Blocks
from .footprints import Footprints
from .geometry import Geometry
from .light_bounds import LightBounds
from .lights import Light
from .linking import Reach, links_of
from .many_lights import TELLING, Chooser, Looks, Wish, everybody
from .parallel import Run, shares
from .sampling import kronecker, shifted, shifts
from .shadow_sums import ShadowSums, doubtful, missed, ratio
from .split import Split
from .visibility import SHORTEN

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]

# Rays of one chunk of work (a thread's arrays stay near 20 MB).
CHUNK_RAYS = 2**17
# Fewer than these are not worth a thread.
LEAST_RAYS = 2**13
# Shadow rays of the pilot for one lamp and point; an occluder of less than 1/16 of lamp and footprint can be missed
# unless a neighbour sees it.
PILOT_RAYS = 16
# Most of one lamp and point, for lumels right beside a lamp: light may vary a hundredfold in one.
MOST_RAYS = 16384
# Error of n quasi-random rays over sd * n^-QMC_RATE, from penumbrae of the Cornell box (METHODS: 16 / 64 / 256 rays).
QMC_RATE = 0.75
# Rays over those before where none of these was above both horizons, though part of the lamp is.
LOST_FACTOR = 16
# Places of a footprint at which the closed form is asked for at first; where it varies between those, as beside a
# lamp's edge, more follow. Of many lamps, none of which matters much alone, fewer are enough.
CLOSED_SAMPLES, CLOSED_SAMPLES_OF_MANY = 16, 4
# Those that follow are this many times (standard deviation / wanted error)^(1 / (.5 + QMC_RATE)), which gives all
# footprints together the least mean square error for the time. To hold each to the wanted error, a few right beside
# lamps took most of it.
CLOSED_MORE = 8
# Which dimensions of the point set serve footprint x, y and lamp u, v: in the natural order a shadow edge along both
# x and u resonates (RMS .028 of the visible part at 1,024 rays, against .0055 in this one).
COLUMNS = (3, 0, 2, 1)
# Up to this many lamps, every one is looked at from every point.
FEW_LAMPS = 4
# A lamp that would give less than this part of all light at a point is drawn with a probability.
SMALL_SHARE = 2e-3
# Receivers of a block that lamps are chosen for, at most; and of a region in which it is tried out which lamps can be
# seen: with and without a wanted error.
BLOCK, FINE_REGION, REGION = 64, 64, 512


class _Batch:
    """Receivers that are worked on together.

    Parameters
    ----------
    rows : (m,) which these are.
    first : the place of the first; the others follow in order.
    neighbours : (n, 8) of all receivers, -1 for none; those outside of the batch are not asked.
    place : (n,) the place of each; None if these are all, in their own order.

    Attributes
    ----------
    least : fewer rays than these are not cut off for a thread: where this is not the only batch, the others keep all
        threads busy.
    """

    def __init__(self, rows: Int, first: int, neighbours: Int | None, place: Int | None = None) -> None:
        self._rows, self._first, self._place = rows, first, place
        self.least = LEAST_RAYS if place is None else CHUNK_RAYS
        self.neighbours = neighbours
        if neighbours is not None and place is not None:
            around = neighbours[rows]
            own = self.place(around)
            self.neighbours = np.where((around >= 0) & (own >= 0) & (own < len(rows)), own, -1)

    def __len__(self) -> int:
        return len(self._rows)

    def place(self, rows: Int) -> Int:
        """The places of receivers in the batch."""
        return rows if self._place is None else self._place[rows] - self._first

    def add(self, total: Float, varied: Float | None, found: tuple[Float, Float]) -> None:
        """Add to (n, ...) and (n,) of all receivers what was found of these."""
        total[self._rows] += found[0]
        if varied is not None:
            varied[self._rows] += found[1]


class DirectLight:
    """Direct irradiance of any list of footprints.

    Parameters
    ----------
    geometry : the surfaces.
    lights : lamps, already about `scene.origin`.
    seed : of the shifts.
    split : the light groups that are kept apart, or None.
    """

    def __init__(self, geometry: Geometry, lights: Sequence[Light], seed: int, split: Split | None = None) -> None:
        self.geometry, self.lights, self.seed, self.split = geometry, tuple(lights), seed, split
        self._columns = 3 if split is None else split.columns
        self._colour = np.array([light.colour for light in self.lights], np.float32).reshape(-1, 3)
        self._brightness = self._colour.mean(axis=1)
        self._banks, self._bank, self._place, blockers = banks(self.lights)
        self._shadows = [geometry.shadows_of(some) for some in blockers]
        self._reach = Reach.of([links_of(light) for light in self.lights], len(geometry.scene.surfaces))
        many = len(self.lights) > FEW_LAMPS
        self._chooser = Chooser(LightBounds.of(self.lights, self._reach), seed) if many else None

    def irradiance(self, places: Footprints, run: Run, tolerance: float = 0.0, pilot: int = PILOT_RAYS,
                   small_share: float = SMALL_SHARE, neighbours: Int | None = None) -> Float:
        """Direct irradiance of each footprint, (n, 3) float32, W/m2; arguments as in `apart`."""
        return self.apart(places, run, tolerance, pilot, small_share, neighbours)[:, :3]

    def apart(self, places: Footprints, run: Run, tolerance: float = 0.0, pilot: int = PILOT_RAYS,
              small_share: float = SMALL_SHARE, neighbours: Int | None = None,
              closed: int = CLOSED_SAMPLES_OF_MANY, varied: Float | None = None) -> Float:
        """Direct irradiance of each footprint, and after it that of every light group.

        Parameters
        ----------
        places : the footprints.
        tolerance : wanted standard deviation of each value, W/m2 (mean of the channels); 0 keeps to the pilot.
        pilot : shadow rays of a footprint and lamp at first.
        small_share : see SMALL_SHARE; of no account where a tolerance is given.
        neighbours : (n, 8) int rows next to each footprint, -1 for none: where they disagree, rays are added.
        closed : places of a footprint at which closed forms are asked for, where there are many lamps.
        varied : (n,) to which is added by how much each lamp's closed form varies on a footprint (standard deviation,
            mean of the channels, W/m2).

        Returns
        -------
        (n, 3) float32, W/m2; with g groups (n, 3 + 3 g).
        """
        total = np.zeros((len(places), self._columns), np.float32)
        if not self.lights or not len(places):
            return total
        wish = Wish(tolerance, pilot, small_share, CLOSED_SAMPLES if self._chooser is None else closed)
        chooser = self._chooser
        if chooser is None:
            together = _Batch(np.arange(len(places)), 0, neighbours)
            for lamp in range(len(self.lights)):
                looks = everybody(self._reach.rows(lamp, places), lamp, wish)
                together.add(total, varied, self._light(looks, together, places, wish, run))
            return total
        most = (FINE_REGION if tolerance > 0 else REGION, BLOCK)
        regions, blocks, single = Blocks.nested(places, most, run, self._reach.kinds(places))
        shown = chooser.shown(regions, places, lambda lamp, rows: self._attempt(places, lamp, rows, run))
        within = np.searchsorted(regions.begin, blocks.begin[:-1], side="right") - 1
        place = np.empty(len(places), np.int64)
        place[blocks.order] = np.arange(len(places))

        def work(part: slice) -> None:
            some = blocks.take(part)
            batch = _Batch(some.rows, int(some.begin[0]), neighbours, place)
            looks = chooser.looks(some, single, shown[within[part]], places, wish)
            batch.add(total, varied, self._light(looks, batch, places, wish, run))

        run.map(work, chooser.batches(blocks))
        return total

    def _attempt(self, places: Footprints, lamp: Int, rows: Int, run: Run) -> tuple[Float, Float]:
        """One shadow ray from each of `rows` to its lamp: the irradiance that it stands for, were it free, and as it is
        (n,) W/m2."""
        order, runs = _runs(self._bank[lamp])
        lamp, rows = lamp[order], rows[order]

        def work(part: slice) -> tuple[Float, Float]:
            key = places.identity[rows[part]] * np.int64(1_000_003) + np.arange(part.start, part.stop)
            points, normals = places.sample(rows[part], *shifts(key, 2, self.seed + 7).T)
            return self._shadow(lamp[part], points, normals, shifts(key, 2, self.seed + 9), run)

        pieces = run.map(work, _pieces(runs, CHUNK_RAYS, LEAST_RAYS))
        out = np.zeros((2, len(rows)), np.float32)
        for column in range(2 if pieces else 0):
            out[column, order] = np.concatenate([piece[column] for piece in pieces]) * self._brightness[lamp]
        return out[0], out[1]

    def _light(self, looks: Looks, batch: _Batch, places: Footprints, wish: Wish, run: Run) -> tuple[Float, Float]:
        """What lamps give to the receivers of a batch that look at them, as `apart` returns it; and by how much their
        closed forms vary on each (n,)."""
        if not len(looks):
            return np.zeros((len(batch), self._columns), np.float32), np.zeros(len(batch))
        # What is alike is worked on together: the same bank, number of rays, and with a closed form or without.
        none = np.zeros(len(looks), np.int64)
        order, _ = _runs(self._kinds(looks, none, looks.rays, looks.closed.astype(np.int64)))
        looks = looks.take(order)
        own = batch.place(looks.rows)
        sums = self._sums(looks, places, none, looks.rays, np.where(looks.closed, wish.closed, 0), batch.least, run)
        value, spread = ratio(sums, looks.rays)
        brightness = self._brightness[looks.lamp] * looks.factor
        varied = sums.varied * brightness
        # A lamp of which the rays met only what lies below the horizon gives something all the same.
        wanted = np.where((sums.tried == 0) & (sums.closed > 0), LOST_FACTOR * looks.rays, 0.0)
        asked = np.zeros(len(looks))
        if wish.tolerance > 0:
            doubt, lost = self._doubt(looks, own, sums, batch)
            wanted = np.where(lost, LOST_FACTOR * looks.rays, wanted)
            sigma = np.where(doubt, np.maximum(spread, sums.level * 0.25), 0) * brightness
            wanted = np.maximum(wanted, np.where(sigma > 0, (sigma / wish.tolerance) ** (1 / QMC_RATE), 0))
            asked = CLOSED_MORE * (varied / wish.tolerance) ** (1 / (0.5 + QMC_RATE))
            asked[varied <= wish.tolerance * sums.places**QMC_RATE] = 0
            wanted = np.maximum(wanted, asked)
        some = np.flatnonzero(wanted > looks.rays)
        if len(some):
            start = looks.rays[some]
            more, places_more = (_grown(start, np.minimum(goal[some], MOST_RAYS)) - start for goal in (wanted, asked))
            order, _ = _runs(self._kinds(looks.take(some), start, more, places_more))
            some, start, more, places_more = some[order], start[order], more[order], places_more[order]
            count = start + more
            added = self._sums(looks.take(some), places, start, more, places_more, batch.least, run)
            value[some] = ratio(sums.take(some).plus(added), count)[0]
        value = value * looks.factor
        light = [_sums_of(own, value * self._colour[looks.lamp, channel], len(batch)) for channel in range(3)]
        if self.split is not None:
            light += self._light_apart(looks.lamp, own, value, len(batch), self.split)
        return np.stack(light, axis=1), _sums_of(own, varied, len(batch))

    @staticmethod
    def _light_apart(lamp: Int, own: Int, value: Float, count: int, split: Split) -> list[Float]:
        """The same for the columns of the lamps' groups."""
        light = [np.zeros(count, np.float32)] * (split.columns - 3)
        group = split.lamp_group[lamp]
        for number in np.unique(group):
            of_group = np.flatnonzero(group == number)
            first = split.first_column(int(number)) - 3
            for channel in range(3):
                given = value[of_group] * split.lamp_colour[lamp[of_group], channel]
                light[first + channel] = _sums_of(own[of_group], given, count)
        return light

    @staticmethod
    def _doubt(looks: Looks, own: Int, sums: ShadowSums, batch: _Batch) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """(n,) each: whether more rays could change what was found, and whether all may have missed, lamp by lamp;
        `own` (n,) are receivers in the batch."""
        doubt, lost = np.zeros((2, len(looks)), bool)
        enough = np.flatnonzero(looks.rays >= TELLING)
        order, runs = _runs(looks.lamp[enough])
        for part in runs:
            these = enough[order[part]]
            some = sums.take(these)
            doubt[these] = doubtful(some, own[these], looks.closed[these], len(batch), batch.neighbours)
            lost[these] = looks.closed[these] & missed(some, own[these], len(batch), batch.neighbours)
        return doubt, lost

    def _kinds(self, looks: Looks, start: Int, count: Int, asked: Int) -> Int:
        """(n,) a number that is the same for looks that can be worked on together."""
        kind = self._bank[looks.lamp].astype(np.int64)
        for number in (count, start, asked):
            kind = kind << 16 | number
        return kind

    def _sums(self, looks: Looks, places: Footprints, start: Int, count: Int, asked: Int, least: int,
              run: Run) -> ShadowSums:
        """Sums over shadow rays start ... start + count - 1 of the point set, and the closed form at the first `asked`
        of their places, for looks in which those that are alike stand together, in parts of so many rays at least."""
        def work(part: slice) -> ShadowSums:
            first = part.start
            return self._rays(looks.lamp[part], places, looks.rows[part], int(start[first]), int(count[first]),
                              int(asked[first]), run)

        kinds = self._kinds(looks, start, count, asked)
        edges = np.append(np.append(0, np.flatnonzero(np.diff(kinds)) + 1), len(kinds))
        runs = [slice(first, last) for first, last in zip(edges[:-1], edges[1:], strict=True)]
        jobs = [piece for alike in runs for piece in
                _pieces([alike], *(max(1, rays // int(count[alike.start])) for rays in (CHUNK_RAYS, least)))]
        return ShadowSums.concatenate(run.map(work, jobs))

    def _rays(self, lamp: Int, places: Footprints, rows: Int, start: int, count: int, asked: int,
              run: Run) -> ShadowSums:
        set_of_points = kronecker(count, 4, start)
        move = shifts(places.identity[rows] * np.int64(1_000_003) + lamp, 4, self.seed + 7919)
        x, y, u, v = (shifted(set_of_points[:, axis], move[:, axis]) for axis in COLUMNS)
        points, normals = places.fan(rows, x, y)
        uv = np.stack([u.reshape(-1), v.reshape(-1)], axis=-1)
        weight, seen = self._shadow(np.repeat(lamp, count), points, normals, uv, run)
        weight, seen = weight.reshape(-1, count), seen.reshape(-1, count)
        asked = min(count, asked)
        form, varied = self._closed(lamp, points, normals, count, asked)
        return ShadowSums(weight.sum(1), seen.sum(1), (seen**2).sum(1), (weight > 0).sum(1), (seen > 0).sum(1), form,
                          varied, np.where(np.isnan(form), 0, asked))

    def _shadow(self, lamp: Int, points: Float, normals: Float, uv: Float, run: Run) -> tuple[Float, Float]:
        """Weights of shadow rays to lamps of one bank, and the same where something stands between: 0 (n,)."""
        towards = self._banks[self._bank[lamp[0]]].sample(points, normals, uv, self._place[lamp])
        weight = towards.weight
        lit = np.flatnonzero(weight > 0)
        seen = np.zeros_like(weight)
        if len(lit):
            reach = np.minimum(towards.distance[lit], np.float32(1e30)) * np.float32(1 - SHORTEN)
            shadows = self._shadows[self._bank[lamp[0]]]
            hidden = shadows.occluded(np.take(points, lit, axis=0), np.take(towards.direction, lit, axis=0), reach)
            seen[lit] = np.where(hidden, 0, weight[lit])
        run.count(len(lit))
        return weight, seen

    def _closed(self, lamp: Int, points: Float, normals: Float, count: int, asked: int) -> tuple[Float, Float]:
        """Closed form over the lamp's colour at the first `asked` of each footprint's `count` places: its mean and its
        standard deviation (n,) float32; nan and 0 if there is none."""
        if not asked:
            return np.full(len(lamp), np.nan, np.float32), np.zeros(len(lamp), np.float32)
        index = (np.arange(0, len(points), count)[:, None] + np.arange(asked)).reshape(-1)
        bank = self._banks[self._bank[lamp[0]]]
        closed = bank.irradiance(np.take(points, index, axis=0), np.take(normals, index, axis=0),
                                 np.repeat(self._place[lamp], asked)).reshape(-1, asked)
        return np.asarray(closed.mean(axis=1)), np.nan_to_num(closed.std(axis=1))


def _sums_of(rows: Int, values: Float, count: int) -> Float:
    """(count,) float32: the sum of the values of each row."""
    return np.asarray(np.bincount(rows, values, count), np.float32)


def _runs(kind: Int) -> tuple[Int, list[slice]]:
    """An order in which things of one kind stand together, and the runs of each kind in it."""
    order = np.argsort(kind, kind="stable")
    edges = np.append(np.flatnonzero(np.diff(kind[order], prepend=-1)), len(kind))
    return order, [slice(first, last) for first, last in zip(edges[:-1], edges[1:], strict=True)]


def _pieces(runs: list[slice], size: int, least: int) -> list[slice]:
    """Runs cut into pieces of at most `size`, for threads, but of at least `least`."""
    return [slice(run.start + part.start, run.start + part.stop) for run in runs
            for part in shares(run.stop - run.start, size, least)]


def _grown(rays: Int, wanted: Float) -> Int:
    """The rays (n,), or 2, 4, 8 ... times as many where more are wanted."""
    return np.asarray(rays * 2 ** np.ceil(np.log2(np.maximum(wanted / rays, 1))).astype(np.int64))

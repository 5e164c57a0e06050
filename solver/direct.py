"""Direct light: what the lamps give, unoccluded, times the part of it that shadow rays find to arrive.

    E = sum over lamps of  E_unoccluded * (sum w_k V_k / sum w_k)          (Heitz, Hill & McGuire 2018)

w_k is the form-factor kernel at the k-th point of lamp and footprint (four dimensions, together), V_k whether the
ray between them is free. A uniform visible fraction in place of the weighted one is biased.

Where we leave the paper:
1. Rays are spent by absolute error: a pilot finds the penumbrae, and only those get more (up to MOST_RAYS).
2. Lamps that give little at a point are drawn by systematic resampling (unbiased), not looped over.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .footprints import Footprints
from .geometry import Geometry
from .lights import Light
from .parallel import Run, slices
from .sampling import kronecker, shifted, shifts, uniform
from .visibility import SHORTEN

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]

# Rays of one chunk of work (a thread's arrays stay near 20 MB).
CHUNK_RAYS = 2**17
# Shadow rays of the pilot for one lamp and point; an occluder of less than 1/16 of lamp and footprint can be missed
# unless a neighbour sees it.
PILOT_RAYS = 16
MOST_RAYS = 4096
# Error of n quasi-random rays over sd * n^-QMC_RATE, from penumbrae of the Cornell box (METHODS: 16 / 64 / 256 rays).
QMC_RATE = 0.75
# Places of a footprint at which the closed form is asked for.
CLOSED_SAMPLES = 16
# Which dimensions of the point set serve footprint x, y and lamp u, v: in the natural order a shadow edge along both
# x and u resonates (RMS .028 of the visible part at 1,024 rays, against .0055 in this one).
COLUMNS = (3, 0, 2, 1)
# Up to this many lamps, every one is looked at from every point.
FEW_LAMPS = 4
# A lamp that would give less than this part of all unoccluded light at a point is drawn with a probability.
SMALL_SHARE = 2e-3


class DirectLight:
    """Direct irradiance of any list of footprints.

    Parameters
    ----------
    geometry : the surfaces.
    lights : lamps, already about `scene.origin`.
    seed : of the shifts.
    """

    def __init__(self, geometry: Geometry, lights: Sequence[Light], seed: int) -> None:
        self.geometry, self.lights, self.seed = geometry, tuple(lights), seed

    def irradiance(self, places: Footprints, run: Run, tolerance: float = 0.0, pilot: int = PILOT_RAYS,
                   small_share: float = SMALL_SHARE, neighbours: Int | None = None) -> Float:
        """Direct irradiance of each footprint.

        Parameters
        ----------
        places : the footprints.
        tolerance : wanted standard deviation of each value, W/m2 (mean of the channels); 0 keeps to the pilot.
        pilot : shadow rays of a footprint and lamp at first.
        small_share : see SMALL_SHARE.
        neighbours : (n, 8) int rows next to each footprint, -1 for none: where they disagree, rays are added.

        Returns
        -------
        (n, 3) float32, W/m2.
        """
        total = np.zeros((len(places), 3), np.float32)
        if not self.lights or not len(places):
            return total
        choose = _Choice(self, places, run, small_share)
        for number, light in enumerate(self.lights):
            rows, factor = choose.rows(number)
            if len(rows):
                total += self._one(light, number, places, rows, factor, run, tolerance, pilot, neighbours)
        return total

    def unoccluded(self, light: Light, places: Footprints, rows: Int) -> Float:
        """Closed-form irradiance at the footprints' middles over the lamp's colour: (n,) float32; nan if none."""
        half = np.full(len(rows), 0.5, np.float32)
        points, normals = places.sample(rows, half, half)
        closed = light.irradiance(points, normals)
        if closed is None:
            return np.full(len(rows), np.nan, np.float32)
        channel = int(np.argmax(light.colour))
        return np.asarray(closed[:, channel] / max(float(light.colour[channel]), 1e-30), np.float32)

    def _closed(self, light: Light, points: Float, normals: Float, count: int) -> Float:
        """Closed form over the lamp's colour, the mean over the first few places of each footprint: (n,) float32."""
        some = min(count, CLOSED_SAMPLES)
        index = (np.arange(0, len(points), count)[:, None] + np.arange(some)).reshape(-1)
        closed = light.irradiance(points[index], normals[index])
        if closed is None:
            return np.full(len(points) // count, np.nan, np.float32)
        channel = int(np.argmax(light.colour))
        return np.asarray(closed[:, channel].reshape(-1, some).mean(axis=1) / max(float(light.colour[channel]), 1e-30))

    def _one(self, light: Light, number: int, places: Footprints, rows: Int, factor: Float, run: Run,
             tolerance: float, pilot: int, neighbours: Int | None) -> Float:
        """What one lamp gives at `rows`, each times its factor."""
        brightness = float(np.mean(light.colour))
        first = self._sums(light, number, places, rows, 0, pilot, run)
        value, spread = _ratio(first, pilot)
        if tolerance > 0 and brightness > 0:
            doubt = _doubtful(first, rows, len(places), neighbours)
            sigma = np.where(doubt, np.maximum(spread, first.level * 0.25), 0) * brightness * factor
            wanted = np.where(sigma > 0, (sigma / tolerance) ** (1 / QMC_RATE), 0)
            wanted = np.minimum(wanted, MOST_RAYS)
            value = self._refined(light, number, places, rows, first, value, wanted, pilot, run)
        out = np.zeros((len(places), 3), np.float32)
        out[rows] = (value * factor)[:, None] * light.colour
        return out

    def _refined(self, light: Light, number: int, places: Footprints, rows: Int, first: _Sums, value: Float,
                 wanted: Float, pilot: int, run: Run) -> Float:
        """More rays where they are wanted, in groups of equal count: 4, 16, 64 ... times the pilot."""
        value = value.copy()
        count = 4 * pilot
        while count <= 4 * MOST_RAYS:
            group = np.flatnonzero((wanted > count / 4) & (wanted <= count))
            if len(group):
                more = self._sums(light, number, places, rows[group], pilot, count - pilot, run)
                both = first.take(group).plus(more)
                value[group] = _ratio(both, count)[0]
            count *= 4
        return value

    def _sums(self, light: Light, number: int, places: Footprints, rows: Int, start: int, count: int,
              run: Run) -> _Sums:
        """Sums over shadow rays start ... start + count - 1 of the point set."""
        set_of_points = kronecker(count, 4, start)

        def work(part: slice) -> _Sums:
            these = rows[part]
            move = shifts(places.identity[these], 4, self.seed + 7919 * (number + 1))
            x, y, u, v = (shifted(set_of_points[:, axis], move[:, axis]).reshape(-1) for axis in COLUMNS)
            points, normals = places.sample(np.repeat(these, count), x, y)
            towards = light.sample(points, normals, np.stack([u, v], axis=-1))
            weight = towards.weight
            lit = np.flatnonzero(weight > 0)
            free = np.zeros(len(weight), bool)
            if len(lit):
                reach = np.minimum(towards.distance[lit], np.float32(1e30)) * np.float32(1 - SHORTEN)
                free[lit] = ~self.geometry.visibility.occluded(points[lit], towards.direction[lit], reach)
            seen = np.where(free, weight, 0).reshape(-1, count)
            weight = weight.reshape(-1, count)
            run.count(len(lit))
            closed = self._closed(light, points, normals, count)
            return _Sums(weight.sum(1), seen.sum(1), (weight > 0).sum(1), (seen > 0).sum(1), closed)

        parts = run.map(work, slices(len(rows), max(1, CHUNK_RAYS // count)))
        return _Sums(*(np.concatenate([getattr(part, name) for part in parts]) for name in _Sums.NAMES))


class _Sums:
    """Sums over the shadow rays of some footprints towards one lamp."""

    NAMES = ("weight", "seen", "tried", "met", "closed")

    def __init__(self, weight: Float, seen: Float, tried: Int, met: Int, closed: Float) -> None:
        self.weight, self.seen, self.tried, self.met, self.closed = weight, seen, tried, met, closed

    @property
    def level(self) -> Float:
        """Unoccluded irradiance over the lamp's colour."""
        return np.where(np.isnan(self.closed), self.weight / np.maximum(self.tried, 1), self.closed)

    def take(self, index: Int) -> _Sums:
        """The sums of some of the footprints."""
        return _Sums(*(getattr(self, name)[index] for name in self.NAMES))

    def plus(self, other: _Sums) -> _Sums:
        """Sums over both sets of rays."""
        return _Sums(self.weight + other.weight, self.seen + other.seen, self.tried + other.tried,
                     self.met + other.met, self.closed)


def _ratio(sums: _Sums, count: int) -> tuple[Float, Float]:
    """The irradiance over the lamp's colour, and the standard deviation of a single ray's estimate of it."""
    part = sums.seen / np.maximum(sums.weight, np.float32(1e-30))
    mean = sums.seen / count
    value = np.where(np.isnan(sums.closed), mean, sums.closed * part)
    spread = sums.level * np.sqrt(np.clip(part * (1 - part), 0, 0.25))
    return np.asarray(value, np.float32), np.asarray(spread, np.float32)


def _doubtful(sums: _Sums, rows: Int, count: int, neighbours: Int | None) -> NDArray[np.bool_]:
    """Footprints whose rays, or whose neighbours' rays, did not all agree; and all of a lamp without closed form."""
    doubt = np.asarray((sums.met > 0) & (sums.met < sums.tried) | np.isnan(sums.closed))
    if neighbours is None:
        return doubt
    # 0: not asked, 1: all free, 2: none free, 3: mixed
    state = np.zeros(count + 1, np.int8)
    state[rows] = np.where(doubt, 3, np.where(sums.tried == 0, 0, np.where(sums.met > 0, 1, 2)))
    around = state[neighbours[rows]]
    own = state[rows][:, None]
    return np.asarray(doubt | (((around != own) & (around > 0)).any(axis=1) & (sums.tried > 0)))


class _Choice:
    """Which footprints look at which lamp, and with what factor."""

    def __init__(self, direct: DirectLight, places: Footprints, run: Run, small_share: float) -> None:
        self._direct, self._places, self._run = direct, places, run
        self._all = np.arange(len(places))
        self._few = len(direct.lights) <= FEW_LAMPS
        if not self._few:
            self._floor = small_share * sum(self._given(number) for number in range(len(direct.lights)))
            self._passed = uniform(places.identity, 99, direct.seed).astype(np.float64)

    def _given(self, number: int) -> Float:
        light = self._direct.lights[number]
        brightness = np.float32(np.mean(light.colour))

        def work(part: slice) -> Float:
            given = self._direct.unoccluded(light, self._places, self._all[part])
            if np.isnan(given).any():
                given = self._estimate(light, part)
            return np.asarray(given * brightness)

        return np.concatenate(self._run.map(work, slices(len(self._all), CHUNK_RAYS // 8)))

    def _estimate(self, light: Light, part: slice) -> Float:
        """A lamp without closed form: the mean weight of a few samples."""
        rows = np.repeat(self._all[part], PILOT_RAYS)
        half = np.full(len(rows), 0.5, np.float32)
        points, normals = self._places.sample(rows, half, half)
        uv = np.tile(kronecker(PILOT_RAYS, 2), (len(rows) // PILOT_RAYS, 1))
        return np.asarray(light.sample(points, normals, uv).weight.reshape(-1, PILOT_RAYS).mean(axis=1))

    def rows(self, number: int) -> tuple[Int, Float]:
        """The footprints that look at a lamp, and one over the probability that they do."""
        if self._few:
            return self._all, np.ones(len(self._all), np.float32)
        given = self._given(number)
        probability = np.minimum(given / np.maximum(self._floor, 1e-30), 1.0)
        before = np.floor(self._passed)
        self._passed += probability
        kept = np.flatnonzero((np.floor(self._passed) > before) & (probability > 0))
        return kept, np.asarray(1 / probability[kept], np.float32)

"""Direct light: what the lamps give, unoccluded, times the part of it that shadow rays find to arrive.

    E = sum over lamps of  E_unoccluded * (sum w_k V_k / sum w_k)          (Heitz, Hill & McGuire 2018)

w_k is the form-factor kernel at the k-th point of lamp and footprint (four dimensions, together), V_k whether the
ray between them is free. A uniform visible fraction in place of the weighted one is biased.

Where we leave the paper:
1. Rays are spent by absolute error: a pilot finds the penumbrae, and only those get more (up to MOST_RAYS).
2. Of many lamps, those that give little are drawn by chance (`many_lights.py`), not looped over. Where one or two rays
   to a lamp are enough, their plain mean weight is taken: it is unbiased, and needs no closed form.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .blocks import Blocks
from .footprints import Footprints
from .geometry import Geometry
from .light_bounds import LightBounds
from .lights import Light
from .many_lights import CLOSED_FROM, Chooser, Look, Wish, everything
from .parallel import Run, slices
from .sampling import kronecker, shifted, shifts
from .shadow_sums import ShadowSums, doubtful, joined, ratio
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
CLOSED_SAMPLES = 4
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
        self._chooser = Chooser(LightBounds.of(self.lights), seed) if len(self.lights) > FEW_LAMPS else None

    def irradiance(self, places: Footprints, run: Run, tolerance: float = 0.0, pilot: int = PILOT_RAYS,
                   small_share: float = SMALL_SHARE, neighbours: Int | None = None) -> Float:
        """Direct irradiance of each footprint.

        Parameters
        ----------
        places : the footprints.
        tolerance : wanted standard deviation of each value, W/m2 (mean of the channels); 0 keeps to the pilot.
        pilot : shadow rays of a footprint and lamp at first.
        small_share : see SMALL_SHARE; of no account where a tolerance is given.
        neighbours : (n, 8) int rows next to each footprint, -1 for none: where they disagree, rays are added.

        Returns
        -------
        (n, 3) float32, W/m2.
        """
        total = np.zeros((len(places), 3), np.float32)
        if not self.lights or not len(places):
            return total
        wish = Wish(tolerance, pilot, small_share)
        if self._chooser is None:
            for look in everything(len(places), len(self.lights), wish):
                self._add(total, [look], places, wish, neighbours, run)
            return total
        regions, blocks, single = Blocks.nested(places, (FINE_REGION if tolerance > 0 else REGION, BLOCK), run)
        shown = self._chooser.shown(regions, places, lambda *asked: self._attempt(places, *asked, run))
        within = np.searchsorted(regions.begin, blocks.begin[:-1], side="right") - 1
        for batch in self._chooser.batches(blocks):
            looks = self._chooser.looks(blocks.take(batch), single, shown[within[batch]], places, wish)
            self._add(total, looks, places, wish, neighbours, run)
        return total

    def _attempt(self, places: Footprints, lamps: Int, runs: Int, rows: Int, run: Run) -> tuple[Float, Float]:
        """One shadow ray from each of `rows`, towards lamp k from runs[k] to runs[k + 1]: the irradiance that it stands
        for, were it free, and as it is (n,) W/m2."""
        def work(job: tuple[int, slice]) -> tuple[Float, Float]:
            light, part = self.lights[job[0]], job[1]
            some = rows[part]
            key = places.identity[some] * np.int64(1_000_003) + np.arange(part.start, part.stop)
            points, normals = places.sample(some, *shifts(key, 2, self.seed + 7).T)
            weight, seen = self._shadow(light, points, normals, shifts(key, 2, self.seed + 9), run)
            brightness = np.float32(np.mean(light.colour))
            return weight * brightness, seen * brightness

        jobs = [(int(lamp), slice(first + part.start, first + part.stop))
                for lamp, first, last in zip(lamps, runs[:-1], runs[1:], strict=True)
                for part in slices(last - first, CHUNK_RAYS)]
        if not jobs:
            return np.zeros(0), np.zeros(0)
        given, seen = zip(*run.map(work, jobs), strict=True)
        return np.concatenate(given), np.concatenate(seen)

    def _add(self, total: Float, looks: list[Look], places: Footprints, wish: Wish, neighbours: Int | None,
             run: Run) -> None:
        """Add what lamps give to those who look at them."""
        sums = self._sums([(look, group, 0, count) for look in looks for count, group in _groups(look)], places, run)
        first = joined(sums, [_kinds(look) for look in looks])
        more: list[tuple[Look, Int, int, int]] = []
        values = []
        for look, own in zip(looks, first, strict=True):
            value, spread = ratio(own, look.rays)
            values.append(value)
            brightness = float(np.mean(self.lights[look.number].colour))
            if wish.tolerance > 0 and brightness > 0:
                doubt = doubtful(own, look.rows, look.rays >= CLOSED_FROM, look.closed, len(total), neighbours)
                sigma = np.where(doubt, np.maximum(spread, own.level * 0.25), 0) * brightness * look.factor
                wanted = np.minimum(np.where(sigma > 0, (sigma / wish.tolerance) ** (1 / QMC_RATE), 0), MOST_RAYS)
                more += [(look, group, start, count) for start, count, group in _steps(look, wanted)]
        place = {id(look): number for number, look in enumerate(looks)}
        asked = [(look, group, start, count - start) for look, group, start, count in more]
        for (look, group, _, count), added in zip(more, self._sums(asked, places, run), strict=True):
            number = place[id(look)]
            values[number][group] = ratio(first[number].take(group).plus(added), count)[0]
        for look, value in zip(looks, values, strict=True):
            total[look.rows] += (value * look.factor)[:, None] * self.lights[look.number].colour

    def _sums(self, asked: list[tuple[Look, Int, int, int]], places: Footprints, run: Run) -> list[ShadowSums]:
        """Sums over shadow rays start ... start + count - 1 of the point set, for some rows of a look each."""
        def work(job: tuple[int, slice]) -> ShadowSums:
            look, group, start, count = asked[job[0]]
            rows = group[job[1]]
            return self._rays(look.number, places, look.rows[rows], start, count, bool(look.closed[rows[0]]), run)

        jobs = [(number, part) for number, (_, group, _, count) in enumerate(asked)
                for part in slices(len(group), max(1, CHUNK_RAYS // count))]
        done = run.map(work, jobs)
        parts: list[list[ShadowSums]] = [[] for _ in asked]
        for (number, _), sums in zip(jobs, done, strict=True):
            parts[number].append(sums)
        return [ShadowSums.concatenate(some) for some in parts]

    def _rays(self, number: int, places: Footprints, rows: Int, start: int, count: int, ask: bool,
              run: Run) -> ShadowSums:
        light = self.lights[number]
        set_of_points = kronecker(count, 4, start)
        move = shifts(places.identity[rows], 4, self.seed + 7919 * (number + 1))
        x, y, u, v = (shifted(set_of_points[:, axis], move[:, axis]).reshape(-1) for axis in COLUMNS)
        points, normals = places.sample(np.repeat(rows, count), x, y)
        weight, seen = self._shadow(light, points, normals, np.stack([u, v], axis=-1), run)
        weight, seen = weight.reshape(-1, count), seen.reshape(-1, count)
        closed = self._closed(light, points, normals, count) if ask and start == 0 else np.full(
            len(rows), np.nan, np.float32)
        return ShadowSums(weight.sum(1), seen.sum(1), (weight > 0).sum(1), (seen > 0).sum(1), closed)

    def _shadow(self, light: Light, points: Float, normals: Float, uv: Float, run: Run) -> tuple[Float, Float]:
        """Weights of shadow rays, and the same where something stands between: 0 (n,)."""
        towards = light.sample(points, normals, uv)
        weight = towards.weight
        lit = np.flatnonzero(weight > 0)
        seen = np.zeros_like(weight)
        if len(lit):
            reach = np.minimum(towards.distance[lit], np.float32(1e30)) * np.float32(1 - SHORTEN)
            hidden = self.geometry.visibility.occluded(points[lit], towards.direction[lit], reach)
            seen[lit] = np.where(hidden, 0, weight[lit])
        run.count(len(lit))
        return weight, seen

    def _closed(self, light: Light, points: Float, normals: Float, count: int) -> Float:
        """Closed form over the lamp's colour, the mean over the first few places of each footprint: (n,) float32."""
        some = min(count, CLOSED_SAMPLES)
        index = (np.arange(0, len(points), count)[:, None] + np.arange(some)).reshape(-1)
        closed = light.irradiance(points[index], normals[index])
        if closed is None:
            return np.full(len(points) // count, np.nan, np.float32)
        channel = int(np.argmax(light.colour))
        return np.asarray(closed[:, channel].reshape(-1, some).mean(axis=1) / max(float(light.colour[channel]), 1e-30))


def _kinds(look: Look) -> Int:
    """What must be alike for rows to be worked on together: (n,) int."""
    return 2 * look.rays + look.closed


def _groups(look: Look) -> list[tuple[int, Int]]:
    """Rows with the same number of rays, that ask for the closed form or don't."""
    kinds = _kinds(look)
    return [(int(kind) // 2, np.flatnonzero(kinds == kind)) for kind in np.unique(kinds)]


def _steps(look: Look, wanted: Float) -> list[tuple[int, int, Int]]:
    """Rows that want more rays than they have, by what they have and what they get: 4, 16, 64 ... times that."""
    found = []
    for start, rows in _groups(look):
        count = 4 * start
        while count <= 4 * MOST_RAYS:
            group = rows[(wanted[rows] > count / 4) & (wanted[rows] <= count)]
            if len(group):
                found.append((start, count, group))
            count *= 4
    return found

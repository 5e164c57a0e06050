"""Suns and other bright spots of a sky's map made lamps, so that no gather ray has to find them by chance.

What shines brighter than CONTRAST times the mean of the rest is taken off the map (what is left there has just that
brightness) and becomes lamps; every texel's light is in either the lamps or the map, none in both:

    map = rest + sum of lamps                    (irradiance of every unoccluded surface, every channel)

A small disc becomes a Sun; another spot a SkyPatch, whose shadow rays are spread by its light (importance sampling of
environment maps: Pharr & Humphreys 2004, section 14.2).
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .components import components
from .lamps import Sun
from .lights import Light
from .scene import Sky
from .sky_patch import SkyPatch
from .sky_picture import Picture, SkyMap, Texels, Window

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]

# (axis (3,) unit, half angle in radians) -> what is seen there.
CloseLook = Callable[[Float, float], Window]
Peeled = tuple[tuple[Light, ...], Sky]

# Texels brighter than this many times the mean of what is left become lamps. Gather rays find fainter ones.
CONTRAST = 6.0
# A spot stays on the map if it gives less than this part of what is left there, and its peak is less than so many
# times above the contrast: few enough gather rays meet it, and none of them brings much.
LEAST_SHARE, LEAST_PEAK = 0.01, 4.0
# Spots that become lamps each; all others together become one.
MOST_SPOTS = 6
# A spot within this half angle has one colour, radians. A wider one gives up as much light of its mean colour as it
# has, if what is left is fainter than the contrast; else each channel becomes a lamp of its own.
SMALL = np.radians(3.0)
# A spot's core, brighter than this part of its peak, is looked at closely if it is small and gives this part of all.
CORE, CORE_SHARE = 0.01, 0.01
# A disc of even radiance has <r^4> / <r^2>^2 = 4/3; up to this, and up to this half angle, a spot counts as a disc.
DISC_KURTOSIS, LARGEST_DISC, DISC_TEXELS = 1.5, SMALL, 12


def peel(sky: Sky, close_look: CloseLook | None = None, name: str = "sky") -> tuple[tuple[Light, ...], Sky]:
    """Take the bright spots off a sky.

    Parameters
    ----------
    sky : a constant sky stays as it is.
    close_look : looks at a small spot more closely than the map does; None: the map is all there is.
    name : what the lamps are called, with a number.

    Returns
    -------
    The lamps, and the sky that is left.
    """
    peeling = peel_parts(sky, name)
    window: Window | None = None
    while True:
        try:
            wanted = peeling.send(window)
        except StopIteration as end:
            peeled: Peeled = end.value
            return peeled
        window = close_look(*wanted) if close_look is not None else None


def peel_parts(sky: Sky, name: str) -> Generator[tuple[Float, float], Window | None, Peeled]:
    """`peel` for a caller that looks closely in its own time: yields the axis (3,) and half angle of each close look,
    and is sent what it shows; None where the map is all there is.
    """
    if sky.radiance.ndim == 1:
        return (), sky
    whole = SkyMap(sky.radiance)
    level = _level(whole)
    brightness = whole.radiance.mean(axis=2)
    row, column = np.nonzero(brightness > level)
    total = float((brightness * whole.solid_angle()).sum())
    part = 1 - level / brightness[row, column]
    bright = _Spot(whole, row, column, whole.radiance[row, column] * part[:, None])
    if not len(row):
        return (), sky
    rest = whole.radiance.copy()
    lamps: list[Light] = []
    for spot in _spots(whole, bright):
        for seen, taken in (yield from _looked_at(spot, whole, level, total)):
            if _is_faint(seen, level):
                continue
            rest[taken.row, taken.column] -= taken.light
            made, left = _lamps(seen, level, f"{name} {len(lamps) + 1}")
            lamps += made
            if left is not None:
                rest[seen.row, seen.column] += left
    return tuple(lamps), Sky(np.maximum(rest, 0))


@dataclass(frozen=True, eq=False)
class _Spot:
    """Texels of a picture and the light that they give up: row, column (k,), light (k, 3) W / (m2 sr)."""

    picture: Picture
    row: Int
    column: Int
    light: Float

    def __post_init__(self) -> None:
        object.__setattr__(self, "texels", self.picture.texels(self.row, self.column))

    texels: Texels = None  # type: ignore[assignment]

    @property
    def power(self) -> float:
        """W/m2, the mean of the channels."""
        return float((self.light.mean(axis=1) * self.texels.solid_angle).sum())

    def take(self, index: NDArray[Any]) -> _Spot:
        """Some of the texels."""
        return _Spot(self.picture, self.row[index], self.column[index], self.light[index])

    def cap(self) -> tuple[Float, float]:
        """Unit axis (3,) and half angle of a cap around the texels' centres."""
        axis = (self.texels.direction * self.texels.solid_angle[:, None]).sum(axis=0)
        length = float(np.linalg.norm(axis))
        if length == 0:
            return np.array([0.0, 0.0, 1.0]), np.pi
        axis = axis / length
        away = np.linalg.norm(self.texels.direction - axis, axis=1).max()
        return axis, 2 * float(np.arcsin(min(away / 2, 1.0)))


def _level(whole: SkyMap) -> float:
    """The brightness L = CONTRAST * mean(min(radiance, L)), from above."""
    solid = np.broadcast_to(whole.solid_angle() / (4 * np.pi), whole.radiance.shape[:2])
    brightness = whole.radiance.mean(axis=2)
    level = np.inf
    for _ in range(100):
        lower = CONTRAST * float((np.minimum(brightness, level) * solid).sum())
        if lower >= level * (1 - 1e-3):
            break
        level = lower
    return float(level)


def _spots(whole: SkyMap, bright: _Spot) -> list[_Spot]:
    """Connected spots, brightest first; the last may be all small ones together."""
    number = np.full((whole.height, whole.width), -1)
    number[bright.row, bright.column] = np.arange(len(bright.row))
    ends = []
    for down, right in ((0, 1), (1, -1), (1, 0), (1, 1)):
        inside = bright.row + down < whole.height
        other = number[(bright.row + down) % whole.height, (bright.column + right) % whole.width]
        pair = np.flatnonzero(inside & (other >= 0))
        ends.append(np.stack([pair, other[pair]]))
    label = components(len(bright.row), *np.concatenate(ends, axis=1))
    power = np.bincount(label, bright.light.mean(axis=1) * bright.texels.solid_angle)
    order = np.argsort(-power, kind="stable")
    spots = [bright.take(np.flatnonzero(label == one)) for one in order[:MOST_SPOTS]]
    others = np.flatnonzero(np.isin(label, order[MOST_SPOTS:]))
    return [*spots, bright.take(others)] if len(others) else spots


def _is_faint(spot: _Spot, level: float) -> bool:
    """Whether the map can keep it."""
    peak = float(spot.light.mean(axis=1).max())
    return spot.power < LEAST_SHARE * 4 * np.pi * level / CONTRAST and peak < (LEAST_PEAK - 1) * level


def _looked_at(spot: _Spot, whole: SkyMap, level: float,
               total: float) -> Generator[tuple[Float, float], Window | None, list[tuple[_Spot, _Spot]]]:
    """A spot in one or two parts, its core from close by: each as it is seen, and as it stands on the map."""
    brightness = spot.light.mean(axis=1)
    core = spot.take(np.flatnonzero(brightness > CORE * brightness.max()))
    axis, half_angle = core.cap()
    if half_angle > SMALL or core.power < CORE_SHARE * total:
        return [(spot, spot)]
    reach = half_angle + 2 * whole.texel_angle
    near = spot.texels.direction @ axis > np.cos(reach)
    bright = whole.radiance.mean(axis=2) > level
    stands_for = np.zeros_like(bright)
    stands_for[spot.row[near], spot.column[near]] = True
    window = yield axis, reach + whole.texel_angle
    if window is None:
        return [(spot, spot)]
    seen = window.radiance.mean(axis=2)
    row, column = np.nonzero(seen > level)
    direction = window.texels(row, column).direction
    texel = whole.place(direction)
    # A texel that the spot only touches may be dark on the map, whose few samples missed it there.
    missed = ~bright[texel] & (direction @ axis > np.cos(reach))
    kept = np.flatnonzero(stands_for[texel] | missed)
    if not len(kept):
        return [(spot, spot)]
    row, column = row[kept], column[kept]
    fine = _Spot(window, row, column, window.radiance[row, column] * (1 - level / seen[row, column])[:, None])
    far = spot.take(np.flatnonzero(~near))
    return [(fine, spot.take(np.flatnonzero(near))), *([(far, far)] if len(far.row) else [])]


def _lamps(spot: _Spot, level: float, name: str) -> tuple[list[Light], Float | None]:
    """A spot's lamps, and what is left of its light (k, 3), None for nothing."""
    fluence = (spot.light * spot.texels.solid_angle[:, None]).sum(axis=0)
    if spot.cap()[1] <= SMALL:
        return [_disc(spot, fluence, name) or _patch(spot, spot.light.mean(axis=1), fluence, name)], None
    colour = fluence / fluence.max()
    some = np.flatnonzero(colour > 0)
    # The most that can be taken of this colour without any channel's going below zero.
    amount = (spot.light[:, some] / colour[some]).min(axis=1)
    left = np.maximum(spot.light - amount[:, None] * colour, 0)
    if left.mean(axis=1).max() < level:
        return [_patch(spot, amount, colour * float((amount * spot.texels.solid_angle).sum()), name)], left
    return [_patch(spot, spot.light[:, channel], fluence * np.eye(3)[channel], f"{name} {'RGB'[channel]}")
            for channel in some], None


def _patch(spot: _Spot, amount: Float, fluence: Float, name: str) -> SkyPatch:
    lit = np.flatnonzero(amount > 0)
    texels = spot.texels
    return SkyPatch(name, texels.direction[lit], texels.across[lit], texels.along[lit], spot.row[lit],
                    amount[lit] * texels.solid_angle[lit], fluence)


def _disc(spot: _Spot, fluence: Float, name: str) -> Sun | None:
    """The spot as a sun, if it is a small disc: the same irradiance on all that faces it, the same mean radius."""
    share = spot.light.mean(axis=1) * spot.texels.solid_angle
    share = share / share.sum()
    mean = share @ spot.texels.direction
    length = float(np.linalg.norm(mean))
    axis = mean / length
    squared = ((spot.texels.direction - axis) ** 2).sum(axis=1)
    second, fourth = float(share @ squared), float(share @ squared**2)
    half_angle = np.sqrt(2 * second)  # of a disc: <r^2> = R^2 / 2
    if len(share) < DISC_TEXELS or half_angle > LARGEST_DISC or fourth > DISC_KURTOSIS * second**2:
        return None
    return Sun(name, -axis, fluence * length, 2 * half_angle)

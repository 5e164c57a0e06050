"""A bright part of the sky as a lamp of its own: shadow rays go where its light comes from."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .errors import SceneError
from .lamp_checks import put, spectrum
from .lights import LightSample, dot

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]

# Directions that stand for the patch where the horizon cuts it. The irradiance of half of a round patch is then right
# to .2 % of the whole (tested).
HORIZON_GROUPS = 128
# Points that are held against all of these directions at once.
CHUNK = 2**15


@dataclass(frozen=True, eq=False)
class SkyPatch:
    """Texels of a picture of the sky, of one chromaticity.

    Parameters
    ----------
    name : for messages.
    direction : (k, 3) unit, towards the texels' centres; texels of one row of the picture stand together.
    across, along : (k, 3) the texels' sides: a texel is all of direction + x across + y along, |x|, |y| <= 1/2.
    row : (k,) int, the row of the picture that each is in, never falling.
    share : (k,) each texel's share of the light; any scale.
    fluence : (3,) W/m2, radiance times solid angle of them all: what a surface that faced every texel would get.
    """

    name: str
    direction: Float
    across: Float
    along: Float
    row: Int
    share: Float
    fluence: Float

    def __post_init__(self) -> None:
        direction, share = np.array(self.direction, np.float64), np.array(self.share, np.float64)
        if direction.ndim != 2 or direction.shape[1:] != (3,) or share.shape != (len(direction),) or not share.any():
            raise SceneError(f"lamp {self.name!r}: directions {direction.shape} and shares {share.shape} do not match, "
                             "or there is no light: give (k, 3) and (k,), k > 0")
        if not (np.isfinite(direction).all() and np.isfinite(share).all()) or share.min() < 0:
            raise SceneError(f"lamp {self.name!r}: a direction or share is negative or not finite")
        put(self, fluence=spectrum(self.name, "fluence", self.fluence), direction=direction, share=share,
            across=np.array(self.across, np.float64), along=np.array(self.along, np.float64), row=np.array(self.row))

    @cached_property
    def _table(self) -> _Table:
        return _Table(self.direction, self.across, self.along, self.row, self.share)

    @property
    def colour(self) -> Float:
        """(3,) float32: fluence, W/m2."""
        return self.fluence

    def power(self) -> Float:
        """(3,) float32, nan: the sky has no flux of its own."""
        return np.full(3, np.nan, np.float32)

    def irradiance(self, points: Float, normals: Float) -> Float:
        """Unoccluded irradiance (n, 3) float32, W/m2."""
        return self._table.cosine(np.asarray(normals, np.float32))[:, None] * self.colour

    def sample(self, points: Float, normals: Float, uv: Float) -> LightSample:
        """Directions in proportion to the light that comes from them; the distance is inf."""
        direction = self._table.directions(uv)
        weight = np.maximum(dot(direction, normals), 0)
        return LightSample(direction, np.full(len(points), np.inf, np.float32), np.asarray(weight, np.float32))

    def translated(self, offset: Float) -> SkyPatch:
        """The patch itself: it stands nowhere."""
        return self


class _Table:
    """Texels by row, with running sums for drawing one: first a row, then a texel of it."""

    def __init__(self, direction: Float, across: Float, along: Float, row: Int, share: Float) -> None:
        share = share / share.sum()
        self._direction, self._across, self._along = (x.astype(np.float32) for x in (direction, across, along))
        starts = np.flatnonzero(np.diff(row, prepend=row[0] - 1))
        self._running = np.concatenate([[0.0], np.cumsum(share)])
        self._start = np.append(starts, len(row))
        self._rows = self._running[self._start]
        self.mean = share @ direction
        self._reach = float(np.clip((direction @ (self.mean / np.linalg.norm(self.mean))).min(), -1, 1)) if (
            np.linalg.norm(self.mean) > 0) else -1.0
        self._group_power, self._group_direction = _grouped(direction, share)

    def directions(self, uv: Float) -> Float:
        """(n, 3) float32 unit directions for uv (n, 2) in [0, 1)^2."""
        row, y = _draw(self._rows, uv[:, 0].astype(np.float64) * self._rows[-1])
        low, high = self._running[self._start[row]], self._running[self._start[row + 1]]
        texel, x = _draw(self._running, low + uv[:, 1] * (high - low))
        texel = np.clip(texel, self._start[row], self._start[row + 1] - 1)
        towards = self._direction[texel] + self._across[texel] * (x - 0.5)[:, None].astype(np.float32)
        towards += self._along[texel] * (y - 0.5)[:, None].astype(np.float32)
        return np.asarray(towards / np.sqrt(dot(towards, towards))[:, None], np.float32)

    def cosine(self, normals: Float) -> Float:
        """(n,) float32: mean over the light of max(0, cos) to the normals.

        Where all of the patch is above the horizon this is linear in the normal (Lambert 1760).
        """
        length = float(np.linalg.norm(self.mean))
        linear = normals @ self.mean.astype(np.float32)
        if length == 0:
            cut = np.arange(len(normals))
        else:
            # The patch is within the angle acos(reach) about its middle.
            sine = np.sqrt(max(1 - self._reach**2, 0.0)) if self._reach > 0 else 1.0
            cut = np.flatnonzero(np.abs(linear) <= (sine + 1e-5) * length)
        result = np.maximum(linear, 0)
        for start in range(0, len(cut), CHUNK):
            some = cut[start:start + CHUNK]
            result[some] = np.maximum(normals[some] @ self._group_direction.T, 0) @ self._group_power
        return np.asarray(result, np.float32)


def _draw(running: Float, value: Float) -> tuple[Int, Float]:
    """The piece of a running sum that each value lies in, and how far into it, 0 to 1."""
    index = np.clip(np.searchsorted(running, value, side="right") - 1, 0, len(running) - 2)
    width = running[index + 1] - running[index]
    return index, np.clip((value - running[index]) / np.where(width > 0, width, 1), 0, 1)


def _grouped(direction: Float, share: Float) -> tuple[Float, Float]:
    """Power (g,) and mean direction (g, 3) float32 of groups of texels that lie together (median cut, Debevec 2005)."""
    groups: list[Int] = [np.arange(len(share))]
    while len(groups) < HORIZON_GROUPS:
        halves = [half for group in groups for half in _halves(direction, share, group)]
        if len(halves) == len(groups):
            break
        groups = halves
    power = np.array([share[group].sum() for group in groups])
    mean = np.array([share[group] @ direction[group] for group in groups]) / np.maximum(power, 1e-300)[:, None]
    return power.astype(np.float32), mean.astype(np.float32)


def _halves(direction: Float, share: Float, group: Int) -> list[Int]:
    """A group cut across its longest extent into two of about equal light."""
    if len(group) < 2:
        return [group]
    axis = int(np.argmax(np.ptp(direction[group], axis=0)))
    group = group[np.argsort(direction[group, axis], kind="stable")]
    running = np.cumsum(share[group])
    middle = int(np.clip(np.searchsorted(running, running[-1] / 2) + 1, 1, len(group) - 1))
    return [group[:middle], group[middle:]]

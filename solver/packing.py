"""Charts get a place on a page: as boxes, standing, tallest first, each where the skyline is lowest.

xatlas packs charts by their true shape but spends 4 s on 800 charts and, with 4 texels between them, filled .40 of the
page where boxes fill .65 in .01 s (250,000 triangles); over real scenes boxes are ahead wherever charts are many, and a
density can be searched for by packing again.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .charts import Charts
from .errors import UnwrapError

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]

# Sides, texels, that every chart is given at least, shorter and longer one: whatever its shape it then covers the
# centre of a texel, and even a strip thinner than a texel gets its light.
LEAST_SIDES = (1.0, 2.5)
# Search for the largest density ends when what fits and what does not are this close, as a ratio.
DENSITY_CLOSENESS = 1.01
DENSITY_STEPS = 24
# A packing reaches about this part of the density at which the boxes' area alone would fill the page.
FIRST_GUESS = 0.96
# More boxes than this are joined to strips of this part of the page's width first, where they are small and equally
# high: 20,000 charts pack in a tenth of the time.
MANY, STRIP = 10_000, 1 / 8


@dataclass(frozen=True, eq=False)
class Packed:
    """Charts on a page: uv (t, 3, 2) float64 texels, and the height that they need, texels."""

    uv: Float
    height: int


class Packer:
    """The charts of one page, ready to be packed at any density.

    Parameters
    ----------
    charts : in metres.
    padding : least number of texels between two charts.
    """

    def __init__(self, charts: Charts, padding: int) -> None:
        self.charts, self.padding = charts, padding
        self.low, self.side = charts.boxes()
        self.turned = self.side[:, 0] > self.side[:, 1]
        self.standing = np.sort(self.side, axis=1)

    def sizes(self, density: float) -> tuple[Float, Int]:
        """Charts' sides in texels (k, 2) float64, and the whole texels they get (k, 2); both standing."""
        sides = np.maximum(self.standing * density, LEAST_SIDES)
        return sides, np.ceil(sides - 1e-6).astype(np.int64)

    def padded_area(self, density: float) -> float:
        """Texels that the charts and the space between them need at least."""
        return float((self.sizes(density)[1] + self.padding).prod(axis=1, dtype=np.float64).sum())

    def covered_area(self, density: float) -> float:
        """Texels of the charts' boxes alone."""
        return float(self.sizes(density)[1].prod(axis=1, dtype=np.float64).sum())

    def height(self, density: float, width: int) -> float:
        """The height of page that a packing needs; infinite if a chart is too wide."""
        whole = self.sizes(density)[1] + self.padding
        if whole[:, 0].max() > width + self.padding:
            return np.inf
        return float(skyline(whole, width + self.padding, enough=width + self.padding)[2] - self.padding)

    def pack(self, density: float, width: int) -> Packed:
        """Place every chart on a page of this width.

        Raises
        ------
        UnwrapError
            If a chart is wider than the page.
        """
        sides, whole = self.sizes(density)
        if whole[:, 0].max() > width:
            raise UnwrapError(f"a chart of {whole[:, 0].max()} texels is wider than a page of {width}: lower density")
        corner, laid, height = skyline(whole + self.padding, width + self.padding)
        turned = self.turned ^ laid
        sides = np.where(laid[:, None], sides[:, ::-1], sides)
        whole = np.where(laid[:, None], whole[:, ::-1], whole)
        chart = self.charts.chart
        uv = self.charts.uv - self.low[chart][:, None]
        uv = np.where(turned[chart][:, None, None],
                      np.stack([self.side[chart, 1][:, None] - uv[:, :, 1], uv[:, :, 0]], axis=2), uv)
        scale = sides / np.maximum(np.where(turned[:, None], self.side[:, ::-1], self.side), 1e-300)
        offset = corner + (whole - sides) / 2
        return Packed(uv * scale[chart][:, None] + offset[chart][:, None], height - self.padding)


def largest_density(packers: list[Packer], side: int) -> float:
    """The most texels a metre at which every packer's charts fit on a square page of its own.

    Raises
    ------
    UnwrapError
        If they do not fit at any density.
    """
    fails, fits = _bound(packers, side), 0.0
    trial = FIRST_GUESS * fails
    for _ in range(DENSITY_STEPS):
        needed = max(packer.height(trial, side) for packer in packers)
        if needed <= side:
            fits = trial
        else:
            fails = trial
        if fits and fails < fits * DENSITY_CLOSENESS:
            break
        # The height goes with the square of the density, roughly; where that leaves the bracket, halve it.
        trial *= float(np.sqrt(side / needed)) * (1 - DENSITY_CLOSENESS / 1000)
        if not fits < trial < fails:
            trial = float(np.sqrt(fits * fails)) if fits else fails / 2
    if not fits:
        raise UnwrapError(_too_many(packers, side))
    return fits


def _bound(packers: list[Packer], side: int) -> float:
    """A density above which no packing exists: the longest chart is too long, or the padded boxes' area too large."""
    room = [(side + packer.padding) ** 2 for packer in packers]
    if any(packer.padded_area(0) > most for packer, most in zip(packers, room, strict=True)):
        raise UnwrapError(_too_many(packers, side))
    low, high = 0.0, side / max(float(packer.standing.max()) for packer in packers)
    for _ in range(DENSITY_STEPS):
        middle = (low + high) / 2
        small = all(packer.padded_area(middle) <= most for packer, most in zip(packers, room, strict=True))
        low, high = (middle, high) if small else (low, middle)
    return high


def _too_many(packers: list[Packer], side: int) -> str:
    count = sum(packer.charts.count for packer in packers)
    return (f"{count} charts do not fit on {len(packers)} page(s) of {side} pixels: raise resolution or max_pages, "
            "or bake fewer objects")


def skyline(size: Int, width: int, enough: int = 0) -> tuple[Int, NDArray[np.bool_], int]:
    """Pack boxes into a strip: the better of standing boxes and of boxes laid down where that is lower.

    Parameters
    ----------
    size : (k, 2) int, standing (height at least width).
    width : of the strip.
    enough : a height at which there is no need to look for a lower one.

    Returns
    -------
    corner : (k, 2) int64 lower left corners.
    laid : (k,) bool, whether a box was laid down.
    height : of the strip that is used.
    """
    if len(size) <= MANY:
        return _better_skyline(size, width, enough)
    strip, within = _strips(size, int(width * STRIP))
    order = np.argsort(strip, kind="stable")
    start = np.searchsorted(strip[order], np.arange(int(strip.max()) + 1))
    sizes = np.column_stack([np.add.reduceat(size[order, 0], start), size[order[start], 1]])
    corner, laid, height = _better_skyline(sizes, width, enough)
    corner, laid = corner[strip], laid[strip]
    corner[np.arange(len(size)), laid.astype(int)] += within  # along the strip: to the right, or up where it was laid
    return corner, laid, height


def _strips(size: Int, length: int) -> tuple[Int, Int]:
    """Join small boxes of the same height side by side: the strip of each box, and its place along it.

    Only boxes narrower than an eighth of a strip are joined, so that strips are about equally long.
    """
    small = size[:, 0] * 8 <= length
    order = np.lexsort((-size[:, 0], -size[:, 1], ~small))
    wide = np.where(small, size[:, 0], 0)[order]
    tall = np.where(small, size[:, 1], 0)[order]
    new_class = np.concatenate([[True], tall[1:] != tall[:-1]])
    before = np.cumsum(wide) - wide
    in_class = before - np.maximum.accumulate(np.where(new_class, before, 0))
    number = in_class // max(length, 1)
    alone = ~small[order]
    new_strip = new_class | np.concatenate([[True], number[1:] != number[:-1]]) | alone
    start = np.maximum.accumulate(np.where(new_strip, before, 0))
    strip, within = np.empty(len(size), np.int64), np.empty(len(size), np.int64)
    strip[order] = np.cumsum(new_strip) - 1
    within[order] = np.where(alone, 0, before - start)
    return strip, within


def _better_skyline(size: Int, width: int, enough: int) -> tuple[Int, NDArray[np.bool_], int]:
    standing = _skyline(size, width, lay=False)
    if standing[2] <= enough:
        return standing
    return min(standing, _skyline(size, width, lay=True), key=lambda found: found[2])


def _skyline(size: Int, width: int, lay: bool) -> tuple[Int, NDArray[np.bool_], int]:
    """Bottom left on a skyline of one height a column; boxes in the order of their height, then width."""
    top = np.zeros(width, np.int64)
    corner, laid = np.zeros(size.shape, np.int64), np.zeros(len(size), bool)
    order = np.lexsort((-size[:, 0], -size[:, 1]))
    for index, (w, h) in zip(order.tolist(), size[order].tolist(), strict=True):
        x, y = _lowest(top, w)
        if lay and h <= width and h != w:
            other_x, other_y = _lowest(top, h)
            if other_y + w < y + h:
                x, y, w, h = other_x, other_y, h, w
                laid[index] = True
        top[x:x + w] = y + h
        corner[index] = x, y
    return corner, laid, int(top.max())


def _lowest(top: Int, width: int) -> tuple[int, int]:
    """Where a box of this width stands lowest: first such column, and the height there."""
    highest, reach = top, 1
    while reach * 2 <= width:
        highest = np.maximum(highest[:-reach], highest[reach:])
        reach *= 2
    if width > reach:
        highest = np.maximum(highest[:reach - width], highest[width - reach:])
    x = int(highest.argmin())
    return x, int(highest[x])

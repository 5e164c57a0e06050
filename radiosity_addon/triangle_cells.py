"""An image layout for a heap of triangles: two by two in square cells, no texel shared, none read from outside.

A triangle of n steps has its corners on texel centres: (0, 0), (n, 0), (0, n) from its cell's corner; a second one
stands on its head in the same cell of n + 3 texels. Bilinear lookups inside the first one reach the texels
i + j <= n + 1, and inside the second one the same from the opposite corner: these never meet. The texels i + j = n + 1
lie just outside the triangle; they continue it linearly (`fill_rims`), so that a lookup is linear along the edge.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]

# Most steps along a triangle's legs.
MOST_STEPS = 512
# Texels that a cell is wider than its triangles' steps.
RIM = 3
# Texels by which a triangle to be baked is larger each way, so that texel centres on its edges lie inside.
MARGIN = 0.01
# Widest image, texels.
WIDEST = 4096


@dataclass(frozen=True, eq=False)
class Cells:
    """Where each of t triangles lies.

    Attributes
    ----------
    steps : (t,) int64 steps along the legs, powers of two.
    corner : (t, 2) int64 texel that the triangle's first corner stands on.
    upside_down : (t,) bool: legs run towards smaller coordinates.
    width, height : of the image, texels.
    """

    steps: Int
    corner: Int
    upside_down: NDArray[np.bool_]
    width: int
    height: int

    def uv(self, margin: float = 0.0) -> Float:
        """(t, 3, 2) float32 image coordinates of the corners, the triangle larger by `margin` texels."""
        legs = np.array([[0, 0], [1, 0], [0, 1]], np.float64)
        grow = np.array([[-1, -1], [2, -1], [-1, 2]], np.float64) * margin
        offsets = legs[None] * self.steps[:, None, None] + grow
        texels = self.corner[:, None] + 0.5 + np.where(self.upside_down[:, None, None], -offsets, offsets)
        return np.asarray(texels / (self.width, self.height), np.float32)

    def inside(self) -> NDArray[np.bool_]:
        """(height, width) bool: texels whose middles lie in or on a triangle."""
        mask = np.zeros((self.height, self.width), bool)
        for steps in np.unique(self.steps):
            rows = np.flatnonzero(self.steps == steps)
            i, j = np.nonzero(np.add.outer(np.arange(steps + 1), np.arange(steps + 1)) <= steps)
            sign = np.where(self.upside_down[rows], -1, 1)[:, None]
            mask[self.corner[rows, 1:] + sign * j, self.corner[rows, :1] + sign * i] = True
        return mask

    def fill_rims(self, pixels: Float) -> None:
        """Continue each triangle by one texel beyond its long edge: pixels (height, width, k), in place."""
        for steps in np.unique(self.steps):
            rows = np.flatnonzero(self.steps == steps)
            along = np.arange(steps + 2)
            sign = np.where(self.upside_down[rows], -1, 1)[:, None]
            x = self.corner[rows, :1] + sign * along
            y = self.corner[rows, 1:] + sign * along[::-1]
            inner = slice(1, -1)
            left, low = pixels[y[:, inner], (x - sign)[:, inner]], pixels[(y - sign)[:, inner], x[:, inner]]
            both = pixels[(y - sign)[:, inner], (x - sign)[:, inner]]
            pixels[y[:, inner], x[:, inner]] = np.maximum(left + low - both, 0)


def place_cells(wanted: Float, most_texels: int) -> Cells:
    """Cells for triangles.

    Parameters
    ----------
    wanted : (t,) steps that each triangle should have; met to a factor of two, less where the texels don't suffice.
    most_texels : of the image, about.
    """
    steps = _fitting(np.asarray(wanted, np.float64), most_texels)
    order = np.argsort(-steps, kind="stable")
    sizes, starts, counts = np.unique(-steps[order], return_index=True, return_counts=True)
    width = _width(-sizes, counts)
    corner = np.zeros((len(steps), 2), np.int64)
    upside_down = np.zeros(len(steps), bool)
    height = 0
    for size, start, count in zip(-sizes, starts, counts, strict=True):
        side = int(size) + RIM
        index = np.arange(count)
        row, column = np.divmod(index // 2, width // side)
        second = (index % 2).astype(bool)
        members = order[start:start + count]
        corner[members, 0] = column * side + np.where(second, side - 1, 0)
        corner[members, 1] = height + row * side + np.where(second, side - 1, 0)
        upside_down[members] = second
        height += (int(row[-1]) + 1) * side
    return Cells(steps, corner, upside_down, width, height)


def _fitting(wanted: Float, most_texels: int) -> Int:
    """Steps as powers of two, all made smaller by the same factor until the cells fit."""
    factor = 1.0
    while True:
        steps = 2 ** np.rint(np.log2(np.clip(wanted * factor, 1, MOST_STEPS))).astype(np.int64)
        if ((steps + RIM) ** 2).sum() / 2 <= most_texels or steps.max() == 1:
            return np.asarray(steps)
        factor /= 2


def _width(sizes: Int, counts: Int) -> int:
    """Of an image that is about square, and holds the largest cell."""
    area = float(((sizes + RIM) ** 2 * ((counts + 1) // 2)).sum())
    return int(min(max(np.ceil(np.sqrt(area)), sizes.max() + RIM), max(WIDEST, sizes.max() + RIM)))

"""Flat pieces of emissive surface: triangles, and the parallelograms that two of them make.

A parallelogram is sampled by its two sides, smoothly and evenly; its two triangles, each by a square root and with a
step between them, spread quasi-random points worse, and cost one polygon more in the closed form.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .components import shared_edges

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]

# How far the fourth corner may lie from where a parallelogram has it, over the longer diagonal: float32 meshes.
SKEW = 1e-5
# Rounds of pairing: each pairs at least the longest diagonal that is left around every triangle.
MOST_ROUNDS = 8


@dataclass(frozen=True, eq=False)
class Panels:
    """Flat pieces, each a triangle or a parallelogram.

    corner, first, second : (p, 3) float64, metres: a corner and the two sides from it.
    square : (p,) bool, whether it is the parallelogram of the two sides, not the triangle.
    triangle : (p,) int, one triangle that it is made of.
    """

    corner: Float
    first: Float
    second: Float
    square: NDArray[np.bool_]
    triangle: Int

    def outlines(self, square: bool) -> tuple[Int, Float]:
        """The parallelograms, or the triangles: which panels (k,), and their corners in order (k, 4 or 3, 3)."""
        rows = np.flatnonzero(self.square == square)
        corner, first, second = self.corner[rows], self.first[rows], self.second[rows]
        path = [corner, corner + first, corner + first + second, corner + second] if square else [
            corner, corner + first, corner + second]
        return rows, np.stack(path, axis=1)


def panels(corners: Float, radiance: Float) -> Panels:
    """The panels of triangles (t, 3, 3) metres of radiance (t, c), in the order of their first triangles."""
    diagonal = partners(corners, radiance)
    other, side = diagonal[:, 0], diagonal[:, 1]
    kept = np.flatnonzero((other < 0) | (np.arange(len(corners)) < other))
    square = other[kept] >= 0
    # The corner across the diagonal, or simply the first; the others follow in the triangle's turn.
    start = np.where(square, (side[kept] + 2) % 3, 0)
    corner = corners[kept, start]
    first, second = (corners[kept, (start + step) % 3] - corner for step in (1, 2))
    return Panels(corner, first, second, square, kept)


def partners(corners: Float, radiance: Float) -> Int:
    """(t, 2) int: the triangle that each makes a parallelogram with, -1 for none, and its side that is the diagonal.

    Both must turn the same way and shine alike.
    """
    count = len(corners)
    found = np.full((count, 2), -1, np.int64)
    node = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)[1].reshape(-1, 3)
    first, second, first_side, second_side = shared_edges(node)
    a, b = corners[first, (first_side + 2) % 3], corners[second, (second_side + 2) % 3]
    start, end = corners[first, first_side], corners[first, (first_side + 1) % 3]
    length = np.linalg.norm(end - start, axis=1)
    across = np.maximum(length, np.linalg.norm(a - b, axis=1))
    good = (node[first, first_side] == node[second, (second_side + 1) % 3]) & (
        np.linalg.norm(a + b - start - end, axis=1) <= SKEW * across) & (
        np.abs(radiance[first] - radiance[second]).max(axis=1) <= SKEW * radiance[first].max(axis=1))
    first, second, first_side, second_side, length = (
        array[good] for array in (first, second, first_side, second_side, length))
    for _ in range(MOST_ROUNDS):
        if not len(first):
            break
        # Each triangle's longest side, the first of those as long: where both ends agree they are a pair.
        order = np.argsort(-length, kind="stable")
        rank = np.empty(len(order), np.int64)
        rank[order] = np.arange(len(order))
        best = np.full(count, len(order))
        np.minimum.at(best, first, rank)
        np.minimum.at(best, second, rank)
        pair = (best[first] == rank) & (best[second] == rank)
        found[first[pair]] = np.stack([second[pair], first_side[pair]], axis=1)
        found[second[pair]] = np.stack([first[pair], second_side[pair]], axis=1)
        left = (found[first, 0] < 0) & (found[second, 0] < 0)
        first, second, first_side, second_side, length = (
            array[left] for array in (first, second, first_side, second_side, length))
    return found

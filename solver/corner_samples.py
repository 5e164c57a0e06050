"""Samples of light inside the triangles of a mesh whose corners get colours."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .settings import Settings

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]

# Samples of the whole scene that are aimed at where no texel density is asked for; each triangle is cut into k x k
# parts, k up to this many, with one sample in each.
SAMPLES, MOST_CUTS = 1 << 18, 16
# Up to this number of triangles each has four samples at least, which tell its three corners apart; above it one.
MANY_TRIANGLES = 250_000


@dataclass(frozen=True, eq=False)
class CornerSamples:
    """The middles of k x k equal parts of every triangle, a triangle's next to each other.

    cuts : (t,) k of each triangle; 0 without area.
    first : (t,) each triangle's first sample.
    triangle : (n,) index among the triangles.
    weight : (n, 2) of corners 1 and 2.
    mirrored : (n,) whether the part points the other way than the triangle.
    area : (n,) m2 of the part.
    """

    cuts: Int
    first: Int
    triangle: Int
    weight: Float
    mirrored: NDArray[np.bool_]
    area: Float

    @classmethod
    def of(cls, area: Float, settings: Settings) -> CornerSamples:
        """The samples of triangles with areas (t,) m2, 0 for those that get none."""
        cuts = cuts_of(area, settings)
        first = np.cumsum(cuts**2) - cuts**2
        triangle = np.repeat(np.arange(len(area)), cuts**2)
        k = cuts[triangle]
        # Part (i, j) of the square of k x k; the half beyond the diagonal is the parts that point the other way.
        i, j = np.divmod(np.arange(len(triangle)) - first[triangle], k)
        mirrored = i + j >= k
        weight = (np.column_stack([i, j]) + 1 / 3) / k[:, None]
        return cls(cuts, first, triangle, np.where(mirrored[:, None], 1 - weight, weight), mirrored,
                   area[triangle] / k**2)

    def __len__(self) -> int:
        return len(self.triangle)

    @property
    def side(self) -> Float:
        """(n,) side of a square in (u, v) with the part's area."""
        return np.asarray(np.sqrt(0.5) / self.cuts[self.triangle])

    def at(self, triangle: Int, weight: Float) -> Int:
        """The samples in whose parts points (n, 2) of triangles (n,) lie; -1 for a triangle without samples. Points
        outside of their triangle count for its border."""
        k = self.cuts[triangle]
        inside = np.clip(weight, 0, 1)
        inside /= np.maximum(inside.sum(axis=1, keepdims=True), 1)
        place = inside * k[:, None]
        i, j = np.minimum(place.astype(np.int64), k[:, None] - 1).T
        # Beyond the diagonal of square (i, j); on the triangle's border there is nothing beyond.
        mirrored = (place.sum(axis=1) - i - j > 1) & (i + j <= k - 2)
        i = np.where(i + j >= k, k - 1 - j, i)
        i, j = np.where(mirrored, k - 1 - i, i), np.where(mirrored, k - 1 - j, j)
        return np.where(k > 0, self.first[triangle] + i * k + j, -1)


def cuts_of(area: Float, settings: Settings) -> Int:
    """(t,) k of the k x k parts of each triangle; 0 without area."""
    density = settings.texel_density
    part = 1 / density**2 if density else max(float(area.sum()) / SAMPLES, 1e-300)
    least = 2 if len(area) <= MANY_TRIANGLES else 1
    cuts: Int = np.where(area > 0, np.clip(np.ceil(np.sqrt(area / part)), least, MOST_CUTS), 0).astype(np.int64)
    return cuts

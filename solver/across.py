"""Which lumels follow where a chart ends: beyond a seam the surface goes on, and so do a lumel's neighbours.

A lumel at a chart's edge has ways that lead to no lumel of its chart. Where a sample of a seam lies on such a way, the
layouts of both charts are known there, and with them where the texel to which the way leads lies in the other chart.
The lumel at that place follows, and the way is turned as that chart is.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .parallel import slices
from .receivers import Lumels
from .scene import Scene, surface_of_triangle
from .seam_samples import SeamSamples, layout_of

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]

# The eight ways to texels beside a texel, (x, y); way k is the opposite of way 7 - k.
WAYS = np.array([(-1, -1), (0, -1), (1, -1), (-1, 0), (1, 0), (-1, 1), (0, 1), (1, 1)])
_AROUND = np.concatenate([WAYS, [(0, 0)]])
_DIRECTIONS = WAYS / np.linalg.norm(WAYS, axis=1, keepdims=True)
# A sample lies on a way if it is no further than this from its middle, texels: samples lie a texel apart.
ON_WAY = 1.0
# The lumel that follows lies no further than this from where the way leads in space, lengths of the way.
ASTRAY = 1.0
# Samples handled at once: about 100 MB of temporary arrays.
CHUNK = 2**15


@dataclass(frozen=True, eq=False)
class Links:
    """Ways from lumel to lumel over seams.

    lumel, way : (m,) where from, and which of WAYS; each pair once.
    other, onward : (m,) where to, and which of WAYS goes on in the same direction there.
    """

    lumel: Int
    way: Int
    other: Int
    onward: Int


def links(samples: SeamSamples, lumels: Lumels, scene: Scene) -> Links:
    """The ways over seams on which samples lie.

    Parameters
    ----------
    samples : of `seam_samples`, for the same lumels.
    """
    both = SeamSamples(np.concatenate([samples.triangle, samples.triangle[:, ::-1]]),
                       np.concatenate([samples.uv, samples.uv[:, ::-1]]))
    grid = _Grid(lumels, scene)
    every = np.arange(len(both))
    found = np.concatenate([np.empty(0, _FOUND),
                            *(_on_ways(both.take(every[part]), grid) for part in slices(len(both), CHUNK))])
    # Of several samples on a way the one nearest to its middle is kept.
    found = found[np.lexsort((found["distance"], found["way"], found["lumel"]))]
    key = found["lumel"] * len(WAYS) + found["way"]
    found = found[np.flatnonzero(np.diff(key, prepend=-1))]
    return Links(found["lumel"], found["way"], found["other"], found["onward"])


_FOUND = np.dtype([("lumel", np.int64), ("way", np.int64), ("other", np.int64), ("onward", np.int64),
                   ("distance", np.float64)])


class _Grid:
    """Where lumels and triangles lie in the layout."""

    def __init__(self, lumels: Lumels, scene: Scene) -> None:
        self.chart, self.chart_of = lumels.chart, lumels.chart_of_triangle
        self.position = lumels.receivers.position
        self._page = lumels.page_of_surface[surface_of_triangle(scene)]
        self._size = np.array([(page.width, page.height) for page in lumels.pages], np.int64)
        self._width, self._height = self._size.T
        self._first = np.concatenate([[0], np.cumsum(self._size.prod(axis=1))])
        self._lumel = np.full(self._first[-1], -1, np.int64)
        self._lumel[self._first[lumels.page] + lumels.pixel] = np.arange(len(lumels))
        self._uv, self._corners = layout_of(lumels, scene), scene.vertices[scene.triangles]

    def texels(self, triangle: Int, uv: Float) -> Float:
        """(n, 2) places in the layout of triangles (n,), texels of their pages."""
        return np.asarray(uv * self._size[self._page[triangle]])

    def of_chart(self, triangle: Int, texel: Int) -> Int:
        """The lumel at texels (..., 2) of the pages of triangles (...); -1 where none of the triangle's chart is."""
        page, (x, y) = self._page[triangle], np.moveaxis(texel, -1, 0)
        width, height = self._width[page], self._height[page]
        within = (x >= 0) & (x < width) & (y >= 0) & (y < height)
        lumel = np.where(within, self._lumel[np.where(within, self._first[page] + y * width + x, 0)], -1)
        return np.where((lumel >= 0) & (self.chart[lumel] == self.chart_of[triangle]), lumel, -1)

    @staticmethod
    def turn(own: Float, other: Float) -> Float:
        """(n, 2, 2): what a step of one texel in one chart is in another, by the ways in space (n, 3, 2) of both; zero
        where a triangle has no area in the layout."""
        square = np.einsum("nxi,nxj->nij", other, other)
        return np.asarray(np.einsum("nij,nxj,nxk->nik", _inverse(square), other, own))

    def metres(self, triangle: Int) -> Float:
        """(n, 3, 2): the way in space of one texel to the right and up; zero for a triangle without area in the
        layout."""
        texels = self.texels(np.repeat(triangle, 3), self._uv[triangle].reshape(-1, 2)).reshape(-1, 3, 2)
        corners = self._corners[triangle]
        sides, spatial = texels[:, 1:] - texels[:, :1], corners[:, 1:] - corners[:, :1]
        # Each side is what its texels are times the ways of the texels: sides @ ways = spatial.
        return np.asarray(np.einsum("nki,nix->nxk", _inverse(sides), spatial))


def _inverse(matrix: Float) -> Float:
    """Inverses of (n, 2, 2); zero where there is none. (By hand: LAPACK wakes all its threads for each of them.)"""
    (a, b), (c, d) = np.moveaxis(matrix, 0, -1)
    determinant = a * d - b * c
    good = determinant != 0
    scale = np.divide(1, determinant, out=np.zeros_like(determinant), where=good)
    return np.asarray(np.moveaxis(np.array([[d, -b], [-c, a]]) * scale, -1, 0))


def _on_ways(samples: SeamSamples, grid: _Grid) -> NDArray[Any]:
    """Ways of lumels near samples, from the samples' first sides to their second: an array of `_FOUND`."""
    own, other = samples.triangle.T
    here, there = (grid.texels(samples.triangle[:, side], samples.uv[:, side]) for side in (0, 1))
    metres = grid.metres(own)
    turn = grid.turn(metres, grid.metres(other))
    texel = np.floor(here).astype(np.int64)[:, None] + _AROUND
    lumel = grid.of_chart(np.repeat(own[:, None], len(_AROUND), axis=1), texel)
    sample, place = np.nonzero((lumel >= 0) & turn.any(axis=(1, 2))[:, None])
    lumel, texel = lumel[sample, place], texel[sample, place]
    pieces = []
    middle = (texel + 0.5 - here[sample]).T
    for way, step in enumerate(WAYS):
        square = (middle[0] + step[0] / 2) ** 2 + (middle[1] + step[1] / 2) ** 2
        near = np.flatnonzero(square < ON_WAY**2)
        near = near[grid.of_chart(own[sample[near]], texel[near] + step) < 0]
        which = sample[near]
        offset = middle[:, near].T + step
        target = np.floor(there[which] + np.einsum("nij,nj->ni", turn[which], offset)).astype(np.int64)
        found = np.empty(len(near), _FOUND)
        found["lumel"], found["way"], found["distance"] = lumel[near], way, square[near]
        found["other"] = grid.of_chart(other[which], target)
        found["onward"] = np.argmax(turn[which] @ step @ _DIRECTIONS.T, axis=1)
        led = metres[which] @ step
        astray = grid.position[found["other"]] - grid.position[found["lumel"]] - led
        good = (found["other"] >= 0) & (found["other"] != found["lumel"])
        good &= np.square(astray).sum(axis=1) < ASTRAY**2 * np.square(led).sum(axis=1)
        pieces.append(found[good])
    return np.concatenate(pieces)

"""Pieces of surface that hang together, and which of them are closed like the skin of a solid."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .components import components, shared_edges
from .faces import corners_of_faces
from .pieces import weld

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]

# Part of its diagonal that the box around a closed surface is widened by: a point on the surface counts as inside.
BOX_MARGIN = 1e-3
# A closed surface holds at least this part of the cube over its diagonal: a sheet and its copy that faces the other way
# hold nothing.
LEAST_VOLUME = 1e-8


@dataclass(frozen=True, eq=False)
class Islands:
    """Pieces of surface that hang together through their edges.

    Attributes
    ----------
    label : (t,) int, piece of each triangle.
    closed : (pieces,) bool, whether every edge joins as many triangles that run along it one way as the other, as
        around a solid.
    inverted : (t,) bool, triangles of closed pieces that face inward.
    solid : (t,) bool, triangles of closed pieces that face outward and have an inside.
    box : (pieces, 2, 3) float64 lowest and highest corners.
    """

    label: Int
    closed: NDArray[np.bool_]
    inverted: NDArray[np.bool_]
    solid: NDArray[np.bool_]
    box: Float

    @classmethod
    def of(cls, corners: Float, apart: Int | None = None) -> Islands:
        """Of (t, 3, 3) triangles; those of different `apart` (t,) never hang together, wherever they touch."""
        corner = weld(corners.reshape(-1, 3)).reshape(-1, 3)
        if apart is not None:
            corner = corners_of_faces(np.asarray(apart, np.int64), corner)
        first, second, _, _ = shared_edges(corner)
        label = components(len(corners), first, second)
        count = int(label.max()) + 1
        closed = np.bincount(label, _open_edges(corner), count) == 0
        # Six times the volume between a piece and a point of it: of a closed one, whatever the point.
        start = corners[np.unique(label, return_index=True)[1], 0][label]
        a, b, c = (corners - start[:, None]).swapaxes(0, 1)
        volume = np.bincount(label, (a * np.cross(b, c)).sum(axis=1), count)
        box = np.empty((count, 2, 3))
        order = np.argsort(label, kind="stable")
        starts = np.searchsorted(label[order], np.arange(count))
        box[:, 0] = np.minimum.reduceat(corners.min(axis=1)[order], starts)
        box[:, 1] = np.maximum.reduceat(corners.max(axis=1)[order], starts)
        least = 6 * LEAST_VOLUME * np.linalg.norm(box[:, 1] - box[:, 0], axis=1) ** 3
        return cls(label, closed, (closed & (volume < 0))[label], (closed & (volume > least))[label], box)

    def box_around(self, rows: Int) -> Float | None:
        """(2, 3) box around the closed pieces that triangles `rows` are of; None if one is not closed."""
        pieces = np.unique(self.label[rows])
        if not self.closed[pieces].all():
            return None
        low, high = self.box[pieces, 0].min(axis=0), self.box[pieces, 1].max(axis=0)
        margin = BOX_MARGIN * np.linalg.norm(high - low)
        return np.asarray(np.stack([low - margin, high + margin]))


def _open_edges(corner: Int) -> Int:
    """(t,) how many sides of each triangle run along an edge that as many do not run along the other way."""
    start, end = corner.reshape(-1).astype(np.int64), np.roll(corner, -1, axis=1).reshape(-1).astype(np.int64)
    nodes = int(corner.max()) + 1
    forward, backward = start * nodes + end, end * nodes + start
    keys, counts = np.unique(forward, return_counts=True)
    own = counts[np.searchsorted(keys, forward)]
    at = np.minimum(np.searchsorted(keys, backward), len(keys) - 1)
    partners = np.where(keys[at] == backward, counts[at], 0)
    return np.asarray(((own != partners) | (start == end)).reshape(-1, 3).sum(axis=1))

"""Sheets with holes that lie on one another, sorted into layers in which none does.

A ray that went through a sheet goes on just behind it, past whatever else lies in the same place: the other leaves of
an ivy that is flat, or the wall that a decal lies on. In layers of their own each of them is met.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .sampling import kronecker
from .visibility import Visibility

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]

# Places of a sheet where others are looked for: what covers a sixteenth of it may stay unseen.
PLACES = 16
# Others lie on a sheet if they are nearer than this many of its offsets.
REACH = 4.0
# Layers at most; what would need more stays together in the last one.
MOST_LAYERS = 8
# Rays at once.
CHUNK_RAYS = 2**18


def sheet_layers(corners: Float, offset: Float, holed: NDArray[np.bool_], embree: bool = True) -> NDArray[np.int32]:
    """(t,) the layer of each triangle, 0 for those without holes.

    Parameters
    ----------
    corners : (t, 3, 3) float32, metres.
    offset : (t,) float32, metres: how far behind a sheet rays go on.
    holed : (t,) bool, which triangles are sheets.
    embree : False forces the NumPy caster (for tests).

    Notes
    -----
    Who stays in a layer is a maximal independent set (Luby 1986): sheets have an order by chance, and the first of all
    that lie on one another stays.
    """
    layer = np.zeros(len(corners), np.int32)
    order = np.random.default_rng(0).permutation(len(corners))
    rest = np.flatnonzero(holed)
    gone = np.zeros(len(corners), bool)
    gone[_pairs(corners, offset, rest, np.flatnonzero(~holed), embree)[0]] = True
    for number in range(MOST_LAYERS):
        layer[rest] = number
        rest = rest[~gone[rest]]
        while len(rest) and number < MOST_LAYERS - 1:
            one, other = _pairs(corners, offset, rest, rest, embree)
            if not len(one):
                break
            first = order.copy()
            np.minimum.at(first, one, order[other])
            np.minimum.at(first, other, order[one])
            stays = order <= first
            gone[one[stays[other]]] = gone[other[stays[one]]] = True
            rest = rest[~gone[rest]]
        rest, gone = np.flatnonzero(gone), np.zeros(len(corners), bool)
        if not len(rest):
            break
    return layer


def _pairs(corners: Float, offset: Float, sheets: Int, among: Int, embree: bool) -> tuple[Int, Int]:
    """Sheets (n,), and of each one of `among`, another than itself, that lies on it."""
    if not len(among):
        return among, among
    caster = Visibility(corners[among], embree)
    place = kronecker(PLACES, 2)
    place = np.where(place.sum(axis=1, keepdims=True) > 1, 1 - place, place).astype(np.float32)
    one, other = [sheets[:0]], [sheets[:0]]
    for start in range(0, len(sheets), CHUNK_RAYS // PLACES):
        rows = sheets[start:start + CHUNK_RAYS // PLACES]
        base, first, second = corners[rows, 0], *(corners[rows, side] - corners[rows, 0] for side in (1, 2))
        normal = np.cross(first, second)
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), np.float32(1e-30))
        above = base + normal * (np.float32(REACH) * offset[rows])[:, None]
        origins = above[:, None] + first[:, None] * place[:, :1] + second[:, None] * place[:, 1:]
        directions = np.repeat(-normal, PLACES, axis=0)
        hits = caster.hits(np.ascontiguousarray(origins.reshape(-1, 3), np.float32), directions)
        sheet = np.repeat(rows, PLACES)
        met = among[np.maximum(hits.triangle, 0)]
        found = (hits.triangle >= 0) & (met != sheet) & (hits.distance < 2 * np.float32(REACH) * offset[sheet])
        one.append(sheet[found])
        other.append(met[found])
    pair = np.unique(np.stack([np.concatenate(one), np.concatenate(other)], axis=1), axis=0)
    return pair[:, 0], pair[:, 1]

"""Emissive triangles with textures, cut into pieces of one exitance each."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .geometry import Geometry

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]

# Cuts of each side of a triangle at most, and pieces of all triangles together, about.
MOST_CUTS, MOST_PIECES = 8, 4096
# Places along each side of a piece at which the texture is looked up.
LOOKS = 4
# Triangles whose pieces differ by less than this part of their mean stay whole.
EVEN = 0.05
# Triangles that are looked up at once.
CHUNK = 2**12


@dataclass(frozen=True, eq=False)
class EmissionPieces:
    """Pieces of triangles.

    triangle : (k,) of the scene; corners : (k, 3, 3) float64, metres; exitance : (k, 3) float32 means, W/m2.
    """

    triangle: Int
    corners: Float
    exitance: Float


def mean_exitance(geometry: Geometry) -> Float:
    """(t, 3) float32 mean exitance of each triangle, W/m2."""
    third = np.full(len(geometry.area), 1 / 3, np.float32)
    out = geometry.emission(np.arange(len(third)), third, third)
    rows = _textured(geometry)
    cuts = _cuts(len(rows))
    for start in range(0, len(rows), CHUNK):
        some = rows[start:start + CHUNK]
        out[some] = _looked_up(geometry, some, cuts).mean(axis=1)
    return out


def emission_pieces(geometry: Geometry, triangles: Int, exitance: Float) -> EmissionPieces:
    """The triangles, those cut whose texture differs from place to place.

    Parameters
    ----------
    triangles : (k,) of the scene.
    exitance : (t, 3) as `mean_exitance` gives.
    """
    textured = np.intersect1d(triangles, _textured(geometry))
    cuts = _cuts(len(textured))
    uneven = []
    pieces = []
    for start in range(0, len(textured) if cuts > 1 else 0, CHUNK):
        some = textured[start:start + CHUNK]
        of_pieces = _looked_up(geometry, some, cuts)
        spread = np.ptp(of_pieces, axis=1).max(axis=1)
        rows = np.flatnonzero(spread > EVEN * of_pieces.mean(axis=(1, 2)))
        uneven.append(some[rows])
        pieces.append(of_pieces[rows])
    cut = np.concatenate(uneven) if uneven else np.zeros(0, np.int64)
    whole = np.setdiff1d(triangles, cut)
    corners = geometry.corners.astype(np.float64)
    if not len(cut):
        return EmissionPieces(whole, corners[whole], exitance[whole])
    barycentric = _barycentric(cuts)
    parts = np.einsum("pck,tkx->tpcx", barycentric, corners[cut]).reshape(-1, 3, 3)
    return EmissionPieces(np.concatenate([whole, np.repeat(cut, len(barycentric))]),
                          np.concatenate([corners[whole], parts]),
                          np.concatenate([exitance[whole], np.concatenate(pieces).reshape(-1, 3)]))


def _textured(geometry: Geometry) -> Int:
    """Triangles whose emission has a texture."""
    textured = np.asarray(geometry.scene.emission_texture) >= 0
    return np.flatnonzero(textured & np.asarray(geometry.scene.emission).any(axis=1))


def _cuts(triangles: int) -> int:
    return int(np.clip(np.sqrt(MOST_PIECES / max(triangles, 1)), 1, MOST_CUTS))


def _barycentric(cuts: int) -> Float:
    """(cuts^2, 3, 3) weights of the triangle's corners at the corners of each piece; rows sum to 1."""
    found = []
    for j in range(cuts):
        for i in range(cuts - j):
            found.append([(i, j), (i + 1, j), (i, j + 1)])
            if i + j < cuts - 1:
                found.append([(i + 1, j), (i + 1, j + 1), (i, j + 1)])
    uv = np.array(found, float) / cuts
    return np.concatenate([1 - uv.sum(axis=2, keepdims=True), uv], axis=2)


def _looked_up(geometry: Geometry, triangles: Int, cuts: int) -> Float:
    """(k, cuts^2, 3) float32 mean exitance of the pieces of some triangles."""
    # The middles of the pieces' own pieces have equal areas.
    inner = _barycentric(LOOKS).mean(axis=1)
    weights = np.einsum("mc,pck->pmk", inner, _barycentric(cuts)).reshape(-1, 3)
    u, v = (np.tile(weights[:, corner], len(triangles)).astype(np.float32) for corner in (1, 2))
    seen = geometry.emission(np.repeat(triangles, len(weights)), u, v)
    return np.asarray(seen.reshape(len(triangles), cuts**2, len(inner), 3).mean(axis=2), np.float32)

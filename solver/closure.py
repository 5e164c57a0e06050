"""Figures of each patch that tell of leaks and of where the energy goes.

In a closed scene every row of form factors sums to 1 (sum_j F_ij = 1, Goral et al. 1984): rays that meet nothing have
slipped through a gap. Rays that meet the back of a face look at the inside of something: a flipped normal, or a wall
that light comes through.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from .cells import NOTHING

if TYPE_CHECKING:
    from .transport import Transport

Float = NDArray[np.floating[Any]]


@dataclass(frozen=True, eq=False)
class PatchTable:
    """One row a patch whose form factors were traced.

    Attributes
    ----------
    middle : (p, 3) float64, metres, world space, of the points at which rays met its cells.
    normal : (p, 3) float32 unit normals, zero where the cells of a patch face against each other.
    area : (p,) float32, m2.
    surface : (p,) int32 index into `Scene.surfaces`: the object with most of the area.
    row_sum : (p,) float32, sum_j F_ij over surfaces: the part of the rays that meets one; the rest sees the sky.
    back_faces : (p,) float32, the part of the rays that meets the back of a face.
    leaving, absorbed : (p,) float32, W/m2, mean of the three channels: emitted and reflected; kept.
    """

    middle: Float
    normal: Float
    area: Float
    surface: NDArray[np.int32]
    row_sum: Float
    back_faces: Float
    leaving: Float
    absorbed: Float

    def __len__(self) -> int:
        return len(self.area)


def patch_table(transport: Transport) -> PatchTable:
    """Read the figures off a solved transport."""
    patch, count = transport.cell_patch, len(transport.patches)
    spots, area = transport.met.spots, transport.met.own_area
    front, triangle = spots.front, spots.triangle
    total = np.bincount(patch, area, count)
    mean = (transport.sums_of_patches(8, partial(_figures, transport), area) / np.maximum(total, 1e-30)).T
    length = np.linalg.norm(mean[:, :3], axis=1, keepdims=True)
    normal = np.divide(mean[:, :3], length, out=np.zeros((count, 3)), where=length > 1e-6)
    row_sum, back, traced = np.zeros(count), np.zeros(count), np.zeros(count, bool)
    is_back = np.append(~front, False)  # the last entry is NOTHING's
    for rows in transport.rows:
        row_sum[rows.patch] = (rows.hits != NOTHING).mean(axis=1)
        back[rows.patch] = is_back[rows.hits].mean(axis=1)
        traced[rows.patch] = True
    keep = np.flatnonzero(traced & (total > 0))
    middle = mean[keep, 3:6] + transport.geometry.scene.origin
    surface = _owners(transport, patch, triangle, area, count)[keep]
    facing, size, sums, backs, out, kept = (
        np.asarray(values[keep], np.float32) for values in (normal, total, row_sum, back, mean[:, 6], mean[:, 7]))
    return PatchTable(middle, facing, size, surface, sums, backs, out, kept)


def _figures(transport: Transport, part: slice) -> list[Float]:
    """Of some cells, (m,) float64 each: normal, middle, leaving, absorbed."""
    met, spots = transport.met, transport.met.spots
    facing = np.take(transport.geometry.normal, spots.triangle[part], axis=0)
    facing = np.where(spots.front[part, None], facing, -facing)
    indirect = np.nan_to_num(np.take(transport.irradiance, transport.cell_patch[part], axis=0))
    reflectance = met.reflectance[part]
    leaving = met.direct[part] + reflectance * indirect
    absorbed = (1 - reflectance) * (met.incident[part] + indirect)
    return [np.asarray(column, np.float64) for column in
            (*facing.T, *spots.points[part].T, leaving.mean(axis=1), absorbed.mean(axis=1))]


def _owners(transport: Transport, patch: NDArray[np.int32], triangle: NDArray[np.integer[Any]], area: Float,
            count: int) -> NDArray[np.int32]:
    """(patches,) int32: the surface that most of each patch's area belongs to."""
    surfaces = transport.geometry.scene.surfaces
    starts = np.array([surface.first for surface in surfaces])
    # Surfaces without triangles begin where the next one does: the last of those that begin there has them.
    surface = np.searchsorted(starts, triangle, side="right") - 1
    pairs, inverse = np.unique(patch.astype(np.int64) * len(surfaces) + surface, return_inverse=True)
    size = np.bincount(inverse.reshape(-1), area, len(pairs))
    order = np.argsort(size, kind="stable")
    owner = np.zeros(count, np.int32)
    owner[pairs[order] // len(surfaces)] = (pairs % len(surfaces))[order]  # the largest is written last
    return owner

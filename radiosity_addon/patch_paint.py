"""Patches painted on the surfaces: triangles cut small, each side of each piece given to the nearest patch that faces
its way.

The table of patches knows their middles and not their outlines, so the pieces between two patches are shared out by
distance.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..solver.closure import PatchTable
from .mesh_arrays import read

Float = NDArray[np.floating[Any]]

# Pieces are as wide as this part of a usual patch; most pieces beside uncut triangles, and along a triangle's side.
PIECE_WIDTH, MOST_PIECES, MOST_CUTS = 0.5, 100_000, 64
# A difference of normals counts as a distance of this many patches' widths.
FACING = 2.0
# A side whose nearest patch faces farther off than this cosine has no patch: light never met it.
SAME_WAY = 0.5
# Distances looked at at once: few enough for a cache.
CHUNK = 2**20


def pieces(depsgraph: Any, objects: Collection[str], patch_area: float) -> Float:
    """(n, 3, 3) float32 world corners of small triangles that cover the meshes of the objects and their instances.

    `patch_area` is that of a usual patch, m2.
    """
    parts = [_triangles(instance) for instance in depsgraph.object_instances
             if instance.object.type == "MESH" and instance.show_self and _name(instance) in objects]
    corners = np.concatenate(parts) if parts else np.empty((0, 3, 3))
    side = np.roll(corners, -1, axis=1) - corners
    area = np.linalg.norm(np.cross(side[:, 0], side[:, 1]), axis=1) / 2
    corners, side = corners[area > 0], side[area > 0]
    if not len(corners):
        return np.empty((0, 3, 3), np.float32)
    longest = np.linalg.norm(side, axis=2).max(axis=1)
    width = PIECE_WIDTH * np.sqrt(patch_area)
    while True:
        cuts = np.clip(np.ceil(longest / width), 1, MOST_CUTS).astype(int)
        if (cuts**2).sum() <= MOST_PIECES + len(cuts):
            break
        width *= 1.25
    return np.concatenate([_cut(corners[cuts == number], int(number)) for number in np.unique(cuts)]).astype(np.float32)


def nearest(table: PatchTable, corners: Float) -> tuple[NDArray[np.intp], Float]:
    """For the front, then the back of each piece the patch it belongs to (2 n,), -1 for none; and normals (2 n, 3)."""
    side = corners[:, 1:] - corners[:, :1]
    normal = np.cross(side[:, 0], side[:, 1])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30)
    normals = np.concatenate([normal, -normal]).astype(np.float32)
    if not len(table) or not len(corners):
        return np.full(len(normals), -1), normals
    # Positions about the middle, so that float32 holds their squares.
    origin = table.middle.mean(axis=0)
    scale = FACING * np.sqrt(np.median(table.area))
    known = np.concatenate([table.middle - origin, scale * table.normal], axis=1).astype(np.float32)
    asked = np.concatenate([np.tile(corners.mean(axis=1) - origin, (2, 1)), scale * normals,
                            np.ones((len(normals), 1))], axis=1).astype(np.float32)
    # |k - a|^2 = |k|^2 - 2 a k + |a|^2: the last is the same for all patches.
    weights = np.concatenate([-2 * known.T, (known**2).sum(axis=1)[None]])
    step = max(1, CHUNK // len(known))
    patch = np.concatenate([np.argmin(asked[start:start + step] @ weights, axis=1)
                            for start in range(0, len(asked), step)])
    return np.where((table.normal[patch] * normals).sum(axis=1) > SAME_WAY, patch, -1), normals


def _name(instance: Any) -> str:
    parent = instance.parent if instance.is_instance else None
    return str(parent.original.name if parent is not None else instance.object.original.name)


def _triangles(instance: Any) -> Float:
    """(t, 3, 3) float64 world corners of a shown mesh; a mirror keeps the front where it is."""
    mesh, matrix = instance.object.data, np.array(instance.matrix_world, np.float64)
    mesh.calc_loop_triangles()
    points = read(mesh.vertices, "co", np.float32, 3) @ matrix[:3, :3].T + matrix[:3, 3]
    corners = points[read(mesh.loop_triangles, "vertices", np.int32, 3)]
    return np.asarray(corners[:, ::-1] if np.linalg.det(matrix[:3, :3]) < 0 else corners)


def _cut(corners: Float, cuts: int) -> Float:
    """Each triangle as cuts * cuts equal ones."""
    i, j = np.divmod(np.arange(cuts * cuts), cuts)
    upper = i + j >= cuts
    # The upright pieces of a grid of parallelograms, and the turned ones folded back from beyond the third side.
    low = np.where(upper[:, None], np.stack([cuts - i, cuts - j], axis=1), np.stack([i, j], axis=1))
    step = np.where(upper, -1, 1)[:, None, None]
    weight = (low[:, None] + step * np.array([(0, 0), (1, 0), (0, 1)])) / cuts
    edges = corners[:, 1:] - corners[:, :1]
    made = corners[:, None, None, 0] + np.einsum("pkc,tcx->tpkx", weight, edges)
    return np.asarray(made.reshape(-1, 3, 3))

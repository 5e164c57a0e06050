"""Faces of more than three corners: a mesh keeps one place in the layout for each corner of a face, so that all
triangles of a face have to hang together in one chart.

xatlas sees triangles alone and lets borders of charts run across faces. A torn face keeps its largest triangle where it
is and the others are folded out beside it; where they would lie over something, the face becomes a chart of its own.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .charts import Charts, numbered, parts, uv_areas
from .components import components, shared_edges
from .planar import lay_flat
from .triangle_normals import normals

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]
Bool = NDArray[np.bool_]

# Triangles lie over each other if they do so by more than this part of the smaller one's size (root of its area).
OVER = 0.01
# Areas are kept of triangles folded out beside sides whose length squared is off by this factor at most.
STRETCHED = 4.0
# Pairs of triangles looked at together: some 100 MB.
PAIRS = 1 << 18


def faces(corner: Int) -> Int:
    """(t,) int64 number 0 ... k - 1 of the face of each triangle: those that share a corner of the mesh, (t, 3) int,
    are of one.
    """
    _, first, inverse = np.unique(corner, return_index=True, return_inverse=True)
    return components(len(corner), np.repeat(np.arange(len(corner)), 3), first[inverse.reshape(-1)] // 3)


def corners_of_faces(face: Int, node: Int) -> Int:
    """(t, 3) int64 number 0 ... k - 1 of the corner of its face that each corner of a triangle is.

    Parameters
    ----------
    face : (t,) int.
    node : (t, 3) int, corners of a face at the same place have the same number.
    """
    key = face[:, None] * (int(node.max(initial=0)) + 1) + node
    return np.asarray(np.unique(key, return_inverse=True)[1]).reshape(-1, 3)


def mend(positions: Float, node: Int, charts: Charts, lost: Bool) -> Charts:
    """Charts in which every corner of a face has one place.

    Parameters
    ----------
    positions : (t, 3, 3), metres; triangles with area.
    node : (t, 3) int, corners of a face at the same place have the same number.
    charts : with an area for every triangle that is not `lost`, at the scale of `positions`.
    lost : (t,) bool, triangles that the flattening has no place for.
    """
    place = corners_of_faces(charts.face, node)
    torn = np.zeros(int(charts.face.max(initial=-1)) + 1, bool)
    held = np.zeros(int(place.max(initial=-1)) + 1, np.int64)
    held[place] = charts.corner
    torn[charts.face[(held[place] != charts.corner).any(axis=1) | lost]] = True
    rows = np.flatnonzero(torn[charts.face])
    if not len(rows):
        return charts
    face, positions, node = numbered(charts.face[rows]), positions[rows], node[rows]
    area = np.where(lost[rows], 0, np.linalg.norm(normals(positions), axis=1))
    order = np.lexsort((-area, face))
    largest = order[np.searchsorted(face[order], np.arange(int(face.max()) + 1))]
    stays = np.zeros(len(rows), bool)
    stays[largest] = True
    uv, reached = _folded_out(positions, node, face, charts.uv[rows], stays)
    home = charts.chart[rows[largest]]
    alone = np.zeros(len(largest), bool)
    alone[face[~reached]] = True
    alone |= area[largest] == 0
    rest = np.ones(len(charts.chart), bool)
    rest[rows[~stays]] = False
    moved = ~stays & ~alone[face]
    over = _over_others(uv[moved], home[face[moved]], face[moved], charts.uv[rest], charts.chart[rest])
    alone[over] = True
    own = np.flatnonzero(alone[face])
    if len(own):
        uv[own] = _laid_alone(positions[own], node[own], numbered(face[own]), stays[own])
    chart, corner = charts.chart.copy(), charts.corner.copy()
    chart[rows] = np.where(alone, charts.count + np.arange(len(alone)), home)[face]
    corner[rows] = _corners(place[rows], largest[~alone], corner[rows], int(corner.max()) + 1)
    all_uv = charts.uv.copy()
    all_uv[rows] = uv
    return Charts(all_uv, parts(corner, charts.face, chart), corner, charts.face)


def _corners(place: Int, kept: Int, before: Int, free: int) -> Int:
    """(t, 3) nodes of the corners `place` of faces: what the kept triangles had before, and of others new ones."""
    number = np.full(int(place.max()) + 1, -1, np.int64)
    number[place[kept]] = before[kept]
    new = np.unique(place[number[place] < 0])
    number[new] = free + np.arange(len(new))
    return np.asarray(number[place])


def _laid_alone(positions: Float, node: Int, face: Int, starts: Bool) -> Float:
    """(t, 3, 2) metres: each face by itself, folded out into the plane of its starting triangle; projected along its
    mean normal where it can't be, since its triangles do not hang together by edges.
    """
    uv = np.zeros((len(positions), 3, 2))
    along, rise, length = _apexes(positions, np.zeros(len(positions), np.int64))
    uv[:, 1, 0], uv[:, 2, 0], uv[:, 2, 1] = length, along * length, rise * length
    uv, reached = _folded_out(positions, node, face, uv, starts)
    split = np.zeros(int(face.max()) + 1, bool)
    split[face[~reached]] = True
    return lay_flat(positions, Charts(uv, face, node, face), split).uv


def _folded_out(positions: Float, node: Int, face: Int, uv: Float, placed: Bool) -> tuple[Float, Bool]:
    """Fold triangles out beside those of their face that are placed: uv (t, 3, 2), and whether each was reached."""
    uv, placed = uv.copy(), placed.copy()
    first, second, side, other = shared_edges(node)
    same = face[first] == face[second]
    source = np.concatenate([first[same], second[same]])
    target = np.concatenate([second[same], first[same]])
    source_side = np.concatenate([side[same], other[same]])
    target_side = np.concatenate([other[same], side[same]])
    along, rise, length = _apexes(positions[target], target_side)
    turned = node[target, target_side] != node[source, source_side]
    while True:
        ready = np.flatnonzero(placed[source] & ~placed[target])
        if not len(ready):
            return uv, placed
        ready = ready[np.unique(target[ready], return_index=True)[1]]
        to, by, s, d = target[ready], source[ready], source_side[ready], target_side[ready]
        a, b, back = uv[by, s], uv[by, (s + 1) % 3], uv[by, (s + 2) % 3]
        start = np.where(turned[ready, None], b, a)
        edge = np.where(turned[ready, None], a, b) - start
        left = np.column_stack([-edge[:, 1], edge[:, 0]])
        away = -np.sign(((back - start) * left).sum(axis=1))
        uv[to, d], uv[to, (d + 1) % 3] = start, start + edge
        # As high as keeps the triangle's area, where the side that it stands on is stretched.
        stretch = (length[ready] ** 2 / np.maximum((edge**2).sum(axis=1), 1e-300)).clip(1 / STRETCHED, STRETCHED)
        uv[to, (d + 2) % 3] = start + along[ready, None] * edge + (away * rise[ready] * stretch)[:, None] * left
        placed[to] = True


def _apexes(positions: Float, side: Int) -> tuple[Float, Float, Float]:
    """Where the corner across from a side stands: how far along it and how high above it, both in lengths of the side,
    and that length.
    """
    row = np.arange(len(positions))
    start = positions[row, side]
    edge, apex = positions[row, (side + 1) % 3] - start, positions[row, (side + 2) % 3] - start
    squared = np.maximum((edge * edge).sum(axis=1), 1e-300)
    along = (edge * apex).sum(axis=1) / squared
    rise = np.linalg.norm(apex - along[:, None] * edge, axis=1) / np.sqrt(squared)
    return along, rise, np.sqrt(squared)


def _over_others(moved: Float, home: Int, face: Int, stays: Float, chart: Int) -> Int:
    """Faces of which a triangle lies over one of its chart: one that stays, or one of a face of lower number.

    Parameters
    ----------
    moved, home, face : (m, 3, 2), (m,), (m,) triangles that were folded out, the charts that they go to, their faces.
    stays, chart : (n, 3, 2), (n,) the triangles that stay, and their charts.
    """
    uv = np.concatenate([stays, moved])
    rank = np.concatenate([np.full(len(stays), -1), face])
    chart = np.concatenate([chart, home])
    order = np.argsort(chart, kind="stable")
    start = np.searchsorted(chart[order], home)
    count = np.searchsorted(chart[order], home, side="right") - start
    ends = np.cumsum(count)
    low, high = uv.min(axis=1), uv.max(axis=1)
    over = [np.zeros(0, np.int64)]
    begin = 0
    while begin < len(moved):
        stop = max(begin + 1, int(np.searchsorted(ends, ends[begin] - count[begin] + PAIRS, side="right")))
        some = count[begin:stop]
        one = np.repeat(np.arange(begin, stop), some)
        step = np.arange(len(one)) - np.repeat(np.cumsum(some) - some, some)
        mine, other = one + len(stays), order[start[one] + step]
        near = (low[mine] < high[other]).all(axis=1) & (low[other] < high[mine]).all(axis=1)
        near &= rank[other] < rank[mine]
        mine, other = mine[near], other[near]
        over.append(rank[mine[_overlap(uv[mine], uv[other])]])
        begin = stop
    return np.unique(np.concatenate(over))


def _overlap(one: Float, other: Float) -> Bool:
    """(n,) whether triangles (n, 3, 2) lie over each other: no side of either keeps them apart (separating axes)."""
    allowed = OVER * np.sqrt(np.minimum(np.abs(uv_areas(one)), np.abs(uv_areas(other))))
    over = np.ones(len(one), bool)
    for triangle in (one, other):
        for side in range(3):
            edge = triangle[:, (side + 1) % 3] - triangle[:, side]
            normal = np.column_stack([-edge[:, 1], edge[:, 0]])
            normal /= np.maximum(np.linalg.norm(normal, axis=1), 1e-300)[:, None]
            a, b = (np.einsum("ncx,nx->nc", uv, normal) for uv in (one, other))
            shared = np.minimum(a.max(axis=1), b.max(axis=1)) - np.maximum(a.min(axis=1), b.min(axis=1))
            over &= shared > allowed
    return over

"""Cut a mesh into pieces that unwrap well and fast: along creases and at walls, then in halves until each is small."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .charts import numbered, of_first
from .components import components, shared_edges
from .triangle_normals import normals, unit

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]

# Faces that meet at a sharper turn than this never share a chart: cosine of 60 degrees.
CREASE_COSINE = 0.5
# Most triangles in a piece: the time of xatlas grows much faster than linearly with it (62,976 triangles: 37 s whole,
# 3.2 s in pieces of 500, at the same use of the page).
PIECE_SIZE = 500
# A face stands on an edge between two others if it rises from them at more than this: sine of 6 degrees.
STANDING = 0.1


def weld(vertices: Float) -> Int:
    """(v,) int64 number of the place of each vertex: the same for vertices at exactly the same place."""
    bits = (np.ascontiguousarray(vertices, np.float64) + 0.0).view(np.uint64).reshape(-1, 3)  # + 0 makes -0 a 0
    return np.asarray(np.unique(_mixed(bits), return_inverse=True)[1]).reshape(-1)


def originals(node: Int) -> Int:
    """(t,) int64: the first triangle that has the same three corners (t, 3), the same way round; often itself."""
    rows = np.take_along_axis(node, lowest_first(node), axis=1).astype(np.uint64)
    _, first, inverse = np.unique(_mixed(rows), return_index=True, return_inverse=True)
    return np.asarray(first[inverse.reshape(-1)])


def lowest_first(node: Int) -> Int:
    """(t, 3) order of the corners that keeps the way round and begins with the lowest number."""
    return np.asarray((node.argmin(axis=1)[:, None] + np.arange(3)) % 3)


def _mixed(rows: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """One 64-bit number a row, the same for the same rows.

    Sorting these is far faster than sorting rows. A false match has a probability of n^2 / 2^65 in all, 3e-8 for a
    million rows.
    """
    key = np.zeros(len(rows), np.uint64)
    for column in rows.T:
        key = (key ^ column) * np.uint64(0x9E3779B97F4A7C15)
        key ^= key >> np.uint64(29)
    return key


def pieces(positions: Float, node: Int, face: Int, limit: int = PIECE_SIZE) -> Int:
    """Number the piece that each triangle belongs to.

    Parameters
    ----------
    positions : (t, 3, 3), metres; triangles with area.
    node : (t, 3) int, corners that are joined have the same number.
    face : (t,) int, triangles of one face stay together.
    limit : most triangles in a piece; a face of more is one of its own.

    Returns
    -------
    (t,) int64 labels 0 ... k - 1. A piece cut in halves for its size need not be connected.
    """
    normal = unit(normals(positions))
    first, second, side, _ = shared_edges(node)
    smooth = (normal[first] * normal[second]).sum(axis=1) > CREASE_COSINE
    smooth &= ~_walled(positions, normal, node, first, second, side)
    label = numbered(of_first(face, components(len(positions), first[smooth], second[smooth])))
    middle = middles(positions, face)
    for _ in range(64):  # more halvings than there are bits in an index
        large = np.bincount(label) > limit
        halves = halved(middle, label, large)
        if halves.max() == label.max():  # single faces can't be cut
            break
        label = halves
    return label


def _walled(positions: Float, normal: Float, node: Int, first: Int, second: Int, side: Int) -> NDArray[np.bool_]:
    """(e,) bool: edges between two triangles on which a third one stands: filtering would carry light through it.

    Parameters
    ----------
    normal : (t, 3) unit.
    first, second, side : pairs of triangles, and the side of the first, as `shared_edges` gives them.
    """
    ends = np.sort(np.stack([node, np.roll(node, -1, axis=1)], axis=-1), axis=2).reshape(-1, 2).astype(np.int64)
    edge = np.unique(ends[:, 0] * (int(node.max(initial=0)) + 1) + ends[:, 1], return_inverse=True)[1].reshape(-1)
    count, order = np.bincount(edge), np.argsort(edge, kind="stable")
    start = np.cumsum(count) - count
    own = edge[first * 3 + side]
    walled = np.zeros(len(first), bool)
    pair = np.flatnonzero(count[own] > 2)
    # Every pair with every side of its edge.
    row = np.repeat(pair, count[own[pair]])
    step = np.arange(len(row)) - np.repeat(np.cumsum(count[own[pair]]) - count[own[pair]], count[own[pair]])
    other = order[start[own[row]] + step]
    rise = positions[other // 3, (other + 2) % 3] - positions[other // 3, other % 3]
    rise /= np.maximum(np.linalg.norm(rise, axis=1), 1e-300)[:, None]
    standing = [(rise * normal[each[row]]).sum(axis=1) > STANDING for each in (first, second)]
    walled[row[standing[0] & standing[1]]] = True
    return walled


def middles(positions: Float, face: Int) -> Float:
    """(t, 3) the mean of the corners of each one's face."""
    number = np.unique(face, return_inverse=True)[1].reshape(-1)
    middle = positions.mean(axis=1)
    mean = np.stack([np.bincount(number, column) for column in middle.T], axis=1) / np.bincount(number)[:, None]
    return np.asarray(mean[number])


def halved(middle: Float, label: Int, chosen: NDArray[np.bool_]) -> Int:
    """Cut the items of the chosen labels, (k,) bool, at the median of their longest extent: new labels 0 ... k - 1.

    Items with the same middle, as triangles of a face have, stay together.
    """
    label, items = label.copy(), np.flatnonzero(chosen[label])
    if len(items):
        group = np.unique(label[items], return_inverse=True)[1].reshape(-1)
        count = np.bincount(group)
        start = np.cumsum(count) - count
        by_group = np.argsort(group, kind="stable")
        extent = (np.maximum.reduceat(middle[items][by_group], start)
                  - np.minimum.reduceat(middle[items][by_group], start))
        along = middle[items, extent.argmax(axis=1)[group]]
        order = np.lexsort((along, group))
        median = along[order[start + count // 2]]
        lowest = along[order[start]]
        # Where the lower half is one place, the cut is above it.
        upper = np.where((median > lowest)[group], along >= median[group], along > median[group])
        label[items[upper]] = len(chosen) + group[upper]
    return np.asarray(np.unique(label, return_inverse=True)[1]).reshape(-1)

"""Connected pieces: which triangles hang together, through which edges."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Int = NDArray[np.integer[Any]]


def components(count: int, a: Int, b: Int) -> Int:
    """Label the connected components of an undirected graph.

    Parameters
    ----------
    count : number of nodes.
    a, b : (e,) int, the edges' ends.

    Returns
    -------
    (count,) int64 labels 0 ... k - 1, numbered by each component's first node.

    Notes
    -----
    Hook and jump (Shiloach & Vishkin 1982): every root with a lower neighbour hooks to the lowest, then paths are
    halved until flat. A hook always goes to a lower label, so no cycle can form, and every round in which an edge still
    joins two roots removes one at least: it ends.
    """
    label: Int = np.arange(count)
    a, b = np.asarray(a), np.asarray(b)
    while True:
        low, high = np.minimum(label[a], label[b]), np.maximum(label[a], label[b])
        differ = low != high
        if not differ.any():
            break
        a, b = a[differ], b[differ]
        np.minimum.at(label, high[differ], low[differ])
        label = _flatten(label)
    return np.asarray(np.unique(label, return_inverse=True)[1]).reshape(count)


def _flatten(label: Int) -> Int:
    """Follow every node's label to its root by doubling."""
    while True:
        jumped = label[label]
        if np.array_equal(jumped, label):
            return label
        label = jumped


def shared_edges(corner: Int) -> tuple[Int, Int, Int, Int]:
    """The pairs of triangle sides that join the same two nodes.

    Parameters
    ----------
    corner : (t, 3) int, node of each corner.

    Returns
    -------
    first, second : (e,) int64 triangle indices, first < second.
    first_side, second_side : (e,) int64, side 0, 1, 2 from corner 0 to 1, 1 to 2, 2 to 0.
    Where three or more triangles share an edge they are paired in a chain. Sides of no length are left out.
    """
    ends = np.stack([corner, np.roll(corner, -1, axis=1)], axis=-1).reshape(-1, 2).astype(np.int64)
    low, high = ends.min(axis=1), ends.max(axis=1)
    key = low * (int(high.max(initial=0)) + 1) + high
    order = np.argsort(key, kind="stable")
    order = order[low[order] != high[order]]
    same = key[order[1:]] == key[order[:-1]]
    one, other = order[:-1][same], order[1:][same]
    return one // 3, other // 3, one % 3, other % 3

"""Which chart of a UV layout covers the centre of each texel."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.floating[Any]]

# Corners whose coordinates agree after rounding to this grid (UV units) are one corner of the layout.
UV_GRID = 1e-6
# Most texels that are tested at once, so that memory stays below about 200 MB.
CHUNK = 1 << 21


def charts_of_triangles(uv: Float) -> NDArray[np.int32]:
    """Number of the chart that each triangle belongs to: triangles that share an edge in the layout are one chart.

    Parameters
    ----------
    uv : (t, 3, 2), corners of the triangles in the layout.

    Returns
    -------
    (t,) int32, 0 ... charts - 1.
    """
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    keys = np.round(uv.reshape(-1, 2) / UV_GRID).astype(np.int64)
    corner = np.unique(keys, axis=0, return_inverse=True)[1].reshape(-1, 3)
    ends = np.sort(np.concatenate([corner[:, [0, 1]], corner[:, [1, 2]], corner[:, [2, 0]]]), axis=1)
    edge = np.unique(ends, axis=0, return_inverse=True)[1].ravel()
    triangle = np.tile(np.arange(len(uv)), 3)
    # Triangles and edges are the two sides of a graph: its connected parts are the charts.
    nodes = len(uv) + int(edge.max(initial=-1)) + 1
    graph = coo_matrix((np.ones(len(edge), bool), (triangle, len(uv) + edge)), shape=(nodes, nodes))
    label = connected_components(graph, directed=False)[1][: len(uv)]
    return np.asarray(np.unique(label, return_inverse=True)[1], np.int32)


def chart_image(uv: Float, resolution: int) -> tuple[NDArray[np.int32], int]:
    """Chart that covers each texel's centre, and how many texels more than one triangle claims.

    Parameters
    ----------
    uv : (t, 3, 2), corners in [0, 1]^2.
    resolution : texels a side.

    Returns
    -------
    (resolution, resolution) int32 with -1 where nothing is, row 0 at v = 0; and the count of texels whose centre lies
    strictly inside two triangles or more (overlaps; a centre on a shared edge is none).
    """
    triangle, overlaps = triangle_image(uv, resolution)
    chart = np.append(charts_of_triangles(uv), np.int32(-1))
    return chart[triangle], overlaps


def triangle_image(uv: Float, resolution: int) -> tuple[NDArray[np.int32], int]:
    """Triangle that covers each texel's centre, -1 for none, and the overlaps, as `chart_image` counts them."""
    image = np.full(resolution * resolution, -1, np.int32)
    claims = np.zeros(resolution * resolution, np.int32)
    for triangle, pixel, inside in _covered(np.asarray(uv, np.float64) * resolution, resolution):
        image[pixel] = triangle
        np.add.at(claims, pixel[inside], 1)
    return image.reshape(resolution, resolution), int(np.count_nonzero(claims > 1))


def _covered(corners: Float, resolution: int) -> list[tuple[NDArray[Any], NDArray[Any], NDArray[Any]]]:
    """(triangle, pixel, strictly inside) of all texel centres in the triangles; corners in texels, (t, 3, 2)."""
    low = np.clip(np.ceil(corners.min(axis=1) - 0.5), 0, resolution).astype(np.int64)
    high = np.clip(np.floor(corners.max(axis=1) - 0.5) + 1, 0, resolution).astype(np.int64)
    size = np.maximum(high - low, 0)
    count = size[:, 0] * size[:, 1]
    parts = []
    steps = np.flatnonzero(count)
    bounds = np.searchsorted(np.cumsum(count[steps]), np.arange(0, count.sum() + CHUNK, CHUNK), side="left")
    for first, last in zip(np.unique(bounds)[:-1], np.unique(bounds)[1:], strict=True):
        some = steps[first:last]
        triangle = np.repeat(some, count[some])
        offset = np.arange(len(triangle)) - np.repeat(np.cumsum(count[some]) - count[some], count[some])
        column = low[triangle, 0] + offset % size[triangle, 0]
        row = low[triangle, 1] + offset // size[triangle, 0]
        inside, strictly = _inside(corners[triangle], np.stack([column + 0.5, row + 0.5], axis=1))
        parts.append((triangle[inside], (row * resolution + column)[inside], strictly[inside]))
    return parts


def _inside(corners: Float, point: Float) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Whether each point lies in its triangle, edges included; and whether well inside (1e-6 texel off the edges)."""
    edge = np.roll(corners, -1, axis=1) - corners
    side = edge[..., 0] * (point[:, None, 1] - corners[..., 1]) - edge[..., 1] * (point[:, None, 0] - corners[..., 0])
    length = np.maximum(np.linalg.norm(edge, axis=2), 1e-12)
    distance = side / length * np.sign(side.sum(axis=1))[:, None]
    return (distance >= 0).all(axis=1) & (side.sum(axis=1) != 0), (distance > 1e-6).all(axis=1)

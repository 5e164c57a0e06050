"""Flatten triangles into charts: the only file that imports xatlas.

1. Triangles are cut into pieces (`solver.pieces`) and every piece is flattened by itself: a planar one is laid into its
   plane (`solver.planar`), only curved ones need xatlas.
2. xatlas stretches each chart to whole texels of the page that it packs on the way; per chart the stretch is measured
   against the mesh and undone, so that charts come out in metres.
3. A face that xatlas tore or lost is put together again, in a chart of its own where need be (`solver.faces`); unevenly
   stretched charts are cut and flattened again.
4. Charts that waste most of their box are turned or cut.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .charts import Charts, cut_wasteful, numbered, parts, straighten, unfold, uv_areas
from .components import components, shared_edges
from .faces import mend
from .pieces import halved, middles, pieces
from .planar import bent, lay_flat
from .triangle_normals import normals

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]
Progress = Callable[[float], None]

# Triangles flattened in one call: xatlas keeps the interpreter meanwhile, and a window with it.
BATCH = 500
# Seconds that an atlas is kept after its use. xatlas ends its threads with a signal that one which has only just begun
# may miss; then it waits for that thread for ever, and the interpreter with it.
SETTLED = 0.2
# Atlases that were used, and when, the oldest first.
_used: deque[tuple[float, Any]] = deque()
# The page on which xatlas packs charts while flattening is thrown away: small, so that it costs little.
DRAFT_PAGE = 16
# xatlas takes triangles for empty by absolute sizes (1.2e-7 area, 1e-4 length): each piece is scaled to this mean
# length of its sides first.
MEAN_SIDE = 10.0
# A chart's measured stretch is believed if both its factors lie within this of the one that keeps the area.
STRETCH_LIMIT = 100.0
# A triangle whose area in its chart is below this part of its area in space was lost in flattening.
LOST = 1e-3
# A chart whose texel density varies more (`_unevenness`) or whose sides are off by more (`_askew`) is cut in two and
# flattened again, so many times at most.
UNEVEN, ASKEW, RECUTS = 0.08, 0.15, 5
# Uneven charts smaller than this part of all area stay as they are: twenty lumels on a page of a million, and two more
# borders would cost as many.
WORTH = 2e-5


def flatten(positions: Float, node: Int, face: Int, progress: Progress | None = None) -> Charts:
    """Flatten triangles into charts with little distortion and no overlap; no face is torn.

    Parameters
    ----------
    positions : (t, 3, 3), metres; every triangle has area.
    node : (t, 3) int, corners that are joined have the same number; objects share none.
    face : (t,) int, the mesh's face of each triangle.
    progress : told the fraction done; what it raises ends the work.
    """
    charts = _flatten_pieces(positions, node, face, pieces(positions, node, face), progress)
    middle = middles(positions, face)
    for _ in range(RECUTS):
        area = np.bincount(charts.chart, _areas(positions))
        uneven = (_unevenness(positions, charts) > UNEVEN) & (area > WORTH * area.sum())
        uneven |= _askew(positions, charts) > ASKEW
        again = np.flatnonzero(uneven[charts.chart])
        if not len(again):
            break
        piece = halved(middle, charts.chart, uneven)[again]
        charts = charts.replaced(again, _flatten_pieces(positions[again], node[again], face[again], piece))
    return straighten(cut_wasteful(straighten(charts)))


def _unevenness(positions: Float, charts: Charts) -> Float:
    """(k,) spread of the texel density over a chart: standard deviation of the logarithm of area in the chart over area
    in space, weighted by area.
    """
    area = _areas(positions)
    log = np.log(np.maximum(np.abs(uv_areas(charts.uv)) / area, LOST))
    mean = lambda values: np.bincount(charts.chart, values * area) / np.bincount(charts.chart, area)  # noqa: E731
    return np.asarray(np.sqrt(np.maximum(mean(log * log) - mean(log) ** 2, 0)))


def _askew(positions: Float, charts: Charts) -> Float:
    """(k,) how far sides are from their length in space: the sum of the differences over that of the lengths."""
    space = np.linalg.norm(np.roll(positions, -1, axis=1) - positions, axis=2)
    flat = np.linalg.norm(np.roll(charts.uv, -1, axis=1) - charts.uv, axis=2)
    wrong = np.bincount(charts.chart, np.abs(flat - space).sum(axis=1))
    return np.asarray(wrong / np.bincount(charts.chart, space.sum(axis=1)))


def _flatten_pieces(positions: Float, node: Int, face: Int, piece: Int, progress: Progress | None = None) -> Charts:
    """Flatten pieces (t,), each by itself; only those that are not planar need xatlas."""
    charts = unfold(Charts(np.zeros((len(positions), 3, 2)), parts(node, face, piece), node, face))
    curved = np.flatnonzero(bent(positions, charts)[charts.chart])
    if len(curved):
        piece = numbered(charts.chart[curved])
        flattened = _flatten_curved(positions[curved], node[curved], face[curved], piece, progress)
        charts = charts.replaced(curved, flattened)
    return lay_flat(positions, charts, ~bent(positions, charts))


def _flatten_curved(positions: Float, node: Int, face: Int, piece: Int, progress: Progress | None) -> Charts:
    """Flatten connected pieces (t,), numbered 0 ... k - 1, with xatlas."""
    order = np.argsort(piece, kind="stable")
    ends = np.append(np.flatnonzero(np.diff(piece[order])), len(order) - 1) + 1
    uv, corner = np.zeros((len(positions), 3, 2)), np.zeros((len(positions), 3), np.int64)
    start = 0
    while start < len(order):
        stop = int(ends[min(int(np.searchsorted(ends, start + BATCH)), len(ends) - 1)])
        batch = order[start:stop]
        uv[batch], corner[batch] = _flatten_batch(positions[batch], node[batch], piece[batch])
        corner[batch] += 3 * start  # a batch makes three nodes a triangle at most
        start = stop
        if progress is not None:
            progress(start / len(order))
    first, second, _, _ = shared_edges(corner)
    chart = components(len(positions), first, second)
    uv = _unstretch(positions, uv, chart)
    lost = np.abs(uv_areas(uv)) < LOST * _areas(positions)
    return mend(positions, node, Charts(uv, chart, corner, face), lost)


def _flatten_batch(positions: Float, node: Int, piece: Int) -> tuple[Float, Int]:
    """UV on a page of no meaning, and the node of every corner in the flattened mesh; `piece` ascends."""
    import xatlas

    atlas = xatlas.Atlas()
    bounds = np.concatenate([[0], np.flatnonzero(np.diff(piece)) + 1, [len(piece)]])
    for first, last in zip(bounds[:-1], bounds[1:], strict=True):
        corners = positions[first:last].reshape(-1, 3)
        _, index, inverse = np.unique(node[first:last], return_index=True, return_inverse=True)
        side = np.linalg.norm(positions[first:last, 1] - positions[first:last, 0], axis=1).mean()
        vertices = (corners[index] - corners[index].mean(axis=0)) * (MEAN_SIDE / side)
        atlas.add_mesh(vertices.astype(np.float32), inverse.reshape(-1, 3).astype(np.uint32))
    options = xatlas.PackOptions()
    options.resolution = DRAFT_PAGE
    atlas.generate(pack_options=options)
    uv, corner = np.empty((len(positions), 3, 2)), np.empty((len(positions), 3), np.int64)
    size, offset = (atlas.width, atlas.height), 0
    for number, (first, last) in enumerate(zip(bounds[:-1], bounds[1:], strict=True)):
        mapping, index, coordinates = atlas.get_mesh(number)
        uv[first:last] = coordinates[index].astype(np.float64) * size
        corner[first:last] = index.astype(np.int64) + offset
        offset += len(mapping)
    _used.append((time.monotonic(), atlas))
    while _used and _used[0][0] < time.monotonic() - SETTLED:
        _used.popleft()
    return uv, corner


def _unstretch(positions: Float, uv: Float, chart: Int) -> Float:
    """Scale every chart along u and v so that its sides are as long as in space.

    Least squares over the sides' squared lengths, `a du^2 + b dv^2 = length^2`, for a and b of each chart; where that
    has no good solution (one triangle askew, a strongly curved chart) one factor for both keeps the area.
    """
    count = int(chart.max(initial=-1)) + 1
    squares = (np.roll(uv, -1, axis=1) - uv) ** 2
    length = ((np.roll(positions, -1, axis=1) - positions) ** 2).sum(axis=2)
    total = lambda values: np.bincount(chart, values.sum(axis=1), count)  # noqa: E731
    u, v = squares[:, :, 0], squares[:, :, 1]
    uu, vv, ul, vl, uv_ = total(u * u), total(v * v), total(u * length), total(v * length), total(u * v)
    space, flat = np.bincount(chart, _areas(positions), count), np.bincount(chart, np.abs(uv_areas(uv)), count)
    with np.errstate(divide="ignore", invalid="ignore"):
        even = space / flat
        determinant = uu * vv - uv_ * uv_
        a, b = (ul * vv - vl * uv_) / determinant, (vl * uu - ul * uv_) / determinant
        good = ((a > even / STRETCH_LIMIT) & (b > even / STRETCH_LIMIT)
                & (a < even * STRETCH_LIMIT) & (b < even * STRETCH_LIMIT))
        scale = np.sqrt(np.where(good[:, None], np.column_stack([a, b]), even[:, None]))
        # Last, keep the area exactly.
        scale *= np.sqrt(even / scale.prod(axis=1))[:, None]
    return np.asarray(uv * np.nan_to_num(scale, posinf=0)[chart][:, None])


def _areas(positions: Float) -> Float:
    return np.asarray(np.linalg.norm(normals(positions), axis=1) / 2)

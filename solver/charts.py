"""Charts: flattened pieces of a mesh in metres, before they get a place on a page."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .components import components, shared_edges

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]

# A chart that fills less of its box than this is cut ...
POOR_FILL = 0.5
# ... if its empty part matters, as a part of the area of all charts ...
WASTE = 1e-4
# ... and if the parts' boxes together are smaller by this factor at least.
GAIN = 0.8
# A chart that fills less of its box than this is turned to fill more, along one of so many of its outline's edges.
GOOD_FILL, EDGES_TRIED = 0.85, 8
# Triangles at one edge, on the same side of it, that can be told apart.
UNFOLDINGS = 8
# Halvings of one chart at most: a frame of four bars needs three.
CUTS = 4


@dataclass(frozen=True, eq=False)
class Charts:
    """Flattened triangles.

    Parameters
    ----------
    uv : (t, 3, 2) float64, metres, each chart in a frame of its own.
    chart : (t,) int64, chart 0 ... k - 1 of each triangle.
    corner : (t, 3) int64 node of each corner; triangles of a chart hang together where they share two.
    face : (t,) int64, face of the mesh of each triangle; those of one face stay in one chart.
    """

    uv: Float
    chart: Int
    corner: Int
    face: Int

    @property
    def count(self) -> int:
        """How many charts there are."""
        return int(self.chart.max(initial=-1)) + 1

    def take(self, index: Int) -> Charts:
        """Some of the triangles, their charts and faces numbered anew."""
        return Charts(self.uv[index], numbered(self.chart[index]), self.corner[index], numbered(self.face[index]))

    def replaced(self, index: Int, by: Charts) -> Charts:
        """Some of the triangles flattened in another way, as charts of their own."""
        uv, chart, corner = self.uv.copy(), self.chart.copy(), self.corner.copy()
        uv[index], chart[index] = by.uv, by.chart + self.count
        corner[index] = by.corner + int(corner.max(initial=-1)) + 1
        return Charts(uv, numbered(chart), corner, self.face)

    def relabelled(self, label: Int) -> Charts:
        """The charts cut into connected pieces of triangles that also have the same label (t,); a face stays whole."""
        return replace(self, chart=parts(self.corner, self.face, label))

    def boxes(self) -> tuple[Float, Float]:
        """Lower corners and sides of the charts' boxes, (k, 2) float64 metres each."""
        return boxes(self.uv, self.chart, self.count)


def numbered(label: Int) -> Int:
    """Labels (t,) as 0 ... k - 1."""
    return np.asarray(np.unique(label, return_inverse=True)[1]).reshape(-1)


def boxes(uv: Float, chart: Int, count: int) -> tuple[Float, Float]:
    """Lower corners and sides of `count` charts' boxes, (k, 2) each; every chart has a triangle."""
    order = np.argsort(chart, kind="stable")
    start = np.searchsorted(chart[order], np.arange(count))
    low = np.minimum.reduceat(uv.min(axis=1)[order], start)
    high = np.maximum.reduceat(uv.max(axis=1)[order], start)
    return low, high - low


def uv_areas(uv: Float) -> Float:
    """(t,) signed areas of triangles (t, 3, 2)."""
    a, b = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    return np.asarray((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) / 2)


def unfold(charts: Charts) -> Charts:
    """Take charts apart in which two triangles run along an edge the same way: flattened they would lie on the same
    side of it, one over the other.
    """
    ends = charts.corner, np.roll(charts.corner, -1, axis=1)
    edge = (ends[0] * (int(charts.corner.max(initial=-1)) + 1) + ends[1]).ravel()
    for _ in range(UNFOLDINGS):
        chart = np.repeat(charts.chart, 3)
        order = np.lexsort((chart, edge))
        double = (edge[order[1:]] == edge[order[:-1]]) & (chart[order[1:]] == chart[order[:-1]])
        if not double.any():
            break
        apart = np.zeros(len(charts.chart), bool)
        apart[order[1:][double] // 3] = True
        charts = charts.relabelled(charts.chart * 2 + apart)
    return charts


def straighten(charts: Charts) -> Charts:
    """Turn charts that fill their box poorly so that the box gets smaller.

    The smallest box has a side along the outline (Freeman & Shapira 1975): the longest edges of it are tried.
    """
    area = np.bincount(charts.chart, np.abs(uv_areas(charts.uv)), charts.count)
    smallest = charts.boxes()[1].prod(axis=1)
    chosen = np.flatnonzero((area < GOOD_FILL * smallest)[charts.chart])
    if not len(chosen):
        return charts
    poor = charts.take(chosen)
    edge = (np.roll(poor.uv, -1, axis=1) - poor.uv).reshape(-1, 2)
    length = np.hypot(edge[:, 0], edge[:, 1])
    first, second, side, other = shared_edges(poor.corner)
    joined = poor.chart[first] == poor.chart[second]
    rank_by = -length  # the outline's edges first, the longest of them first
    rank_by[np.concatenate([first * 3 + side, second * 3 + other])[np.tile(joined, 2)]] = 0
    order = np.lexsort((rank_by, np.repeat(poor.chart, 3)))
    count = 3 * np.bincount(poor.chart)
    start = np.cumsum(count) - count
    best, box = poor.uv, poor.boxes()[1].prod(axis=1)
    for rank in range(EDGES_TRIED):
        along = order[start + np.minimum(rank, count - 1)]
        turn = edge[along] / np.maximum(length[along], 1e-300)[:, None]
        c, s = turn[poor.chart, 0][:, None], turn[poor.chart, 1][:, None]
        turned = np.stack([c * poor.uv[:, :, 0] + s * poor.uv[:, :, 1], c * poor.uv[:, :, 1] - s * poor.uv[:, :, 0]], 2)
        size = boxes(turned, poor.chart, poor.count)[1].prod(axis=1)
        better = size < box
        best, box = np.where(better[poor.chart][:, None, None], turned, best), np.where(better, size, box)
    uv = charts.uv.copy()
    uv[chosen] = best
    return replace(charts, uv=uv)


def cut_wasteful(charts: Charts) -> Charts:
    """Cut charts that leave most of their box empty: rings, frames, L-shapes.

    Each is halved at the middle of its box's longer side, and so are its parts, while they are poor; of all these
    stages the first is kept whose boxes are nearly as small as the best, if that is a gain. (A window frame of 5.5 x
    4 m holds .05 m2 of surface in a box of 22; its two halves still need 22, its four bars .06.)
    """
    area = np.abs(uv_areas(charts.uv))
    limit = WASTE * area.sum()
    _, side = charts.boxes()
    whole = side.prod(axis=1)
    filled = np.bincount(charts.chart, area, charts.count)
    chosen = np.flatnonzero(((filled < POOR_FILL * whole) & (whole - filled > limit))[charts.chart])
    if not len(chosen):
        return charts
    poor, area = charts.take(chosen), area[chosen]
    owner = np.zeros(poor.count, np.int64)  # of each chart in `poor`, its number in `charts`
    owner[poor.chart] = charts.chart[chosen]
    stages, sizes = [poor.chart], [whole[owner]]
    for _ in range(CUTS):
        part = _halve(replace(poor, chart=stages[-1]), area, limit)
        _, part_side = boxes(poor.uv, part, int(part.max()) + 1)
        parent = np.zeros(len(part_side), np.int64)
        parent[part] = poor.chart
        stages.append(part)
        sizes.append(np.bincount(parent, part_side.prod(axis=1), poor.count))
    size = np.stack(sizes)
    stage = (size <= np.maximum(size.min(axis=0) / GAIN, 0)).argmax(axis=0)
    stage[size.min(axis=0) > GAIN * size[0]] = 0
    part = np.stack(stages)[stage[poor.chart], np.arange(len(chosen))]
    label = charts.chart.copy()
    cut = stage[poor.chart] > 0
    pair = poor.chart * (int(part.max()) + 1) + part  # stages number their parts each in their own way
    label[chosen[cut]] = charts.count + pair[cut]
    return replace(charts, chart=numbered(label))


def _halve(charts: Charts, area: Float, limit: float) -> Int:
    """Labels after cutting the poor charts in the better of two ways: at the middle of the longer side, or lying
    triangles from standing ones (the bars of a frame may be two triangles each, as long as the frame).
    """
    uv, chart, count = charts.uv, charts.chart, charts.count
    low, side = charts.boxes()
    filled = np.bincount(chart, area, count)
    box = side.prod(axis=1)
    poor = ((filled < POOR_FILL * box) & (box - filled > limit))[chart]
    axis = side.argmax(axis=1)[chart]
    middle = uv.mean(axis=1)[np.arange(len(uv)), axis]
    extent = np.ptp(uv, axis=1)
    ways = []
    for apart in (middle > (low + side / 2)[chart, axis], extent[:, 0] > extent[:, 1]):
        part = charts.relabelled(chart * 2 + (poor & apart)).chart
        _, part_side = boxes(uv, part, int(part.max()) + 1)
        parent = np.zeros(len(part_side), np.int64)
        parent[part] = chart
        ways.append((part, np.bincount(parent, part_side.prod(axis=1), count)))
    (halves, halves_size), (bars, bars_size) = ways
    label = np.where((bars_size < halves_size)[chart], bars + int(halves.max()) + 1, halves)
    return numbered(label)


def parts(corner: Int, face: Int, label: Int) -> Int:
    """(t,) int64 number 0 ... k - 1 of the connected piece of triangles that also have the same label.

    Parameters
    ----------
    corner : (t, 3) int node of each corner.
    face : (t,) int; triangles of one face have the label of the first of them, and hang together.
    label : (t,) int.
    """
    label = of_first(face, label)
    first, second, _, _ = shared_edges(corner)
    same = label[first] == label[second]
    order = np.argsort(face, kind="stable")
    whole = face[order[1:]] == face[order[:-1]]
    return components(len(corner), np.concatenate([first[same], order[:-1][whole]]),
                      np.concatenate([second[same], order[1:][whole]]))


def of_first(face: Int, value: NDArray[Any]) -> NDArray[Any]:
    """The values (t,) that the first triangle of each one's face has."""
    _, first, inverse = np.unique(face, return_index=True, return_inverse=True)
    return np.asarray(value[first[inverse.reshape(-1)]])

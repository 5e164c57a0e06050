"""Which texel centres lie in which triangle of a layout."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]

# Where in a texel its centre is, in texels from its lower left corner: Blender's bake moves the raster by a thousandth
# so that a centre never lies exactly on an edge of an aligned layout.
CENTRE = (0.501, 0.502)
# A centre this far outside an edge still counts, in texels: two triangles that share the edge leave no gap between
# them through rounding. Far above float64 rounding at 16,384 texels, far below anything visible.
EDGE_SLACK = 1e-6
# A centre this far inside two triangles is claimed by both, in texels. Above the rounding of float32 UVs at 16,384
# texels (.001), so that neighbours along an edge never count as overlapping.
OVERLAP_INSET = 0.01
# Triangles with less area in the layout than this hold no centre, square texels.
MIN_TEXEL_AREA = 1e-9
# Rows of texels and texels handled at once: about 100 MB of temporary arrays.
ROW_CHUNK = 1 << 17
PIXEL_CHUNK = 1 << 20


@dataclass(frozen=True, eq=False)
class Coverage:
    """Who owns the texels of one image.

    owner : (height * width,) int32 index of the triangle that covers the centre, -1 for none; of several the last one.
    overlapped : (m,) int64 texels whose centre lies well inside more than one triangle, sorted.
    """

    owner: NDArray[np.int32]
    overlapped: Int


def to_texels(uv: Float, width: int, height: int) -> Float:
    """Layout coordinates [0, 1]^2 -> float64 texels, in which the centre of texel (column, row) is (column, row)."""
    return np.asarray(uv, np.float64) * (width, height) - CENTRE


def rasterise(uv: Float, width: int, height: int) -> Coverage:
    """Find the triangle at each texel's centre; the last one drawn wins, as in Cycles' bake.

    Parameters
    ----------
    uv : (t, 3, 2), corners in the image's [0, 1]^2; parts outside are cut off. Either winding.
    width, height : of the image, texels.
    """
    owner = np.full(width * height, -1, np.int32)
    inner = np.full(width * height, -1, np.int32)
    doubled = []
    for triangle, pixel, inside in _texels(uv, width, height):
        owner[pixel] = triangle
        triangle, pixel = triangle[inside], pixel[inside]
        taken = inner[pixel] >= 0
        inner[pixel] = triangle
        doubled.append(pixel[taken | (inner[pixel] != triangle)])
    return Coverage(owner, np.unique(np.concatenate(doubled)) if doubled else np.empty(0, np.int64))


def holds_centre(uv: Float, width: int, height: int) -> NDArray[np.bool_]:
    """(t,) bool: whether a triangle covers any texel centre at all."""
    held = np.zeros(len(uv), bool)
    for triangle, _, _ in _texels(uv, width, height):
        held[triangle] = True
    return held


def _texels(uv: Float, width: int, height: int) -> Iterator[tuple[Int, Int, NDArray[np.bool_]]]:
    """Chunks of (triangle, texel, well inside), in the order of the triangles."""
    low = np.ceil(uv[:, :, 1].min(axis=1).astype(np.float64) * height - CENTRE[1] - EDGE_SLACK)
    high = np.floor(uv[:, :, 1].max(axis=1).astype(np.float64) * height - CENTRE[1] + EDGE_SLACK)
    low, high = np.clip(low, 0, height), np.clip(high, -1, height - 1)
    rows = np.maximum(high - low + 1, 0).astype(np.int64)
    for part in chunks(rows, ROW_CHUNK):
        corners = to_texels(uv[part], width, height)
        index = np.repeat(np.arange(len(corners)), rows[part])
        row = low[part].astype(np.int64)[index] + _counter(rows[part])
        first, last, inner_first, inner_last = _row_spans(corners, index, row, width)
        length = np.maximum(last - first + 1, 0)
        for piece in chunks(length, PIXEL_CHUNK):
            span = np.repeat(np.arange(piece.start, piece.stop), length[piece])
            column = first[span] + _counter(length[piece])
            inside = (inner_first[span] <= column) & (column <= inner_last[span])
            yield index[span] + part.start, row[span] * width + column, inside


def _row_spans(corners: Float, index: Int, row: Int, width: int) -> tuple[Int, Int, Int, Int]:
    """The columns of a row whose centres lie in its triangle: first and last of all, and of those well inside.

    The three edges give linear inequalities in x, `slope x + constant >= inset` with the distance from the edge on the
    left; each is a bound from the left or from the right.
    """
    side = np.roll(corners, -1, axis=1) - corners
    twice_area = side[:, 0, 0] * side[:, 1, 1] - side[:, 0, 1] * side[:, 1, 0]
    length = np.sqrt((side**2).sum(axis=2))
    scale = np.sign(twice_area)[:, None] / np.where(length > 0, length, 1)
    slope = (-scale * side[:, :, 1])[index]
    constant = (scale * side[:, :, 0])[index] * (row[:, None] - corners[index, :, 1]) - slope * corners[index, :, 0]
    degenerate = (np.abs(twice_area) <= 2 * MIN_TEXEL_AREA)[index]
    bounds = []
    for inset in (-EDGE_SLACK, OVERLAP_INSET):
        with np.errstate(divide="ignore", invalid="ignore"):
            crossing = (inset - constant) / slope
        left = np.where(slope > 0, crossing, -np.inf).max(axis=1)
        right = np.where(slope < 0, crossing, np.inf).min(axis=1)
        empty = degenerate | ((slope == 0) & (constant < inset)).any(axis=1)
        bounds.append(np.where(empty, width, np.clip(np.ceil(left), 0, width)).astype(np.int64))
        bounds.append(np.where(empty, -1, np.clip(np.floor(right), -1, width - 1)).astype(np.int64))
    return bounds[0], bounds[1], bounds[2], bounds[3]


def chunks(weight: Int, limit: int) -> Iterator[slice]:
    """Runs of consecutive items whose weights add up to `limit` at most, or a single item."""
    total = np.concatenate([[0], np.cumsum(weight)])
    start = 0
    while start < len(weight):
        stop = int(np.searchsorted(total, total[start] + limit, side="right")) - 1
        stop = min(max(stop, start + 1), len(weight))
        if total[stop] > total[start]:
            yield slice(start, stop)
        start = stop


def _counter(counts: Int) -> Int:
    """0 ... counts[0] - 1, 0 ... counts[1] - 1, and so on."""
    ends = np.cumsum(counts)
    return np.arange(int(ends[-1]) if len(ends) else 0) - np.repeat(ends - counts, counts)

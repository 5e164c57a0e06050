"""What a comparison looks like, in arrays of bytes: maps, the signed error in colours with its scale, the chart."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .bitmap_font import draw_text, text_size
from .compare_score import Maps

Float = NDArray[np.floating[Any]]
Bytes = NDArray[np.uint8]
RGB = tuple[int, int, int]

# The maps' white is this percentile of the light.
WHITE_PERCENTILE = 98
# Colours of the signed error from minus to plus, sRGB: blue, white, red.
SCALE = np.array([(0.02, 0.19, 0.42), (0.13, 0.45, 0.74), (0.57, 0.77, 0.87), (0.97, 0.97, 0.97), (0.96, 0.65, 0.51),
                  (0.84, 0.26, 0.22), (0.40, 0.0, 0.12)])
# Lumels that don't count.
UNCOUNTED = 0.55
INK, GREY, OURS, CYCLES = (30, 30, 30), (190, 190, 190), (200, 70, 20), (30, 90, 180)
# Pixels of a map on the board, of the gaps between, and of the chart.
SIDE, GAP, CHART = 420, 16, (640, 420)


@dataclass(frozen=True)
class Points:
    """The chart's points, errors as fractions: ours, Cycles' with all of its budget, Cycles' time at our error.

    ours, cycles : (seconds, error).  law : two ends of Cycles' line, ((seconds, error), (seconds, error)), or None.
    """

    ours: tuple[float, float]
    cycles: tuple[float, float]
    law: tuple[tuple[float, float], tuple[float, float]] | None


def points_of(numbers: dict[str, Any]) -> Points:
    """From the numbers of `compare_score.py`. An error that can't be told from 0 is drawn at its upper bound."""
    ours = numbers["ours"]
    own = (max(ours["seconds"], 1e-3), max(ours["rms"] or ours["rms_high"], 1e-6))
    cycles = (max(numbers["cycles"]["seconds"], 1e-3), max(numbers["cycles"]["rms"], 1e-6))
    equal = numbers["equal_error"]
    end = (equal["cycles_seconds"], equal["rms"]) if equal else None
    return Points(own, cycles, (cycles, end) if end else None)


def span_of(p95: float) -> float:
    """The end of the error's scale, a fraction: 1, 2 or 5 times a power of ten, twice the 95th percentile or above."""
    wanted = max(2 * p95, 1e-4)
    power = 10.0 ** math.floor(math.log10(wanted))
    return next(factor * power for factor in (1, 2, 5, 10) if factor * power >= wanted * 0.999)


def light(values: Float, white: float) -> Bytes:
    """Radiance as sRGB bytes, row 0 on top."""
    linear = np.clip(values / max(white, 1e-30), 0, 1)
    coded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    return np.asarray(np.rint(coded * 255), np.uint8)[::-1]


def map_light(maps: Maps, values: Float, white: float) -> Bytes:
    """The light of a page without what is spread round its charts, (h, w, 3) bytes, row 0 on top."""
    return light(np.where(maps.surface[..., None] >= 0, values, 0), white)


def white_of(values: Float) -> float:
    """What is shown white."""
    return float(np.percentile(values.max(axis=-1), WHITE_PERCENTILE)) if values.size else 1.0


def error_colours(part: Float) -> Float:
    """sRGB (..., 3) in 0 ... 1 at parts of the scale, -1 ... 1."""
    stops = np.linspace(-1, 1, len(SCALE))
    return np.stack([np.interp(part, stops, SCALE[:, axis]) for axis in range(3)], axis=-1)


def signed_error(maps: Maps, mean: float) -> Float:
    """(h, w) float32: (ours - Cycles) / the scene's mean, over R, G, B; nan where the lumel is not lit."""
    there = maps.counted.inner | maps.counted.edge
    error = (maps.ours - maps.cycles).mean(axis=2) / np.float32(mean)
    return np.asarray(np.where(there, error, np.nan), np.float32)


def heat_map(maps: Maps, mean: float, span: float) -> Bytes:
    """(h, w, 3) bytes, row 0 on top: the signed error in colours; edge lumels paler, others grey."""
    error = signed_error(maps, mean)
    colour = error_colours(np.clip(np.nan_to_num(error) / span, -1, 1))
    colour[maps.counted.edge] = (colour[maps.counted.edge] + UNCOUNTED) / 2
    colour[np.isnan(error)] = UNCOUNTED
    return np.asarray(np.rint(colour * 255), np.uint8)[::-1]


def legend(span: float, width: int = SIDE) -> Bytes:
    """The error's scale with its numbers, (34, width, 3) bytes."""
    picture = paper(width, 34)
    bar = error_colours(np.linspace(-1, 1, width))
    picture[:16] = np.rint(bar * 255).astype(np.uint8)[None]
    for part in (-1.0, -0.5, 0.0, 0.5, 1.0):
        text = percent(part * span)
        column = round((part + 1) / 2 * (width - 1))
        picture[16:20, max(column - 1, 0):column + 1] = INK
        wide = text_size(text, 1)[0]
        draw_text(picture, text, min(max(column - wide // 2, 0), width - wide), 23, INK)
    return picture


def percent(value: float) -> str:
    """A signed fraction in per cent with the digits it needs; 0 without a sign."""
    return f"{100 * value:+.3g} %" if value else "0 %"


def paper(width: int, height: int) -> Bytes:
    """An empty picture."""
    return np.full((height, width, 3), 255, np.uint8)


def fitted(picture: Bytes, side: int) -> Bytes:
    """A picture in a square of `side` pixels: enlarged by whole factors, or every n-th pixel of it."""
    longest = max(picture.shape[:2])
    if longest <= side:
        factor = side // longest
        shown = np.repeat(np.repeat(picture, factor, axis=0), factor, axis=1)
    else:
        step = -(-longest // side)
        shown = picture[::step, ::step]
    square = np.full((side, side, 3), 230, np.uint8)
    square[:shown.shape[0], :shown.shape[1]] = shown
    return square


def board(maps: list[Maps], numbers: dict[str, Any], lines: list[str]) -> Bytes:
    """One picture of it all, row 0 on top: the first page ours, Cycles' and its error, the numbers, and the chart."""
    mean, span = numbers["lumels"]["mean_radiance"], numbers["span"]
    shown = maps[0]
    white = white_of(shown.cycles[shown.counted.inner | shown.counted.edge])
    width = 3 * SIDE + 4 * GAP
    picture = paper(width, SIDE + 34 + CHART[1] + 7 * GAP)
    panels = (("ours", map_light(shown, shown.ours, white)), ("Cycles", map_light(shown, shown.cycles, white)),
              ("error: ours - Cycles, of the mean", heat_map(shown, mean, span)))
    for index, (title, panel) in enumerate(panels):
        x = GAP + index * (SIDE + GAP)
        draw_text(picture, title, x, GAP, INK, 2)
        put(picture, fitted(panel, SIDE), x, 3 * GAP)
    put(picture, legend(span), GAP + 2 * (SIDE + GAP), 3 * GAP + SIDE + 6)
    draw_text(picture, f"{shown.name}" + (f", 1 of {len(maps)} images" if len(maps) > 1 else ""), GAP,
              3 * GAP + SIDE + 8, INK, 2)
    top = 3 * GAP + SIDE + 34 + 2 * GAP
    put(picture, chart(points_of(numbers)), width - CHART[0] - GAP, top)
    for row, line in enumerate(lines):
        draw_text(picture, line, GAP, top + 24 * row, INK, 2)
    return picture


def put(picture: Bytes, part: Bytes, x: int, y: int) -> None:
    """Lay one picture on another."""
    picture[y:y + part.shape[0], x:x + part.shape[1]] = part


def axes_of(points: Points) -> tuple[tuple[float, float], tuple[float, float]]:
    """Ends of the chart's axes, whole powers of ten: seconds, and errors."""
    seconds, errors = zip(points.ours, points.cycles, *(points.law or ()), strict=True)

    def ends(values: tuple[float, ...]) -> tuple[float, float]:
        low, high = math.floor(math.log10(min(values) * 0.8)), math.ceil(math.log10(max(values) * 1.25))
        return 10.0**low, 10.0 ** max(high, low + 1)

    return ends(seconds), ends(errors)


def chart(points: Points) -> Bytes:
    """Error against seconds, log-log: (420, 640, 3) bytes."""
    picture = paper(*CHART)
    (x0, x1), (y0, y1) = axes_of(points)
    left, right, top, bottom = 90, CHART[0] - 20, 40, CHART[1] - 50

    def place(point: tuple[float, float]) -> tuple[float, float]:
        x = left + math.log(point[0] / x0) / math.log(x1 / x0) * (right - left)
        return x, bottom - math.log(point[1] / y0) / math.log(y1 / y0) * (bottom - top)

    draw_text(picture, "relative RMS error", left, 6, INK, 2)
    draw_text(picture, "seconds", right - 84, CHART[1] - 16, INK, 2)
    for power in range(round(math.log10(x0)), round(math.log10(x1)) + 1):
        x = round(place((10.0**power, y0))[0])
        picture[top:bottom, x] = GREY
        text = f"{10.0**power:g}"
        draw_text(picture, text, x - text_size(text, 2)[0] // 2, bottom + 10, INK, 2)
    for power in range(round(math.log10(y0)), round(math.log10(y1)) + 1):
        y = round(place((x0, 10.0**power))[1])
        picture[y, left:right] = GREY
        text = f"{100 * 10.0**power:g} %"
        draw_text(picture, text, left - 8 - text_size(text, 2)[0], y - 7, INK, 2)
    if points.law is not None:
        _dashes(picture, place(points.law[0]), place(points.law[1]), CYCLES)
    for point, name, colour in ((points.ours, "ours", OURS), (points.cycles, "Cycles", CYCLES)):
        x, y = (round(value) for value in place(point))
        picture[max(y - 5, 0):y + 6, max(x - 5, 0):x + 6] = colour
        wide = text_size(name, 2)[0]
        # Away from the other point, unless that is out of the chart.
        other = place(points.cycles if name == "ours" else points.ours)[0]
        leftwards = (x < other and x - 10 - wide > left) or x + 10 + wide > right
        draw_text(picture, name, x - 10 - wide if leftwards else x + 10, y - 7, colour, 2)
    return picture


def _dashes(picture: Bytes, start: tuple[float, float], end: tuple[float, float], colour: RGB) -> None:
    length = max(math.dist(start, end), 1.0)
    along = np.arange(0, length, 0.5)
    along = along[(along // 6) % 2 == 0] / length
    columns = np.rint(start[0] + along * (end[0] - start[0])).astype(int)
    rows = np.rint(start[1] + along * (end[1] - start[1])).astype(int)
    for offset in (0, 1):
        picture[np.clip(rows + offset, 0, picture.shape[0] - 1), np.clip(columns, 0, picture.shape[1] - 1)] = colour

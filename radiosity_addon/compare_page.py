"""The page of a comparison: one HTML file that needs no other, its pictures inside."""

from __future__ import annotations

import base64
import html
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import compare_pictures as pictures
from . import png
from .compare_score import Maps
from .progress import clock
from .warn import as_line

Float = NDArray[np.floating[Any]]

# Maps that are shown, those with the most error first; and objects that are listed.
MOST_MAPS, MOST_OBJECTS = 12, 20
# Longest side of a map on the page, pixels of the file.
LONGEST_SIDE = 512

STYLE = """
body { font: 15px/1.45 system-ui, sans-serif; color: #222; max-width: 1180px; margin: 2em auto; padding: 0 1em; }
h1 { font-size: 1.5em; } h2 { font-size: 1.15em; margin-top: 2em; }
table { border-collapse: collapse; } td, th { padding: .2em .9em .2em 0; text-align: right; vertical-align: top; }
td:first-child, th:first-child { text-align: left; } th { border-bottom: 1px solid #999; font-weight: 600; }
.row { display: flex; gap: 1em; flex-wrap: wrap; } figure { margin: 0; flex: 1 1 300px; max-width: 380px; }
.view figure { max-width: 560px; } figure img { width: 100%; image-rendering: pixelated; background: #e6e6e6; }
figcaption { font-size: .9em; color: #555; } .note { color: #555; max-width: 52em; } svg text { font-size: 13px; }
"""


def page(maps: list[Maps], told: dict[str, Any], views: dict[str, Float]) -> str:
    """The whole page; arguments as in `compare_write.write`."""
    scene = html.escape(str(told["scene"]).replace("\\", "/").rsplit("/", 1)[-1])
    numbers = told["comparison"]
    parts = [
        f"<h1>{scene}: radiosity against Cycles on the same lumels</h1>",
        f"<p>{html.escape(verdict(told))}</p>",
        _table(told),
        "<h2>Error against time</h2>",
        chart(pictures.points_of(numbers)),
        f'<p class="note">{html.escape(_about_chart(numbers))}</p>',
        "<h2>Light and error</h2>", _maps(maps, numbers),
        *(["<h2>The camera's view</h2>", _views(views)] if views else []),
        "<h2>By object</h2>", _objects(numbers["objects"]),
        "<h2>What was compared</h2>", _conditions(told),
    ]
    body = "\n".join(parts)
    return (f'<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"><title>{scene}: radiosity and Cycles</title>'
            f"<style>{STYLE}</style></head><body>\n{body}\n</body></html>\n")


def verdict(told: dict[str, Any]) -> str:
    """The result in two sentences."""
    numbers, wanted = told["comparison"], told["settings"]["error"]
    ours, equal = numbers["ours"], numbers["equal_error"]
    met = "within" if ours["rms_low"] <= wanted else "above"
    text = (f"Our bake is {ours['rms']:.2%} RMS from the truth (95 % interval {ours['rms_low']:.2%} to "
            f"{ours['rms_high']:.2%}), {met} the {wanted:.2%} that were asked for, after {_seconds(ours['seconds'])}.")
    if equal and equal["factor"]:
        how = "measured" if equal["measured"] else "by the law of its noise, one over the root of its samples"
        text += (f" Cycles takes {_seconds(equal['cycles_seconds'])} to the same error ({how}): "
                 f"{equal['factor']:.3g} times as long.")
    return text


def _seconds(value: float) -> str:
    return f"{value:.1f} s" if value < 120 else f"{clock(value)} min"


def _table(told: dict[str, Any]) -> str:
    ours, cycles = told["comparison"]["ours"], told["comparison"]["cycles"]
    audit = told["audit"]["estimated"]
    rows = [
        ("seconds", f"{ours['seconds']:.1f}", f"{cycles['seconds']:.1f} for {cycles['samples']} samples in two bakes"),
        ("relative RMS error, noise taken out", f"{ours['rms']:.2%}", f"{cycles['rms']:.2%} (its own noise)"),
        ("... as our own audit estimated it", _part(audit["rms"]), ""),
        ("bias", f"{ours['bias']:+.2%} &plusmn; {ours['bias_standard_error']:.2%}", "0 by construction"),
        ("95th percentile, noise taken out", f"{ours['p95_clean']:.2%}", ""),
        ("95th percentile as it stands", f"{ours['p95']:.2%}", f"{ours['p95_noise']:.2%} from Cycles' noise alone"),
        ("worst lumels (0.1 %), noise taken out", f"{ours['worst']:.1%}", ""),
        ("RMS at the edges of charts", _part(ours["edge_rms"]), _part(cycles["edge_rms"])),
    ]
    body = "".join(f"<tr><td>{name}</td><td>{own}</td><td>{theirs}</td></tr>" for name, own, theirs in rows)
    return f"<table><tr><th></th><th>ours</th><th>Cycles</th></tr>{body}</table>"


def _part(value: float | None) -> str:
    return f"{value:.2%}" if value is not None and math.isfinite(value) else ""


def _about_chart(numbers: dict[str, Any]) -> str:
    cycles = numbers["cycles"]
    return (f"Both axes are logarithmic; further down is better, further left is faster. Cycles' point is the noise "
            f"that is left with all of its {cycles['samples']} samples; the dashed line is how it goes on from there. "
            "Seconds are wall clock: ours with the export of the scene, Cycles' those of its bake of one mesh.")


def chart(points: pictures.Points) -> str:
    """Error against seconds as SVG."""
    (x0, x1), (y0, y1) = pictures.axes_of(points)
    left, right, top, bottom = 70, 620, 20, 340

    def place(point: tuple[float, float]) -> tuple[float, float]:
        x = left + math.log(point[0] / x0) / math.log(x1 / x0) * (right - left)
        return x, bottom - math.log(point[1] / y0) / math.log(y1 / y0) * (bottom - top)

    parts = []
    for power in range(round(math.log10(x0)), round(math.log10(x1)) + 1):
        x = place((10.0**power, y0))[0]
        parts.append(f'<line x1="{x:.1f}" y1="{top}" x2="{x:.1f}" y2="{bottom}" stroke="#ccc"/>'
                     f'<text x="{x:.1f}" y="{bottom + 18}" text-anchor="middle">{10.0**power:g} s</text>')
    for power in range(round(math.log10(y0)), round(math.log10(y1)) + 1):
        y = place((x0, 10.0**power))[1]
        parts.append(f'<line x1="{left}" y1="{y:.1f}" x2="{right}" y2="{y:.1f}" stroke="#ccc"/>'
                     f'<text x="{left - 8}" y="{y + 4:.1f}" text-anchor="end">{100 * 10.0**power:g} %</text>')
    if points.law is not None:
        (ax, ay), (bx, by) = (place(end) for end in points.law)
        parts.append(f'<line x1="{ax:.1f}" y1="{ay:.1f}" x2="{bx:.1f}" y2="{by:.1f}" stroke="#1e5ab4" '
                     'stroke-width="2" stroke-dasharray="6 5"/>')
    for point, name, colour in ((points.ours, "ours", "#c84614"), (points.cycles, "Cycles", "#1e5ab4")):
        x, y = place(point)
        # Away from the other point; there is room beside the chart for a name.
        other = place(points.cycles if name == "ours" else points.ours)[0]
        label, anchor = (x - 11, "end") if x < other and x > left + 60 else (x + 11, "start")
        parts.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="6" fill="{colour}"><title>{name}: {point[1]:.2%} after '
                     f'{point[0]:.1f} s</title></circle><text x="{label:.1f}" y="{y + 4:.1f}" fill="{colour}" '
                     f'text-anchor="{anchor}">{name}</text>')
    return f'<svg width="680" height="370" viewBox="0 0 680 370" role="img">{"".join(parts)}</svg>'


def _maps(maps: list[Maps], numbers: dict[str, Any]) -> str:
    mean, span = numbers["lumels"]["mean_radiance"], numbers["span"]
    rows = []
    for one in maps[:MOST_MAPS]:
        there = one.counted.inner | one.counted.edge
        white = pictures.white_of(one.cycles[there])
        shown = (("ours", pictures.map_light(one, one.ours, white)),
                 ("Cycles", pictures.map_light(one, one.cycles, white)),
                 ("error", pictures.heat_map(one, mean, span)))
        figures = "".join(_figure(picture, f"{one.name}: {what}") for what, picture in shown)
        rows.append(f'<div class="row">{figures}</div>')
    if len(maps) > MOST_MAPS:
        rows.append(f'<p class="note">{MOST_MAPS} of {len(maps)} images, those with the most error; all are beside '
                    "this page as EXR files.</p>")
    ends = f"{pictures.percent(-span)} to {pictures.percent(span)}"
    scale = f'<p><img src="{data_uri(pictures.legend(span))}" alt="{ends}"></p>'
    note = ("Error is ours minus Cycles, in per cent of the scene's mean, Cycles' noise included. Red is too bright, "
            "blue too dark; grey lumels don't count, pale ones lie at the edge of a chart.")
    return f'<p class="note">{html.escape(note)}</p>{scale}{"".join(rows)}'


def _views(views: dict[str, Float]) -> str:
    white = pictures.white_of(views["Cycles"])
    captions = {"ours": "Eevee with the baked light", "Cycles": "Cycles, the same diffuse scene, not denoised"}
    figures = "".join(_figure(pictures.light(view, white), captions[name]) for name, view in views.items())
    return f'<div class="row view">{figures}</div>'


def _figure(picture: NDArray[np.uint8], caption: str) -> str:
    step = -(-max(picture.shape[:2]) // LONGEST_SIDE)
    return (f'<figure><img src="{data_uri(picture[::step, ::step])}" alt="">'
            f"<figcaption>{html.escape(caption)}</figcaption></figure>")


def data_uri(picture: NDArray[np.uint8]) -> str:
    """A picture as an address that holds it."""
    return "data:image/png;base64," + base64.b64encode(png.encode(picture)).decode("ascii")


def _objects(objects: list[dict[str, Any]]) -> str:
    body = "".join(f"<tr><td>{html.escape(row['object'])}</td><td>{row['lumels']}</td><td>{row['rms']:.2%}</td>"
                   f"<td>{row['bias']:+.2%}</td></tr>" for row in objects[:MOST_OBJECTS])
    more = f'<p class="note">{len(objects) - MOST_OBJECTS} more.</p>' if len(objects) > MOST_OBJECTS else ""
    return ("<table><tr><th>object</th><th>inner lumels</th><th>RMS error</th><th>bias</th></tr>"
            f"{body}</table>{more}")


def _conditions(told: dict[str, Any]) -> str:
    numbers = told["comparison"]
    lumels, cycles = numbers["lumels"], numbers["cycles"]
    lines = [
        "Both programs bake the diffuse twin of the scene: every surface with the diffuse reflectance and the emission "
        "that our bake gives it; gloss, metal, glass, bumps and fog are left out in both.",
        f"Cycles: DIFFUSE bake, {told['settings']['passes']} passes without colour, {cycles['bounces']} bounces, "
        f"nothing clamped, no adaptive sampling, no denoising, two seeds of {cycles['samples'] // 2} samples each.",
        f"{lumels['counted']} inner lumels count (lit, and all eight neighbours in the same chart); "
        f"{lumels['left_out']} of them, the 0.1 % that deviate most, are left out of RMS, bias and percentiles "
        f"(RMS with them: {numbers['ours']['rms_untrimmed']:.2%}). {lumels['hidden']} that nobody sees, inside solids, "
        f"show what is beside them, and {lumels['doubled']} lie under a part of another face, where Cycles shades by "
        "chance: these do not count.",
        "The RMS error is the root of the mean of (ours - first) (ours - second) over lumels and channels, over the "
        "mean of the reference: the noise of the two references, being independent, adds nothing to it.",
    ]
    listed = "".join(f"<li>{html.escape(line)}</li>" for line in lines)
    warned = "".join(f"<li>{html.escape(as_line(entry))}</li>" for entry in told["warnings"])
    return f"<ul>{listed}</ul>" + (f"<p>What was told of this scene:</p><ul>{warned}</ul>" if warned else "")

"""The tables of docs/accuracy.md, from the rows of accuracy.csv; the text around them stays as it is.

Between the lines `<!-- NAME -->` and `<!-- end -->` of the page stand: `bakes`, every row; `factors`, how much longer
Cycles takes to our errors; `levels`, the times to given errors.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

Row = Mapping[str, str]

LABELS = {"ours": "ours, `--error {}`", "cycles": "Cycles, {} samples", "mitsuba": "Mitsuba, {} samples",
          "luxcore": "LuxCore, {} samples", "cycles + oidn lightmap": "Cycles + OIDN (RTLightmap), {}",
          "cycles + oidn": "Cycles + OIDN (RT), {}"}
DENOISED = ("cycles + oidn lightmap", "cycles + oidn")
LEVELS = (0.05, 0.03, 0.01)


def rows_of(table: Path) -> list[Row]:
    """The rows of a table."""
    with table.open(newline="") as file:
        return list(csv.DictReader(file))


def is_hidden(row: Row) -> bool:
    """Whether the references' noise hides the error: it may be 0, for all that is known."""
    return not float(row["rms_low"])


def error_of(row: Row) -> float:
    """Relative RMS error; of one that is hidden, the upper end of its interval."""
    return float(row["rms_high"] if is_hidden(row) else row["rms"])


def points(rows: Sequence[Row], scene: str, programs: Sequence[str]) -> list[tuple[float, float]]:
    """Relative RMS error and seconds of a scene's rows, the smallest error first; see `error_of`."""
    return sorted((error_of(row), float(row["seconds"])) for row in rows
                  if row["scene"] == scene and row["program"] in programs)


def cycles_law(rows: Sequence[Row], scene: str) -> tuple[float, float, float]:
    """(e, s, o): n samples of Cycles have the error e / sqrt(n) and take o + s n seconds; from 64 and 256 samples."""
    found = {row["knob"]: row for row in rows if row["scene"] == scene and row["program"] == "cycles"}
    few, many = found["64"], found["256"]
    each = (float(many["seconds"]) - float(few["seconds"])) / (256 - 64)
    one = float(np.exp(np.mean([np.log(float(row["rms"]) * float(row["knob"]) ** 0.5) for row in (few, many)])))
    return one, each, float(few["seconds"]) - 64 * each


def cycles_seconds(rows: Sequence[Row], scene: str, error: float) -> float:
    """How long Cycles takes to an error, by that law."""
    one, each, overhead = cycles_law(rows, scene)
    return overhead + each * (one / error) ** 2


def seconds_to(curve: Sequence[tuple[float, float]], error: float) -> float:
    """Seconds in which a curve of (error, seconds) gets to an error: on straight lines between its points, both axes
    logarithmic; those of its coarsest point where that is better already; inf where no point is as good."""
    good = [seconds for found, seconds in curve if found <= error]
    if not good or error >= max(found for found, _ in curve):
        return min(good, default=np.inf)
    errors, seconds = np.log(np.maximum(np.array(curve), 1e-9)).T
    return float(np.exp(np.interp(np.log(error), errors, seconds)))


def factors(rows: Sequence[Row], knob: str) -> dict[str, float]:
    """Of each scene: Cycles' seconds to the error of our bake with this knob, over ours."""
    ours = {row["scene"]: row for row in rows if row["program"] == "ours" and row["knob"] == knob}
    return {scene: cycles_seconds(rows, scene, error_of(row)) / float(row["seconds"]) for scene, row in ours.items()}


def bakes_table(rows: Sequence[Row]) -> str:
    """Every row."""
    lines = ["| scene | program | seconds | RMS error | bias | our own estimate |", "|---|---|---|---|---|---|"]
    before = ""
    for row in rows:
        low, high, rms = (100 * float(row[name]) for name in ("rms_low", "rms_high", "rms"))
        scene = "" if row["scene"] == before else f"{row['scene']} ({row['lumels']} inner lumels)"
        before = row["scene"]
        estimate = f"{100 * float(row['estimated']):.2f} %" if row["estimated"] else ""
        lines.append(f"| {scene} | {LABELS[row['program']].format(row['knob'])} | {float(row['seconds']):.1f} | "
                     f"{rms:.2f} % ({low:.2f} to {high:.2f}) | {100 * float(row['bias']):+.2f} % | {estimate} |")
    return "\n".join(lines)


def factors_table(rows: Sequence[Row]) -> str:
    """How much longer Cycles takes to each of our errors, and the geometric means over the scenes."""
    lines = ["| scene | at our error | ours | Cycles, by the law | factor |", "|---|---|---|---|---|"]
    for row in (row for row in rows if row["program"] == "ours"):
        error, seconds = error_of(row), float(row["seconds"])
        theirs, most = cycles_seconds(rows, row["scene"], error), "at most " * is_hidden(row)
        lines.append(f"| {row['scene']} | {most}{100 * error:.2f} % | {seconds:.1f} s | {theirs:.0f} s | "
                     f"{theirs / seconds:.1f} |")
    lines.append("")
    for knob in dict.fromkeys(row["knob"] for row in rows if row["program"] == "ours"):
        found = factors(rows, knob)
        mean = np.exp(np.mean(np.log(list(found.values()))))
        lines.append(f"Geometric mean over {len(found)} scenes at `--error {knob}`: {mean:.1f}.  ")
    return "\n".join(lines)


def levels_table(rows: Sequence[Row]) -> str:
    """Seconds of ours, of the better of the two denoisers, and of Cycles by its law, to given errors."""
    lines = ["| scene | error | ours | Cycles + OIDN | Cycles, by the law |", "|---|---|---|---|---|"]
    for scene in dict.fromkeys(row["scene"] for row in rows):
        for level in LEVELS:
            ours = seconds_to(points(rows, scene, ("ours",)), level)
            denoised = min(seconds_to(points(rows, scene, (program,)), level) for program in DENOISED)
            cycles = cycles_seconds(rows, scene, level)
            cells = [_seconds(ours), _against(denoised, ours), _against(cycles, ours)]
            lines.append(f"| {scene} | {100 * level:.0f} % | {' | '.join(cells)} |")
    return "\n".join(lines)


def _seconds(seconds: float) -> str:
    return f"{seconds:.1f} s" if np.isfinite(seconds) else "not measured"


def _against(seconds: float, ours: float) -> str:
    if not np.isfinite(seconds):
        return "not reached"
    return f"{seconds:.1f} s" + (f" ({seconds / ours:.1f} times ours)" if np.isfinite(ours) else "")


def with_tables(page: str, rows: Sequence[Row]) -> str:
    """The page with its tables anew.

    Raises
    ------
    ValueError
        If one of them has no place in it.
    """
    for name, make in (("bakes", bakes_table), ("factors", factors_table), ("levels", levels_table)):
        begin, end = f"<!-- {name} -->\n", "<!-- end -->"
        before, found, rest = page.partition(begin)
        if not found or end not in rest:
            raise ValueError(f"the page has no place for a table: put '{begin.strip()}' and '{end}' there")
        page = f"{before}{begin}\n{make(rows)}\n\n{end}{rest.partition(end)[2]}"
    return page

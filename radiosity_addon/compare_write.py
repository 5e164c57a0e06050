"""The files of a comparison: float images, the numbers, a picture of it all, and one page to look at."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..solver.whole_file import whole_file
from . import compare_page, compare_pictures, png, report
from .baked_images import write_file
from .compare_request import BOARD, PAGE, CompareRequest
from .compare_score import Maps
from .progress import clock

Float = NDArray[np.floating[Any]]


def write(maps: list[Maps], told: dict[str, Any], views: dict[str, Float], asked: CompareRequest) -> dict[str, Path]:
    """Write everything into the request's folder, the maps with the largest error first.

    Parameters
    ----------
    maps : the pages.
    told : the report; gets the span of the error's colours, and the files.
    views : the camera's view by program, (h, w, 3) float32, row 0 at the bottom; may be empty.
    asked : where to.

    Returns
    -------
    The files by what they are: "page", "board", "numbers".

    Raises
    ------
    OutputError
        If a file can't be written.
    """
    numbers = told["comparison"]
    numbers["span"] = compare_pictures.span_of(numbers["ours"]["p95"])
    ordered = sorted(maps, key=lambda one: -_weight(one))
    told["outputs"] = _write_images(maps, numbers["lumels"]["mean_radiance"], asked.folder, asked.bake.report_path)
    board_path, page_path, numbers_path = asked.folder / BOARD, asked.folder / PAGE, asked.bake.report_path
    assert numbers_path is not None
    told["page"], told["board"] = (report.relative_to_report(path, numbers_path) for path in (page_path, board_path))
    for path, data in ((board_path, png.encode(compare_pictures.board(ordered, numbers, lines_of(told)))),
                       (page_path, compare_page.page(ordered, told, views).encode())):
        with whole_file(path) as beside:
            beside.write_bytes(data)
    report.write(told, numbers_path)
    return {"page": page_path, "board": board_path, "numbers": numbers_path}


def lines_of(told: dict[str, Any]) -> list[str]:
    """The comparison in a few lines."""
    numbers, wanted = told["comparison"], told["settings"]["error"]
    ours, cycles, equal = numbers["ours"], numbers["cycles"], numbers["equal_error"]
    lines = [
        f"ours    {clock(ours['seconds'])}  RMS {ours['rms']:.2%} ({ours['rms_low']:.2%} to {ours['rms_high']:.2%})",
        f"        asked for {wanted:.2%}, audit said {_audit(told)}",
        f"        p95 {ours['p95_clean']:.2%}, worst {ours['worst']:.1%}",
        f"        bias {ours['bias']:+.2%}",
        f"Cycles  {clock(cycles['seconds'])}  noise {cycles['rms']:.2%}, {cycles['samples']} samples",
    ]
    if equal and equal["factor"]:
        lines.append(f"        at our error {clock(equal['cycles_seconds'])}, {equal['factor']:.3g} times ours")
    lines.append(f"{numbers['lumels']['counted']} lumels, {numbers['lumels']['left_out']} left out")
    return lines


def _audit(told: dict[str, Any]) -> str:
    estimated = told["audit"]["estimated"]["rms"]
    return f"{estimated:.2%}" if estimated is not None else "nothing"


def _weight(one: Maps) -> float:
    """How much of the whole square error a page carries."""
    inner = one.counted.inner
    return float(((one.ours - one.first) * (one.ours - one.second))[inner].sum())


def _write_images(maps: Iterable[Maps], mean: float, folder: Path, numbers: Path | None) -> list[dict[str, Any]]:
    """Ours, Cycles' and the signed error of each page as EXR files; their paths for the report."""
    taken: set[str] = set()
    outputs = []
    for one in maps:
        error = np.nan_to_num(compare_pictures.signed_error(one, mean))
        images = {"ours": (one.ours, "radiance"), "cycles": (one.cycles, "radiance"),
                  "error": (np.repeat(error[..., None], 3, axis=2), "(ours - Cycles) / mean of Cycles")}
        row: dict[str, Any] = {"image": one.name}
        for name, (pixels, quantity) in images.items():
            header: dict[str, str | float] = {"software": "Radiosity Lightmaps", "quantity": quantity}
            path = write_file(folder, f"{one.name}_{name}", pixels, header, taken)
            row[name] = report.relative_to_report(path, numbers)
        outputs.append(row)
    return outputs

"""What a bake and its warnings look like as text."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from typing import Any

from .progress import clock
from .request import Request
from .warn import as_line


def print_warnings(warnings: Iterable[dict[str, Any]]) -> None:
    """Each on a line of standard error."""
    for warning in warnings:
        print(f"radiosity: warning: {as_line(warning)}", file=sys.stderr, flush=True)


def one_line(report: dict[str, Any]) -> str:
    """How much was baked, how well, how fast."""
    estimated = report["error"]["estimated"]
    within = "" if estimated["rms"] is None else (
        f", error {estimated['rms']:.2%} ({estimated['rms_low']:.2%} to {estimated['rms_high']:.2%})")
    return f"{report['lumels']} lumels of {len(report['outputs'])} objects in {clock(report['seconds'])}{within}"


def print_outcome(report: dict[str, Any], request: Request, exit_code: int, verb: str = "baked") -> None:
    """The bake in a few lines of standard output."""
    print(f"{verb} {one_line(report)}", flush=True)
    if exit_code:
        print(f"radiosity: warning: the wanted error of {report['error']['wanted']:.2%} was not reached: "
              "the results are written all the same, a lower --error makes the bake work longer", file=sys.stderr)
    for label, path in (("lightmaps", request.output), ("baked scene", request.save), ("report", request.report_path)):
        if path is not None:
            print(f"{label:<12}{path}", flush=True)

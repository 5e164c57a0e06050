"""What is asked of a comparison, and its words on the command line."""

from __future__ import annotations

import argparse
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ..solver.errors import SettingsError
from ..solver.settings import Settings
from .request import Request, folder_beside

# Cycles' time where nothing is said, seconds.
DEFAULT_SECONDS = 60.0
FOLDER = "//compare"
NUMBERS, PAGE, BOARD = "compare.json", "compare.html", "compare.png"
# With fewer samples the two bakes lean to the texels' centres (sample 0 is always there).
LEAST_SAMPLES = 8
ADVICE = "save it, or choose a folder (--output)"


@dataclass(frozen=True)
class CompareRequest:
    """A bake, and Cycles' share.

    Parameters
    ----------
    bake : our bake; it writes nothing by itself.
    seconds : that Cycles' bakes may take together; None where `samples` says it.
    samples : of a lumel in Cycles' two bakes together.
    camera : whether the scene's camera is rendered too.
    """

    bake: Request
    seconds: float | None = DEFAULT_SECONDS
    samples: int | None = None
    camera: bool = False

    def __post_init__(self) -> None:
        if self.seconds is not None and not 0 < self.seconds < 1e6:
            raise SettingsError(f"seconds is {self.seconds:g}: give Cycles a time above 0")
        if self.samples is not None and self.samples < LEAST_SAMPLES:
            raise SettingsError(f"samples is {self.samples}: use a number from {LEAST_SAMPLES}")
        if self.bake.settings.target != "lightmap":
            raise SettingsError(f"target is {self.bake.settings.target!r}: lightmaps alone are compared with Cycles, "
                                "use lightmap")

    @property
    def folder(self) -> Path:
        """Where the results go."""
        assert self.bake.output is not None
        return self.bake.output


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The words of `compare` that a bake does not have."""
    budget = parser.add_argument_group("what Cycles gets").add_mutually_exclusive_group()
    budget.add_argument("--seconds", type=float, metavar="S", default=argparse.SUPPRESS,
                        help=f"for its two bakes together (default: {DEFAULT_SECONDS:g})")
    budget.add_argument("--samples", type=int, metavar="N", default=argparse.SUPPRESS,
                        help="of each lumel, in its two bakes together")
    results = parser.add_argument_group("what comes of it")
    results.add_argument("--output", type=Path, metavar="DIR", default=argparse.SUPPRESS,
                         help="folder of the results (default: compare, beside the .blend)")
    results.add_argument("--report", type=Path, metavar="PATH", default=argparse.SUPPRESS,
                         help=f"the numbers (default: {NUMBERS} in the output folder)")
    results.add_argument("--camera", action=argparse.BooleanOptionalAction, default=argparse.SUPPRESS,
                         help="render the camera's view too: Eevee with the baked light beside Cycles")


def request_of(given: dict[str, Any], settings: Settings, blend: str) -> CompareRequest:
    """The request of these arguments; all else is as the settings say.

    Raises
    ------
    SettingsError
        On a value that makes no sense, or if there is no folder to write to.
    """
    output = given.get("output") or folder_beside(blend, FOLDER, advice=ADVICE)
    # Cycles' bake stores radiance: ours is compared in the same quantity, and relative errors are those of any other.
    bake = Request(replace(settings, quantity="radiance"), output, given.get("report") or output / NUMBERS)
    samples = given.get("samples")
    seconds = None if samples is not None else given.get("seconds", DEFAULT_SECONDS)
    return CompareRequest(bake, seconds, samples, bool(given.get("camera", False)))

"""All programs on the same lumels of one scene: error and seconds, in one run on one machine.

    python -m benchmarks.peers.run cornell --programs ours cycles oidn mitsuba luxcore

Rows are those of benchmarks.cycles.compare, written to out/benchmarks/NAME/peers.csv. What a program can't do is
printed and written beside it as peers.txt: a missing curve has a reason.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from radiosity.solver import image_file

from ..cycles import compare, reference
from ..cycles.compare import Comparison, Row
from ..cycles.scenes import CASES, Case, case_named
from . import denoised, environment, twin_arrays
from .environment import PeerError

Float = NDArray[np.floating[Any]]

ERRORS = (0.1, 0.03, 0.01)
CYCLES_SAMPLES = (16, 64, 256)
# A renderer's own knob, samples a lumel.
MITSUBA_SAMPLES = (16, 64, 256)
LUXCORE_SAMPLES = (16, 64, 256)
# A lumel is the mean over the central half of its texel, as in Cycles.
FOOTPRINT = 0.5
FOLDER = Path(__file__).parent


def run_ours(comparison: Comparison) -> None:
    """Our bakes."""
    compare.run_ours(comparison, list(ERRORS), (), by_object=False)


def run_cycles(comparison: Comparison) -> None:
    """Cycles' bakes."""
    compare.run_cycles(comparison, list(CYCLES_SAMPLES))


def run_oidn(comparison: Comparison) -> None:
    """The denoisers on Cycles' bakes of this run, or on those that an earlier run kept; both times count."""
    denoisers = denoised.denoisers()
    if not denoisers:
        raise PeerError("no Open Image Denoise: run python -m benchmarks.peers.environment")
    timed = {int(row.knob): row.seconds for row in comparison.rows if row.program == "cycles"}
    kept = {bake.samples: bake for bake in reference.load(comparison.case, comparison.known["content"])
            if bake.seed >= reference.TIMED_SEED and (not timed or bake.seconds in timed.values())}
    if not kept:
        raise PeerError("no bake of Cycles to denoise: add cycles to --programs")
    for name, denoiser in denoisers.items():
        # Loading the library and its weights is no part of the work.
        denoised.denoised(denoiser, kept[min(kept)], comparison.squares)
        for samples, bake in sorted(kept.items()):
            radiance, seconds, cpu_seconds = denoised.denoised(denoiser, bake, comparison.squares)
            _add(comparison, name, samples, radiance, bake.seconds + seconds, bake.cpu_seconds + cpu_seconds,
                 "this run" if timed else "earlier run")


def run_mitsuba(comparison: Comparison) -> None:
    """Mitsuba's path integrator from the same lumels."""
    environment.require("mitsuba")
    if environment.llvm() is None:
        raise PeerError(f"Mitsuba's vectorised mode needs the library of LLVM {environment.LLVM}: set "
                        "DRJIT_LIBLLVM_PATH to it (its scalar mode takes no wavefront of rays)")
    resolution = int(comparison.known["resolution"])
    for row, arrays in _renderer(comparison, "mitsuba", MITSUBA_SAMPLES):
        radiance = twin_arrays.images(np.load(row["values"]), arrays, resolution)
        _add(comparison, "mitsuba", row["samples"], radiance, row["seconds"], row["cpu_seconds"], "this run")


def run_luxcore(comparison: Comparison) -> None:
    """LuxCore's BAKECPU engine on the same layouts."""
    environment.require("pyluxcore")
    resolution = int(comparison.known["resolution"])
    for row, arrays in _renderer(comparison, "luxcore", LUXCORE_SAMPLES):
        names = [str(name) for name in arrays["page_names"]]
        radiance = {name: _whole(Path(path), comparison.squares[name], resolution)
                    for name, path in zip(names, row["images"], strict=True)}
        _add(comparison, "luxcore", row["samples"], radiance, row["seconds"], row["cpu_seconds"], "this run")


def _whole(path: Path, side: int, resolution: int) -> Float:
    """LuxCore's map of a square as the whole image, row 0 at v = 0 (LuxCore writes it the other way up)."""
    image = np.zeros((resolution, resolution, 3), np.float32)
    image[:side, :side] = image_file.read_exr(path)[::-1]
    return image


def _renderer(comparison: Comparison, program: str, samples: tuple[int, ...]) -> Iterator[tuple[dict[str, Any], Any]]:
    """Rows of the answer of a script of this folder that gets the twin's arrays, and those arrays."""
    folder = comparison.case.folder / "peers"
    path = twin_arrays.write(comparison.case, comparison.known, folder)
    request = {"arrays": str(path), "samples": list(samples), "seed": reference.TIMED_SEED, "footprint": FOOTPRINT,
               "bounces": reference.BOUNCES, "resolution": int(comparison.known["resolution"]),
               "squares": comparison.squares}
    answer = environment.run(FOLDER / f"{program}_bake.py", request, folder)
    with np.load(path) as archive:
        arrays = {name: archive[name] for name in archive.files}
    for row in answer["rows"]:
        yield row, arrays


def _add(comparison: Comparison, program: str, samples: int, radiance: Any, seconds: float, cpu_seconds: float,
         measured: str) -> None:
    busy = compare.load() if measured == "this run" else float("nan")
    compare.print_row(comparison.add(program, str(samples), radiance, seconds, cpu_seconds=cpu_seconds, busy=busy,
                                     measured=measured))


# Timed in every round.
TIMED_AGAIN = {"ours", "cycles"}
PROGRAMS: dict[str, Callable[[Comparison], None]] = {
    "ours": run_ours,
    "cycles": run_cycles,
    "oidn": run_oidn,
    "mitsuba": run_mitsuba,
    "luxcore": run_luxcore,
}


def measure(case: Case, programs: list[str], rounds: int = 1) -> tuple[list[Row], dict[str, str]]:
    """The rows of one scene, and why programs are missing from them, by name.

    rounds : how often ours and Cycles are timed, in turn; of each bake the quickest counts, since other work on the
        machine only ever makes one longer.
    """
    comparison, problems = Comparison(case), {}
    wanted = [program for program in PROGRAMS if program in programs]
    for program in wanted + [program for program in wanted if program in TIMED_AGAIN] * (rounds - 1):
        try:
            PROGRAMS[program](comparison)
        except PeerError as problem:
            problems[program] = str(problem)
            print(f"  {case.name} {program}: no curve: {problem}", flush=True)
    rows = quickest(comparison.rows)
    compare.write_csv(case.folder / "peers.csv", rows)
    (case.folder / "peers.txt").write_text("".join(f"{name}: {why}\n" for name, why in problems.items()))
    return rows, problems


def quickest(rows: list[Row]) -> list[Row]:
    """Of the rows of one program and knob the one with the fewest seconds, in the order of their first."""
    best: dict[tuple[str, str], Row] = {}
    for row in rows:
        kept = best.setdefault((row.program, row.knob), row)
        if row.seconds < kept.seconds:
            best[row.program, row.knob] = row
    return list(best.values())


def main(arguments: list[str] | None = None) -> int:
    """Command line."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.peers.run", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("scene", nargs="+", choices=list(CASES), metavar="SCENE", help=", ".join(CASES))
    parser.add_argument("--programs", nargs="+", choices=list(PROGRAMS), default=list(PROGRAMS))
    parser.add_argument("--rounds", type=int, default=1, help="times that ours and Cycles are timed, in turn (1)")
    chosen = parser.parse_args(arguments)
    for name in chosen.scene:
        measure(case_named(name), chosen.programs, chosen.rounds)
    return 0


if __name__ == "__main__":
    sys.exit(main())

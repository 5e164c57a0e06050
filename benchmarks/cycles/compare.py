"""Our bake against Cycles' on the same lumels: error and seconds, in one run on one machine.

    python -m benchmarks.cycles.compare cornell classroom --error .1 .03 --time-cycles 16 64 256

For each scene: the diffuse twin (made if it is not there), the two references (made by `reference.py` before), our
bakes at each error, and Cycles' bakes at each sample count. Rows are printed and written to
out/benchmarks/NAME/compare.csv; pictures lie beside it. `rms` is the number that `error` in report.json means (see
`solver/estimator.py`).
"""

from __future__ import annotations

import argparse
import csv
import os
import sys
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from radiosity.solver import estimator, sampling_law

from . import ours, pictures, reference
from .scenes import CASES, Case, case_named
from .twin import make_twin

Float = NDArray[np.floating[Any]]

# Noise that references are made to when there are none yet, and for how long at most.
FIRST_NOISE, FIRST_MINUTES, FIRST_SAMPLES = 0.09, 10.0, 256
# A load above this when a bake begins means that others use the machine too.
BUSY = 0.5


@dataclass(frozen=True)
class Row:
    """One bake of one scene. Errors are fractions of the reference's mean over the inner lumels.

    knob : what was asked of the program: our `error`, Cycles' samples.
    seconds : our report's (export and write-back included), or Cycles' bake operator's (synchronisation included).
    cpu_seconds : of all threads; ours hold the start of Python and Blender too. What to look at on a busy machine.
    busy : the machine's load when the bake began, in processes waiting to run; above .5 `seconds` are not worth much.
    estimated : the error that the program itself reports (Cycles has none);  reached : whether it says it reached it.
    edge_rms, edge_lumels : the same estimate over the edge lumels, a set of its own, in parts of its own mean.
    clean : whether the references' noise is below three times rms.
    """

    scene: str
    program: str
    knob: str
    seconds: float
    process_seconds: float
    cpu_seconds: float
    busy: float
    rays: int | None
    lumels: int
    rms: float
    rms_low: float
    rms_high: float
    p95: float
    p95_noise: float
    bias: float
    bias_standard_error: float
    edge_rms: float
    edge_lumels: int
    noise: float
    trimmed: int
    rms_untrimmed: float
    clean: bool
    estimated: float | None
    reached: bool | None
    reference_samples: int
    measured: str


class Comparison:
    """One scene, ready to score any program's bake of its lumels."""

    def __init__(self, case: Case) -> None:
        self.case, self.known = case, make_twin(case)
        pair = reference.references(case, self.known["content"])
        if pair is None:
            reference.refine(case, FIRST_SAMPLES, FIRST_NOISE, FIRST_MINUTES)
            pair = reference.references(case, self.known["content"])
        if pair is None:
            raise RuntimeError(f"{case.name} has no references: run python -m benchmarks.cycles.reference {case.name}")
        self.pair, self.chosen = pair, reference.selection(case, pair)
        self.squares = {row["object"]: int(row["square"]) for row in self.known["receivers"]}
        self.rows: list[Row] = []

    def score(self, radiance: dict[str, Float], which: str) -> estimator.Score:
        """The error over the `inner` or the `edge` lumels of all receivers."""
        take = self.chosen.take
        return estimator.score(take(radiance, which), take(self.pair.first, which), take(self.pair.second, which))

    def by_object(self, radiance: dict[str, Float]) -> list[tuple[str, int, float, float]]:
        """(object, inner lumels, rms, bias), both in parts of the scene's mean, nothing trimmed; noise taken out."""
        mean = self.score(radiance, "inner").mean
        found = []
        for name, masks in self.chosen.counted.items():
            if masks.inner.any():
                part = [image[name][masks.inner] for image in (radiance, self.pair.first, self.pair.second)]
                square = estimator.mean_square_error(part[0], part[1], part[2])[0]
                bias = float((part[0] - (part[1] + part[2]) / 2).mean())
                found.append((name, len(part[0]), max(square, 0.0) ** 0.5 / mean, bias / mean))
        return found

    def add(
        self,
        program: str,
        knob: str,
        radiance: dict[str, Float],
        seconds: float,
        *,
        cpu_seconds: float,
        busy: float,
        process_seconds: float = 0.0,
        rays: int | None = None,
        estimated: float | None = None,
        reached: bool | None = None,
        measured: str = "this run",
    ) -> Row:
        """Score a bake, keep its row and draw its pictures."""
        inner, edge = self.score(radiance, "inner"), self.score(radiance, "edge")
        row = Row(
            scene=self.case.name,
            program=program,
            knob=knob,
            seconds=seconds,
            process_seconds=process_seconds or seconds,
            cpu_seconds=cpu_seconds,
            busy=busy,
            rays=rays,
            lumels=inner.lumels,
            rms=inner.rms,
            rms_low=inner.rms_low,
            rms_high=inner.rms_high,
            p95=inner.p95,
            p95_noise=inner.p95_noise,
            bias=inner.bias,
            bias_standard_error=inner.bias_standard_error,
            edge_rms=edge.rms,
            edge_lumels=edge.lumels,
            noise=inner.noise,
            trimmed=inner.trimmed,
            rms_untrimmed=inner.rms_untrimmed,
            clean=inner.is_clean(),
            estimated=estimated,
            reached=reached,
            reference_samples=min(self.pair.samples),
            measured=measured,
        )
        self.rows.append(row)
        self._draw(row, radiance, inner.mean)
        return row

    def add_ours(self, error: float, extra: tuple[str, ...] = ()) -> tuple[Row, ours.OurBake]:
        """Bake to `error` with our program, `extra` words on its command line, and score the result."""
        busy = load()
        done = ours.bake(self.case, self.known, error, self.case.folder / f"ours_{error:g}", extra)
        row = self.add(
            "ours",
            f"{error:g}",
            done.radiance,
            done.seconds,
            process_seconds=done.process_seconds,
            cpu_seconds=done.cpu_seconds,
            busy=busy,
            rays=done.rays,
            estimated=done.estimated.get("rms"),
            reached=done.reached,
        )
        return row, done

    def _draw(self, row: Row, radiance: dict[str, Float], mean: float) -> None:
        truth = {name: (self.pair.first[name] + self.pair.second[name]) / 2 for name in self.squares}
        pictures.write_sheet(
            self.case.folder / f"{row.program}_{row.knob}.png",
            f"{row.scene}, {row.program} {row.knob}: rms {row.rms:.2%}, bias {row.bias:+.2%}, {row.seconds:.1f} s",
            radiance,
            truth,
            {name: masks.inner for name, masks in self.chosen.counted.items()},
            self.squares,
            mean,
            max(row.rms, 0.01),
        )


def load() -> float:
    """Processes waiting to run, on average over the last minute (nan where the system does not tell)."""
    return os.getloadavg()[0] if hasattr(os, "getloadavg") else float("nan")


def run_ours(comparison: Comparison, errors: list[float], extra: tuple[str, ...], by_object: bool) -> None:
    """Our bakes, one for each wanted error."""
    for error in errors:
        row, done = comparison.add_ours(error, extra)
        print_row(row)
        if by_object:
            for name, lumels, rms, bias in comparison.by_object(done.radiance):
                print(f"    {name:20s} {lumels:6d} lumels  rms {rms:8.2%}  bias {bias:+8.2%}")


def run_cycles(comparison: Comparison, samples: list[int]) -> None:
    """Cycles' bakes, timed now; each is kept."""
    if not samples:
        return
    twin = reference.TwinInCycles(comparison.case)
    for index, count in enumerate(samples):
        busy = load()
        done = twin.bake(count, reference.TIMED_SEED + index)
        reference.save(comparison.case, done, twin.content)
        print_row(
            comparison.add("cycles", str(count), done.radiance, done.seconds, cpu_seconds=done.cpu_seconds, busy=busy)
        )


def earlier_cycles(comparison: Comparison) -> None:
    """Cycles' bakes that an earlier run timed."""
    for done in reference.load(comparison.case, comparison.known["content"]):
        if done.seed >= reference.TIMED_SEED:
            row = comparison.add(
                "cycles",
                str(done.samples),
                done.radiance,
                done.seconds,
                cpu_seconds=done.cpu_seconds,
                busy=float("nan"),
                measured="earlier run",
            )
            print_row(row)


def print_equal_error(rows: list[Row]) -> None:
    """Cycles' time at the error of each of our bakes, over our time."""
    timed = [row for row in rows if row.program == "cycles" and row.rms > 0]
    if not timed:
        print("    no bake of Cycles is timed: give --time-cycles 16 64 256 for the times at equal error")
        return
    for clock in ("seconds", "cpu_seconds"):
        curve = sampling_law.fit(
            [int(row.knob) for row in timed], [getattr(row, clock) for row in timed], [r.rms for r in timed]
        )
        print(
            f"    Cycles, {clock}: {curve.overhead:.2f} + {curve.per_sample:.4f} a sample, error {curve.one_sample:.3f}"
            f" / sqrt(samples), kept within a factor {curve.spread:.2f} by {len(timed)} bakes"
        )
        for row in rows:
            if row.program == "ours" and row.rms > 0:
                where = "measured" if curve.is_measured_at(row.rms) else "OUTSIDE the measured points, by the law alone"
                theirs, own = curve.seconds_at(row.rms), float(getattr(row, clock))
                print(
                    f"      at our {row.rms:.2%} (error {row.knob}): Cycles {theirs:.1f} with "
                    f"{curve.samples_at(row.rms):.0f} samples, ours {own:.1f}: "
                    f"Cycles takes {theirs / own:.2f} times as long ({where})"
                )


def print_row(row: Row) -> None:
    """One line for one bake."""
    said = "" if row.estimated is None else f", says {row.estimated:.2%}{'' if row.reached else ' (not reached)'}"
    print(
        f"  {row.scene} {row.program} {row.knob}: {row.seconds:.1f} s ({row.cpu_seconds:.1f} CPU), rms {row.rms:.2%} "
        f"({row.rms_low:.2%} to {row.rms_high:.2%}), p95 {row.p95:.2%} (noise alone {row.p95_noise:.2%}), "
        f"bias {row.bias:+.2%} +- {row.bias_standard_error:.2%}, edge rms {row.edge_rms:.2%}{said}; "
        f"{row.lumels} lumels, {row.trimmed} left out (with them {row.rms_untrimmed:.2%}), "
        f"references' noise {row.noise:.2%}{'' if row.clean else ': TOO NOISY for this error'}",
        flush=True,
    )


def write_csv(path: Path, rows: list[Row]) -> None:
    """All rows of one scene."""
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, [field.name for field in fields(Row)])
        writer.writeheader()
        for row in rows:
            writer.writerow({k: f"{v:.6g}" if isinstance(v, float) else v for k, v in asdict(row).items()})


def compare(case: Case, errors: list[float], samples: list[int], extra: tuple[str, ...], by_object: bool) -> list[Row]:
    """Measure one scene; its rows."""
    comparison = Comparison(case)
    pair = comparison.pair
    print(
        f"{case.name}: {comparison.known['triangles']} triangles, {comparison.known['lumels']} lumels; "
        f"references of {pair.samples[0]} and {pair.samples[1]} samples"
    )
    run_ours(comparison, errors, extra, by_object)
    if samples:
        run_cycles(comparison, samples)
    else:
        earlier_cycles(comparison)
    print_equal_error(comparison.rows)
    write_csv(case.folder / "compare.csv", comparison.rows)
    busiest = max((row.busy for row in comparison.rows if row.measured == "this run"), default=0.0)
    if busiest > BUSY:
        print(f"    other programs kept the machine busy (load {busiest:.1f}): compare CPU seconds, not seconds")
    print(f"    rows: {case.folder / 'compare.csv'}; pictures beside it")
    return comparison.rows


def main(arguments: list[str] | None = None) -> int:
    """Command line; 1 if a scene could not be measured."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.cycles.compare", description=(__doc__ or "").splitlines()[0]
    )
    parser.add_argument("scene", nargs="+", help=f"one or more of {', '.join(CASES)}, or all")
    parser.add_argument("--error", type=float, nargs="*", default=[0.03], help="errors asked of our bake (.03)")
    parser.add_argument(
        "--time-cycles", type=int, nargs="*", default=[], metavar="SAMPLES", help="bake with Cycles too"
    )
    parser.add_argument("--by-object", action="store_true", help="our error for each receiver")
    parser.add_argument("--argument", action="append", default=[], help="one more word for our command line (repeat)")
    chosen = parser.parse_args(arguments)
    failed = 0
    for name in CASES if chosen.scene == ["all"] else chosen.scene:
        try:
            compare(case_named(name), chosen.error, chosen.time_cycles, tuple(chosen.argument), chosen.by_object)
        except RuntimeError as problem:
            print(problem, file=sys.stderr)
            failed = 1
    return failed


if __name__ == "__main__":
    sys.exit(main())

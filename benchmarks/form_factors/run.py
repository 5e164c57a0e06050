"""Measure every method on every case: error against seconds and evaluations, as CSV.

    python -m radiosity.benchmarks.form_factors.run [--output out/form_factors.csv] [--most 65536] [--peers]

Columns: case, method, samples (pairs of patches, logarithms, pixels or rays asked for), value, relative_error (RMS over
seeds where the method is random), seconds (of one call, the best of the calls).
"""

from __future__ import annotations

import argparse
import csv
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from . import peers
from .cases import OCCLUDED, UNOCCLUDED, Case
from .methods import METHODS, NO_OCCLUDERS, ONE_SIZE, RANDOM

COLUMNS = ("case", "method", "samples", "value", "relative_error", "seconds")
ROOT = Path(__file__).resolve().parents[2]
SEEDS = 8
# Calls of a method that knows no seed: the first one warms up, the best one counts.
CALLS = 3
MOST = 65536


def measure(case: Case, name: str, samples: int) -> tuple[float, float, float]:
    """(value, relative error, seconds) of a method on a case."""
    values, seconds = [], []
    for seed in range(SEEDS) if name in RANDOM else [0] * CALLS:
        begin = time.perf_counter()
        values.append(METHODS[name](case.a, case.b, samples, case.occluders, seed=seed))
        seconds.append(time.perf_counter() - begin)
    deviation = np.abs(np.array(values) / case.exact - 1)
    return float(np.mean(values)), float(np.sqrt((deviation**2).mean())), min(seconds)


def rows(cases: tuple[Case, ...], most: int) -> Iterator[tuple[str, str, int, float, float, float]]:
    """One row for each case, method and number of samples: 1, 16, 256, ... up to `most`."""
    ladder = [16**k for k in range(1, 8) if 16**k <= most] or [most]
    for case in cases:
        for name in METHODS:
            if case.occluders and name in NO_OCCLUDERS:
                continue
            for samples in [1] if name in ONE_SIZE else ladder:
                yield case.name, name, samples, *measure(case, name, samples)


def write(path: Path, cases: tuple[Case, ...], most: int = MOST, with_peers: bool = False) -> dict[str, str]:
    """Measure, and write the CSV; with peers, why some of their programs are missing, by name."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file)
        table.writerow(COLUMNS)
        for row in rows(cases, most):
            table.writerow(_words(row))
        theirs, problems = peers.rows(cases, most, SEEDS, CALLS, ROOT / "out" / "peers") if with_peers else ([], {})
        for row in theirs:
            table.writerow(_words(row))
    return problems


def _words(row: tuple[str, str, int, float, float, float]) -> list[str]:
    return [row[0], row[1], str(row[2]), f"{row[3]:.10g}", f"{row[4]:.3g}", f"{row[5]:.3g}"]


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--output", type=Path, default=Path("out/form_factors.csv"))
    parser.add_argument("--most", type=int, default=MOST, help="the most samples a method gets")
    parser.add_argument("--peers", action="store_true", help="pyviewfactor and raystrack too, if installed")
    arguments = parser.parse_args()
    problems = write(arguments.output, UNOCCLUDED + OCCLUDED, arguments.most, arguments.peers)
    for name, why in problems.items():
        print(f"{name}: no curve: {why}")


if __name__ == "__main__":
    main()

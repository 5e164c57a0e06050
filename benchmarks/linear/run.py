"""Measure every solver on both systems: products and seconds to a tolerance, against the reflectance, as CSV.

    python -m radiosity.benchmarks.linear.run [--output out/linear.csv] [--side 8] [--cap 1000]

Columns: system, patches, reflectance, solver, products, seconds, residual (at the end), error (max|B - B_exact| over
max B_exact).
"""

from __future__ import annotations

import argparse
import csv
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from .methods import SOLVERS
from .systems import cube, two_rooms

COLUMNS = ("system", "patches", "reflectance", "solver", "products", "seconds", "residual", "error")
REFLECTANCES = (0.5, 0.8, 0.9, 0.95, 0.99)
# Residual over emission; max-norm errors are then below 1e-4 over 1 - rho, and in practice far better.
TOLERANCE = 1e-4


def rows(side: int, cap: int, reflectances: tuple[float, ...] = REFLECTANCES) -> Iterator[tuple[object, ...]]:
    """One row for each system, reflectance and solver."""
    for name, build in (("cube", cube), ("two rooms", two_rooms)):
        for reflectance in reflectances:
            system = build(side, reflectance)
            exact = system.radiosity()
            for solver, solve in SOLVERS.items():
                begin = time.perf_counter()
                result = solve(system.F, system.reflectance, system.emission, system.areas, TOLERANCE, cap)
                seconds = time.perf_counter() - begin
                error = float(np.abs(result.radiosity - exact).max() / exact.max())
                yield (name, len(exact), reflectance, solver, f"{result.products:.4g}", f"{seconds:.3g}",
                       f"{result.residuals[-1]:.3g}", f"{error:.3g}")


def write(path: Path, side: int, cap: int, reflectances: tuple[float, ...] = REFLECTANCES) -> None:
    """Measure, and write the CSV."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file)
        table.writerow(COLUMNS)
        table.writerows(rows(side, cap, reflectances))


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--output", type=Path, default=Path("out/linear.csv"))
    parser.add_argument("--side", type=int, default=8, help="squares along a wall")
    parser.add_argument("--cap", type=int, default=1000, help="the most products a solver gets")
    arguments = parser.parse_args()
    write(arguments.output, arguments.side, arguments.cap)


if __name__ == "__main__":
    main()

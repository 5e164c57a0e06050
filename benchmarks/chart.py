"""Error against time, ours and Cycles', as a picture: measures the scenes (or takes measured rows) and draws them.

    python benchmarks/chart.py              measure and draw
    python benchmarks/chart.py --draw       draw docs/accuracy.csv again
"""

from __future__ import annotations

import argparse
import csv
import subprocess
import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.ticker import NullFormatter, ScalarFormatter

ROOT = Path(__file__).resolve().parents[1]
TABLE = ROOT / "docs" / "accuracy.csv"
PICTURE = ROOT / "docs" / "accuracy.png"
SCENES = ("cornell", "truck_town", "classroom")
COLOURS = dict(zip(SCENES, ("tab:red", "tab:green", "tab:blue"), strict=True))


def measure() -> None:
    """Run the comparison and gather its rows into one table."""
    errors, samples = ("--error", ".1", ".03"), ("--time-cycles", "64", "256")
    command = (sys.executable, "-m", "benchmarks.cycles.compare", *SCENES, *errors, *samples)
    subprocess.run(command, cwd=ROOT, check=True)
    lines: list[str] = []
    for scene in SCENES:
        rows = (ROOT / "out" / "benchmarks" / scene / "compare.csv").read_text().splitlines()
        lines += rows if not lines else rows[1:]
    TABLE.write_text("\n".join(lines) + "\n")


def draw() -> None:
    """One curve a program and scene; both axes logarithmic."""
    with TABLE.open(newline="") as file:
        rows = list(csv.DictReader(file))
    figure, axes = plt.subplots(figsize=(8, 5))
    for scene in SCENES:
        for program, style in (("ours", "o-"), ("cycles", "s--")):
            points = sorted((float(row["seconds"]), 100 * float(row["rms"])) for row in rows
                            if (row["scene"], row["program"]) == (scene, program))
            if points:
                axes.loglog(*zip(*points, strict=True), style, color=COLOURS[scene], label=f"{scene}, {program}")
    axes.set_xlabel("seconds (wall clock, two cores)")
    axes.set_ylabel("relative RMS error, %")
    axes.grid(True, which="both", alpha=0.3)
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter(ScalarFormatter())
        axis.set_minor_formatter(NullFormatter())
    axes.set_xticks([3, 5, 10, 20, 50])
    axes.set_yticks([1, 2, 3, 5, 10, 20])
    axes.legend(loc="center left", bbox_to_anchor=(1, 0.5))
    figure.tight_layout()
    figure.savefig(PICTURE, dpi=100)


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--draw", action="store_true", help="draw the table that is there, without measuring")
    if not parser.parse_args().draw:
        measure()
    draw()


if __name__ == "__main__":
    main()

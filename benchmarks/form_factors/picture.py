"""Error against seconds for single form factors, one curve a method, as a picture.

    python -m radiosity.benchmarks.form_factors.picture TABLE.csv PICTURE.png
"""

from __future__ import annotations

import csv
import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

from .cases import BY_NAME

# What is drawn of all the cases in the table: apart, near, far, touching, flat, and two in shadow.
SHOWN = ("P-01", "P-03", "P-04", "P-05", "P-11c", "P-14", "P-15", "P-16")
# The exact values have so many digits: what agrees better is drawn here.
FLOOR = 1e-12
# A value that is off by more than this is drawn here, at the upper edge: centroids near contact are off by 3,000.
CEILING = 10.0


def draw(table: Path, picture: Path) -> None:
    """Draw the table's cases; single points where a method has no knob."""
    with table.open(newline="") as file:
        rows = list(csv.DictReader(file))
    methods = list(dict.fromkeys(row["method"] for row in rows))
    colours = {method: f"C{index}" for index, method in enumerate(method for method in methods if method != "ours")}
    figure, axes = plt.subplots(2, 4, figsize=(16, 8), sharex=True, sharey=True, layout="constrained")
    for axis, name in zip(axes.flat, SHOWN, strict=True):
        for method in methods:
            points = [(float(row["seconds"]), _bounded(float(row["relative_error"]))) for row in rows
                      if (row["case"], row["method"]) == (name, method)]
            if points:
                ours = method == "ours"
                axis.loglog(*zip(*points, strict=True), "*" if ours else "o-", label=method, zorder=3 if ours else 2,
                            color="black" if ours else colours[method], markersize=14 if ours else 4)
        axis.set_title(f"{name}: {BY_NAME[name].about}", fontsize=10)
        axis.grid(True, alpha=0.3)
        axis.set_ylim(FLOOR / 3, CEILING * 3)
    for axis in axes[-1]:
        axis.set_xlabel("seconds a pair")
    for axis in axes[:, 0]:
        axis.set_ylabel("relative error")
    handles = {label: handle for axis in axes.flat
               for handle, label in zip(*axis.get_legend_handles_labels(), strict=True)}
    figure.legend(handles.values(), handles.keys(), loc="outside right center")
    figure.savefig(picture, dpi=80)
    plt.close(figure)


def _bounded(error: float) -> float:
    # Not a number: nodes of a contour that coincide.
    return CEILING if error != error else min(max(error, FLOOR), CEILING)


if __name__ == "__main__":
    draw(Path(sys.argv[1]), Path(sys.argv[2]))

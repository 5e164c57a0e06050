"""Error against seconds for single form factors, one curve a method, as a picture.

    python -m radiosity.benchmarks.form_factors.picture TABLE.csv PICTURE.png
"""

from __future__ import annotations

import csv
import sys
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

from .cases import BY_NAME
from .methods import METHODS
from .peers import PACKAGES

# What is drawn of all the cases in the table: apart, near, far, touching, flat, and three in shadow.
SHOWN = ("P-01", "P-03", "P-04", "P-05", "P-11c", "P-14", "P-15", "P-16")
# The exact values have so many digits: what agrees better is drawn here.
FLOOR = 1e-12
# A value that is off by more than this is drawn here, at the upper edge: centroids near contact are off by 3,000.
CEILING = 10.0
NOTE = f"at the upper rim: {CEILING:g} times off and more, or no number; at the lower rim: all digits that are known"
Style = dict[str, Any]


def styles() -> dict[str, Style]:
    """How each method is drawn: ours a star, the classical methods lines, other people's programs dashed."""
    classical = [name for name in METHODS if name != "ours"]
    star: Style = {"color": "black", "marker": "*", "markersize": 15, "linestyle": "", "zorder": 3}
    drawn = {"ours": star}
    for index, name in enumerate(classical):
        drawn[name] = {"color": f"C{index}", "marker": "o", "markersize": 4}
    for index, name in enumerate(PACKAGES, len(classical)):
        drawn[name] = {"color": f"C{index}", "marker": "s", "markersize": 5, "linestyle": "--"}
    return drawn


def draw(table: Path, picture: Path) -> None:
    """Draw the table's cases; single points where a method has no knob."""
    with table.open(newline="") as file:
        rows = list(csv.DictReader(file))
    figure, axes = plt.subplots(2, 4, figsize=(16, 8), sharex=True, sharey=True, layout="constrained")
    for axis, name in zip(axes.flat, SHOWN, strict=True):
        for method, style in styles().items():
            points = [(float(row["seconds"]), _bounded(float(row["relative_error"]))) for row in rows
                      if (row["case"], row["method"]) == (name, method)]
            if points:
                axis.loglog(*zip(*points, strict=True), label=method, **style)
        axis.set_title(f"{name}: {BY_NAME[name].about}", fontsize=10)
        axis.grid(True, alpha=0.3)
        axis.set_ylim(FLOOR / 3, CEILING * 3)
    figure.supxlabel(f"seconds a pair\n({NOTE})", fontsize=11)
    figure.supylabel("relative error", fontsize=11)
    handles = {label: handle for axis in axes.flat
               for handle, label in zip(*axis.get_legend_handles_labels(), strict=True)}
    figure.legend(handles.values(), handles.keys(), loc="outside right center", fontsize=11)
    figure.savefig(picture, dpi=100)
    plt.close(figure)


def _bounded(error: float) -> float:
    # Not a number: nodes of a contour that coincide.
    return CEILING if error != error else min(max(error, FLOOR), CEILING)


if __name__ == "__main__":
    draw(Path(sys.argv[1]), Path(sys.argv[2]))

"""Baked, reference and signed error, side by side for every receiver, to look at."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.floating[Any]]

# The error's colours run from minus to plus this many times the error that was asked for.
ERROR_SPAN = 5.0
# The pictures' white, as a multiple of the scene's mean; and their gamma.
WHITE, GAMMA = 4.0, 2.2


def write_sheet(
    path: Path,
    title: str,
    baked: dict[str, Float],
    reference: dict[str, Float],
    counted: dict[str, NDArray[np.bool_]],
    squares: dict[str, int],
    mean: float,
    error: float,
) -> None:
    """One PNG: a row for each receiver with the bake, the reference and (bake - reference) / mean.

    Parameters
    ----------
    baked, reference : (rows, columns, 3) for each receiver.
    counted : the lumels that count; others are left grey in the third picture.
    squares : side of the part of each image that is used, pixels.
    mean : the scene's mean of the reference;  error : relative, what the colours are scaled by.
    """
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    names = list(squares)
    figure, axes = pyplot.subplots(
        len(names), 3, figsize=(12, 4 * len(names)), squeeze=False, layout="constrained", dpi=80
    )
    span = ERROR_SPAN * error
    for name, row in zip(names, axes, strict=True):
        part = (slice(0, squares[name]), slice(0, squares[name]))
        for axis, image, what in ((row[0], baked[name], "baked"), (row[1], reference[name], "reference")):
            shown = np.clip(image[part] / (WHITE * mean), 0, 1) ** (1 / GAMMA)
            axis.imshow(shown, origin="lower", interpolation="nearest")
            axis.set_title(f"{name}: {what}", fontsize=9)
        signed = (baked[name] - reference[name])[part].mean(axis=2) / mean
        signed = np.ma.masked_where(~counted[name][part], signed)
        shown = row[2].imshow(signed, origin="lower", interpolation="nearest", cmap="RdBu_r", vmin=-span, vmax=span)
        row[2].set_facecolor("0.7")
        row[2].set_title("(baked - reference) / scene's mean", fontsize=9)
        figure.colorbar(shown, ax=row[2], shrink=0.8)
    for axis in axes.flat:
        axis.set_xticks([])
        axis.set_yticks([])
    figure.suptitle(title)
    figure.savefig(path)
    pyplot.close(figure)

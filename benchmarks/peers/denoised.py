"""Cycles' bakes and a denoiser on the lightmap: what people do when they have no time for samples."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..cycles.reference import CyclesBake
from . import oidn

Float = NDArray[np.floating[Any]]


def denoisers() -> dict[str, oidn.Denoiser]:
    """The curves' names and the denoisers behind them, those that are at hand."""
    both = {"cycles + oidn lightmap": oidn.lightmap(), "cycles + oidn": oidn.blenders()}
    return {name: denoiser for name, denoiser in both.items() if denoiser is not None}


def denoised(
    denoiser: oidn.Denoiser, bake: CyclesBake, squares: dict[str, int]
) -> tuple[dict[str, Float], float, float]:
    """A bake's lightmaps without their noise, receiver by receiver, and the seconds that took: wall clock, CPU.

    Parameters
    ----------
    squares : side of the part of each image that is used, pixels; only that part is denoised.

    The gaps between charts are filled first, without which their black bleeds in; that time counts, too.
    """
    names = list(squares)
    parts = [(slice(0, squares[name]), slice(0, squares[name])) for name in names]
    wall, cpu = time.perf_counter(), time.process_time()
    noisy = [oidn.filled(bake.radiance[n][part], bake.covered[n][part]) for n, part in zip(names, parts, strict=True)]
    clean = oidn.denoise(denoiser, noisy)
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    radiance = {name: np.array(bake.radiance[name]) for name in names}
    for name, part, image in zip(names, parts, clean, strict=True):
        radiance[name][part] = np.where(bake.covered[name][part][..., None], image, 0)
    return radiance, wall, cpu

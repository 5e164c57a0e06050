"""The words of a bake, the same in the panel, on the command line, in the library and in the report."""

from __future__ import annotations

import math
import os
from dataclasses import asdict, dataclass
from numbers import Integral, Real
from typing import Any

from .errors import SettingsError

PRESETS = {"draft": 0.10, "medium": 0.03, "high": 0.01, "reference": 0.003}
TARGETS = ("lightmap", "vertex")
ATLASES = ("object", "shared")
QUANTITIES = ("radiance", "irradiance", "illuminance", "radiosity")
PASSES = ("both", "direct", "indirect")

# Largest side of an image that is made (a page of 16,384 x 16,384 x RGB float32 is 3.2 GB).
MAX_RESOLUTION = 16384
# What a lightmap gets when neither resolution nor texel density is asked for, pixels.
DEFAULT_PAGE = 1024


@dataclass(frozen=True)
class Settings:
    """What to bake, and how well.

    Parameters
    ----------
    target : "lightmap" or "vertex" (a colour attribute on the mesh corners).
    error : wanted relative RMS error of the baked light, a fraction (.03 = 3 %).
    uv_layer : name of an existing UV map to use as it is; None makes `UVMap_Lightmap`.
    resolution : pixels a side of each image; None sizes images by `texel_density`.
    texel_density : pixels per metre; None chooses a density that fills `max_pages` pages of 1,024 pixels.
    max_pages : most pages that a shared atlas may have.
    atlas : "shared" pages, or one image an "object"; None means shared, and object with `uv_layer`.
    quantity : "radiance" (E / pi), "irradiance" (W/m2), "illuminance" (lux) or "radiosity" (W/m2).
    passes : "both", "direct" or "indirect".
    only : names of the objects to bake; empty bakes all. All others still block, reflect and emit.
    footprint : part of a texel, each way, that a lumel is the mean of (.5, as Cycles).
    margin : texels of dilation.
    seed : same input and seed give the same bits, whatever the number of threads.
    threads : worker threads; 0 uses all cores.

    Raises
    ------
    SettingsError
        On a value that makes no sense; the message names the word, the value and what is allowed.
    """

    target: str = "lightmap"
    error: float = PRESETS["medium"]
    uv_layer: str | None = None
    resolution: int | None = None
    texel_density: float | None = None
    max_pages: int = 1
    atlas: str | None = None
    quantity: str = "radiance"
    passes: str = "both"
    only: tuple[str, ...] = ()
    footprint: float = 0.5
    margin: int = 16
    seed: int = 0
    threads: int = 0

    def __post_init__(self) -> None:
        _one_of("target", self.target, TARGETS)
        _one_of("quantity", self.quantity, QUANTITIES)
        _one_of("passes", self.passes, PASSES)
        if self.atlas is not None:
            _one_of("atlas", self.atlas, ATLASES)
        put = lambda word, value: object.__setattr__(self, word, value)  # noqa: E731
        put("error", _within("error", self.error, 1e-4, 1.0))
        put("footprint", _within("footprint", self.footprint, 0.0, 1.0))
        for word, most in (("margin", 256), ("threads", 1024), ("seed", 2**32 - 1)):
            put(word, _whole(word, getattr(self, word), 0, most))
        put("max_pages", _whole("max_pages", self.max_pages, 1, 1024))
        if self.resolution is not None:
            put("resolution", _whole("resolution", self.resolution, 4, MAX_RESOLUTION))
        if self.texel_density is not None:
            put("texel_density", _within("texel_density", self.texel_density, 1e-6, 1e6))
        if self.resolution is not None and self.texel_density is not None:
            raise SettingsError("resolution and texel_density are both set: keep one of the two")
        if isinstance(self.only, str):
            raise SettingsError(f"only is {self.only!r}: give a list of names")
        put("only", tuple(self.only))

    @property
    def thread_count(self) -> int:
        """Worker threads to start."""
        return self.threads or os.cpu_count() or 1

    @property
    def effective_atlas(self) -> str:
        """One image an object where the user's own UV map is used, shared pages otherwise, unless asked."""
        return self.atlas or ("object" if self.uv_layer else "shared")

    def as_dict(self) -> dict[str, Any]:
        """The settings as they stand in report.json."""
        return {**asdict(self), "only": list(self.only), "atlas": self.effective_atlas}


def _one_of(word: str, value: str, allowed: tuple[str, ...]) -> None:
    if value not in allowed:
        raise SettingsError(f"{word} is {value!r}: use one of {', '.join(allowed)}")


def _within(word: str, value: Any, low: float, high: float) -> float:
    if not (isinstance(value, Real) and math.isfinite(value) and low <= float(value) <= high):
        raise SettingsError(f"{word} is {value!r}: use a number from {low:g} to {high:g}")
    return float(value)


def _whole(word: str, value: Any, low: int, high: int) -> int:
    if isinstance(value, bool) or not (isinstance(value, Integral) and low <= int(value) <= high):
        raise SettingsError(f"{word} is {value!r}: use a whole number from {low} to {high}")
    return int(value)

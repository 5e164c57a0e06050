"""Light groups as layers of an EXR file beside each image: they add up to it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..solver.groups import shown
from ..solver.mixing import Layer
from ..solver.quantities import header
from ..solver.result import Bake
from ..solver.settings import Settings
from .baked_images import write_marked

Float = NDArray[np.floating[Any]]

# What new reflectances change, beside the groups, which have the light of those that were baked.
REFLECTANCE = "Reflectance"
# What the file is called after its image.
SUFFIX = "_groups"


def write(path: Path, bake: Bake, number: int, settings: Settings, origin: Mapping[str, str | float]) -> None:
    """Write the file of one lightmap; `origin` goes into its header.

    Raises
    ------
    OutputError
        If it can't be written.
    """
    layers = {name: shown(_values(parts[number]) * bake.groups.tints[name], settings.quantity)
              for name, parts in bake.groups.layers.items()}
    if "recoloured" in bake.report:
        layers[REFLECTANCE] = bake.lightmaps[number].pixels - sum_of(layers)
    write_marked(path, sum_of(layers), {**header(settings, bake.report), **origin}, layers)


def sum_of(layers: dict[str, Float]) -> Float:
    """All layers together."""
    return np.asarray(sum(layers.values()), np.float32)


def _values(layer: Any) -> Float:
    return layer.values() if isinstance(layer, Layer) else layer

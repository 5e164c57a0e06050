"""Light groups as layers of an EXR file beside each image: they add up to it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..solver.groups import shown
from ..solver.mixing import Layer
from ..solver.quantities import header
from ..solver.result import Bake
from . import baked_images
from .report import relative_to_report
from .request import Request

Float = NDArray[np.floating[Any]]

# What new reflectances change, beside the groups, which have the light of those that were baked.
REFLECTANCE = "Reflectance"
# What the file is called after its image.
SUFFIX = "_groups"


def write_group_files(bake: Bake, request: Request, outputs: list[dict[str, Any]]) -> list[Path]:
    """Write one file an image into the output folder and name it in the report's outputs; none without a folder.

    Raises
    ------
    OutputError
        If a file can't be written.
    """
    if request.output is None or not bake.groups.layers:
        return []
    settings, taken = request.settings, set[Path]()
    paths = []
    for number, page in enumerate(bake.lightmaps):
        layers = {name: shown(_values(parts[number]) * bake.groups.tints[name], settings.quantity)
                  for name, parts in bake.groups.layers.items()}
        about = {**header(settings, bake.report), "software": "Radiosity Lightmaps"}
        if "recoloured" in bake.report:
            layers[REFLECTANCE] = page.pixels - sum_of(layers)
        path = baked_images.write_file(request.output, page.name + SUFFIX, sum_of(layers), about, taken, layers)
        paths.append(path)
        for entry in outputs:
            if entry["object"] in page.surfaces:
                entry["groups"] = relative_to_report(path, request.report_path)
    return paths


def sum_of(layers: dict[str, Float]) -> Float:
    """All layers together."""
    return np.asarray(sum(layers.values()), np.float32)


def _values(layer: Any) -> Float:
    return layer.values() if isinstance(layer, Layer) else layer

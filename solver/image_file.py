"""Lightmaps as OpenEXR files: linear float pixels, what they mean in the header, light groups as named layers.

The only file that imports OpenEXR. Everywhere in the solver row 0 of an image is v = 0, the bottom; a file's first
row is the top, as OpenEXR and Blender have it, so rows are turned over here and nowhere else.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .errors import OutputError
from .whole_file import reason, whole_file

Float = NDArray[np.floating[Any]]

CHANNELS = "RGB"
# Blender reads channels as layer.pass.letter; without a pass it takes a name for the pass of a layer without a name.
PASS = ".Combined"
# What OpenEXR itself puts into a header: not to be given, and not returned, as an attribute of ours.
RESERVED = frozenset({
    "channels", "compression", "dataWindow", "displayWindow", "lineOrder", "pixelAspectRatio", "screenWindowCenter",
    "screenWindowWidth", "type", "name", "version", "chunkCount", "tiles",
})
# Largest half float; values above it become infinite when stored as half.
HALF_MAX = 65504.0


def write_exr(path: str | os.PathLike[str], pixels: Float, header: Mapping[str, str | float] | None = None, *,
              layers: Mapping[str, Float] | None = None, half: bool = False) -> None:
    """Write one image, and light groups beside it as layers, losslessly compressed.

    The file appears whole or not at all: it is written beside its name and then moved there.

    Parameters
    ----------
    path : of the file; its folder must exist.
    pixels : (height, width, 3), row 0 at the bottom; stored as float32.
    header : attributes for the reader, text or numbers (quantity, unit ...).
    layers : more images of the same shape, by name; stored as the channels `name.Combined.R`, G, B, which
        Blender shows as a render layer of that name.
    half : store 16-bit floats, half the size, three digits; values above 65,504 are held there.

    Raises
    ------
    OutputError
        If the file can't be written, or the pixels or attributes can't be stored.
    """
    path = Path(path)
    channels = _to_channels(path, pixels, layers or {}, half)
    attributes = _attributes(path, header or {})
    if not os.path.isdir(path.parent):
        raise OutputError(f"{path}: the folder {path.parent} does not exist: make it, or choose another")
    if os.path.isdir(path):
        raise OutputError(f"{path} is a folder: give the name of a file")
    with whole_file(path) as beside:
        _write(beside, attributes, channels)


def read_exr(path: str | os.PathLike[str]) -> Float:
    """The image of a file, (height, width, 3) float32, row 0 at the bottom.

    Raises
    ------
    OutputError
        If the file can't be read or holds no R, G, B.
    """
    layers, _ = read_layers(path)
    if "" not in layers:
        raise OutputError(f"{path} has no channels R, G, B, but layers {', '.join(sorted(layers)) or 'none'}")
    return layers[""]


def read_layers(path: str | os.PathLike[str]) -> tuple[dict[str, Float], dict[str, str | float]]:
    """All images of a file by name ("" is the one without), and its attributes.

    Raises
    ------
    OutputError
        If the file can't be read.
    """
    import OpenEXR

    path = Path(path)
    if not os.path.isfile(path):
        raise OutputError(f"{path} does not exist: check the name")
    try:
        with OpenEXR.File(str(path), separate_channels=True) as file:
            channels = {name: np.array(channel.pixels) for name, channel in file.channels().items()}
            header = {name: value for name, value in file.header().items() if name not in RESERVED}
    except (OSError, RuntimeError) as cause:
        raise OutputError(f"{path} can't be read as an OpenEXR image ({str(cause).strip()}): bake it again") from cause
    return _from_channels(channels), {n: v for n, v in header.items() if isinstance(v, str | int | float)}


def _to_channels(path: Path, pixels: Float, layers: Mapping[str, Float], half: bool) -> dict[str, Float]:
    """Every image as three planes, first row on top."""
    shape = np.shape(pixels)
    channels = {}
    for name, image in {"": pixels, **layers}.items():
        if np.ndim(image) != 3 or np.shape(image) != (*shape[:2], 3) or 0 in shape:
            raise OutputError(f"{path}: layer {name!r} has shape {np.shape(image)}, not ({shape[0]}, {shape[1]}, 3)")
        stored = np.clip(image, -HALF_MAX, HALF_MAX).astype(np.float16) if half else np.asarray(image, np.float32)
        for index, letter in enumerate(CHANNELS):
            full_name = f"{name}{PASS}.{letter}" if name else letter
            channels[full_name] = np.ascontiguousarray(stored[::-1, :, index])
    return channels


def _from_channels(channels: Mapping[str, Float]) -> dict[str, Float]:
    """Planes joined to images by layer name; a plane that belongs to no whole R, G, B is left out."""
    names = {full.rpartition(".")[0] for full in channels}
    layers = {}
    for name in sorted(names):
        planes = [channels.get(f"{name}.{letter}" if name else letter) for letter in CHANNELS]
        if all(plane is not None for plane in planes):
            layers[name.removesuffix(PASS)] = np.stack(planes, axis=-1)[::-1].astype(np.float32)  # type: ignore[arg-type]
    return layers


def _attributes(path: Path, header: Mapping[str, str | float]) -> dict[str, str | float]:
    for name, value in header.items():
        if name in RESERVED or not isinstance(value, str | int | float):
            raise OutputError(f"{path}: {name!r} = {value!r} can't be an attribute: give text or a number, other name")
    return {name: value if isinstance(value, str) else float(value) for name, value in header.items()}


def _write(path: Path, attributes: Mapping[str, str | float], channels: Mapping[str, Float]) -> None:
    import OpenEXR

    with open(path, "wb"):
        pass  # a full disk or a missing right shows here, with the system's own words
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage, **attributes}
    try:
        OpenEXR.File(header, dict(channels)).write(str(path))
    except (RuntimeError, ValueError, TypeError, MemoryError) as cause:
        raise OSError(reason(cause)) from cause

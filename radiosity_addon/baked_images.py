"""Lightmaps as EXR files and as Blender images, which never take the place of what is not ours."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ..solver.quantities import PREFIX
from .exr_writer import has_attribute, text_attribute, write_exr
from .names import block_name, file_stem

Float = NDArray[np.floating[Any]]

# Custom property of all that we make in a .blend, and attribute of all files that we write.
MARK = "radiosity_lightmaps"
# Attributes of the files of a bake: its .blend and the one saved with it, relative to the file's folder, and the
# objects, with commas between.
BLEND, SAVED, OBJECTS = f"{PREFIX}blend", f"{PREFIX}saved", f"{PREFIX}objects"
# What tells layouts apart, an attribute of a file; and custom property of the image that shows it.
LAYOUT = f"{PREFIX}layout"
BETWEEN = ", "


def is_our_file(path: Path) -> bool:
    """Whether we wrote an image file."""
    return has_attribute(path, MARK)


def write_file(folder: Path, name: str, pixels: Float, header: dict[str, str | float], taken: set[str]) -> Path:
    """Write `name`.exr into the folder; `name`_2.exr and so on where such a file is not ours, or was just written.

    Raises
    ------
    OutputError
        If it can't be written.
    """
    path = free_path(folder, name, taken)
    write_marked(path, pixels, header)
    return path


def free_path(folder: Path, name: str, taken: set[str],
              may_replace: Callable[[Path], bool] = is_our_file) -> Path:
    """Where `write_file` writes, or with another word on what it may replace; it is `taken` from then on."""
    stem = file_stem(name) or "Lightmap"
    path, number = folder / f"{stem}.exr", 1
    while place_of(path) in taken or (path.exists() and not may_replace(path)):
        number += 1
        path = folder / f"{stem}_{number}.exr"
    taken.add(place_of(path))
    return path


def place_of(path: Path) -> str:
    """A path as it is compared with others, however it is written: on Windows and macOS case makes no difference."""
    return os.path.realpath(path).casefold()


def write_marked(path: Path, pixels: Float, header: dict[str, str | float],
                 layers: Mapping[str, Float] | None = None) -> None:
    """Write a file that we know as ours.

    Raises
    ------
    OutputError
        If it can't be written.
    """
    write_exr(path, pixels, {**header, MARK: 1.0}, layers)


def linked_image(name: str, path: Path, blend: str, *, pack: bool) -> Any:
    """A Blender image of the file: relative to the .blend where that is possible, packed if asked."""
    image = _loaded(name, path)
    if pack:
        image.pack()
    image.filepath = _relative(path, blend)
    image[LAYOUT] = text_attribute(path, LAYOUT)
    return image


def packed_image(name: str, path: Path) -> Any:
    """A Blender image that lives in the .blend alone, as the EXR file that it would be outside."""
    image = _loaded(name, path)
    # Packs the file's own bytes, 32 bit floats; an image filled through `pixels` would be packed by way of 16.
    image.pack()
    image.filepath = f"//{file_stem(name)}.exr"
    return image


def _loaded(name: str, path: Path) -> Any:
    """Load a file as an image called `name`; an image of ours with that name goes, a user's stays."""
    image = bpy.data.images.load(str(path), check_existing=False)
    image.colorspace_settings.name = "Linear Rec.709"
    image[MARK] = True
    image.use_fake_user = True
    name = block_name(name)
    old = bpy.data.images.get(name)
    if old is not None and old.library is None and MARK in old:
        old.user_remap(image)
        bpy.data.images.remove(old)
    image.name = name
    return image


def _relative(path: Path, blend: str) -> str:
    if not blend:
        return str(path)
    try:
        return str(bpy.path.relpath(str(path)))
    except ValueError:
        return str(path)  # another drive

"""The files of a result, written whole beside their places by whichever thread, and put there by Blender's.

    images      one EXR file a lightmap
    layers      one EXR file a lightmap with the light groups, where they are asked for
    groups      what a relight needs (`cache`), where it is kept
"""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..solver.errors import OutputError
from ..solver.quantities import header
from ..solver.result import Bake, Lightmap
from ..solver.whole_file import reason
from . import baked_images, group_files
from .claims import Claims
from .digest import digest
from .report import relative_path
from .request import Request

# Characters of the objects' names in a header, so that its own mark stays where `is_our_file` looks for it.
MOST_NAMES = 16384


@dataclass(frozen=True)
class Staged:
    """Files on their way.

    folder : holds them; it goes with `close`.
    images, layers : in the order of the lightmaps; `layers` may be empty.
    """

    folder: Path
    images: tuple[Path, ...]
    layers: tuple[Path, ...]

    def place(self, names: Sequence[str], output: Path, claims: Claims) -> tuple[list[Path], list[Path]]:
        """Put all files into the output folder: paths of images and of layers, in the order of the lightmaps.

        Parameters
        ----------
        names : of the images.
        claims : what may be replaced.

        Raises
        ------
        OutputError
            If that can't be done.
        """
        def placed(file: Path, name: str) -> Path:
            return _moved(file, baked_images.free_path(output, name, claims.taken, claims.may_replace))

        images = [placed(file, name) for file, name in zip(self.images, names, strict=True)]
        layers = [placed(file, name + group_files.SUFFIX)
                  for file, name in zip(self.layers, names, strict=bool(self.layers))]
        return images, layers

    def close(self) -> None:
        """What was not put anywhere goes."""
        shutil.rmtree(self.folder, ignore_errors=True)


def stage(bake: Bake, request: Request, blend: str) -> Staged:
    """Write the images of a bake of a .blend, "" if it was never saved; touches no bpy.

    Raises
    ------
    OutputError
        If a file can't be written.
    """
    folder = _folder(request.output)
    try:
        images = tuple(folder / f"image_{number}.exr" for number in range(len(bake.lightmaps)))
        for number, (page, path) in enumerate(zip(bake.lightmaps, images, strict=True)):
            baked_images.write_marked(path, page.pixels, {
                **_header(bake, page, request, blend), baked_images.LAYOUT: _layout(bake, number, request)})
        layers: tuple[Path, ...] = ()
        if request.group_layers and request.output is not None and bake.groups.layers:
            layers = tuple(folder / f"layers_{number}.exr" for number in range(len(bake.lightmaps)))
            for number, path in enumerate(layers):
                group_files.write(path, bake, number, request.settings, _origin(request, blend))
    except BaseException:
        shutil.rmtree(folder, ignore_errors=True)
        raise
    return Staged(folder, images, layers)


def _folder(output: Path | None) -> Path:
    """A folder of our own, on the same disk as the places that the files will go to."""
    try:
        return Path(tempfile.mkdtemp(prefix=".radiosity-", dir=output))
    except OSError as cause:
        raise OutputError(f"folder {output} can't be written to ({reason(cause)}): "
                          "change its rights or choose another folder") from cause


def _moved(file: Path, path: Path) -> Path:
    try:
        os.replace(file, path)
    except OSError as cause:
        raise OutputError(f"{path} can't be written ({reason(cause)}): check the folder's rights and space") from cause
    return path


def _header(bake: Bake, lightmap: Lightmap, request: Request, blend: str) -> dict[str, str | float]:
    """What a file says of its numbers, which objects it holds, and where it comes from."""
    return {**header(request.settings, bake.report), **_origin(request, blend),
            baked_images.OBJECTS: baked_images.BETWEEN.join(lightmap.surfaces)[:MOST_NAMES]}


def _layout(bake: Bake, number: int, request: Request) -> str:
    """A sum of what lies where on a page, and of what its numbers mean."""
    uv = [bake.uv[index] for index in np.flatnonzero(bake.page_of_surface == number)]
    return digest(request.settings.quantity, *(layout for layout in uv if layout is not None))


def _origin(request: Request, blend: str) -> dict[str, str | float]:
    """The program, and of a file in the output folder its .blend and the one that is saved with the bake."""
    told: dict[str, str | float] = {"software": "Radiosity Lightmaps"}
    if request.output is not None:
        blends = {baked_images.BLEND: blend, baked_images.SAVED: request.save}
        told.update({name: relative_path(Path(path), request.output) for name, path in blends.items() if path})
    return told

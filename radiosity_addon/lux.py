"""Illuminance of baked surfaces: minimum, mean, maximum and uniformity, read from their lightmaps or vertex colours."""

from __future__ import annotations

import csv
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..solver.errors import NothingToBake
from ..solver.quantities import photometric
from ..solver.raster import rasterise
from ..solver.whole_file import whole_file
from . import false_colour
from .baked_light import TO_RADIANCE
from .mesh_arrays import read, read_uv
from .results import Result, results

Float = NDArray[np.floating[Any]]

COLUMNS = ("name", "minimum lx", "mean lx", "maximum lx", "uniformity", "area m2")


@dataclass(frozen=True)
class Row:
    """Illuminance over an area, lx and m2."""

    name: str
    minimum: float
    mean: float
    maximum: float
    area: float

    @property
    def uniformity(self) -> float:
        """Minimum over mean (EN 12464-1)."""
        return self.minimum / self.mean if self.mean > 0 else 0.0

    @classmethod
    def of(cls, name: str, lux: Float, area: Float) -> Row:
        """From values (n,) and the areas (n,) that they stand for."""
        total = float(area.sum(dtype=np.float64))
        mean = float((lux.astype(np.float64) * area).sum() / total) if total > 0 else 0.0
        return cls(name, float(lux.min(initial=np.inf)), mean, float(lux.max(initial=0)), total)


def illuminance(stored: Float, quantity: str) -> Float:
    """Values (..., 3) of a lightmap as illuminance (...), lx."""
    # TO_RADIANCE leads to E / pi.
    return np.asarray(photometric(stored) * (np.pi * TO_RADIANCE[quantity]), np.float32)


def measure(scene: Any, depsgraph: Any) -> list[Row]:
    """A row for each baked object of a scene.

    Raises
    ------
    NothingToBake
        If no object holds a bake that tells of illuminance.
    """
    images: dict[tuple[str, str], Float] = {}
    rows = []
    for result in results(scene):
        if result.quantity == "radiosity":
            continue
        lux, area = _values(result, depsgraph, images)
        if len(lux):
            rows.append(Row.of(result.item.name, lux, area))
    if not rows:
        raise NothingToBake("no object holds a bake that tells of lux: bake radiance, irradiance or illuminance")
    return rows


def keep(scene: Any, rows: Iterable[Row], *, surfaces: bool) -> None:
    """Put rows into the scene's table: of all surfaces in place of older ones, or a plane in place of its like."""
    view = scene.radiosity_view
    new = list(rows)
    planes = [] if not surfaces else [_row(row) for row in view.rows if row.name not in scene.objects]
    old = [] if surfaces else [_row(row) for row in view.rows if row.name not in {row.name for row in new}]
    view.rows.clear()
    for row in (*old, *new, *planes):
        line = view.rows.add()
        for name in ("name", "minimum", "mean", "maximum", "area"):
            setattr(line, name, getattr(row, name))
    fit_scale(view)


def fit_scale(view: Any) -> None:
    """Let the scale hold the values of the table but for a few bright spots, or what the user asks for."""
    if view.automatic:
        area = sum(row.area for row in view.rows)
        mean = sum(row.mean * row.area for row in view.rows) / area if area > 0 else 1.0
        top = max((row.maximum for row in view.rows), default=1.0)
        low, high = 0.0, false_colour.nice_top(min(top, false_colour.SPAN * mean))
    else:
        low, high = view.low, max(view.high, view.low * 1.001 + 1e-9)
    view.scale_low, view.scale_high, view.scale_title = low, high, "Illuminance, lx"
    view.scale_step = false_colour.nice_step(high - low)
    false_colour.set_scale(low, high, view.scale_step)


def write_csv(path: Path, rows: Iterable[Any]) -> None:
    """Write a table, whole or not at all.

    Raises
    ------
    OutputError
        If it can't be written.
    """
    with whole_file(path) as beside:
        path.parent.mkdir(parents=True, exist_ok=True)
        with beside.open("w", newline="", encoding="utf-8") as file:
            table = csv.writer(file)
            table.writerow(COLUMNS)
            for row in rows:
                table.writerow([row.name, *(f"{value:.6g}" for value in (
                    row.minimum, row.mean, row.maximum, row.uniformity, row.area))])


def _row(line: Any) -> Row:
    return Row(line.name, line.minimum, line.mean, line.maximum, line.area)


def _values(result: Result, depsgraph: Any, images: dict[tuple[str, str], Float]) -> tuple[Float, Float]:
    """Illuminance (n,) lx of the lumels or corners of an object, and the area (n,) m2 of each."""
    shown = result.item.evaluated_get(depsgraph)
    mesh = shown.to_mesh()
    try:
        mesh.calc_loop_triangles()
        corners = read(mesh.loop_triangles, "loops", np.int32, 3)
        vertices = read(mesh.loop_triangles, "vertices", np.int32, 3)
        matrix = np.array(shown.matrix_world, np.float64)
        place = (read(mesh.vertices, "co", np.float32, 3) @ matrix[:3, :3].T)[vertices]
        area = np.linalg.norm(np.cross(place[:, 1] - place[:, 0], place[:, 2] - place[:, 0]), axis=1) / 2
        if result.target == "vertex":
            attribute = mesh.color_attributes.get(result.layer)
            if attribute is None or attribute.domain != "CORNER":
                return np.empty(0, np.float32), np.empty(0)
            colours = read(attribute.data, "color", np.float32, 4)[:, :3]
            return illuminance(colours, result.quantity)[corners].reshape(-1), np.repeat(area / 3, 3)
        if result.layer not in mesh.uv_layers:
            return np.empty(0, np.float32), np.empty(0)
        return _texels(_pixels(result, images), read_uv(mesh, result.layer)[corners], area)
    finally:
        shown.to_mesh_clear()


def _texels(lux: Float, uv: Float, area: Float) -> tuple[Float, Float]:
    """Values and areas of the texels whose centres lie in triangles; a triangle without one counts by its middle's."""
    height, width = lux.shape
    owner = rasterise(uv, width, height).owner
    texel = np.flatnonzero(owner >= 0)
    number = np.bincount(owner[texel], minlength=len(area))
    small = np.flatnonzero((number == 0) & (area > 0))
    middle = (uv[small].mean(axis=1) * (width, height)).astype(np.int64)
    column, row = (np.clip(middle[:, axis], 0, size - 1) for axis, size in ((0, width), (1, height)))
    flat = lux.reshape(-1)
    return (np.concatenate([flat[texel], flat[row * width + column]]),
            np.concatenate([(area / np.maximum(number, 1))[owner[texel]], area[small]]))


def _pixels(result: Result, images: dict[tuple[str, str], Float]) -> Float:
    """(height, width) illuminance of a result's image, lx."""
    image = result.image
    key = (image.name_full, result.quantity)
    if key not in images:
        if not image.has_data and not len(image.pixels):
            raise NothingToBake(f"image {image.name!r} can't be read from {image.filepath}: bake again")
        stored = np.empty(len(image.pixels), np.float32)
        image.pixels.foreach_get(stored)
        images[key] = illuminance(stored.reshape(image.size[1], image.size[0], image.channels)[:, :, :3],
                                  result.quantity)
    return images[key]

"""Illuminance on a working plane: a grid of points over the floor that look up, measured by the solver.

Points inside furniture or walls are left out: those without light, and dim ones that see mostly backs of faces. Backs
alone say little, for normals of rooms are often flipped.
"""

from __future__ import annotations

import threading
from dataclasses import dataclass, replace
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ..solver.bake import irradiance
from ..solver.errors import NothingToBake, SettingsError
from ..solver.inside import sees_backs
from ..solver.quantities import photometric
from ..solver.scene import Scene
from . import false_colour, leaks
from .baked_light import VIEW_MARK
from .binding import Binding
from .export import export_parts
from .job import Job
from .lux import Row, keep
from .parts import WINDOW_PART, Parts
from .request import Request
from .settings import settings_of
from .view_settings import LUX

Float = NDArray[np.floating[Any]]

NAME = "Radiosity Working Plane"
MOST_POINTS = 2**18
# Points with less than this part of the median are inside something.
DARK = 1e-4
# So are those with less than this part of it that see more than this part of backs.
DIM, BACKS = 0.1, 0.5


@dataclass(frozen=True, eq=False)
class Grid:
    """Cells of a horizontal plane: low (x, y), size of a cell (x, y), counts (columns, rows), height z; metres."""

    low: Float
    cell: Float
    count: tuple[int, int]
    z: float

    def middles(self) -> Float:
        """(columns * rows, 3) float64, row by row."""
        x, y = (self.low[axis] + (np.arange(self.count[axis]) + 0.5) * self.cell[axis] for axis in (0, 1))
        across, along = np.meshgrid(x, y)
        return np.stack([across.ravel(), along.ravel(), np.full(across.size, self.z)], axis=1)

    def corners(self, cells: NDArray[Any]) -> Float:
        """(cells, 4, 3) corners of some cells, counter-clockwise from above."""
        corner = self._corner(cells)
        return np.concatenate([self.low + corner * self.cell, np.full((len(cells), 4, 1), self.z)], axis=2)

    def at_corners(self, cells: NDArray[Any], values: Float) -> Float:
        """(cells, 4) values at the corners: the mean of the given cells that meet there."""
        corner = self._corner(cells)
        number = (corner[:, :, 1] * (self.count[0] + 1) + corner[:, :, 0]).ravel()
        total = np.bincount(number, np.repeat(values, 4)) / np.maximum(np.bincount(number), 1)
        return np.asarray(total[number].reshape(-1, 4))

    def _corner(self, cells: NDArray[Any]) -> NDArray[np.int64]:
        """(cells, 4, 2) column and row of the corners of some cells."""
        row, column = np.divmod(cells, self.count[0])
        return np.asarray(np.stack([column, row], axis=1)[:, None] + np.array([(0, 0), (1, 0), (1, 1), (0, 1)]))


def grid_over(low: Float, high: Float, z: float, spacing: float, border: float) -> Grid:
    """The grid over a rectangle (low to high, (2,) metres) without its border.

    Raises
    ------
    SettingsError
        If nothing is left, or there would be too many points.
    """
    span = np.asarray(high - low - 2 * border, np.float64)
    if not (span > 0).all():
        raise SettingsError(f"the working plane's border of {border:g} m leaves nothing of a floor of "
                            f"{high[0] - low[0]:.3g} m by {high[1] - low[1]:.3g} m: lower it, or choose another floor")
    count = np.maximum(np.round(span / spacing), 1)
    if count.prod() > MOST_POINTS:
        raise SettingsError(f"the working plane would have {count.prod():.0f} points: raise its spacing of "
                            f"{spacing:g} m, or choose a smaller floor")
    return Grid(np.asarray(low + border), span / count, (int(count[0]), int(count[1])), z)


class PlaneJob(Job):
    """Measures the plane as a bake is made: export, work in a thread, write back."""

    def __init__(self, scene: Any, view_layer: Any) -> None:
        # Vertex colours ask nothing of UV maps, which a plane does not use.
        settings = replace(settings_of(scene, {"target": "vertex", "passes": "both"}), only=())
        super().__init__(Request(settings), scene, view_layer)
        self._irradiance: Float | None = None
        self._backs: Float | None = None

    def exporting(self, part_seconds: float = WINDOW_PART) -> Parts[None]:
        """Read the scene, and lay out the points. Raises RadiosityError."""
        scene, layer = self._place()
        self._exported = yield from export_parts(scene, layer, self.request.settings, self.warnings,
                                                 part_seconds=part_seconds)
        view = scene.radiosity_view
        floor = view.floor.name if view.floor is not None else ""
        low, high = _bounds(self._exported.scene, self._exported.bindings, floor)
        z = (high[2] if floor else low[2]) + view.height
        self.grid = grid_over(low[:2], high[:2], float(z), view.spacing, view.border)
        self.progress("export", 1.0)

    def _work(self) -> None:
        assert self._exported is not None
        try:
            points = self.grid.middles()
            up = np.broadcast_to(np.array([0.0, 0.0, 1.0]), points.shape)
            self._backs = sees_backs(self._exported.scene, points)
            self._irradiance = irradiance(self._exported.scene, self.request.settings, points, up, self.progress,
                                          self._cancel.is_set)
        except BaseException as error:  # noqa: BLE001 - it is raised again in Blender's thread, by finish()
            self._failure = error

    @property
    def is_baked(self) -> bool:
        """Whether the points are measured."""
        return self._irradiance is not None

    def finishing(self) -> Parts[Row]:  # type: ignore[override]
        """Put the result into the table and the viewport. Raises what the worker raised, or RadiosityError."""
        from . import preview

        self.wait(threading.TIMEOUT_MAX)
        if self._failure is not None:
            raise self._failure
        self.refuse_cancelled()
        assert self._irradiance is not None
        assert self._backs is not None
        scene, _ = self._place()
        lux = photometric(self._irradiance)
        typical = np.median(lux[lux > 0]) if lux.any() else 1.0
        cells = np.flatnonzero((lux > DARK * typical) & ((lux > DIM * typical) | (self._backs <= BACKS)))
        if not len(cells):
            raise NothingToBake(f"no light reaches the working plane at {self.grid.z:.3g} m: "
                                "set its height and floor so that it lies in the room")
        row = Row.of(f"Plane {self.grid.z:.3g} m", lux[cells], np.full(len(cells), self.grid.cell.prod()))
        yield
        keep(scene, [row], surfaces=False)
        if scene.radiosity_view.mode != LUX:
            preview.show(scene, LUX, plane=True)
        _show(scene, self.grid, cells, lux[cells])
        return row


def _show(scene: Any, grid: Grid, cells: NDArray[Any], lux: Float) -> None:
    """Draw the plane in false colours, in place of an older one."""
    for item in [item for item in bpy.data.objects if VIEW_MARK in item and item.name.startswith(NAME)]:
        mesh = item.data
        bpy.data.objects.remove(item)
        bpy.data.meshes.remove(mesh)
    mesh = leaks.polygons(NAME, grid.corners(cells))
    values = np.asarray(grid.at_corners(cells, lux), np.float32)
    mesh.attributes.new("lux", "FLOAT", "POINT").data.foreach_set("value", values.ravel())
    view = scene.radiosity_view
    scale = false_colour.scale_group(view.scale_low, view.scale_high, view.scale_step)
    mesh.materials.append(false_colour.material_of_attribute("lux", scale))
    leaks.show_only(scene, NAME, mesh)


def _bounds(scene: Scene, bindings: tuple[Binding, ...], floor: str) -> tuple[Float, Float]:
    """The bounding box, (3,) and (3,) metres, of an object, or of all."""
    rows = [np.arange(surface.first, surface.first + surface.count)
            for surface, binding in zip(scene.surfaces, bindings, strict=True)
            if not floor or floor in (binding.object, binding.instancer)]
    triangles = np.concatenate(rows) if rows else np.empty(0, np.int64)
    if not len(triangles):
        raise SettingsError(f"the floor {floor!r} is not in renders or has no faces: choose another floor")
    corners = scene.vertices[scene.triangles[triangles]].reshape(-1, 3)
    return corners.min(axis=0), corners.max(axis=0)

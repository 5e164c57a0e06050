"""What a bake and a solve return, and the report that tells of it."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from .audit import ErrorBar
from .closure import PatchTable
from .emission_pieces import mean_exitance
from .energy import EnergyBalance
from .errors import SceneError
from .geometry import Geometry
from .groups import GroupLight
from .linear import LinearResult
from .parallel import Run
from .paths import Paths
from .scene import Scene, with_mean_texture
from .settings import Settings

if TYPE_CHECKING:
    from .transport import Transport

Float = NDArray[np.floating[Any]]

VERSION = "0.1.0"


@dataclass(frozen=True, eq=False)
class Lightmap:
    """One image: name, pixels (h, w, 3) float32 whose row 0 is the bottom (v = 0), and the objects on it.

    hidden : (h, w) bool, lumels that nobody sees, which show the light of others (`solver.unseen`); None: not known.
    """

    name: str
    pixels: Float
    surfaces: tuple[str, ...]
    hidden: NDArray[np.bool_] | None = None


@dataclass(frozen=True, eq=False)
class Bake:
    """What a bake returns.

    lightmaps : the images; empty for target "vertex".
    uv : a (count, 3, 2) float32 layout for every surface, None where it does not receive.
    page_of_surface : (surfaces,) int32 index into `lightmaps`, -1 for none.
    corner_colours : for target "vertex" a (count, 3, 3) float32 for every surface (None where it does not receive).
    report : what report.json holds, as far as the solver knows it.
    groups : the light groups' images or corner colours, each as `lightmaps` or `corner_colours` (see `solver.groups`).
    patches : figures of each patch (see `solver.closure`).
    paths : what other reflectances need (see `solver.paths`); None if it was not to be kept, or would be too large.
    """

    lightmaps: tuple[Lightmap, ...]
    uv: tuple[Float | None, ...]
    page_of_surface: NDArray[np.int32]
    corner_colours: tuple[Float | None, ...] | None
    report: dict[str, Any]
    groups: GroupLight = field(default_factory=lambda: GroupLight({}, {}))
    patches: PatchTable | None = None
    paths: Paths | None = None


@dataclass(frozen=True, eq=False)
class Solution:
    """The solution on patches, seen from the triangles.

    radiosity, irradiance : (t, 3) float32 W/m2 of each triangle's front; irradiance is all of it, direct and indirect.
    outcome : of the linear solver (see `LinearResult`).
    statistics : stages, patches, rays, residuals.
    """

    radiosity: Float
    irradiance: Float
    outcome: str
    statistics: dict[str, Any]

    @classmethod
    def of(cls, geometry: Geometry, transport: Transport, sides: NDArray[np.int64], linear: LinearResult,
           stages: Stages) -> Solution:
        """Means over `sides`, met cells on each triangle's front, some of them more than once."""
        cells, count = transport.cells, len(geometry.area)
        rows, triangle = cells.rows(sides), cells.triangle_of(sides)
        places = np.bincount(triangle, minlength=count)

        def mean(values: Float) -> Float:
            columns = [np.bincount(triangle, values[rows, axis], count) for axis in range(3)]
            return np.asarray(np.stack(columns, axis=1) / np.maximum(places, 1)[:, None], np.float32)

        indirect = np.nan_to_num(transport.irradiance)[transport.cell_patch]
        statistics = {"stages": stages.as_list(), "patches": len(transport.patches), "cells": len(cells),
                      "products": linear.products, "residuals": list(linear.residuals)}
        # Cells leave out what lamps emit, so that rays which meet a lamp don't count it twice.
        of_cells = mean(transport.met.emission)
        of_lamps = np.where(of_cells.any(axis=1, keepdims=True), np.float32(0), mean_exitance(geometry))
        radiosity = mean(transport.leaving()[:-1]) + of_lamps
        return cls(radiosity, mean(transport.met.incident + indirect), linear.outcome, statistics)


class Stages:
    """Seconds and rays of each stage of a bake."""

    def __init__(self, run: Run) -> None:
        self._run = run
        self._seconds: dict[str, float] = {}

    @contextmanager
    def __call__(self, name: str) -> Iterator[None]:
        """Time what stands inside, and count its rays."""
        self._run.check()
        self._run.stage = name
        self._run.report(0.0)
        start = time.perf_counter()
        yield
        self._seconds[name] = self._seconds.get(name, 0.0) + time.perf_counter() - start
        self._run.report(1.0)

    def as_list(self) -> list[dict[str, Any]]:
        """As report.json has them."""
        return [{"name": name, "seconds": seconds, "rays": self._run.rays.get(name, 0)}
                for name, seconds in self._seconds.items()]


def report(scene: Scene, settings: Settings, stages: Stages, lumels: int, transport: Transport, error: ErrorBar,
           balance: EnergyBalance, linear: LinearResult, warnings: list[dict[str, Any]]) -> dict[str, Any]:
    """What the solver knows of report.json."""
    listed = stages.as_list()
    return {
        "version": VERSION,
        "settings": settings.as_dict(),
        "stages": listed,
        "lumels": lumels,
        "patches": len(transport.patches),
        "cells": len(transport.cells),
        "rays": sum(stage["rays"] for stage in listed),
        "triangles": len(scene.triangles),
        "seconds": sum(stage["seconds"] for stage in listed),
        "error": {"wanted": settings.error, "estimated": asdict(error)},
        "energy": {**asdict(balance), "imbalance": balance.imbalance},
        "solver": {"outcome": linear.outcome, "products": linear.products, "residuals": list(linear.residuals)},
        "outputs": [],
        "warnings": warnings,
    }


def refuse_singular(linear: LinearResult, scene: Scene) -> None:
    """A closed scene that absorbs nothing has no solution: say so."""
    if linear.outcome != "converged":
        reflectance = with_mean_texture(scene, scene.reflectance, scene.reflectance_texture).max(axis=1)
        highest = int(np.argmax(reflectance))
        raise SceneError(f"{scene.whose(highest)} reflects {float(reflectance[highest]):.3g} of the light in a scene "
                         f"that lets none out, so that light never ends: lower the reflectance below .99 (solver: "
                         f"{linear.outcome} after {linear.products} products)")

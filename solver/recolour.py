"""Other reflectances after a bake: one solve on the patches, and no ray.

    rho'     reflectance of every kept cell, of the scene as it is now
    H'       H = q + F (rho H) with the kept rows, solved for the old reflectances and for the new
    change   of each receiver's bounced light: the mean over its kept rays of what they bring now, less what they
             brought

Both ends of the change come from the same rays, so that what did not change cancels: noise is in proportion to the
change, and the kept image, for which more rays were traced, gets that on top.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .cells import Cells
from .errors import SceneError
from .geometry import Geometry
from .linear import LinearResult
from .mixing import mix
from .parallel import Run, slices
from .paths import KeptLook, Paths, shape_of, sky_hits
from .result import refuse_singular
from .row_system import RowSystem
from .sampling import kronecker
from .scene import Scene
from .tables import mean_over_rays, padded

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]

# Points of a cell at which its reflectance is looked up.
CELL_SAMPLES = 4
# Cells, and rays, that are worked at at once.
CHUNK_CELLS, CHUNK_RAYS = 2**17, 2**20
# A reflectance of 1 as it is kept. A half float's rounding of .95 would change the light of a closed room by .5 %.
WHOLE = 2**16 - 1
# Relative residual of the linear system.
TOLERANCE = 1e-5


def bounced_change(paths: Paths, scene: Scene, factors: ArrayLike, run: Run) -> tuple[Float, ...]:
    """What other reflectances change in the bounced light of every receiver.

    Parameters
    ----------
    paths : kept by a bake.
    scene : the same scene with other reflectances or textures; its lights are not asked for.
    factors : (groups, 3), how strong each light group is now, as times the light that was kept without its tint.

    Returns
    -------
    For each kept look (n, 3) float32, W/m2; what they differ by is noise.

    Raises
    ------
    SceneError
        If rays would go other ways in this scene, or if it keeps all of its light.
    """
    if shape_of(scene) != paths.shape:
        raise SceneError("what rays can meet has changed since the bake (shape, visibility or transparency): "
                         "bake again")
    factors = np.asarray(factors, np.float64).reshape(-1, 3)
    after = reflectance_of(Geometry(scene), paths.cell_size, paths.side, run)
    old = _Light.of(paths, factors, paths.reflectance, run)
    new = _Light.of(paths, factors, after, run)
    refuse_singular(new.linear, scene)
    return tuple(_gathered(look, new, run) - _gathered(look, old, run) for look in paths.looks)


def reflectance_of(geometry: Geometry, cell_size: float, sides: NDArray[np.int64], run: Run) -> NDArray[np.uint16]:
    """(c, 3) mean reflectance of sides of cells as parts of `WHOLE`, at a few points of each; the same whenever it is
    asked.
    """
    cells, points = Cells(geometry, cell_size), kronecker(CELL_SAMPLES, 2)

    def look(part: slice) -> NDArray[np.uint16]:
        total = np.zeros((part.stop - part.start, 3), np.float32)
        for x, y in points:
            count = len(total)
            triangle, u, v, _ = cells.places(sides[part], np.full(count, x), np.full(count, y))
            total += geometry.reflectance(triangle, u, v, cells.share(sides[part], triangle))
        return np.asarray(np.rint(total * np.float32(WHOLE / CELL_SAMPLES)), np.uint16)

    # Where receivers see nothing but the sky there is no cell.
    return np.concatenate([np.empty((0, 3), np.uint16), *run.map(look, slices(len(sides), CHUNK_CELLS))])


@dataclass(frozen=True, eq=False)
class _Light:
    """All light of the cells under one set of reflectances.

    leaving, reflected : (c + 1, 4) radiosity B = E + rho H, and the part rho H of it; the last row is nothing.
    reflectance : (c + 1, 4).
    sky : (3,) what the sky's light without its tint is multiplied by.
    linear : of the patches' solution.
    """

    leaving: Float
    reflected: Float
    reflectance: Float
    sky: Float
    linear: LinearResult

    @classmethod
    def of(cls, paths: Paths, factors: Float, reflectance: NDArray[np.uint16], run: Run) -> _Light:
        """Solve the patches."""
        rho = reflectance / np.float32(WHOLE)
        direct = rho * mix(paths.incident, factors)
        direct[paths.glowing] += paths.glow * factors[paths.glow_group].astype(np.float32)
        sky = np.asarray(factors[paths.sky_group] if paths.sky_group >= 0 else np.zeros(3), np.float32)
        system = RowSystem(paths.rows, rho, paths.patch, paths.patches)
        linear = system.solve(direct, lambda rows: rows.mean_sky() * sky, TOLERANCE, run)
        reflected = rho * np.asarray(linear.value, np.float32)[paths.patch]
        return cls(padded(direct + reflected), padded(reflected), padded(rho), sky, linear)


def _gathered(look: KeptLook, light: _Light, run: Run) -> Float:
    """(n, 3) what the kept rays of each receiver bring from surfaces, W/m2."""
    rays = look.hits.shape[1]
    return np.concatenate(run.map(lambda part: mean_over_rays(_brought(look, light, part), rays),
                                  slices(len(look.hits), max(1, CHUNK_RAYS // rays))))


def _brought(look: KeptLook, light: _Light, part: slice) -> Float:
    """(rays, 4) what each ray of some receivers brings.

    A ray that goes on stands in place of its patch's irradiance: B = E + rho H becomes B + factor rho (V - H), where V
    is what it brings.
    """
    legs = _legs(look, light, part)
    for before, leg in zip(legs[-2::-1], legs[:0:-1], strict=True):
        here = before.cell[leg.parent]
        onward = np.take(light.reflectance, here, axis=0) * leg.value - np.take(light.reflected, here, axis=0)
        before.value[leg.parent] += np.float32(leg.factor) * onward
    return legs[0].value


@dataclass(frozen=True, eq=False)
class _Leg:
    """One level of some receivers' rays.

    cell : (k,) met; value : (k, 4) what would be brought if none went on; parent, factor : as in `paths.Level`, where
    parents are counted within these receivers; nothing for the first.
    """

    cell: NDArray[np.int32]
    value: Float
    parent: Int
    factor: float


def _legs(look: KeptLook, light: _Light, part: slice) -> list[_Leg]:
    """All levels of the rays of some receivers."""
    rays = look.hits.shape[1]
    cell = look.hits[part].reshape(-1)
    legs = [_Leg(cell, np.take(light.leaving, cell, axis=0), np.empty(0, np.int64), 0.0)]
    first, last = part.start * rays, part.stop * rays
    for level in look.levels:
        low, high = (int(place) for place in np.searchsorted(level.parent, (first, last)))
        cell = level.cell[low:high]
        value = np.take(light.leaving, cell, axis=0)
        if len(level.sky):
            missed = sky_hits(cell)
            before = len(sky_hits(level.cell[:low]))
            value[missed, :3] = level.sky[before:before + len(missed)] * light.sky
        legs.append(_Leg(cell, value, level.parent[low:high].astype(np.int64) - first, level.factor))
        first, last = low, high
    return legs

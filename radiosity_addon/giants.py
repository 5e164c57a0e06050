"""Plates that dwarf all else, a ground of kilometres under a town: they would take the lumels of what matters."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..solver.layout import world_areas
from ..solver.scene import Scene
from ..solver.settings import Settings
from .warn import Warnings, warn

Float = NDArray[np.floating[Any]]

# A surface is giant if it is so many times as wide as all others together, takes this part of all lumels, and is no
# thicker than this part of its width: a room is not, though it is wider than the table that stands in it.
GIANT_EXTENT, GIANT_SHARE, GIANT_THICKNESS = 4.0, 0.6, 0.05


@dataclass(frozen=True)
class Giant:
    """A giant surface: its index, its width in metres and in widths of all else, its part of the lumels, and the
    factor on its density at which it takes as many lumels as all others together.
    """

    index: int
    extent: float
    times: float
    share: float
    fair: float


def giants(scene: Scene) -> list[Giant]:
    """The giant surfaces of a scene."""
    areas = world_areas(scene)
    whole = [index for index, item in enumerate(scene.surfaces) if item.count and item.receives]
    weight = np.array([float(areas[item.triangles].sum()) * item.density**2
                       for item in (scene.surfaces[index] for index in whole)])
    boxes = np.array([_box(scene, scene.surfaces[index]) for index in whole])
    found = []
    for number, index in enumerate(whole):
        others = np.delete(boxes, number, axis=0)
        if not len(others):
            break
        sides = np.ptp(boxes[number], axis=0)
        extent = float(sides.max())
        rest = float((others[:, 1].max(axis=0) - others[:, 0].min(axis=0)).max())
        share = float(weight[number] / max(float(weight.sum()), 1e-300))
        if extent > GIANT_EXTENT * rest and share > GIANT_SHARE and sides.min() <= GIANT_THICKNESS * extent:
            fair = scene.surfaces[index].density * float(np.sqrt((1 - share) / share))
            found.append(Giant(index, extent, extent / max(rest, 1e-9), share, fair))
    return found


def with_fair_shares(scene: Scene, settings: Settings, warnings: Warnings) -> Scene:
    """The scene with giants that take half of the lumels and no more, where the user left the density to us.

    A density in pixels per metre, an own UV map, a density factor of the object or an image for each object are the
    user's word, and stand.
    """
    ours = (settings.target == "lightmap" and settings.uv_layer is None and settings.texel_density is None
            and settings.effective_atlas == "shared")
    found = giants(scene) if ours else []
    surfaces = list(scene.surfaces)
    for giant in found:
        item = surfaces[giant.index]
        if item.density != 1.0 or giant.fair <= 0:
            continue
        surfaces[giant.index] = replace(item, density=giant.fair)
        warn(warnings, item.name, "giant", f"is {giant.extent:.4g} m wide, {giant.times:.0f} times all else, and would "
             f"take {giant.share:.1%} of the lumels: it gets half of them, so that its pixels are "
             f"{1 / giant.fair:.3g} times as wide as those of others; set its density factor (object properties > "
             "Radiosity Lightmaps) to choose, exclude it, or cut off what nobody sees")
    return replace(scene, surfaces=tuple(surfaces)) if found else scene


def _box(scene: Scene, item: Any) -> Float:
    corners = scene.vertices[scene.triangles[item.triangles]]
    return np.stack([corners.min(axis=(0, 1)), corners.max(axis=(0, 1))])

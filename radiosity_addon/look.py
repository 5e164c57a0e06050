"""What the viewport shows of a bake on its way: triangles, and the light on them. Works on arrays alone."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..solver.result import Bake
from ..solver.scene import Scene, with_mean_texture
from .baked_light import TO_RADIANCE

Float = NDArray[np.float32]
Int = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Look:
    """One state of the light.

    title : what it is, for people.
    corners : (n, 3, 3) float32, the triangles in world space.
    uv : (n, 3, 2) float32, where they lie in their page.
    page : (n,) int32 index into `pages`, ascending; -1 where `colour` alone tells the light.
    colour : (n, 3, 3) float32, by which the page is multiplied at each corner; without a page, radiance.
    pages : (h, w, 3) float32 each, row 0 at the bottom.
    """

    title: str
    corners: Float
    uv: Float
    page: NDArray[np.int32]
    colour: Float
    pages: tuple[Float, ...]


def receiving_triangles(scene: Scene) -> Int:
    """(n,) the triangles of objects that are baked."""
    return np.concatenate([np.arange(surface.first, surface.first + surface.count)
                           for surface in scene.surfaces if surface.receives])


def mean_colours(scene: Scene) -> tuple[Float, Float]:
    """Reflectance, and radiance of emission, of every triangle (t, 3): textures by their mean."""
    return (with_mean_texture(scene, scene.reflectance, scene.reflectance_texture),
            with_mean_texture(scene, scene.emission, scene.emission_texture) / np.float32(np.pi))


def look_at(scene: Scene, bake: Bake, quantity: str, title: str) -> Look:
    """The light of a bake on the surfaces of its scene."""
    chosen = receiving_triangles(scene)
    reflectance, glow = mean_colours(scene)
    # Radiosity holds the surface's colour already.
    tint = np.ones_like(reflectance) if quantity == "radiosity" else reflectance
    colour = np.repeat(np.float32(TO_RADIANCE[quantity]) * tint[chosen][:, None], 3, axis=1)
    corners = np.asarray(scene.vertices[scene.triangles[chosen]], np.float32)
    surfaces = [(index, surface) for index, surface in enumerate(scene.surfaces) if surface.receives]
    uv = np.concatenate([_or_zero(bake.uv[index], surface.count, 2) for index, surface in surfaces])
    page = np.concatenate([np.full(surface.count, bake.page_of_surface[index], np.int32)
                           for index, surface in surfaces])
    if bake.corner_colours is not None:
        colour = colour * np.concatenate([_or_zero(bake.corner_colours[index], surface.count, 3)
                                          for index, surface in surfaces])
    elif (page < 0).any():
        colour[page < 0] = 0
    _glow(colour, page, uv, glow[chosen], bake)
    order = np.argsort(page, kind="stable")
    return Look(title, corners[order], uv[order], page[order], colour[order],
                tuple(item.pixels for item in bake.lightmaps))


def _glow(colour: Float, page: NDArray[np.int32], uv: Float, glow: Float, bake: Bake) -> None:
    """Add the radiance (n, 3) that triangles send out by themselves: those that do have their light at the corners."""
    for number, lightmap in enumerate(bake.lightmaps):
        here = np.flatnonzero((page == number) & glow.any(axis=1))
        height, width = lightmap.pixels.shape[:2]
        x, y = (np.clip(uv[here, :, axis] * size, 0, size - 1).astype(int) for axis, size in enumerate((width, height)))
        colour[here] *= lightmap.pixels[y, x]
        page[here] = -1
    colour += glow[:, None] * (page < 0)[:, None, None]


def _or_zero(values: Any, count: int, width: int) -> Float:
    return np.zeros((count, 3, width), np.float32) if values is None else np.asarray(values, np.float32)

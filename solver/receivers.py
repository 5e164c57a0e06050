"""Where light is wanted: positions, shading normals and footprints, whoever asks (lumels, mesh corners, probes)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.floating[Any]]


@dataclass(frozen=True, eq=False)
class Receivers:
    """Points that receive light, each the centre of a footprint on its triangle.

    Parameters
    ----------
    position : (n, 3) float32, metres, relative to `Scene.origin`.
    normal : (n, 3) float32 unit shading normals.
    triangle : (n,) int32, the scene's triangle that the point lies on; -1 for a free point (a probe).
    barycentric : (n, 2) float32, weights of the triangle's corners 1 and 2 (corner 0 has 1 - u - v), as Embree's.
    footprint : (n, 2, 2) float32, change of (u, v) along the two sides of the footprint at full size (a whole
        texel): row 0 for one texel to the right, row 1 for one texel up. The part of it that a value is the mean
        of is `Settings.footprint`; samples that fall off the triangle are drawn again, as Cycles does.
    surface : (n,) int32, the surface of the scene whose light is asked for, -1 for none; None: that of the triangle.
    texel : (n, 2) int32, column and row in an image; None for receivers that are in none.
    """

    position: Float
    normal: Float
    triangle: NDArray[np.int32]
    barycentric: Float
    footprint: Float
    surface: NDArray[np.int32] | None = None
    texel: NDArray[np.int32] | None = None

    def __len__(self) -> int:
        return len(self.position)

    def take(self, index: NDArray[Any]) -> Receivers:
        """The receivers at `index` (an index array, a mask or a slice)."""
        return Receivers(self.position[index], self.normal[index], self.triangle[index],
                         self.barycentric[index], self.footprint[index],
                         *(None if some is None else some[index] for some in (self.surface, self.texel)))


@dataclass(frozen=True)
class Page:
    """One image that is baked: its name and its size in pixels."""

    name: str
    width: int
    height: int


@dataclass(frozen=True, eq=False)
class Lumels:
    """The texels of the lightmaps that a triangle's inside covers with its centre.

    Parameters
    ----------
    receivers : one a lumel.
    surface : (n,) int32 index into `Scene.surfaces`.
    page : (n,) int32 index into `pages`.
    pixel : (n,) int64, row * width + column in that page; row 0 is at v = 0 (the bottom).
    chart : (n,) int32, the connected piece of the layout that the lumel belongs to.
    pages : the images.
    page_of_surface : (surfaces,) int32, the page each object lies on; -1 for one that does not receive.
    uv : one (count, 3, 2) float32 a surface (None for one that does not receive): the layout in its page, [0, 1]^2.
    chart_of_triangle : (t,) int32, the piece of the layout that each triangle of the scene belongs to.
    """

    receivers: Receivers
    surface: NDArray[np.int32]
    page: NDArray[np.int32]
    pixel: NDArray[np.int64]
    chart: NDArray[np.int32]
    pages: tuple[Page, ...]
    page_of_surface: NDArray[np.int32]
    uv: tuple[Float | None, ...]
    chart_of_triangle: NDArray[np.int32]

    def __len__(self) -> int:
        return len(self.pixel)

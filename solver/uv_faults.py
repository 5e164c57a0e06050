"""What is wrong with a layout that the user made: stretch, uneven density, faces without room."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .scene import Scene
from .settings import Settings

Float = NDArray[np.floating[Any]]
Warnings = list[dict[str, Any]]

# A triangle is stretched if a texel is this many times longer in space one way than the other.
STRETCHED = 4.0
# It is coarse if it has this part of the object's usual texels per metre.
COARSE = 0.25
# Parts of an object's area from which on it is told of.
TOLD = 0.05


def warn_of_distortion(scene: Scene, settings: Settings, warnings: Warnings) -> None:
    """Tell of the user's own layouts: `uv_stretch`, `uv_density`, `uv_no_area`."""
    if settings.uv_layer is None:
        return
    for item in scene.surfaces:
        if item.lightmap_uv is None or not item.receives:
            continue
        tell = lambda code, message, name=item.name: warnings.append(  # noqa: E731
            {"object": name, "code": code, "message": message})
        positions = scene.vertices[scene.triangles[item.triangles]]
        stretched, coarse, lost = distorted_parts(positions, item.lightmap_uv)
        if stretched > TOLD:
            tell("uv_stretch", f"{stretched:.0%} of its area is stretched more than {STRETCHED:g} times in UV map "
                 f"{settings.uv_layer!r}, and so are its lumels: apply the object's scale and unwrap it (UV > Unwrap)")
        if coarse > TOLD:
            tell("uv_density", f"{coarse:.0%} of its area has less than {COARSE:g} of the texels per metre that is "
                 f"usual in its UV map {settings.uv_layer!r}: even it out (UV > Average Islands Scale)")
        if lost > TOLD:
            tell("uv_no_area", f"{lost:.0%} of its area has no area in UV map {settings.uv_layer!r} and gets no "
                 "lumels: unwrap it (UV > Unwrap)")


def stretch(positions: Float, uv: Float) -> tuple[Float, Float]:
    """How a layout distorts triangles.

    Parameters
    ----------
    positions : (t, 3, 3), metres.
    uv : (t, 3, 2), the layout.

    Returns
    -------
    ratio : (t,) longest over shortest way that one unit of the layout covers in space (1 is undistorted); inf for a
        triangle without area in the layout or in space.
    density : (t,) units of the layout per metre, the root of area over area; 0 for such a triangle.

    Notes
    -----
    The singular values of the map from layout to space (Sander et al., Texture Mapping Progressive Meshes, 2001).
    """
    a, b = positions[:, 1] - positions[:, 0], positions[:, 2] - positions[:, 0]
    s, t = (np.asarray(uv[:, k] - uv[:, 0], np.float64) for k in (1, 2))
    area = s[:, 0] * t[:, 1] - s[:, 1] * t[:, 0]
    space = np.linalg.norm(np.cross(a, b), axis=1)
    # A triangle that is a line or a point in the layout or in space is flat without bound.
    ratio, density = np.full(len(uv), np.inf), np.zeros(len(uv))
    rows = np.flatnonzero((area != 0) & (space > 0))
    a, b, s, t, area = a[rows], b[rows], s[rows], t[rows], area[rows]
    along, across = (a * t[:, 1:] - b * s[:, 1:]) / area[:, None], (b * s[:, :1] - a * t[:, :1]) / area[:, None]
    one, two, both = (np.einsum("ij,ij->i", x, y) for x, y in ((along, along), (across, across), (along, across)))
    longest = np.sqrt((one + two + np.hypot(one - two, 2 * both)) / 2)
    # The singular values' product is area over area: no difference of large numbers for the small one.
    product = space[rows] / np.abs(area)
    ratio[rows], density[rows] = longest**2 / product, product**-0.5
    return ratio, density


def distorted_parts(positions: Float, uv: Float) -> tuple[float, float, float]:
    """Parts of the area, 0 to 1: of stretched triangles, of coarse ones, of those that the layout leaves no area."""
    area = np.linalg.norm(np.cross(positions[:, 1] - positions[:, 0], positions[:, 2] - positions[:, 0]), axis=1)
    whole = area.sum()
    if not whole > 0:
        return 0.0, 0.0, 0.0
    ratio, density = stretch(positions, uv)
    lost = density == 0
    order = np.argsort(density)
    usual = density[order][min(np.searchsorted(np.cumsum(area[order]), whole / 2, side="right"), len(area) - 1)]
    stretched = (ratio > STRETCHED) & ~lost
    coarse = (density < COARSE * usual) & ~lost & ~stretched
    return tuple(float(area[rows].sum() / whole) for rows in (stretched, coarse, lost))  # type: ignore[return-value]

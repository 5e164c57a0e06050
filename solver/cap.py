"""A spherical cap of constant radiance: what suns, spheres and discs that face the point look like.

The cap has half angle alpha, and its axis makes the angle theta with the surface's normal. Its irradiance is radiance
times its projected solid angle, the area that the cap (clipped at the horizon) covers when dropped on the surface's
unit disc (Nusselt 1928). Sphere lamps of radius r have sin alpha = r / d, discs that face the point tan alpha = r / d.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .sampling import frames

Float = NDArray[np.floating[Any]]

# Below this sine of the half angle a cap that the horizon cuts counts as whole or hidden: the closed form's two terms
# cancel there (their difference goes as sin^2), and the slice of the surface's orientations concerned is as thin.
SMALLEST_CUT = 1e-5


def projected_solid_angle(cosine: Float, sine_squared: Float) -> Float:
    """Projected solid angle of caps, clipped at the horizon.

    Parameters
    ----------
    cosine : (n,) cos theta, axis against the surface's normal.
    sine_squared : (n,) sin^2 alpha in [0, 1]; half angles go up to 90 degrees.

    Returns
    -------
    (n,) float32 in [0, pi].

    Notes
    -----
    Above the horizon pi sin^2(alpha) cos(theta). Where the horizon cuts it, the outline that is left projects to part
    of an ellipse and part of the unit circle, whose areas are (Snyder 1996, Area light sources for real-time
    graphics), with q = sqrt(1 - (cos theta / sin alpha)^2):
        sin^2(alpha) (cos theta arccos(-cot theta cot alpha) - q cot alpha) + arctan(q tan alpha)
    """
    cosine, sine_squared = np.broadcast_arrays(np.asarray(cosine, np.float32), np.asarray(sine_squared, np.float32))
    result = np.pi * sine_squared * np.maximum(cosine, 0)
    cut = np.flatnonzero((cosine * cosine < sine_squared) & (sine_squared > SMALLEST_CUT**2))
    if len(cut):
        result[cut] = _cut_by_horizon(cosine[cut].astype(np.float64), sine_squared[cut].astype(np.float64))
    return np.asarray(result, np.float32)


def _cut_by_horizon(cosine: Float, sine_squared: Float) -> Float:
    # float64: the terms are of the order of sin, their sum of sin^3
    sine_theta = np.sqrt(np.maximum(1 - cosine**2, np.finfo(np.float64).tiny))
    sine, cosine_alpha = np.sqrt(sine_squared), np.sqrt(np.maximum(1 - sine_squared, 0))
    q = np.sqrt(np.maximum(1 - cosine**2 / sine_squared, 0))
    along = np.clip(-cosine * cosine_alpha / (sine_theta * sine), -1, 1)
    ellipse = sine_squared * cosine * np.arccos(along) - q * sine * cosine_alpha
    return np.asarray(np.maximum(ellipse + np.arctan2(q * sine, cosine_alpha), 0))


def solid_angle(sine_squared: Float) -> Float:
    """2 pi (1 - cos alpha), without the difference that loses the digits of small caps."""
    return np.asarray(2 * np.pi * one_minus_cosine(sine_squared), np.float32)


def one_minus_cosine(sine_squared: Float) -> Float:
    """1 - cos alpha from sin^2 alpha."""
    return np.asarray(sine_squared / (1 + np.sqrt(np.maximum(1 - sine_squared, 0))))


def disc(uv: Float) -> tuple[Float, Float]:
    """Equal-area and continuous map of the unit square to the unit disc (Shirley and Chiu 1997).

    uv (n, 2) in [0, 1)^2 -> x (n,), y (n,).
    """
    a, b = 2 * uv[:, 0] - 1, 2 * uv[:, 1] - 1
    wide = np.abs(a) > np.abs(b)
    radius = np.where(wide, a, b)
    ratio = np.where(wide, b, a) / np.where(radius == 0, 1, radius)
    angle = np.where(wide, np.pi / 4 * ratio, np.pi / 2 - np.pi / 4 * ratio)
    return radius * np.cos(angle), radius * np.sin(angle)


def directions(axis: Float, sine_squared: Float, uv: Float) -> tuple[Float, Float, Float]:
    """Directions spread evenly over the caps.

    Parameters
    ----------
    axis : (n, 3) float32 unit; or (1, 3), one for all.
    sine_squared : (n,) or scalar, sin^2 alpha.
    uv : (n, 2) in [0, 1)^2.

    Returns
    -------
    direction (n, 3) float32 unit; cosine (n,) and squared sine (n,) of their angles with the axis.
    """
    x, y = disc(uv)
    height = one_minus_cosine(sine_squared) * (x * x + y * y)
    return towards(axis, sine_squared, x, y), np.asarray(1 - height), np.asarray(height * (2 - height))


def towards(axis: Float, sine_squared: Float, x: Float | float, y: Float | float) -> Float:
    """The direction (n, 3) float32 that (x, y) of the unit disc has in the cap: equal areas stay equal."""
    rise = one_minus_cosine(sine_squared)
    height = rise * (x * x + y * y)
    scale = np.sqrt(rise * (2 - height))
    tangent, bitangent = frames(axis)
    right, up, along = scale * x, scale * y, 1 - height
    # Column by column: much faster than products with rows of three.
    direction = np.empty((max(np.size(along), len(axis)), 3), np.float32)
    for column in range(3):
        direction[:, column] = tangent[:, column] * right + bitangent[:, column] * up + axis[:, column] * along
    return direction

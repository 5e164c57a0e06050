"""Nodes whose value is the same everywhere, or is here replaced by a mean: what diffuse light sees of them.

Two kinds of nodes depend on the ray and not on the surface. `Light Path` counts as for a diffuse ray, the only kind
there is here. `Fresnel` and `Layer Weight` count by their mean over the hemisphere, each direction weighted by its
cosine, as light from everywhere would meet the surface.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.floating[Any]]
Triple = tuple[float, float, float]
Known = Callable[[Any], Triple | None]

# What a Light Path node says of a diffuse ray after its first bounce; all other outputs are 0.
DIFFUSE_RAY = {"Is Diffuse Ray": 1.0, "Is Reflection Ray": 1.0, "Ray Length": 1.0, "Ray Depth": 1.0,
               "Diffuse Depth": 1.0}
VIEW_DEPENDENT = frozenset({"ShaderNodeFresnel", "ShaderNodeLayerWeight"})
# Directions of the quadrature over the hemisphere: the means are then exact to six digits.
DIRECTIONS = 4096
# Layer Weight's blend is held below this, as in Cycles, where the Fresnel term would divide by zero.
MOST_BLEND = 1 - 1e-5


def of(source: Any, known: Known) -> Triple | None:
    """The value of an output socket that is known without evaluating nodes, else None.

    Parameters
    ----------
    source : output socket, or an unlinked input with a value of its own.
    known : the same of an input of its node, linked or not.
    """
    kind = source.node.bl_idname
    if not source.is_output or kind in {"ShaderNodeRGB", "ShaderNodeValue"}:
        return triple(source.default_value)
    if kind == "ShaderNodeLightPath":
        return triple(DIFFUSE_RAY.get(source.name, 0.0))
    if kind in VIEW_DEPENDENT:
        value = known(source.node.inputs[0])
        return None if value is None else triple(mean_weight(kind, source.name, float(value[0])))
    return None


def mean_weight(kind: str, output: str, value: float) -> float:
    """Mean over the hemisphere of a Fresnel (IOR) or Layer Weight (blend) node's output."""
    if kind == "ShaderNodeFresnel":
        return mean_fresnel(value)
    blend = min(max(value, 0.0), MOST_BLEND)
    if output == "Fresnel":
        return mean_fresnel(1 / (1 - blend))
    cosine = _cosines()
    if blend != 0.5:
        cosine = cosine ** (2 * blend if blend < 0.5 else 0.5 / (1 - blend))
    return float(1 - cosine.mean())


def mean_fresnel(ior: float) -> float:
    """Part of diffuse light that a smooth dielectric surface reflects (Fresnel 1823, unpolarised; cosine-weighted)."""
    ior = max(ior, 1e-5)
    cosine = _cosines()
    inside = 1 - (1 - cosine**2) / ior**2
    bent = np.sqrt(np.maximum(inside, 0))
    across = (cosine - ior * bent) / (cosine + ior * bent)
    along = (ior * cosine - bent) / (ior * cosine + bent)
    return float(np.where(inside > 0, (across**2 + along**2) / 2, 1.0).mean())


def mean_coat(weight: float, tint: Triple, ior: float) -> Triple:
    """Part of the light from below that leaves through Principled's coat, of light that is diffuse outside.

    Notes
    -----
    As in Cycles a coat of full weight passes tint^(1 / cos), the cosine being that of the bent way in it, on the way
    out alone. What its gloss holds back is left out, as Cycles does for light that is sent to other surfaces.
    """
    way = 1 / _bent(ior)
    red, green, blue = (1 - weight + weight * float((max(channel, 0.0) ** way).mean()) for channel in tint)
    return red, green, blue


def coat_exponent(ior: float) -> float:
    """The power of a tint that `mean_coat` comes to: exact for one of .3, within 1 % of the light from .1 to 1."""
    middle = 0.3
    return float(np.log((middle ** (1 / _bent(ior))).mean()) / np.log(middle))


def _bent(ior: float) -> Float:
    """`_cosines` of the directions inside of a coat."""
    return np.asarray(np.sqrt(1 - (1 - _cosines() ** 2) / max(ior, 1.0) ** 2))


def _cosines() -> Float:
    """Cosines of directions that are equally likely under diffuse light: their squares are spread evenly."""
    return np.asarray(np.sqrt((np.arange(DIRECTIONS) + 0.5) / DIRECTIONS))


def triple(value: Any) -> Triple:
    """A colour, a vector or a number as three numbers."""
    if hasattr(value, "__len__"):
        return float(value[0]), float(value[1]), float(value[2])
    return float(value), float(value), float(value)

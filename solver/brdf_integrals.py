"""What a BRDF reflects, by quadrature over the hemisphere, and the diffuse surface that stands for it in a bake.

    rho(o)   = int f(i, o) cos_i d_i              directional-hemispherical reflectance
    rho_hh   = (1 / pi) int rho(o) cos_o d_o      bihemispherical: of light that comes evenly from everywhere

(names as in Nicodemus, Richmond, Hsia, Ginsberg and Limperis 1977). Reciprocity makes rho(o) the part that is
reflected of a ray out of o as well. A Lambertian surface of reflectance rho_hh sends back as much as the BRDF does of
even light: that is `diffuse_equivalent`. Where that light goes is what radiosity leaves out: see `residual`.

Gloss is narrow in the half vector h, so the quadrature runs over h: i = 2 (o . h) h - o, d_i = 4 (o . h) d_h (Torrance
and Sparrow 1967). All i above the surface are met by theta_h < (pi/2 + atan2(sin theta_o cos phi_h, cos theta_o)) / 2,
so no node is wasted and no kink is integrated over; nodes in sqrt(theta_h) crowd in the gloss.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .brdf import Brdf
from .errors import SceneError

Float = NDArray[np.floating[Any]]

# Nodes along sqrt(theta_h), around the normal, and along the cosine of the other direction: what Phong's and Blinn's
# lobes of any exponent need for five digits of rho_hh and of the residual.
POLAR_NODES, AZIMUTHS, COSINES = 64, 96, 32
# A reflectance may be above 1 by this much, which is the quadrature's or a rounded table's doing.
GAIN_TOLERANCE = 2e-3


def directional_reflectance(brdf: Brdf, cosines: Float) -> Float:
    """The part of light from directions (k,), given by the cosine to the normal, that is reflected: (k, 3) float64.

    The BRDF must be isotropic, and is taken as the same on both sides of the plane of o and the normal.
    """
    outgoing, incoming, weight = _nodes(np.asarray(cosines, np.float64))
    return np.asarray((brdf(incoming, outgoing) * weight[..., None]).sum(axis=(1, 2)))


def hemispherical_reflectance(brdf: Brdf) -> Float:
    """The part (3,) float64 of light that comes evenly from everywhere that is reflected."""
    cosines, weight = _cosine_nodes()
    return np.asarray(weight @ directional_reflectance(brdf, cosines))


def diffuse_equivalent(brdf: Brdf) -> Float:
    """The reflectance (3,) float32 of the diffuse surface that stands for a BRDF in `Scene.reflectance`.

    Raises
    ------
    SceneError
        If the BRDF reflects more than all light.
    """
    reflectance = hemispherical_reflectance(brdf)
    if not (reflectance <= 1 + GAIN_TOLERANCE).all():
        raise SceneError(f"{_name(brdf)} reflects {reflectance.max():.4g} of even light, more than all of it: "
                         "scale it down")
    return np.minimum(reflectance, 1).astype(np.float32)


def residual(brdf: Brdf) -> Float:
    """The part (3,) float64 of the reflected light that its diffuse equivalent sends elsewhere, 0 ... 1.

    Half of int int |f - rho_hh / pi| cos_i cos_o d_i d_o over all that is reflected, pi rho_hh: 0 for Lambert, near 1
    for a mirror. Light from one side goes wrong by this part; of light that comes evenly from everywhere, far less.
    """
    cosines, weight = _cosine_nodes()
    return np.asarray(weight @ directional_residual(brdf, cosines))


def directional_residual(brdf: Brdf, cosines: Float) -> Float:
    """The same for light from single directions (k,), given by their cosine: (k, 3) float64, over rho_hh as well.

    Above 1 where far more light is reflected than rho_hh.
    """
    mean = hemispherical_reflectance(brdf)
    outgoing, incoming, weight = _nodes(np.asarray(cosines, np.float64))
    gap = (np.abs(brdf(incoming, outgoing) - mean / np.pi) * weight[..., None]).sum(axis=(1, 2))
    return np.asarray(np.divide(gap, 2 * mean, out=np.zeros_like(gap), where=mean > 0))


def reciprocity_gap(brdf: Brdf, pairs: int = 4096, seed: int = 0) -> float:
    """The largest |f(i, o) - f(o, i)| of random pairs, over f's largest value there: 0 for what is physical."""
    random = np.random.default_rng(seed)
    first, second = (_upward(random, pairs) for _ in range(2))
    there, back = brdf(first, second), brdf(second, first)
    largest = max(float(there.max()), float(back.max()))
    return float(np.abs(there - back).max()) / largest if largest > 0 else 0.0


def _nodes(cosine: Float) -> tuple[Float, Float, Float]:
    """Outgoing (k, 1, 1, 3) and incoming (k, n, m, 3) directions, and the weights cos_i d_i (k, n, m)."""
    t, dt = _unit_gauss(POLAR_NODES)
    cosine = cosine[:, None, None]
    sine = np.sqrt(1 - cosine**2)
    # Half way around is enough: both sides of the plane of o and the normal are alike.
    phi = (np.pi * (np.arange(AZIMUTHS) + 0.5) / AZIMUTHS)[None, None, :]
    limit = (np.pi / 2 + np.arctan2(sine * np.cos(phi), cosine)) / 2
    theta = limit * t[None, :, None] ** 2
    dh = 2 * limit * t[None, :, None] * dt[None, :, None] * np.sin(theta) * (2 * np.pi / AZIMUTHS)
    half = _spherical(theta, phi)
    outgoing = np.stack([sine, np.zeros_like(sine), cosine], axis=-1)
    along = (half * outgoing).sum(axis=-1)
    incoming = 2 * along[..., None] * half - outgoing
    return outgoing, incoming, np.maximum(incoming[..., 2], 0) * 4 * along * dh


def _cosine_nodes() -> tuple[Float, Float]:
    """Cosines and the weights of (1 / pi) int ... cos d = int ... 2 mu d mu."""
    mu, weight = _unit_gauss(COSINES)
    return mu, 2 * mu * weight


def _unit_gauss(count: int) -> tuple[Float, Float]:
    x, w = np.polynomial.legendre.leggauss(count)
    return (x + 1) / 2, w / 2


def _spherical(theta: Float, phi: Float) -> Float:
    return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi),
                     np.cos(theta) * np.ones_like(phi)], axis=-1)


def _upward(random: np.random.Generator, count: int) -> Float:
    """Directions (count, 3) evenly over the hemisphere."""
    cosine, phi = random.random(count), 2 * np.pi * random.random(count)
    return _spherical(np.arccos(cosine), phi)


def _name(brdf: Brdf) -> str:
    return str(getattr(brdf, "name", type(brdf).__name__))

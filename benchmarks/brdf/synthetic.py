"""Data as measured surfaces give it, in MERL's binary format, made by a formula: no measured file is in this project.

The surfaces are rough dielectrics and metals: microfacets of a long-tailed distribution with Fresnel's reflection and
masking over a Lambertian base. Like real data, and unlike Phong's lobe, they have tails beside the gloss and reflect
more towards grazing light.
Reference: Trowbridge and Reitz 1975 and Walter, Marschner, Li and Torrance 2007 (distribution, masking); Schlick 1994
(Fresnel).
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from radiosity.solver.brdf import Float, half_vector
from radiosity.solver.merl import SCALE, SHAPE

# What the format stores where a bin's directions lie below the surface.
NOT_MEASURED = -1.0


@dataclass(frozen=True)
class Microfacets:
    """A rough surface: roughness alpha, reflectance along the normal F0 (3,), Lambertian base rho (3,)."""

    name: str
    roughness: float
    normal_reflectance: tuple[float, float, float]
    base: tuple[float, float, float]

    def __call__(self, incoming: Float, outgoing: Float) -> Float:
        """Evaluate, see `solver.brdf.Brdf`."""
        i, o = incoming[..., 2], outgoing[..., 2]
        above = (i > 0) & (o > 0)
        half = half_vector(incoming, outgoing)
        a2 = self.roughness**2
        facets = a2 / (np.pi * (half[..., 2] ** 2 * (a2 - 1) + 1) ** 2)
        safe_i, safe_o = np.where(above, i, 1), np.where(above, o, 1)
        visible = 4 / ((1 + _slope(safe_i, a2)) * (1 + _slope(safe_o, a2)))
        grazing = np.clip(1 - (half * outgoing).sum(axis=-1), 0, 1)[..., None] ** 5
        fresnel = np.array(self.normal_reflectance) * (1 - grazing) + grazing
        gloss = (facets * visible / (4 * safe_i * safe_o))[..., None] * fresnel
        # What the gloss reflects along the normal does not reach the base, on the way in and out.
        below = np.array(self.base) / np.pi * (1 - np.array(self.normal_reflectance)) ** 2
        return np.asarray(above[..., None] * (gloss + below))


SURFACES = (
    Microfacets("plastic", 0.12, (0.05, 0.05, 0.05), (0.30, 0.10, 0.08)),
    Microfacets("matte paint", 0.60, (0.04, 0.04, 0.04), (0.55, 0.55, 0.50)),
    Microfacets("rough metal", 0.30, (0.90, 0.75, 0.50), (0.0, 0.0, 0.0)),
)


def bin_directions() -> tuple[Float, Float]:
    """Incoming and outgoing directions (90, 90, 180, 3) of the middles of all bins, phi_h = 0."""
    h, d, p = ((np.arange(count) + 0.5) / count for count in SHAPE)
    theta_h, theta_d, phi_d = np.meshgrid(np.pi / 2 * h**2, np.pi / 2 * d, np.pi * p, indexing="ij")
    difference = np.stack([np.sin(theta_d) * np.cos(phi_d), np.sin(theta_d) * np.sin(phi_d), np.cos(theta_d)], axis=-1)
    # Turned by theta_h about y, the difference vector is the incoming direction; the half vector mirrors it.
    c, s = np.cos(theta_h), np.sin(theta_h)
    x, y, z = np.moveaxis(difference, -1, 0)
    incoming = np.stack([c * x + s * z, y, c * z - s * x], axis=-1)
    half = np.stack([s, np.zeros_like(s), c], axis=-1)
    outgoing = 2 * (incoming * half).sum(axis=-1, keepdims=True) * half - incoming
    return incoming, outgoing


def write_merl(path: str | os.PathLike[str], brdf: Callable[[Float, Float], Float]) -> None:
    """Write a BRDF's values at the bins' middles in MERL's format: 35 MB."""
    incoming, outgoing = bin_directions()
    below = (incoming[..., 2] <= 0) | (outgoing[..., 2] <= 0)
    stored = np.where(below[..., None], NOT_MEASURED, brdf(incoming, outgoing) / SCALE)
    with Path(path).open("wb") as file:
        file.write(np.array(SHAPE, "<i4").tobytes())
        file.write(np.ascontiguousarray(np.moveaxis(stored, -1, 0), "<f8").tobytes())


def _slope(cosine: Float, a2: float) -> Float:
    """sqrt(1 + alpha^2 tan^2) of Smith's masking."""
    return np.asarray(np.sqrt(1 + a2 * (1 / cosine**2 - 1)))

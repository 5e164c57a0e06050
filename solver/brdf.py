"""Bidirectional reflectance distribution functions: Lambert, Phong and Blinn, reciprocal and without gain of energy.

A BRDF f is the radiance sent into direction o over the irradiance that arrives from direction i, 1 / sr. Directions
point away from the surface, which lies in z = 0 and faces +z. The bake carries diffuse light alone: what it takes from
a BRDF is `brdf_integrals.diffuse_equivalent`; measured BRDFs are in `merl.py`.

    Lambert   f = rho / pi                                    Lambert 1760
    Phong     f = k_d / pi + k_s (n + 2) / (2 pi) (r . o)^n   Phong 1975; normalised by Lafortune and Willems 1994
    Blinn     f = k_d / pi + k_s c(n) (h . z)^n               Blinn 1977
              c(n) = (n + 2) (n + 4) / (8 pi (2^(-n/2) + n))

r is i mirrored at the normal, h the middle of i and o. Both factors make the lobe reflect k_s of what falls in along
the normal, where it reflects most, so k_d + k_s <= 1 conserves energy. The c(n) of Blinn's lobe is the exact integral
of cos^n(theta / 2) cos(theta) over the hemisphere.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .errors import SceneError

Float = NDArray[np.floating[Any]]

# Highest exponent: a lobe of .1 degrees, a mirror in all but name, and still within the quadrature's five digits.
MAX_EXPONENT = 1e6
# Rounding of colours that are meant to add up to 1.
SUM_TOLERANCE = 1e-6


class Brdf(Protocol):
    """f(incoming (..., 3), outgoing (..., 3)) -> (..., 3) float64, 1 / sr; 0 if a direction is below the surface."""

    def __call__(self, incoming: Float, outgoing: Float) -> Float: ...


@dataclass(frozen=True, eq=False)
class Lambert:
    """The same radiance into all directions.

    Parameters
    ----------
    reflectance : rho in [0, 1], a number or (3,).

    Raises
    ------
    SceneError
        If it is out of range.
    """

    reflectance: ArrayLike

    def __post_init__(self) -> None:
        object.__setattr__(self, "reflectance", _colour("Lambert's reflectance", self.reflectance))

    def __call__(self, incoming: Float, outgoing: Float) -> Float:
        """Evaluate."""
        return np.asarray(_above(incoming, outgoing)[..., None] * np.asarray(self.reflectance) / np.pi)


@dataclass(frozen=True, eq=False)
class Phong:
    """A cosine lobe about the mirrored direction over a Lambertian base.

    Parameters
    ----------
    diffuse, specular : k_d and k_s in [0, 1], numbers or (3,); their sum must not exceed 1.
    exponent : n >= 0.

    Raises
    ------
    SceneError
        If a value is out of range.
    """

    diffuse: ArrayLike
    specular: ArrayLike
    exponent: float

    def __post_init__(self) -> None:
        _check_lobe(self, "Phong")

    def __call__(self, incoming: Float, outgoing: Float) -> Float:
        """Evaluate."""
        cosine = np.maximum((mirrored(incoming) * outgoing).sum(axis=-1), 0)
        lobe = (self.exponent + 2) / (2 * np.pi) * cosine**self.exponent
        return _combined(self, lobe, incoming, outgoing)


@dataclass(frozen=True, eq=False)
class Blinn:
    """A cosine lobe of the half vector about the normal, over a Lambertian base; parameters as of `Phong`."""

    diffuse: ArrayLike
    specular: ArrayLike
    exponent: float

    def __post_init__(self) -> None:
        _check_lobe(self, "Blinn")

    def __call__(self, incoming: Float, outgoing: Float) -> Float:
        """Evaluate."""
        n = self.exponent
        factor = (n + 2) * (n + 4) / (8 * np.pi * (2 ** (-n / 2) + n))
        lobe = factor * np.maximum(half_vector(incoming, outgoing)[..., 2], 0) ** n
        return _combined(self, lobe, incoming, outgoing)


def mirrored(direction: Float) -> Float:
    """Directions (..., 3) mirrored at the normal."""
    return np.asarray(direction * np.array([-1.0, -1.0, 1.0]))


def half_vector(incoming: Float, outgoing: Float) -> Float:
    """The unit vector (..., 3) midway between two directions; 0 where they are opposite."""
    total = incoming + outgoing
    length = np.linalg.norm(total, axis=-1, keepdims=True)
    return np.asarray(np.divide(total, length, out=np.zeros_like(total), where=length > 0))


def _above(incoming: Float, outgoing: Float) -> NDArray[np.bool_]:
    return np.asarray((incoming[..., 2] > 0) & (outgoing[..., 2] > 0))


def _combined(brdf: Phong | Blinn, lobe: Float, incoming: Float, outgoing: Float) -> Float:
    value = np.asarray(brdf.diffuse) / np.pi + np.asarray(brdf.specular) * lobe[..., None]
    return np.asarray(_above(incoming, outgoing)[..., None] * value)


def _check_lobe(brdf: Phong | Blinn, name: str) -> None:
    diffuse, specular = _colour(f"{name}'s diffuse", brdf.diffuse), _colour(f"{name}'s specular", brdf.specular)
    if (diffuse + specular > 1 + SUM_TOLERANCE).any():
        raise SceneError(f"{name}: diffuse {diffuse.tolist()} and specular {specular.tolist()} reflect more than all "
                         "light: lower one, so that no channel's sum is above 1")
    exponent = float(brdf.exponent)
    if not 0 <= exponent <= MAX_EXPONENT:
        raise SceneError(f"{name}'s exponent is {exponent!r}: give a number from 0 to {MAX_EXPONENT:g}")
    for field, value in (("diffuse", diffuse), ("specular", specular), ("exponent", exponent)):
        object.__setattr__(brdf, field, value)


def _colour(what: str, value: ArrayLike) -> Float:
    array = np.asarray(value, np.float64)
    if array.shape not in ((), (3,)) or not ((array >= 0) & (array <= 1)).all():
        raise SceneError(f"{what} is {array.tolist()}: give a number, or three, from 0 to 1")
    return np.array(np.broadcast_to(array, 3))

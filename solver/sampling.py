"""Quasi-Monte-Carlo points and random shifts that depend on nothing but an identity and a seed.

A point set is an additive recurrence (Kronecker) on the roots of x^(d+1) = x + 1, moved by a random shift per
receiver (Cranley & Patterson 1976). Sets can be continued: the first n points of a longer one are the shorter one.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]

# Steps of `interleaved` by one texel to the right and up. Searched for: with these, the waves that 16 to 256 of
# `rays_of_places` take for a mean are those that the filter of `smooth.py` suppresses most.
ACROSS_IMAGE = np.array([[0.77456949, 0.44942266], [0.08761461, 0.46666262]])

# Tangents jump where a unit normal's third coordinate falls below this.
LOW = np.float32(-0.5)


@cache
def _steps(dimensions: int) -> NDArray[np.float64]:
    root = 2.0
    for _ in range(64):
        root = (1.0 + root) ** (1.0 / (dimensions + 1))
    return np.asarray((1.0 / root) ** np.arange(1, dimensions + 1))


def kronecker(count: int, dimensions: int, start: int = 0) -> Float:
    """Points start ... start + count - 1 of the recurrence: (count, dimensions) float32 in [0, 1)."""
    return _recurrence(count, _steps(dimensions), start)


def rays_of_places(count: int, start: int = 0) -> Float:
    """Such points for a ray's direction (0, 1) and its start on a footprint (2, 3): (count, 4) float32 in [0, 1).

    Light varies far more with the direction. The recurrence of four dimensions, seen in its first two, has only seven
    heights for a long while (its first step is nearly 6/7); here those two are the recurrence of two dimensions, and
    the others follow Richtmyer (1951).
    """
    return _recurrence(count, np.concatenate([_steps(2), np.sqrt([2.0, 3.0]) - 1]), start)


def _recurrence(count: int, steps: NDArray[np.float64], start: int) -> Float:
    index = np.arange(start + 1, start + count + 1, dtype=np.float64)[:, None]
    return np.asarray((index * steps) % 1.0, np.float32)


def interleaved(texel: Int, identity: Int, seed: int) -> Float:
    """Shifts of two dimensions by which lumels side by side complete one another: (n, 2) float32 in [0, 1).

    Independent shifts leave noise of all wavelengths in an image. These are a lattice over the image, so that what
    `rays_of_places` misses at a lumel has a short wavelength, which smoothing takes away (interleaved sampling: Keller
    & Heidrich 2001).

    Parameters
    ----------
    texel : (n, 2) column and row in the image.
    identity : (n,) what has a shift in common.
    """
    return np.asarray((combined(texel, ACROSS_IMAGE) + shifts(identity, 2, seed)) % 1.0, np.float32)


def mixed(identity: NDArray[Any], dimension: int, seed: int) -> NDArray[np.uint64]:
    """64 random bits for every identity: (n,) uint64, the same wherever and whenever they are asked for.

    Notes
    -----
    The finaliser of MurmurHash3 (Appleby 2008) over 64 bits, with the dimension and the seed mixed in before.
    """
    with np.errstate(over="ignore"):
        salt = np.uint64((dimension * 0xD1B54A32D192ED03 + seed * 0x8CB92BA72F3D8DD7) % 2**64)
        key = np.asarray(identity).astype(np.uint64) * np.uint64(0x9E3779B97F4A7C15) + salt
        key ^= key >> np.uint64(33)
        key *= np.uint64(0xFF51AFD7ED558CCD)
        key ^= key >> np.uint64(33)
        key *= np.uint64(0xC4CEB9FE1A85EC53)
        key ^= key >> np.uint64(33)
    return np.asarray(key)


def uniform(identity: NDArray[Any], dimension: int, seed: int) -> Float:
    """A random number in [0, 1) for every identity: (n,) float32, from `mixed`."""
    # 24 bits: the most that a float32 below 1 holds.
    top = mixed(identity, dimension, seed) >> np.uint64(40)
    return np.asarray(top.astype(np.float32) * np.float32(2.0**-24))


def shifts(identity: NDArray[Any], dimensions: int, seed: int) -> Float:
    """A random shift for every identity: (n, dimensions) float32 in [0, 1)."""
    return np.stack([uniform(identity, dimension, seed) for dimension in range(dimensions)], axis=-1)


def shifted(points: Float, shift: Float) -> Float:
    """Points moved modulo 1: (n, k) from points (k,) and shift (n,), float32 in [0, 1)."""
    moved = points[None, :] + shift[:, None]
    moved -= np.floor(moved)
    # Rounding can leave exactly 1, which a floor() downstream would count as the next cell.
    return np.minimum(moved, np.float32(1.0 - 2.0**-24), out=moved)


def frames(normals: Float) -> tuple[Float, Float]:
    """Two tangents for every unit normal: (n, 3) each, right-handed (Duff et al. 2017).

    They jump where the normal turns below LOW, and not at z = 0, where that of a wall goes to and fro by rounding.
    """
    x, y, z = normals[..., 0], normals[..., 1], normals[..., 2]
    sign = np.where(z > LOW, np.float32(1.0), np.float32(-1.0))
    a = -1.0 / (sign + z)
    b = x * y * a
    first = np.stack([1.0 + sign * x * x * a, sign * b, -sign * x], axis=-1)
    second = np.stack([b, sign + y * y * a, -y], axis=-1)
    return first, second


def cosine_directions(normals: Float, u: Float, v: Float) -> Float:
    """Directions with density cos(theta) / pi about the normals (Malley 1988).

    normals (n, 3), u and v (n, k) in [0, 1) -> (n, k, 3) float32.
    """
    first, second = frames(normals)
    radius = np.sqrt(u)
    angle = np.float32(2.0 * np.pi) * v
    x = radius * np.cos(angle)
    y = radius * np.sin(angle)
    z = np.sqrt(1.0 - u)
    out = np.empty((*u.shape, 3), np.float32)
    for axis in range(3):
        out[..., axis] = x * first[:, None, axis] + y * second[:, None, axis] + z * normals[:, None, axis]
    return out


def combined(coordinates: NDArray[Any], axes: Float) -> Float:
    """Coordinates (n, k) along axes (k, c) -> (n, c); not by BLAS, whose bits depend on the number of cores."""
    return np.asarray(np.einsum("nk,kc->nc", coordinates, axes))

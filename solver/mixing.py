"""Kept light of many groups, mixed to one image by a factor for each group and channel.

A layer is kept as half floats (11 bits, .05 %) scaled to its brightest value, half the size of what it came from.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Float = NDArray[np.floating[Any]]

# A layer's brightest value is kept as this, the largest power of two of a half float; what is darker than the smallest
# half float that is not denormal, 2e-9 of it, is kept as zero: denormal numbers cost far more to multiply.
BRIGHTEST = 2.0**15
DARKEST = 2.0**-14
# A half float's bits, moved to a float's places, are the number times 2^-112. The power is given back in two steps, so
# that no factor overflows: an exponent of one sign and the other's.
GIVEN_BACK = 100
LEFT = 12
MANTISSA_SHIFT = np.int32(13)
# The sign of a half float, moved along, leaves copies of itself where none belong.
SIGN_AND_NUMBER = np.int32(-0x70000001)
# Values that are mixed at once: they stay in the cache of one core.
CHUNK = 3 * 2**14


@dataclass(frozen=True, eq=False)
class Layer:
    """Light of one group, under white light of the strength that it was baked with.

    bits : (..., 3) int16, the bits of half floats, without denormal ones.
    scale : the value is the half float times this.
    """

    bits: NDArray[np.int16]
    scale: float

    @classmethod
    def of(cls, values: Float) -> Layer:
        """Keep values (..., 3)."""
        values = np.asarray(values, np.float32)
        scale = float(np.max(np.abs(values), initial=0)) / BRIGHTEST
        if not scale > 0:
            return cls(np.zeros(values.shape, np.int16), 0.0)
        scaled = values / np.float32(scale)
        half = np.where(np.abs(scaled) >= DARKEST, scaled, 0).astype(np.float16)
        return cls(half.view(np.int16), scale)

    def values(self) -> Float:
        """What is kept, (..., 3) float32."""
        return np.asarray(self.bits.view(np.float16).astype(np.float32) * np.float32(self.scale))


def mix(layers: Sequence[Layer], factors: ArrayLike) -> Float:
    """The sum of the layers, each times its factor.

    Parameters
    ----------
    layers : g >= 1 of one shape (..., 3).
    factors : (g, 3), of each layer's red, green and blue, >= 0.

    Returns
    -------
    (..., 3) float32.
    """
    factors = np.asarray(factors, np.float64).reshape(len(layers), 3)
    lit = [(layer.bits.reshape(-1), factor * layer.scale) for layer, factor in zip(layers, factors, strict=True)
           if (factor * layer.scale).any()]
    shape = layers[0].bits.shape
    out = np.zeros(int(np.prod(shape)), np.float32)
    tiles = [np.tile((factor * 2.0**GIVEN_BACK).astype(np.float32), CHUNK // 3) for _, factor in lit]
    whole, part = np.empty(CHUNK, np.int32), np.empty(CHUNK, np.float32)
    for start in range(0, len(out), CHUNK):
        count = min(CHUNK, len(out) - start)
        total = out[start:start + count]
        for (bits, _), tile in zip(lit, tiles, strict=True):
            np.left_shift(bits[start:start + count], MANTISSA_SHIFT, out=whole[:count], dtype=np.int32)
            np.bitwise_and(whole[:count], SIGN_AND_NUMBER, out=whole[:count])
            np.multiply(whole[:count].view(np.float32), tile[:count], out=part[:count])
            total += part[:count]
        total *= np.float32(2.0**LEFT)
    return out.reshape(shape)

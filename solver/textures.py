"""What textures show: at points, or of small pieces of surface about points.

A cell of the solver is seen at a few points only, and may hold hundreds of texels: what is asked there are texels a
quarter to half as wide as the cell, each the mean of what it covers (a mip map: Williams 1983).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from .scene import Texture

Float = NDArray[np.floating[Any]]

# A piece of surface is looked at by texels that are at most so wide, beside itself: filtering reads two of them, which
# must not reach far into what lies beside the piece in the image.
TEXEL_SHARE = np.float32(0.5)


@dataclass(frozen=True, eq=False)
class MipMap:
    """Ever smaller images of one, each half as wide and high as the one before, down to one pixel (Williams 1983).

    pixels : (n, 3) float32 of all, one after another;  first : (k,) where each begins;  size : (k, 2) width and height.
    """

    pixels: Float
    first: NDArray[np.int64]
    size: NDArray[np.int64]

    @classmethod
    def of(cls, pixels: Float) -> MipMap:
        """Those of an image (height, width, 3), which is not among them unless it has but one pixel."""
        images = [_halved(_halved(pixels, 0), 1)]
        while max(images[-1].shape[:2]) > 1:
            images.append(_halved(_halved(images[-1], 0), 1))
        size = np.array([image.shape[1::-1] for image in images], np.int64)
        first = np.cumsum(size.prod(axis=1)) - size.prod(axis=1)
        return cls(np.concatenate([image.reshape(-1, 3) for image in images]), first, size)


def _halved(pixels: Float, axis: int) -> Float:
    """An image half as long along one axis; what is over at the end stands for itself."""
    even, odd = (slice(None),) * axis + (slice(0, None, 2),), (slice(None),) * axis + (slice(1, None, 2),)
    out: Float = pixels[even].copy()
    pairs = (slice(None),) * axis + (slice(0, pixels.shape[axis] // 2),)
    out[pairs] = (out[pairs] + pixels[odd]) / np.float32(2)
    return out


def looked_up(texture: Texture, uv: Float, width: Float | None = None) -> Float:
    """What a texture shows, repeated in both directions, bilinear.

    Parameters
    ----------
    uv : (n, 2), where.
    width : (n,) of the piece of surface that is meant, in parts of the image; None for points.

    Returns
    -------
    (n, 3) float32.
    """
    lines, columns = texture.pixels.shape[:2]
    across = None if width is None else width * np.float32(np.sqrt(lines * columns)) * TEXEL_SHARE
    if across is None or not (across >= 2).any():
        return _bilinear(texture.pixels.reshape(-1, 3), 0, columns, lines, uv)
    chain = texture.smaller
    level = np.log2(np.maximum(across, 1)).astype(np.intp)
    out, fine, coarse = np.empty((len(uv), 3), np.float32), np.flatnonzero(level < 1), np.flatnonzero(level >= 1)
    out[fine] = _bilinear(texture.pixels.reshape(-1, 3), 0, columns, lines, uv[fine])
    level = np.minimum(level[coarse], len(chain.size)) - 1
    columns, lines = chain.size[level].T
    out[coarse] = _bilinear(chain.pixels, chain.first[level], columns, lines, uv[coarse])
    return out


def _bilinear(pixels: Float, first: Any, columns: Any, lines: Any, uv: Float) -> Float:
    """What images show at uv (n, 2); they are parts of the pixels (m, 3), with the first of each, and its size."""
    x, y = ((uv[:, axis] - np.floor(uv[:, axis])) * count - np.float32(0.5)
            for axis, count in ((0, np.float32(columns)), (1, np.float32(lines))))
    left, low = np.floor(x).astype(np.int32), np.floor(y).astype(np.int32)
    part_x, part_y = (x - left)[:, None], (y - low)[:, None]
    left, right = first + left % columns, first + (left + 1) % columns
    low, high = low % lines * columns, (low + 1) % lines * columns

    def at(place: NDArray[Any]) -> Float:
        return np.take(pixels, place, axis=0)

    bottom = at(low + left) * (1 - part_x) + at(low + right) * part_x
    top = at(high + left) * (1 - part_x) + at(high + right) * part_x
    return np.asarray(bottom * (1 - part_y) + top * part_y, np.float32)

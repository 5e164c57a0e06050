"""Blender images as textures in linear light."""

from __future__ import annotations

import math
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..solver.errors import SceneError
from ..solver.scene import Texture
from .parts import PAUSE, Parts, aside
from .shown_images import file_of, missing_error
from .sockets import ASSOCIATED
from .warn import Warnings, warn

Float = NDArray[np.floating[Any]]

# Colour spaces whose numbers are light already, or no colour at all.
LINEAR_SPACES = frozenset({"Linear Rec.709", "Non-Color", "Linear", "Raw", "scene_linear"})
# Longest side of a texture that is kept; larger ones are averaged down (4,096 x 4,096 floats would be 200 MB each).
LONGEST_SIDE = 2048
# Cycles filters byte images before it decodes them, the solver afterwards: images up to this side are made larger
# before they are decoded, where the difference between neighbouring pixels is seen.
SMALL_SIDE, ENLARGED = 256, 8
# Pixels that are decoded at once.
PART_PIXELS = 2**18
# Pixels a side that a first look takes for the mean of an image.
GLANCE_SIDE = 128


def texture_parts(image: Any, material: str, warnings: Warnings, highest: float = math.inf) -> Parts[Texture]:
    """The image's pixels as reflectance or light.

    Parameters
    ----------
    highest : what brighter pixels are held to; those above 1 are told of.

    Raises
    ------
    SceneError
        If the image's file is missing or can't be read.
    """
    _tell_tiles(image, material, warnings)
    stored = yield from _stored(image, material)
    decode = _decoder(image, material, warnings)
    name = image.name
    return (yield from aside(lambda: _texture(name, stored, decode, material, warnings, highest)))


def mean_parts(image: Any, material: str, highest: float = math.inf) -> Parts[Float]:
    """About the mean of the image's pixels, (3,) float32: of every so-manieth of them, for a first look.

    Raises
    ------
    SceneError
        If the image's file is missing or can't be read.
    """
    stored = yield from _stored(image, material)
    step = -(-max(stored.shape[:2]) // GLANCE_SIDE)
    pixels = _decoder(image, material, [])(stored[::step, ::step])
    pixels = np.clip(np.nan_to_num(pixels, nan=0.0, posinf=0.0, neginf=0.0), 0.0, highest)
    return np.asarray(pixels.mean(axis=(0, 1)), np.float32)


def _stored(image: Any, material: str) -> Parts[Float]:
    """The image as it is kept, (h, w, channels) float32."""
    yield PAUSE
    # Asked for its size, Blender reads the file.
    width, height = image.size
    channels = image.channels
    if not (width and height and channels):
        if image.source in {"SEQUENCE", "MOVIE"}:
            raise SceneError(f"material {material!r}: Cycles alone reads frames of image {image.name!r}: switch Cycles "
                             "on (Preferences > Add-ons) or choose a still image")
        raise missing_error(image, file_of(image), f"material {material!r}")
    # Memory that was written to before is filled in half the time: it is the window that waits for the second.
    values = yield from aside(lambda: np.full(width * height * channels, 0, np.float32))
    yield PAUSE
    image.pixels.foreach_get(values)
    yield
    return values.reshape(height, width, channels)


def _texture(name: str, stored: Float, decode: Callable[[Float], Float], material: str, warnings: Warnings,
             highest: float) -> Texture:
    """The image decoded, some rows at a time; touches no bpy."""
    height, width = stored.shape[:2]
    # An image that is enlarged is small.
    rows = height if max(width, height) <= SMALL_SIDE else max(1, PART_PIXELS // width)

    def read(start: int) -> tuple[Float, float, bool]:
        pixels = decode(stored[start:start + rows])
        is_light = bool(np.isfinite(pixels).all() and pixels.min() >= 0)
        if not is_light:
            pixels = np.clip(np.nan_to_num(pixels, nan=0.0, posinf=0.0, neginf=0.0), 0.0, None)
        return np.minimum(pixels, np.float32(highest)), float(pixels.max()), is_light

    with ThreadPoolExecutor() as pool:
        parts = list(pool.map(read, range(0, height, rows)))
    if not all(is_light for _, _, is_light in parts):
        warn(warnings, material, "texture", f"image {name!r} has values that are negative or not finite: "
             "they count as black")
    brightest = max(brightest for _, brightest, _ in parts)
    if brightest > 1 and math.isfinite(highest):
        warn(warnings, material, "reflectance", f"its image {name!r} has values up to {brightest:g}: they are "
             f"held to {highest}, choose a darker one")
    made = Texture(_shrunk(np.concatenate([pixels for pixels, _, _ in parts])), name)
    # Worked out here, where no window waits, and kept.
    _ = made.mean
    return made


def _tell_tiles(image: Any, material: str, warnings: Warnings) -> None:
    if image.source == "TILED":
        warn(warnings, material, "texture", f"image {image.name!r} has UDIM tiles, of which the first alone is used: "
             "join them into one image")


def _decoder(image: Any, material: str, warnings: Warnings) -> Callable[[Float], Float]:
    """From stored rows (h, w, channels) to linear light (h, w, 3).

    Byte images are handed out as they are coded; float images are in linear light already.
    """
    space = image.colorspace_settings.name
    coded = not image.is_float and space not in LINEAR_SPACES
    if coded and space != "sRGB":
        warn(warnings, material, "texture", f"image {image.name!r} has the colour space {space!r}: it is read as sRGB")
    associated = not image.is_float and image.alpha_mode in ASSOCIATED
    small = max(image.size) <= SMALL_SIDE
    # A byte has 256 values: looked up, they cost a tenth of the power function.
    table = srgb_to_linear(np.arange(256, dtype=np.float32) / 255)

    def decode(stored: Float) -> Float:
        pixels, alpha = stored[:, :, :3], stored[:, :, 3:]
        if stored.shape[2] < 3:
            pixels = np.repeat(stored[:, :, :1], 3, axis=2)
        if associated and alpha.size and alpha.min() < 1:
            # As Cycles does: the colour, still coded in bytes, is multiplied by alpha and rounded down.
            pixels = np.floor(np.rint(pixels * 255) * np.rint(alpha * 255) / 255) / np.float32(255)
        if not coded:
            return pixels
        return srgb_to_linear(_enlarged(pixels)) if small else np.take(table, _bytes(pixels))

    return decode


def _bytes(pixels: Float) -> NDArray[np.uint8]:
    """Pixels of a byte image as the bytes that they are stored as."""
    return np.asarray(pixels * np.float32(255) + np.float32(0.5), np.uint8)


def srgb_to_linear(values: Float) -> Float:
    """IEC 61966-2-1: sRGB code values in [0, 1] to linear light."""
    low = values / np.float32(12.92)
    high = ((np.maximum(values, 0) + np.float32(0.055)) / np.float32(1.055)) ** np.float32(2.4)
    return np.where(values <= 0.04045, low, high).astype(np.float32)


def _enlarged(pixels: Float) -> Float:
    """The image with `ENLARGED` pixels for each, between the old ones' middles bilinear, repeated at its edges."""
    for axis in (0, 1):
        place = (np.arange(pixels.shape[axis] * ENLARGED) + 0.5) / ENLARGED - 0.5
        low = np.floor(place).astype(np.intp)
        part = (place - low).astype(np.float32).reshape((-1, 1, 1) if axis == 0 else (1, -1, 1))
        first, second = (np.take(pixels, low + step, axis=axis, mode="wrap") for step in (0, 1))
        pixels = first * (1 - part) + second * part
    return pixels


def _shrunk(pixels: Float) -> Float:
    """The image averaged over whole blocks of pixels until its longest side fits."""
    factor = -(-max(pixels.shape[:2]) // LONGEST_SIDE)
    if factor == 1:
        return pixels
    # Blocks that cover the image exactly, also where its side is no multiple of the factor.
    for axis in (0, 1):
        length = pixels.shape[axis]
        starts = np.linspace(0, length, max(1, length // factor), endpoint=False).astype(np.intp)
        sums = np.add.reduceat(pixels, starts, axis=axis)
        counts = np.diff(np.append(starts, length)).reshape((-1, 1, 1) if axis == 0 else (1, -1, 1))
        pixels = sums / counts.astype(np.float32)
    return np.ascontiguousarray(pixels, np.float32)

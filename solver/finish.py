"""Values of lumels become images: they grow a margin so that filtering at a chart's edge meets no black, and agree
across the seams between charts.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .parallel import Run
from .receivers import Lumels
from .seams import Seams
from .settings import Settings

Float = NDArray[np.floating[Any]]


def finished(lumels: Lumels, seams: Seams, values: Float, settings: Settings,
             run: Run | None = None) -> list[Float]:
    """The lightmaps as they are written: dilated, and continuous across seams. Arguments as in `to_images` and
    `Seams.stitch`.

    Radiosity holds the colour of the surface, which may well have a step at a seam: it is not stitched.
    """
    if settings.quantity == "radiosity":
        return to_images(lumels, values, settings)
    # Filtering reads one texel beyond a chart, so seams need that much, whether or not it is asked for.
    images = seams.stitch(to_images(lumels, values, replace(settings, margin=max(settings.margin, 1))), run)
    # Least squares may go below zero beside a bright lumel; light does not.
    images = [np.maximum(image, 0) for image in images]
    if settings.margin > 0:
        return images
    for index, image in enumerate(images):
        image[~texels(lumels, index)] = 0
    return images


def texels(lumels: Lumels, page: int, which: NDArray[np.bool_] | None = None) -> NDArray[np.bool_]:
    """(height, width) the texels of a page that are lumels, or some of the lumels (n,)."""
    image, here = lumels.pages[page], lumels.page == page
    out = np.zeros(image.height * image.width, bool)
    out[lumels.pixel[here if which is None else here & which]] = True
    return out.reshape(image.height, image.width)


def to_images(lumels: Lumels, values: Float, settings: Settings) -> list[Float]:
    """The lightmaps: values at the lumels, dilated by `settings.margin`, zero elsewhere.

    Parameters
    ----------
    lumels : n of them.
    values : (n, 3).

    Returns
    -------
    One (height, width, 3) float32 a page, row 0 at the bottom.
    """
    images = []
    for index, page in enumerate(lumels.pages):
        here = lumels.page == index
        pixels = np.zeros((page.height * page.width, 3), np.float32)
        pixels[lumels.pixel[here]] = values[here]
        images.append(dilate(pixels.reshape(page.height, page.width, 3), texels(lumels, index), settings.margin))
    return images


def dilate(pixels: Float, covered: NDArray[np.bool_], margin: int) -> Float:
    """Fill the texels round the covered ones, ring by ring, with the mean of those of their eight neighbours that are
    covered or filled by an earlier ring.

    Parameters
    ----------
    pixels : (height, width, 3).
    covered : (height, width) bool; these texels keep their value.
    margin : number of rings.

    Returns
    -------
    (height, width, 3) float32.

    Notes
    -----
    Only the newest ring is looked at, so the work is that of the texels that are filled, not of margin x image.
    """
    height, width, channels = pixels.shape
    stride = width + 2  # a border of one texel, so that no neighbour leaves the array
    known = np.zeros((height + 2, stride), bool)
    known[1:-1, 1:-1] = covered
    inside = np.zeros_like(known)
    inside[1:-1, 1:-1] = True
    colour = np.zeros((height + 2, stride, channels), np.float32)
    colour[1:-1, 1:-1] = np.where(covered[:, :, None], pixels, 0)
    known_flat, colour_flat = known.ravel(), colour.reshape(-1, channels)
    empty = (inside & ~known).ravel()
    around = np.array([-stride - 1, -stride, -stride + 1, -1, 1, stride - 1, stride, stride + 1])
    newest = np.flatnonzero(known_flat)
    for _ in range(margin):
        wanted = np.zeros(len(empty), bool)
        for step in around:
            wanted[newest + step] = True
        ring = np.flatnonzero(wanted & empty)
        if not len(ring):
            break
        total, count = np.zeros((len(ring), channels), np.float32), np.zeros(len(ring), np.float32)
        for step in around:
            neighbour = ring + step
            weight = known_flat[neighbour]
            count += weight
            total += colour_flat[neighbour] * weight[:, None]
        colour_flat[ring] = total / count[:, None]
        known_flat[ring], empty[ring] = True, False
        newest = ring
    return np.ascontiguousarray(colour[1:-1, 1:-1])

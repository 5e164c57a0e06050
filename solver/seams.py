"""Light continuous across the seams of the layout.

Two charts that meet along an edge in space are filtered from different texels there, and the edge shows as a line. The
texels next to it are moved, those of the margin above all, so that both sides agree: least squares over samples along
the seams (Iwanicki, Lighting Technology of The Last of Us, SIGGRAPH 2013), solved matrix-free by conjugate gradients.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .linear import dot
from .parallel import Run
from .receivers import Lumels
from .scene import Scene, surface_of_triangle
from .seam_samples import SeamSamples

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]

# Weights of a difference across a seam, of moving a lumel, and of moving a texel of the margin: what fills the margin
# gives way, what was baked less so.
SEAM_WEIGHT, LUMEL_WEIGHT, MARGIN_WEIGHT = 4.0, 1.5, 0.05
# A step of up to this many times the error of the light on both sides may be noise, and a lumel beside it has
# `LUMEL_WEIGHT`. Larger ones are what lumels are too coarse for, the edge of a shadow that both charts sample in other
# places: lumels that are moved there get wrong, so that their weight grows with the square of the step, up to so many
# times. No one step does for all scenes: where a tenth of the light was taken for noise, classroom at an error of .1
# kept 1.37 times the steps of lumels inside charts, and with lumels light enough for that, truck_town's twin, which has
# little noise, came from .73 to .80 per cent.
NOISY, STIFFEST = 3.0, 100.0
TOLERANCE, MOST_STEPS = 1e-4, 60


@dataclass(frozen=True, eq=False)
class Taps:
    """The texels that filtering reads on both sides of seams.

    texel : (n, 2, 4) int64 index over all pages, one after another.
    weight : (n, 2, 4) float64, of the bilinear filter.
    chart : (n, 2) int32, the chart whose side it is.
    owner : (texels,) int32, chart of each texel of all pages, -1 where it is margin.
    """

    texel: Int
    weight: Float
    chart: NDArray[np.int32]
    owner: NDArray[np.int32]


class Seams:
    """The seams of a layout, ready to be stitched in any number of sets of images.

    Parameters
    ----------
    samples, lumels, scene : where the seams are.
    values : (n, 3), the light of the lumels, which says how far each may be moved: that of all lights together, so that
        parts of it, stitched one by one, add up to the whole.
    errors : (n,) about how far off each lumel may be, in parts of its light.
    own : (n,) bool, which lumels show light of their own; what the margin grew over gives way as the margin does. None:
        all of them.
    """

    def __init__(self, samples: SeamSamples, lumels: Lumels, scene: Scene, values: Float, errors: Float,
                 own: NDArray[np.bool_] | None = None) -> None:
        taps = seam_taps(samples, lumels, scene)
        if own is not None:
            taps.owner[texel_of(lumels)[~own]] = -1
        texel = taps.texel.reshape(-1, 8)
        self._weight = (taps.weight * np.array([1.0, -1.0])[:, None]).reshape(-1, 8)
        self._moved = self._weight * _follows(taps).reshape(-1, 8)
        self._unknown, column = np.unique(texel, return_inverse=True)
        self._column = column.reshape(texel.shape)
        light, noise = np.zeros((len(taps.owner), 3)), np.zeros(len(taps.owner))
        where = texel_of(lumels)
        light[where], noise[where] = values, errors * values.mean(axis=1)
        stiff = LUMEL_WEIGHT * stiffness(taps, light, noise)[self._unknown]
        self._anchor = np.where(taps.owner[self._unknown] >= 0, stiff, MARGIN_WEIGHT)

    def stitch(self, images: list[Float], run: Run | None = None) -> list[Float]:
        """Make the light agree on both sides of the seams.

        Parameters
        ----------
        images : one (height, width, 3) a page, dilated by one texel at least.
        run : the threads to do it with; it may be cancelled. None: here and now.

        Returns
        -------
        Copies, changed next to seams only. Never changed are texels at creases, at walls that stand on a seam, and
        between objects unless they are flush.
        """
        if not len(self._unknown):
            return [np.array(image) for image in images]
        flat = np.concatenate([np.asarray(image, np.float64).reshape(-1, 3) for image in images])
        before = flat[self._unknown]
        run = run or Run()

        def work(channel: int) -> Float:
            step = np.einsum("ij,ij->i", self._weight, np.take(before[:, channel], self._column))
            return _solve(self._column, self._moved, self._anchor, step, run.check)

        change = np.stack(run.map(work, range(3)), axis=1)
        flat[self._unknown] = np.maximum(before + change, np.minimum(before, 0))
        return _pages(flat, images)


def _follows(taps: Taps) -> NDArray[np.bool_]:
    """(n, 2, 4) which texels a sample may move: all, but no lumels across a seam from a side that shows none.

    A chart narrower than a texel may have no lumel. What its texels show is made up, and follows the other side.
    """
    lumel = taps.owner[taps.texel] >= 0
    known = (taps.weight * lumel).sum(axis=2) > 0
    return np.asarray(~lumel | known.all(axis=1)[:, None, None])


def _pages(flat: Float, images: list[Float]) -> list[Float]:
    """Texels of all pages one after another, as images of the same shapes."""
    ends = np.cumsum([image.shape[0] * image.shape[1] for image in images])[:-1]
    return [part.reshape(image.shape).astype(np.float32)
            for part, image in zip(np.split(flat, ends), images, strict=True)]


def texel_of(lumels: Lumels) -> Int:
    """(n,) where the lumels stand among the texels of all pages, one after another."""
    sizes = np.array([page.width * page.height for page in lumels.pages], np.int64)
    return np.asarray(np.concatenate([[0], np.cumsum(sizes)])[lumels.page] + lumels.pixel)


def stiffness(taps: Taps, light: Float, noise: Float) -> Float:
    """How much lumels resist being moved, from 1 to `STIFFEST`.

    Parameters
    ----------
    taps : what is read at samples of seams.
    light, noise : (texels, 3) and (texels,), at the lumels; those of the margin are not looked at.

    Returns
    -------
    (texels,) the square of the step of light at the samples that read a texel, in parts of the step that may be noise.
    """
    part = taps.weight * (taps.owner[taps.texel] >= 0)
    total = part.sum(axis=2)
    both = np.flatnonzero((total > 0).all(axis=1))
    texel, part = taps.texel[both], part[both] / total[both, :, None]
    shown = (light[texel] * part[:, :, :, None]).sum(axis=2)
    step = np.abs(shown[:, 0] - shown[:, 1]).mean(axis=1)
    usual = NOISY * np.hypot(*(noise[texel] * part).sum(axis=2).T)
    steps, usuals = (np.bincount(texel.ravel(), (part * each[:, None, None]).ravel(), len(light))
                     for each in (step, usual))
    # Where there is neither step nor noise, nothing moves anyway.
    relative = np.divide(steps, usuals, out=np.full(len(light), np.inf), where=usuals > 0)
    return np.asarray(np.clip(np.square(relative), 1, STIFFEST))


def seam_taps(samples: SeamSamples, lumels: Lumels, scene: Scene) -> Taps:
    """What filtering reads at samples of seams.

    A sample is left out if it reads a lumel of another chart than its own, where charts lie closer than a texel.
    """
    sizes = np.array([(page.width, page.height) for page in lumels.pages], np.int64)
    offset = np.concatenate([[0], np.cumsum(sizes.prod(axis=1))])
    owner = np.full(offset[-1], -1, np.int32)
    owner[texel_of(lumels)] = lumels.chart
    page = lumels.page_of_surface[surface_of_triangle(scene)[samples.triangle]].reshape(-1)
    texel, weight = _taps(samples.uv.reshape(-1, 2) * sizes[page] - 0.5, sizes[page], offset[page])
    texel, weight = texel.reshape(-1, 2, 4), weight.reshape(-1, 2, 4)
    chart, there = lumels.chart_of_triangle[samples.triangle], owner[texel]
    usable = ((there < 0) | (there == chart[:, :, None]) | (weight == 0)).all(axis=(1, 2))
    return Taps(texel[usable], weight[usable], chart[usable], owner)


def _taps(point: Float, size: Int, offset: Int) -> tuple[Int, Float]:
    """The four texels that bilinear filtering reads at a point (n, 2), texels, and their weights."""
    corner = np.floor(point).astype(np.int64)
    part = point - corner
    texel, weight = [], []
    for down in (0, 1):
        for right in (0, 1):
            place = np.clip(corner + np.array([right, down]), 0, size - 1)
            texel.append(offset + place[:, 1] * size[:, 0] + place[:, 0])
            weight.append((part[:, 0] if right else 1 - part[:, 0]) * (part[:, 1] if down else 1 - part[:, 1]))
    return np.stack(texel, axis=1), np.stack(weight, axis=1)


def _solve(column: Int, weight: Float, anchor: Float, step: Float, check: Callable[[], None]) -> Float:
    """The change d (m,) that minimises anchor d^2 + SEAM_WEIGHT (step + difference of d across the seams)^2; `check`
    is called before each iteration, and may raise."""
    flat, count = column.ravel(), len(anchor)

    def transposed(rows: Float) -> Float:
        return np.asarray(np.bincount(flat, (weight * rows[:, None]).ravel(), count), np.float64)

    def differences(x: Float) -> Float:
        return np.asarray(np.einsum("ij,ij->i", weight, np.take(x, column)))

    def apply(x: Float) -> Float:
        return np.asarray(anchor * x + SEAM_WEIGHT * transposed(differences(x)))

    diagonal = anchor + SEAM_WEIGHT * np.bincount(flat, (weight**2).ravel(), count)
    residual = np.asarray(-SEAM_WEIGHT * transposed(step))
    change = np.zeros(count)
    direction = z = residual / diagonal
    rho = dot(residual, z)
    goal = TOLERANCE**2 * rho
    for _ in range(MOST_STEPS):
        if rho <= goal:
            break
        check()
        image = apply(direction)
        curvature = dot(direction, image)
        if not curvature > 0:
            break
        length = rho / curvature
        change += length * direction
        residual -= length * image
        z = residual / diagonal
        rho, before = dot(residual, z), rho
        direction = z + rho / before * direction
    return change

"""A bake in other light and other colours: kept groups in their new strengths, and what new reflectances change.

No ray is traced. See `groups` for lights, `paths` and `recolour` for reflectances.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .across import links
from .errors import SettingsError
from .finish import finished
from .groups import KEPT_AS, GroupLight, shown
from .kernels import kernels
from .layout import Layout
from .lumels import lumels as lay_out
from .mixing import Layer, mix
from .neighbours import LumelNeighbours, Neighbours
from .parallel import Run
from .quantities import encode
from .receivers import Page, Receivers
from .recolour import bounced_change
from .result import Bake
from .scene import Scene
from .seam_samples import seam_samples
from .seams import Seams
from .settings import Settings
from .smooth import smooth
from .vertices import corner_receivers

Float = NDArray[np.floating[Any]]
Progress = Callable[[str, float], None]


def relight(bake: Bake, settings: Settings, strengths: Mapping[str, ArrayLike] | None = None,
            scene: Scene | None = None, progress: Progress | None = None,
            cancelled: Callable[[], bool] | None = None) -> Bake:
    """What the bake would be in other light, or with other reflectances.

    Parameters
    ----------
    bake : with light groups, whose layers may be arrays or `mixing.Layer`; with paths, where reflectances change.
    settings : of the bake.
    strengths : by the groups' names, what each layer is multiplied by, a number or (3,); None for what it was.
    scene : the scene that was baked, with other reflectances or textures; None where these are what they were.

    Returns
    -------
    Bake
        With lightmaps or corner colours anew; `groups.tints` are the strengths. With a scene, its reflectances' part in
        the light is in no group, and the report has `recoloured`: kept rays of a receiver, and the RMS sampling error
        of that part over the mean light.

    Raises
    ------
    SettingsError
        If other groups are named than the bake has, if it has no paths, or if its quantity is radiosity.
    SceneError
        See `recolour.bounced_change`.
    """
    wanted = bake.groups.tints if strengths is None else strengths
    if set(wanted) != set(bake.groups.layers):
        raise SettingsError(f"strengths are given of {sorted(wanted)}, and the bake kept {sorted(bake.groups.layers)}: "
                            "give one for each group")
    factors = {name: np.array(np.broadcast_to(np.asarray(wanted[name], np.float32), 3)) for name in bake.groups.layers}
    mixed = _mixed(bake, factors) if factors else bake
    if scene is not None:
        mixed = _recoloured(mixed, scene, settings, Run(settings.thread_count, progress, cancelled))
    if factors:
        mixed = _with(mixed, [shown(one, settings.quantity) for one in _lit(mixed)])
    return mixed


def _mixed(bake: Bake, factors: dict[str, Float]) -> Bake:
    """The groups in their strengths, as they are kept."""
    table = np.array(list(factors.values()))
    totals = [mix(parts, table) if isinstance(parts[0], Layer) else
              np.asarray(sum(part * factor for part, factor in zip(parts, table, strict=True)), np.float32)
              for parts in zip(*bake.groups.layers.values(), strict=True) if parts[0] is not None]
    # Vertex colours of single groups may be below zero; what is shown is not.
    return replace(_with(bake, [np.maximum(total, 0) for total in totals]),
                   groups=GroupLight(bake.groups.layers, factors))


def _lit(bake: Bake) -> list[Float]:
    """Pixels of all pages, or colours of all objects that have some."""
    if bake.corner_colours is not None:
        return [colours for colours in bake.corner_colours if colours is not None]
    return [page.pixels for page in bake.lightmaps]


def _with(bake: Bake, values: Sequence[Float]) -> Bake:
    """The bake with other pixels or colours, in the order of `_lit`."""
    if bake.corner_colours is not None:
        fresh = iter(values)
        return replace(bake, corner_colours=tuple(
            None if colours is None else next(fresh) for colours in bake.corner_colours))
    return replace(bake, lightmaps=tuple(replace(page, pixels=pixels)
                                         for page, pixels in zip(bake.lightmaps, values, strict=True)))


def _recoloured(bake: Bake, scene: Scene, settings: Settings, run: Run) -> Bake:
    """Mixed light, as it is kept, with what the scene's reflectances change in it."""
    if settings.quantity == "radiosity":
        raise SettingsError("radiosity holds the colours of the surfaces themselves, and its light can't be told from "
                            "them any more: bake again")
    if settings.passes == "direct":
        return bake
    if bake.paths is None:
        raise SettingsError("the bake kept nothing that other reflectances could be worked out from: bake again, and "
                            "keep its paths")
    factors = np.array(list(bake.groups.tints.values()) or [np.ones(3)])
    quantity = KEPT_AS.get(settings.quantity, settings.quantity) if bake.groups.tints else settings.quantity
    looks = [encode(look, quantity, np.ones_like(look)) for look in bounced_change(bake.paths, scene, factors, run)]
    add = _add_to_corners if settings.target == "vertex" else _add_to_lumels
    values, noise = add(bake, scene, settings, looks, run)
    level = float(np.concatenate([one.reshape(-1, 3) for one in values]).mean())
    told = {"rays_kept": bake.paths.rays, "noise": noise / max(level, 1e-30)}
    return replace(_with(bake, values), report={**bake.report, "recoloured": told})


def _add_to_lumels(bake: Bake, scene: Scene, settings: Settings, looks: Sequence[Float],
                   run: Run) -> tuple[list[Float], float]:
    """Pages with a change, given as two looks at it, and the RMS error of their mean."""
    pages = tuple(Page(page.name, page.pixels.shape[1], page.pixels.shape[0]) for page in bake.lightmaps)
    lumels = lay_out(scene, settings, [], run.step, Layout(pages, bake.page_of_surface, bake.uv))
    samples = seam_samples(lumels, scene, run.check)
    near = LumelNeighbours(lumels, links(samples, lumels, scene))
    change, noise = _smoothed(looks, lumels.receivers, near, run)
    for number, page in enumerate(bake.lightmaps):
        here = lumels.page == number
        change[here] += page.pixels.reshape(-1, 3)[lumels.pixel[here]]
    values = np.maximum(change, 0)
    # What was baked agrees across the seams already.
    size = np.abs(noise).mean(axis=1)
    errors = size / np.maximum(values.mean(axis=1), np.maximum(size, 1e-30))
    return finished(lumels, Seams(samples, lumels, scene, values, errors), values, settings, run), _rms(noise)


def _smoothed(looks: Sequence[Float], receivers: Receivers, near: Neighbours, run: Run) -> tuple[Float, Float]:
    """The mean of two looks at a change, smoothed as gathered light is, and a sample of its error."""
    nothing = np.zeros_like(looks[0])
    first, second = (np.concatenate([nothing, look], axis=1) for look in looks)
    first, second = smooth(first, second, kernels(receivers, near, run), run)
    return (first + second)[:, 3:6] / 2, (first - second)[:, 3:6] / 2


def _add_to_corners(bake: Bake, scene: Scene, settings: Settings, looks: Sequence[Float],
                    run: Run) -> tuple[list[Float], float]:
    """Colours of objects, likewise."""
    receivers, near, fit = corner_receivers(scene, settings, run)
    change, noise = _smoothed(looks, receivers, near, run)
    # A part of a whole that is above zero everywhere: the change itself may well be below.
    fitted = [part for part in fit(change, np.ones_like(change)) if part is not None]
    total = [np.maximum(before + part, 0) for before, part in zip(_lit(bake), fitted, strict=True)]
    return total, _rms(noise)


def _rms(values: Float) -> float:
    return float(np.sqrt(np.mean(np.square(values, dtype=np.float64))))

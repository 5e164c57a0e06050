"""Light groups: lamps, emissive triangles or the sky whose light is baked apart, so that it can be changed afterwards.

Light is linear and its channels do not mix, so a group is baked under white light of its own strength, and its colour,
the *tint*, is multiplied in afterwards: a change of power or colour is another tint, also for a channel that was dark.
The lightmap is the sum of the groups, each times its tint.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .errors import SceneError
from .quantities import encode
from .scene import Scene

Float = NDArray[np.floating[Any]]

# Parts of red, green and blue in two lights that differ by less are one chromaticity.
CHROMATICITY_STEP = 1e-4
WHITE = np.ones(3, np.float32)
# Quantities that mix the channels, and as what their groups are kept.
KEPT_AS = {"illuminance": "irradiance"}


@dataclass(frozen=True, eq=False)
class LightGroup:
    """Light that is baked apart.

    Parameters
    ----------
    name : unique among the groups of a bake.
    lights : indices into `Scene.lights`.
    emission : (t,) bool, the triangles whose emission belongs to it, or None.
    sky : whether the sky belongs to it.
    """

    name: str
    lights: tuple[int, ...] = ()
    emission: NDArray[np.bool_] | None = None
    sky: bool = False


def tint(scene: Scene, group: LightGroup) -> Float:
    """(3,) float32, the brightest channel 1: what the group's white light is to be multiplied by.

    White where it is baked in its own colours: where its members differ in colour, for a sky's map, and for emission
    by a texture.
    """
    if group.sky and scene.sky.radiance.ndim > 1:
        return WHITE
    textured = np.asarray(scene.emission_texture) >= 0
    if group.emission is not None and (textured & group.emission).any():
        return WHITE
    colours = [light.colour for light in (scene.lights[index] for index in group.lights)]
    if group.emission is not None:
        colours += list(np.unique(np.asarray(scene.emission)[group.emission], axis=0))
    if group.sky:
        colours.append(scene.sky.radiance)
    found = np.array([colour for colour in colours if np.any(colour)], np.float64).reshape(-1, 3)
    if not len(found):
        return WHITE
    parts = found / found.max(axis=1, keepdims=True)
    if np.ptp(parts, axis=0).max() > CHROMATICITY_STEP:
        return WHITE
    return np.asarray(parts[np.argmax(found.sum(axis=1))], np.float32)


def is_own_colour(scene: Scene, group: LightGroup) -> bool:
    """Whether a group is baked in its own colours (see `tint`); for white light it is the same."""
    return bool((tint(scene, group) == 1).all())


def check_groups(scene: Scene, groups: Sequence[LightGroup]) -> None:
    """Every light in one group, and no name twice.

    Raises
    ------
    SceneError
        With the light that is in none or in several groups.
    """
    names = [group.name for group in groups]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise SceneError(f"two light groups are called {twice[0]!r}: give each a name of its own")
    times = np.zeros(len(scene.lights), int)
    emission = np.zeros(len(scene.triangles), int)
    for group in groups:
        if group.lights and not (0 <= min(group.lights) and max(group.lights) < len(times)):
            raise SceneError(f"light group {group.name!r} names lamps {group.lights} of {len(times)}")
        np.add.at(times, np.array(group.lights, int), 1)
        if group.emission is not None:
            if np.shape(group.emission) != emission.shape:
                raise SceneError(f"light group {group.name!r}: emission has shape {np.shape(group.emission)}, not "
                                 f"{emission.shape}: give a mask of the triangles")
            emission += group.emission
    lamps = np.array([bool(np.any(light.colour)) for light in scene.lights], bool)
    wrong = np.flatnonzero(lamps & (times != 1))
    if len(wrong):
        raise SceneError(f"lamp {scene.lights[wrong[0]].name!r} is in {times[wrong[0]]} light groups: put it in one")
    unsorted = np.flatnonzero(np.asarray(scene.emission).any(axis=1) & (emission != 1))
    if len(unsorted):
        raise SceneError(f"{scene.whose(int(unsorted[0]))} emits and is in {emission[unsorted[0]]} light groups: "
                         "put it in one")
    skies = sum(group.sky for group in groups)
    if not scene.sky.is_black and skies != 1:
        raise SceneError(f"the sky is in {skies} light groups: put it in one")


@dataclass(frozen=True, eq=False)
class GroupLight:
    """What every group gives, under white light of the strength that it was baked with.

    layers : by the group's name one array (..., 3) a page or object, None where nothing is baked.
    tints : (3,) float32 by name; the sum of layers times tints is the whole.
    """

    layers: dict[str, Any]
    tints: dict[str, Float]


def shown(light: Float, quantity: str) -> Float:
    """What `GroupLight` keeps (..., 3), as the quantity that is asked for."""
    if quantity not in KEPT_AS:
        return light
    return encode(light.reshape(-1, 3), quantity, np.ones(3, np.float32)).reshape(light.shape)

"""Light groups: lamps, emissive triangles or the sky whose light is baked apart, so that it can be changed afterwards.

Light is linear and its channels do not mix, so a group is baked under white light of its own strength, and its colour,
the *tint*, is multiplied in afterwards: a change of power or colour is another tint, also for a channel that was dark.
The lightmap is the sum of the groups, each times its tint.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .errors import SceneError
from .lights import Light, LightSample
from .quantities import encode
from .scene import Scene, Sky

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


@dataclass(frozen=True, eq=False)
class Tinted:
    """A lamp in another colour. Its light has one chromaticity, as every lamp's here has (see `Light.colour`)."""

    lamp: Light
    colour: Float

    @property
    def name(self) -> str:
        """The lamp's."""
        return self.lamp.name

    @property
    def _factor(self) -> Float:
        """(3,) what the strongest channel of the lamp's own colour is multiplied by."""
        return np.asarray(self.colour / max(float(np.max(self.lamp.colour)), 1e-30), np.float32)

    @property
    def _channel(self) -> int:
        return int(np.argmax(self.lamp.colour))

    def power(self) -> Float:
        """(3,) float32: flux that leaves the lamp, W."""
        return np.asarray(self.lamp.power()[self._channel] * self._factor)

    def irradiance(self, points: Float, normals: Float) -> Float | None:
        """Unoccluded irradiance (n, 3) float32, W/m2, or None."""
        closed = self.lamp.irradiance(points, normals)
        return None if closed is None else np.asarray(closed[:, self._channel, None] * self._factor)

    def sample(self, points: Float, normals: Float, uv: Float) -> LightSample:
        """The lamp's."""
        return self.lamp.sample(points, normals, uv)

    def translated(self, offset: Float) -> Tinted:
        """The same lamp, moved by (3,) metres."""
        return Tinted(self.lamp.translated(offset), self.colour)


def tint(scene: Scene, group: LightGroup) -> Float:
    """(3,) float32, the brightest channel 1: what the group's white light is to be multiplied by.

    White where its members differ in colour, and for a sky's map: their own colours are baked then.
    """
    if group.sky and scene.sky.radiance.ndim > 1:
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


def alone(scene: Scene, group: LightGroup) -> Scene:
    """The scene with no light but the group's, in white (see `tint`)."""
    colour = tint(scene, group)
    mixed = bool((colour == 1).all())
    white = (lambda value: value) if mixed else (lambda value: np.repeat(np.max(value, axis=-1, keepdims=True), 3, -1))
    lights = tuple(light if mixed else Tinted(light, white(light.colour))
                   for light in (scene.lights[index] for index in group.lights))
    emission = np.zeros_like(scene.emission)
    if group.emission is not None:
        emission[group.emission] = white(np.asarray(scene.emission)[group.emission])
    sky = Sky(white(scene.sky.radiance)) if group.sky else Sky()
    return replace(scene, lights=lights, emission=emission, sky=sky)


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

    layers : by the group's name one value, or one array (..., 3) a page or object, None where nothing is baked.
    tints : (3,) float32 by name; the sum of layers times tints is the whole.
    """

    layers: dict[str, Any]
    tints: dict[str, Float]

    def encoded(self, quantity: str, reflectance: Float,
                finish: Callable[[Float], Sequence[Float | None]]) -> GroupLight:
        """From values (n, 3) of receivers to images or corner colours, by `finish`.

        Illuminance mixes the channels, so it is kept as irradiance until `total`.
        """
        kept = KEPT_AS.get(quantity, quantity)
        return GroupLight({name: tuple(finish(encode(values, kept, reflectance)))
                           for name, values in self.layers.items()}, self.tints)

    def total(self, quantity: str, whole: Sequence[Any]) -> list[Any]:
        """The sum of the groups; `whole` if there are none."""
        return mixed(list(self.layers.values()), list(self.tints.values()), quantity) if self.layers else list(whole)


def mixed(layers: Sequence[Sequence[Float | None]], factors: Sequence[Float], quantity: str) -> list[Float | None]:
    """The sum of groups, each an array (..., 3) or None for every page or object, times their factors (3,)."""
    totals: list[Float | None] = []
    for parts in zip(*layers, strict=True):
        there = [part for part in parts if part is not None]
        if not there:
            totals.append(None)
            continue
        total = sum(np.asarray(part * factor, np.float32) for part, factor in zip(there, factors, strict=True))
        totals.append(shown(np.asarray(total), quantity))
    return totals


def shown(light: Float, quantity: str) -> Float:
    """What `GroupLight.encoded` keeps (..., 3), as the quantity that is asked for."""
    if quantity not in KEPT_AS:
        return light
    return encode(light.reshape(-1, 3), quantity, np.ones(3, np.float32)).reshape(light.shape)


def in_groups(scene: Scene, groups: Sequence[LightGroup], light: Callable[[Scene], Float]) -> GroupLight:
    """Every group's light at the receivers, (n, 3) W/m2.

    light : irradiance (n, 3) of a scene that is lit by one group alone.
    """
    check_groups(scene, groups)
    return GroupLight({group.name: light(alone(scene, group)) for group in groups},
                      {group.name: tint(scene, group) for group in groups})

"""Light groups on their way through a bake: every table that holds light has three more columns for each of them.

What rays are sent, where patches are split and what is smoothed is decided by all light together; the groups only add
up what those same rays bring. So a bake with groups is the bake without them, and the groups add up to it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .geometry import Geometry
from .groups import KEPT_AS, GroupLight, LightGroup, check_groups, is_own_colour, tint
from .lights import Light
from .quantities import encode
from .scene import Scene
from .sources import sources_by_kind

Float = NDArray[np.floating[Any]]


@dataclass(frozen=True, eq=False)
class Split:
    """Which light belongs to which group.

    names : of the groups.
    tints : (g, 3) float32 (see `groups.tint`).
    own_colour : (g,) bool, groups that are baked in their own colours, not in white.
    triangle_group : (t,) int32, the group of each triangle's emission, -1 for none.
    sky_group : the group of the sky, -1 for none.
    lamp_group : (lamps,) int32 of the lamps that are looked at, emissive triangles among them.
    lamp_colour : (lamps, 3) float32, what the group's column has in place of `Light.colour`.
    passes : which of the groups' gathered light is wanted, as in `Settings`.
    """

    names: tuple[str, ...]
    tints: Float
    own_colour: NDArray[np.bool_]
    triangle_group: NDArray[np.int32]
    sky_group: int
    lamp_group: NDArray[np.int32]
    lamp_colour: Float
    passes: str

    def __len__(self) -> int:
        return len(self.names)

    @property
    def columns(self) -> int:
        """Columns of a table of light: three for all of it, and three for each group."""
        return 3 + 3 * len(self.names)

    def first_column(self, group: int) -> int:
        """Where a group's three columns begin."""
        return 3 + 3 * group

    def white(self, group: int, values: Float) -> Float:
        """Light (..., 3) of a group, without its tint."""
        if self.own_colour[group]:
            return values
        return np.repeat(values.max(axis=-1, keepdims=True), 3, axis=-1)


def split_lights(geometry: Geometry, groups: Sequence[LightGroup],
                 passes: str) -> tuple[tuple[Light, ...], NDArray[np.bool_], Split]:
    """The scene's light sources, as `sources.light_sources`, and how they fall into groups.

    Raises
    ------
    SceneError
        If a light is in no group or in several.
    """
    scene = geometry.scene
    check_groups(scene, groups)
    owner = np.full(len(scene.triangles), -1, np.int32)
    for number, group in enumerate(groups):
        if group.emission is not None:
            owner[group.emission] = number
    lamps, is_lamp, kinds = sources_by_kind(geometry, owner)
    own_colour = np.array([is_own_colour(scene, group) for group in groups], bool)
    lamp_group = np.concatenate([_of_lights(scene, groups), kinds]).astype(np.int32)
    colours = np.array([lamp.colour for lamp in lamps], np.float32).reshape(-1, 3)
    white = np.repeat(colours.max(axis=1, keepdims=True, initial=0), 3, axis=1)
    tints = np.array([tint(scene, group) for group in groups], np.float32)
    sky = next((number for number, group in enumerate(groups) if group.sky), -1)
    return lamps, is_lamp, Split(tuple(group.name for group in groups), tints, own_colour, owner, sky, lamp_group,
                                 np.where(own_colour[lamp_group][:, None], colours, white), passes)


def _of_lights(scene: Scene, groups: Sequence[LightGroup]) -> NDArray[np.int32]:
    """The group of each of the scene's lamps that shine."""
    owner = np.full(len(scene.lights), -1, np.int32)
    for number, group in enumerate(groups):
        owner[list(group.lights)] = number
    return owner[[bool(np.any(light.colour)) for light in scene.lights]]


def group_light(split: Split | None, apart: Float, quantity: str, reflectance: Float,
                finish: Callable[[Float], Sequence[Float | None]]) -> GroupLight:
    """The groups' images or corner colours, from their irradiance (n, 3 g) at the receivers, by `finish`.

    Illuminance mixes the channels, so it is kept as irradiance (see `groups.shown`).
    """
    layers: dict[str, tuple[Float | None, ...]] = {}
    for number, name in enumerate(split.names if split is not None else ()):
        values = encode(apart[:, 3 * number:3 * number + 3], KEPT_AS.get(quantity, quantity), reflectance)
        layers[name] = tuple(finish(values))
    return GroupLight(layers, {} if split is None else dict(zip(split.names, split.tints, strict=True)))

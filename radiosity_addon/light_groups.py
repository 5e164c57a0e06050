"""Which lights of a Blender scene are baked apart, and by what each is multiplied when they have changed since."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ..solver.errors import RadiosityError, SettingsError
from ..solver.groups import LightGroup, tint
from ..solver.scene import Scene
from .sockets import Triple
from .survey import Survey

Float = NDArray[np.floating[Any]]

MODES = ("none", "lamp", "collection", "all")
# What lamps without a collection of their own are called, and all lamps together.
LOOSE, EVERY = "Lamps", "Lamps"
# A bake keeps a layer a group and carries them all along.
MOST_GROUPS = 64
# Members of a group may differ by this part in what they are multiplied by.
TOGETHER = 1e-3
BLACK: Triple = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Member:
    """A part of a light in a group.

    kind, name, part : "lamp", "material" or "world"; its name; and the name of the part that has a strength.
    reference : the strength of each channel that the group's layer is baked with; inf for a channel that gives nothing.
    """

    kind: str
    name: str
    part: str
    reference: Triple


@dataclass(frozen=True, eq=False)
class Group:
    """A light group as it is kept: its members, and the tint that it had when it was baked."""

    name: str
    members: tuple[Member, ...]
    tint: Triple

    def factors(self, seen: Survey) -> Float:
        """(3,) float64: what its layer is to be multiplied by.

        Raises
        ------
        RadiosityError
            If its members are not changed alike.
        """
        if not self.members:
            return np.array(self.tint, np.float64)
        ratios = np.array([self._ratio(member, strength_of(seen, member)) for member in self.members])
        known = ~np.isnan(ratios)
        factors = np.array([ratios[known[:, channel], channel].max(initial=0) for channel in range(3)])
        apart = known & (np.abs(np.nan_to_num(ratios) - factors) > TOGETHER * np.maximum(factors, 1e-9))
        if apart.any():
            member = self.members[int(np.flatnonzero(apart.any(axis=1))[0])]
            if len(self._names()) == 1:
                raise RadiosityError(f"the parts of {member.kind} {member.name!r} that give light were changed each "
                                     "otherwise, and their light is kept together: change them by the same factor, or "
                                     "bake again")
            raise RadiosityError(f"{member.kind} {member.name!r} was changed otherwise than the rest of light group "
                                 f"{self.name!r}, whose light is kept together: change them alike, or bake again with "
                                 "a group for each lamp")
        return factors

    def _names(self) -> set[str]:
        """Of lights: of lamps there may be several, materials and the world are a group each."""
        return {member.name for member in self.members}

    def _ratio(self, member: Member, strength: Triple) -> list[float]:
        """New strength over the reference; nan where a channel was and stays dark."""
        ratios = []
        for new, old in zip(strength, member.reference, strict=True):
            if old == 0 and new > 0:
                apart = ", with a group for each lamp" if len(self._names()) > 1 else ""
                raise RadiosityError(f"{member.kind} {member.name!r} has a colour that it had nothing of at the bake, "
                                     f"and shares its light group with other colours: bake again{apart}")
            ratios.append(new / old if old > 0 else np.nan)
        return ratios


def make_groups(scene: Scene, seen: Survey, mode: str) -> tuple[tuple[LightGroup, Group], ...]:
    """The groups of an exported scene, for the solver and to be kept.

    Parameters
    ----------
    scene : as exported, its lamps first among the lights.
    seen : the scene's survey, of the same moment.
    mode : one of MODES but "none".

    Raises
    ------
    SettingsError
        If there would be too many.
    """
    lamps: dict[str, list[int]] = defaultdict(list)
    objects = {item.name_full: item for item in bpy.data.objects if item.type == "LIGHT"}
    for index, light in enumerate(scene.lights[: seen.lamp_count]):
        lamps[_group_of(light.name, objects, mode)].append(index)
    taken: set[str] = set()
    made = []
    for name, indices in lamps.items():
        names = dict.fromkeys(scene.lights[index].name for index in indices)
        made.append(_with_members(scene, LightGroup(_unique(name, "", taken), tuple(indices)), seen, "lamp", names))
    emission, material = np.asarray(scene.emission).any(axis=1), np.asarray(scene.material)
    for number in np.unique(material[emission]):
        name = scene.material_names[number] if number >= 0 else "emission"
        group = LightGroup(_unique(name, "material", taken), emission=emission & (material == number))
        made.append(_with_members(scene, group, seen, "material", [name]))
    suns = tuple(range(seen.lamp_count, len(scene.lights)))
    if suns or not scene.sky.is_black:
        group = LightGroup(_unique("World", "world", taken), suns, sky=not scene.sky.is_black)
        made.append(_with_members(scene, group, seen, "world", ["World"]))
    if len(made) > MOST_GROUPS:
        raise SettingsError(f"there would be {len(made)} light groups, and {MOST_GROUPS} can be kept: group lamps by "
                            "collection or all in one (--groups)")
    return tuple(made)


def strength_of(seen: Survey, member: Member) -> Triple:
    """Red, green and blue now; black for what is off or gone."""
    source = seen.source(member.kind, member.name)
    return source.strengths.get(member.part, BLACK) if source is not None else BLACK


def _with_members(scene: Scene, group: LightGroup, seen: Survey, kind: str,
                  names: Sequence[str] | dict[str, None]) -> tuple[LightGroup, Group]:
    colour = tint(scene, group)
    members = []
    for name in names:
        source = seen.source(kind, name)
        for part, strength in (source.strengths if source is not None else {}).items():
            if any(strength):
                members.append(Member(kind, name, part, _reference(strength, colour)))
    red, green, blue = (float(value) for value in colour)
    return group, Group(group.name, tuple(members), (red, green, blue))


def _reference(strength: Triple, colour: Float) -> Triple:
    """The strength at which a light of white colour would give the layer.

    A layer is what the light gives over its tint; a channel that was dark was baked as bright as the brightest.
    """
    whole = [old / part if part > 0 else np.inf for old, part in zip(strength, colour, strict=True)]
    brightest = max(value for value in whole if np.isfinite(value))
    red, green, blue = (float(brightest if part <= 0 and old <= 0 else value)
                        for value, part, old in zip(whole, colour, strength, strict=True))
    return red, green, blue


def _group_of(lamp: str, objects: Mapping[str, Any], mode: str) -> str:
    if mode == "lamp":
        return lamp
    if mode == "all":
        return EVERY
    item = objects.get(lamp)
    own = [collection.name for collection in item.users_collection] if item is not None else []
    return own[0] if own and own[0] in bpy.data.collections else LOOSE


def _unique(name: str, kind: str, taken: set[str]) -> str:
    """A name that no other group has."""
    found, number = name, 1
    while found in taken:
        number += 1
        found = f"{name} ({kind})" if kind and number == 2 else f"{name} {number}"
    taken.add(found)
    return found

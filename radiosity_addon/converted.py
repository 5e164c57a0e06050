"""What a bake converted to meshes, for kept light, which speaks of the scene as it was before.

A relight may meet either: the file that was saved with the meshes, or the one that was baked.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from .binding import Binding
from .survey import Survey


@dataclass(frozen=True)
class Converted:
    """A mesh object that stands for a surface.

    object : its name.
    place, mesh, read : sums of it when it was made, as `Survey` has them.
    """

    object: str
    place: str
    mesh: str
    read: dict[str, str]


def converted(before: Sequence[Binding], after: Sequence[Binding], seen: Survey) -> dict[str, Converted]:
    """What was converted, by surface; `seen` is the scene after it."""
    return {old.surface: Converted(new.object, seen.places[new.object], seen.meshes[new.object],
                                   seen.read.get(new.object, {}))
            for old, new in zip(before, after, strict=True)
            if new.object != old.object and new.object in seen.places}


def present(known: Mapping[str, Converted], seen: Survey) -> dict[str, Converted]:
    """Those that the scene shows in place of their surface."""
    return {surface: made for surface, made in known.items()
            if made.object in seen.places and surface not in seen.places}


def as_before(seen: Survey, baked: Survey, made: Mapping[str, Converted]) -> Survey:
    """A scene in the words of the one that was baked: what is as it was made counts as what it stands for."""
    surface_of = {entry.object: surface for surface, entry in made.items()}

    def renamed(values: Mapping[str, Any]) -> dict[str, Any]:
        return {surface_of.get(name, name): value for name, value in values.items()}

    places, meshes, read = renamed(seen.places), renamed(seen.meshes), renamed(seen.read)
    for surface, entry in made.items():
        if places[surface] == entry.place:
            places[surface] = baked.places[surface]
        if meshes[surface] == entry.mesh:
            meshes[surface] = baked.meshes[surface]
        if read.get(surface, {}) == entry.read:
            read[surface] = baked.read.get(surface, {})
    return replace(seen, places=places, meshes=meshes, materials=renamed(seen.materials), links=renamed(seen.links),
                   missed=renamed(seen.missed), read=read)

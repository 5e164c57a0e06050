"""Light and shadow linking, as Cycles reads Blender's collections (Object > Shading > Light Linking).

1. A linking collection says of each of its own objects and child collections whether it is included or excluded; what
   it says of a child counts for all objects in it, at any depth. Of an object that is met several times the last word
   counts, and objects come after children.
2. Where anything is included, all else is left out. Otherwise all else takes part: an empty collection changes nothing.
3. An instance is taken for its instancer where that is in a linking collection of any light, else for what it shows.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ..solver.linking import Links
from .visible import Shown

INCLUDE = "INCLUDE"
# Blender's words for the collections of whom a light reaches, and of who stops it.
WORDS = ("receiver_collection", "blocker_collection")


class Linking:
    """The links of a scene's lamps and emissive meshes.

    Parameters
    ----------
    depsgraph : evaluated bpy dependency graph.
    shown : its meshes, which are the surfaces of the solver's scene.
    """

    def __init__(self, depsgraph: Any, shown: Sequence[Shown]) -> None:
        objects = [item.original for item in depsgraph.ids if isinstance(item, bpy.types.Object)]
        self._receivers, self._blockers = (_Masks(word, objects, shown) for word in WORDS)
        # One object for all lights that are linked alike: the solver takes such emissive meshes together.
        self._links: dict[tuple[Any, Any], Links | None] = {}

    def of(self, item: Any) -> Links | None:
        """The links of a bpy object; None if it reaches everything and everything stops its light."""
        key = (self._receivers.collection(item), self._blockers.collection(item))
        if key not in self._links:
            (receivers, probes), (blockers, _) = self._receivers.of(key[0]), self._blockers.of(key[1])
            is_free = receivers.all() and blockers.all()
            self._links[key] = None if is_free else Links(receivers, blockers, probes)
        return self._links[key]


class _Masks:
    """Which meshes are linked, by collection.

    Parameters
    ----------
    word : "receiver_collection" or "blocker_collection".
    objects : all original objects that a render knows.
    shown : the meshes.
    """

    def __init__(self, word: str, objects: Sequence[Any], shown: Sequence[Shown]) -> None:
        self._word = word
        collections = {self.collection(item) for item in objects} - {None}
        self._states = {collection: states(collection) for collection in collections}
        told = {item for found in self._states.values() for item in found}
        self._owners = [item.parent if item.parent in told else item.original for item in shown]

    def collection(self, item: Any) -> Any:
        """The linking collection of a bpy object, or None."""
        return getattr(item.original.light_linking, self._word)

    def of(self, collection: Any) -> tuple[NDArray[np.bool_], bool]:
        """Which meshes (s,) are linked by a collection, and whether what it says nothing of is."""
        found = self._states.get(collection, {})
        rest = INCLUDE not in found.values()
        return np.array([found[item] == INCLUDE if item in found else rest for item in self._owners], bool), rest


def told() -> dict[Any, dict[Any, str]]:
    """The `states` of every collection of the file that a light is linked by."""
    collections = {getattr(item.light_linking, word) for item in bpy.data.objects for word in WORDS} - {None}
    return {collection: states(collection) for collection in collections}


def states(collection: Any) -> dict[Any, str]:
    """"INCLUDE" or "EXCLUDE" by original object."""
    found: dict[Any, str] = {}
    for child, entry in zip(collection.children, collection.collection_children, strict=True):
        for inner in (child, *child.children_recursive):
            found |= dict.fromkeys(inner.objects, entry.light_linking.link_state)
    for item, entry in zip(collection.objects, collection.collection_objects, strict=True):
        found[item] = entry.light_linking.link_state
    return found

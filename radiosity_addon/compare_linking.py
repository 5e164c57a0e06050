"""Light linking in the diffuse twin, whose meshes hold many objects each: those that are linked alike go together.

The twin says it all by exclusion. With inclusion Cycles loses light of wide lamps behind what does not stop it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ..solver.linking import FREE, Links, links_of
from ..solver.scene import Scene

Mask = NDArray[np.bool_]
# What Blender calls a light's two linking collections, in the order of `masks`.
COLLECTIONS = ("receiver_collection", "blocker_collection")


def masks(links: Links, surfaces: int) -> Mask:
    """(2, s) bool: the surfaces that a light reaches, and those that stop it."""
    return np.stack([np.broadcast_to(np.asarray(mask), surfaces) for mask in (links.receivers, links.blockers)])


def kinds(scene: Scene) -> tuple[NDArray[np.int64], NDArray[np.int64], Mask]:
    """The kind of each surface (s,); a surface of each kind (k,); and what each kind's emission is linked to (k, 2, s).

    Surfaces are of one kind if all lights reach them, or are stopped by them, alike, and they glow for the same ones.
    """
    count = len(scene.surfaces)
    own = [surface.links or FREE for surface in scene.surfaces]
    number = {links: index for index, links in enumerate(dict.fromkeys([*own, *map(links_of, scene.lights)]))}
    column = np.concatenate([*(masks(links, count) for links in number), [[number[links] for links in own]]])
    _, first, kind = np.unique(column, axis=1, return_index=True, return_inverse=True)
    return kind.reshape(-1), first, np.array([masks(own[surface], count) for surface in first])


class TwinLinks:
    """Links lamps and meshes of the twin.

    Parameters
    ----------
    meshes : objects of the twin, and a surface of the kind that each is of.
    """

    def __init__(self, meshes: Sequence[tuple[Any, int]]) -> None:
        self._meshes = meshes
        self._collections: dict[bytes, Any] = {}

    def link(self, item: Any, wanted: Mask) -> None:
        """Give an object of the twin its links, (2, s) bool as `masks`."""
        for word, mask in zip(COLLECTIONS, wanted, strict=True):
            if not mask.all():
                setattr(item.light_linking, word, self._without(mask))

    def _without(self, mask: Mask) -> Any:
        """A collection that excludes all meshes but those of some surfaces."""
        left_out = np.array([not mask[surface] for _, surface in self._meshes])
        key = left_out.tobytes()
        if key not in self._collections:
            made = bpy.data.collections.new("left out")
            for (mesh, _), is_out in zip(self._meshes, left_out, strict=True):
                if is_out:
                    made.objects.link(mesh)
            for entry in made.collection_objects:
                entry.light_linking.link_state = "EXCLUDE"
            self._collections[key] = made
        return self._collections[key]

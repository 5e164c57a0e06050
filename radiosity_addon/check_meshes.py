"""Findings on meshes: none of their faces there, turned over or in one place, edges of many faces, giant plates."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..solver.mesh_faults import find_faults, inward
from ..solver.scene import Scene
from .binding import Binding
from .giants import giants
from .visible import rendered_objects
from .warn import Warnings, warn

Float = NDArray[np.floating[Any]]

# Faults of fewer faces than this part of a mesh are not worth a line.
WORTH = 1e-3


def check_meshes(scene: Scene, places: dict[str, Float], warnings: Warnings) -> None:
    """Tell of all surfaces.

    Parameters
    ----------
    scene : as exported.
    places : (3,) metres, where each lamp and camera is, by name.
    """
    faults = find_faults(scene)
    hollow, around = inward(scene, np.array(list(places.values()), np.float64).reshape(-1, 3))
    for index, item in enumerate(scene.surfaces):
        worth = max(1.0, WORTH * item.count)
        if faults.turned[index] >= worth:
            warn(warnings, item.name, "flipped", f"{faults.turned[index]} edges have faces that are turned against "
                 "each other, and only the fronts of faces are baked: recalculate normals (Mesh > Normals > "
                 "Recalculate Outside)")
        if hollow[index]:
            warn(warnings, item.name, "flipped", "is closed, faces inward and has nothing inside: its outside is not "
                 "baked; flip its normals (Mesh > Normals > Flip) if it is seen from outside")
        inside = [name for name, owner in zip(places, around, strict=True) if owner == index]
        if inside:
            warn(warnings, item.name, "flipped", f"faces outward, but {', '.join(map(repr, inside[:3]))} "
                 f"{'is' if len(inside) == 1 else 'are'} inside: its inside is not baked; flip its normals (Mesh > "
                 "Normals > Flip), or give it walls with a thickness (Solidify)")
        if faults.crowded[index] >= worth:
            warn(warnings, item.name, "non_manifold", f"{faults.crowded[index]} edges belong to more than two faces, "
                 "where inside and outside are not clear: select them (Select > All by Trait > Non Manifold) and "
                 "remove the faces that are too many")
        if faults.doubled[index] >= worth:
            other = scene.surfaces[faults.partner[index]].name
            where = "of its own" if other == item.name else f"of {other!r}"
            warn(warnings, item.name, "overlapping", f"on {faults.doubled[index]} of its {item.count} triangles lies "
                 f"another, mostly {where}, that faces the same way: which one a render shows is chance; delete one of "
                 "them (Mesh > Merge > By Distance) or move them apart")
    _giants(scene, warnings)


def check_faces(view_layer: Any, bindings: Iterable[Binding], warnings: Warnings) -> None:
    """Tell of the meshes of which a render shows nothing, as they have no faces and make none."""
    shown = {name for binding in bindings for name in (binding.object, binding.instancer)}
    for item in rendered_objects(view_layer):
        if item.type == "MESH" and not item.data.polygons and item.name not in shown:
            warn(warnings, item.name, "no_faces", "has no faces, and nothing of it is baked: fill it (Mesh > Face in "
                 "Edit Mode), or hide it from renders")


def _giants(scene: Scene, warnings: Warnings) -> None:
    """Plates that dwarf all else by the user's own word; the others were told of when they got their fair share."""
    for giant in giants(scene):
        warn(warnings, scene.surfaces[giant.index].name, "giant", f"is {giant.extent:.4g} m wide, {giant.times:.0f} "
             f"times all else, and takes {giant.share:.0%} of the lumels: exclude it, lower its density factor (object "
             "properties > Radiosity Lightmaps), or cut off what nobody sees")

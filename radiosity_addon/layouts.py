"""One layout for all objects that share a mesh: a mesh holds one UV map, so its objects get an image each instead.

Works on arrays alone; unwrapping takes long and runs in the worker thread.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..solver.layout import make_layout
from ..solver.scene import Scene, Surface
from ..solver.settings import Settings
from .binding import Binding
from .warn import Warnings, warn

Float = NDArray[np.floating[Any]]


def with_shared_layouts(scene: Scene, bindings: Sequence[Binding], settings: Settings, warnings: Warnings,
                        progress: Any = None) -> tuple[Scene, Settings]:
    """The scene with a common `lightmap_uv` on all surfaces that show the same mesh, and the settings to go with it.

    Parameters
    ----------
    scene, bindings : as exported, in the same order.
    settings : what to bake.
    warnings : gets a line where `atlas` can't be had for them.
    progress : callable(fraction) or None.
    """
    groups = _groups(scene, bindings)
    if settings.target != "lightmap" or settings.uv_layer is not None or not groups:
        return scene, settings
    if settings.atlas == "shared":
        for group in groups:
            warn(warnings, bindings[group[0]].surface, "own_image", f"shares its mesh with {len(group) - 1} others: "
                 "each of them gets an image of its own; make them single-user to have them on shared pages")
    first = [scene.surfaces[group[0]] for group in groups]
    layout = make_layout(_part(scene, first), replace(settings, atlas="object"), warnings, progress)
    surfaces = list(scene.surfaces)
    for group, uv in zip(groups, layout.uv, strict=True):
        assert uv is not None
        corners = np.zeros((bindings[group[0]].corner_count, 2), np.float32)
        corners[scene.surfaces[group[0]].corner_ids] = uv
        for index in group:
            surfaces[index] = replace(surfaces[index], lightmap_uv=corners[surfaces[index].corner_ids])
    # Without a word on the atlas, surfaces with a layout get an image each and all others shared pages.
    atlas = None if settings.atlas == "shared" else settings.atlas
    return replace(scene, surfaces=tuple(surfaces)), replace(settings, atlas=atlas)


def _groups(scene: Scene, bindings: Sequence[Binding]) -> list[list[int]]:
    """Indices of receiving surfaces that share a layout; the one with the most triangles, which covers all, first."""
    members: dict[str, list[int]] = defaultdict(list)
    for index, (surface, binding) in enumerate(zip(scene.surfaces, bindings, strict=True)):
        if surface.receives and binding.layout:
            members[binding.layout].append(index)
    return [sorted(group, key=lambda index: -scene.surfaces[index].count)
            for group in members.values() if len(group) > 1]


def _part(scene: Scene, surfaces: Sequence[Surface]) -> Scene:
    """A scene of these surfaces alone: what an unwrap needs to know."""
    rows = np.concatenate([np.arange(s.first, s.first + s.count) for s in surfaces])
    used, triangles = np.unique(scene.triangles[rows], return_inverse=True)
    starts = np.cumsum([0, *(s.count for s in surfaces)])
    moved = tuple(replace(s, first=int(start), links=None) for s, start in zip(surfaces, starts[:-1], strict=True))
    normals = None if scene.corner_normals is None else scene.corner_normals[rows]
    return Scene(scene.vertices[used], triangles.reshape(-1, 3), corner_normals=normals, surfaces=moved)

"""What a bake does for its light groups: chosen before it, kept after it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..solver.groups import LightGroup
from ..solver.result import Bake
from ..solver.scene import Scene
from . import cache
from .binding import Binding
from .converted import Converted, converted
from .export import Exported
from .light_groups import Group, make_groups
from .parts import WINDOW_PART, Parts
from .request import Request
from .survey import Survey, survey_parts


@dataclass(frozen=True, eq=False)
class KeptGroups:
    """The groups of a bake on its way.

    folders : where groups of this scene may lie, the first of them for new ones.
    for_solver, groups : the same groups, in the same order; empty if none are to be kept.
    seen : the scene at the time of the export.
    """

    folders: tuple[Path, ...]
    for_solver: tuple[LightGroup, ...] = ()
    groups: tuple[Group, ...] = ()
    seen: Survey | None = None

    @classmethod
    def of(cls, exported: Scene, scene: Any, view_layer: Any, request: Request,
           part_seconds: float) -> Parts[KeptGroups]:
        """The groups that are asked for, in parts of about so many seconds.

        Raises
        ------
        RadiosityError
            See `make_groups`.
        """
        folders = tuple(cache.places(request.output, scene.name))
        if request.groups == "none":
            return cls(folders)
        seen = yield from survey_parts(scene, view_layer, part_seconds)
        made = make_groups(exported, seen, request.groups)
        return cls(folders, tuple(group for group, _ in made), tuple(group for _, group in made), seen)

    def none(self) -> KeptGroups:
        """No groups, in the same places."""
        return KeptGroups(self.folders)

    def stage(self, bake: Bake, exported: Exported, request: Request) -> Path | None:
        """Write what a relight needs beside its place, and return where; touches no bpy.

        Raises
        ------
        OutputError
            If it can't be written.
        """
        if self.seen is None:
            return None
        return cache.stage(self.folders[0], bake, self.groups, self.seen, request.settings, exported.scene.surfaces,
                           exported.bindings, exported.materials)

    def converted(self, before: Sequence[Binding], after: Sequence[Binding], scene: Any,
                  view_layer: Any) -> Parts[dict[str, Converted]]:
        """What a relight must know of surfaces that were converted to meshes, by surface."""
        if self.seen is None or before == after:
            return {}
        return converted(before, after, (yield from survey_parts(scene, view_layer, WINDOW_PART)))

    def place(self, staged: Path | None, made: Mapping[str, Converted]) -> None:
        """Put it there, with what was converted. Without groups what an earlier bake kept there goes: its light belongs
        to other images.

        Raises
        ------
        OutputError
            If that can't be done.
        """
        for folder in self.folders:
            cache.clear(folder)
        if staged is not None:
            cache.place(staged, self.folders[0], made)

"""What a bake does for its light groups: chosen before it, kept after it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ..solver.groups import LightGroup
from ..solver.result import Bake
from ..solver.scene import Scene
from . import cache
from .export import Exported
from .group_files import write_group_files
from .light_groups import Group, make_groups
from .request import Request
from .survey import Survey, survey


@dataclass(frozen=True, eq=False)
class KeptGroups:
    """The groups of a bake on its way.

    for_solver, groups : the same groups, in the same order; empty if none are to be kept.
    seen : the scene at the time of the export.
    """

    for_solver: tuple[LightGroup, ...] = ()
    groups: tuple[Group, ...] = ()
    seen: Survey | None = None

    @classmethod
    def of(cls, exported: Scene, scene: Any, view_layer: Any, request: Request) -> KeptGroups:
        """The groups that are asked for.

        Raises
        ------
        RadiosityError
            See `make_groups`.
        """
        if request.groups == "none":
            return cls()
        seen = survey(scene, view_layer)
        made = make_groups(exported, seen, request.groups)
        return cls(tuple(group for group, _ in made), tuple(group for _, group in made), seen)

    def keep(self, bake: Bake, exported: Exported, request: Request, scene_name: str,
             outputs: list[dict[str, Any]]) -> None:
        """Put the groups' light where a relight finds it. Without groups what an earlier bake kept there goes: its
        light belongs to other images.

        Raises
        ------
        OutputError
            If it can't be written.
        """
        folders = cache.places(request.output, scene_name)
        for folder in folders:
            cache.clear(folder)
        if self.seen is None:
            return
        cache.keep(folders[0], bake, self.groups, self.seen, request.settings, exported.scene.surfaces,
                   exported.bindings)
        if request.group_layers:
            write_group_files(bake, request, outputs)

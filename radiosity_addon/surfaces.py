"""The meshes and lamps of a scene as a render shows them, read in parts.

Blender hands a render's view of the scene out for one call only, so each part asks for it anew, and goes on where the
last one ended. That takes as long as the scene's modifiers do: a part lasts for a multiple of it.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

from ..solver.errors import NothingToBake, SceneError
from ..solver.lights import Light
from ..solver.settings import Settings
from . import cycles, preview
from .assembly import Assembly
from .binding import Binding
from .lamp_nodes import Emissions
from .lights import export_lights
from .linking import Linking
from .parts import ENDLESS, Parts
from .receiving import choose_receivers
from .visible import shown_meshes
from .warn import Warnings

# A part goes on for as long as it took to begin, times this, however short it is to be.
WORTH = 1.0


@dataclass(frozen=True, eq=False)
class Surfaces:
    """What a scene shows: all meshes, who is baked of them (one binding a mesh, in their order), and the lamps."""

    assembly: Assembly
    bindings: tuple[Binding, ...]
    lamps: tuple[Light, ...]


def surface_parts(scene: Any, view_layer: Any, settings: Settings, emissions: Emissions, warnings: Warnings,
                  convert: bool, part_seconds: float = ENDLESS) -> Parts[Surfaces]:
    """Read the meshes and lamps; `export.export_parts` has the words.

    Raises
    ------
    SceneError, SettingsError, NothingToBake
        With the object, the value and the next step; SceneError too if the scene changes between two parts.
    """
    reader = _Reader(settings, emissions, warnings, convert, part_seconds)
    while reader.has_more:
        reader.begin()
        # A view of an older bake would be read as light of its own.
        with preview.suspended():
            cycles.with_render_depsgraph(scene, view_layer, reader.go_on)
        yield
    return Surfaces(reader.assembly, reader.bindings, reader.lamps)


class _Reader:
    """Goes through the meshes that a render shows, from call to call."""

    def __init__(self, settings: Settings, emissions: Emissions, warnings: Warnings, convert: bool,
                 part_seconds: float) -> None:
        # From the first part on, which knows how lamps and meshes are linked.
        self._assembly: Assembly | None = None
        self.bindings: tuple[Binding, ...] = ()
        self.lamps: tuple[Light, ...] = ()
        self._settings, self._emissions, self._warnings = settings, emissions, warnings
        self._convert, self._part_seconds = convert, part_seconds
        self._begun, self._done = 0.0, 0

    @property
    def assembly(self) -> Assembly:
        """What was read so far."""
        assert self._assembly is not None
        return self._assembly

    @property
    def has_more(self) -> bool:
        """Whether meshes are left."""
        return not self.bindings or self._done < len(self.bindings)

    def begin(self) -> None:
        """A part begins, with Blender's own work."""
        self._begun = time.perf_counter()
        if self._assembly is not None:
            self._assembly.forget_meshes()

    def go_on(self, depsgraph: Any) -> None:
        """Read some meshes."""
        first = not self.bindings
        shown = shown_meshes(depsgraph, self._warnings if first else [])
        if not shown:
            raise NothingToBake("a render of the scene shows no mesh with faces: add one, or make it visible in "
                                "renders")
        if first:
            self.bindings = choose_receivers(shown, self._settings, self._warnings, self._convert)
            linking = Linking(depsgraph, shown)
            self._assembly = Assembly(self._settings, linking, self._warnings)
            self.lamps = export_lights(depsgraph, linking, self._warnings, self._emissions)
        if [item.name for item in shown] != [binding.surface for binding in self.bindings]:
            raise SceneError("the scene was changed while it was read: bake again")
        now = time.perf_counter()
        until = max(self._begun + self._part_seconds, now + WORTH * (now - self._begun))
        while self.has_more:
            self.assembly.add(shown[self._done], self.bindings[self._done])
            self._done += 1
            if time.perf_counter() > until:
                return

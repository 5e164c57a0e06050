"""The meshes and lamps of a scene as a render shows them, read in parts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ..solver.errors import NothingToBake, SceneError
from ..solver.lights import Light
from ..solver.settings import Settings
from .assembly import Assembly
from .binding import Binding
from .lamp_nodes import Emissions
from .lights import export_lights
from .linking import Linking
from .parts import ENDLESS, Parts
from .receiving import choose_receivers
from .render_walk import Clock, walk
from .visible import carriers, rendered_meshes
from .warn import Warnings


@dataclass(frozen=True, eq=False)
class Surfaces:
    """What a scene shows: all meshes, who is baked of them (one binding a mesh, in their order), and the lamps."""

    assembly: Assembly
    bindings: tuple[Binding, ...]
    lamps: tuple[Light, ...]


def surface_parts(scene: Any, view_layer: Any, settings: Settings, emissions: Emissions, warnings: Warnings,
                  convert: bool, part_seconds: float = ENDLESS, *, roughly: bool = False) -> Parts[Surfaces]:
    """Read the meshes and lamps that a render shows; `export.export_parts` has the words, `render_walk.walk` `roughly`.

    Raises
    ------
    SceneError, SettingsError, NothingToBake
        With the object, the value and the next step; SceneError too if the scene changes between two parts.
    """
    reader = _Reader(settings, emissions, warnings, convert)
    yield from walk(scene, view_layer, reader.go_on, part_seconds, roughly=roughly)
    return Surfaces(reader.assembly, reader.bindings, reader.lamps)


class _Reader:
    """Goes through the meshes that a render shows, from part to part."""

    def __init__(self, settings: Settings, emissions: Emissions, warnings: Warnings, convert: bool) -> None:
        # From the first part on, which knows how lamps and meshes are linked.
        self._assembly: Assembly | None = None
        self.bindings: tuple[Binding, ...] = ()
        self.lamps: tuple[Light, ...] = ()
        self._settings, self._emissions, self._warnings, self._convert = settings, emissions, warnings, convert
        self._done = 0

    @property
    def assembly(self) -> Assembly:
        """What was read so far."""
        assert self._assembly is not None
        return self._assembly

    def go_on(self, depsgraph: Any, clock: Clock) -> bool:
        """Read some meshes; whether these were the last."""
        first = not self.bindings
        shown = rendered_meshes(depsgraph, self._warnings if first else [])
        if not shown:
            raise NothingToBake("a render of the scene shows no mesh with faces: add one, or make it visible in "
                                "renders")
        if first:
            self.bindings = choose_receivers(shown, self._settings, self._warnings, self._convert,
                                             carriers(depsgraph) if self._convert else frozenset())
            linking = Linking(depsgraph, shown)
            self._assembly = Assembly(self._settings, linking, self._warnings)
            self.lamps = export_lights(depsgraph, linking, self._warnings, self._emissions)
        if [item.name for item in shown] != [binding.surface for binding in self.bindings]:
            raise SceneError("the scene was changed while it was read: bake again")
        self.assembly.forget_meshes()
        # One mesh may have hundreds of materials.
        for material in (material for item in shown for material in item.materials):
            if not self.assembly.materials.knows(material):
                self.assembly.materials.slot(material)
                if clock.is_over():
                    return False
        while self._done < len(shown):
            self.assembly.add(shown[self._done], self.bindings[self._done])
            self._done += 1
            if clock.is_over():
                break
        return self._done == len(shown)

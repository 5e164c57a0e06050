"""Relight: new lamp strengths and base colours into images that are baked already, from what a bake kept, without a
ray.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from types import MappingProxyType
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ..solver.errors import RadiosityError, SettingsError
from ..solver.relight import relight as solver_relight
from ..solver.result import Bake
from ..solver.scene import Scene
from ..solver.settings import Settings
from . import blend_file, cache, compat, report
from .binding import Binding
from .changes import changes, reflect_otherwise, refuse
from .conversion import bound_to
from .converted import Converted, as_before, present
from .export import Exported, surface_scene_parts
from .job import Job, Outcome, wait_for
from .light_groups import Group
from .memory import peak_memory_bytes
from .parts import WINDOW_PART, Parts, aside
from .request import Request
from .staging import stage
from .summary import print_outcome
from .survey import survey_parts
from .write_back import write_back

Float = NDArray[np.floating[Any]]

# Words of the settings that kept light was baked with: another value needs another bake.
BAKED_IN = ("target", "uv_layer", "resolution", "texel_density", "max_pages", "atlas", "quantity", "passes", "only",
            "footprint", "margin", "seed", "error")
# No such word.
NOTHING: Mapping[str, Any] = MappingProxyType({})

# Part of the time that stages usually take; only the estimate of the time left depends on it.
WEIGHTS = {"export": 1.0, "light": 4.0, "write": 1.0}


def relight(request: Request, scene: Any, view_layer: Any, given: Mapping[str, Any] = NOTHING) -> Outcome:
    """Mix the kept groups of a scene anew and write the results; settings are those of the bake.

    given : words that ask for a bake, see `check_words`.

    Raises
    ------
    RadiosityError
        If nothing is kept, if it does not hold any more (says what has changed), or if results can't be written.
    """
    job = RelightJob(request, scene, view_layer, given)
    try:
        job.export()
        job.start()
        return job.finish()
    finally:
        job.close()


class RelightJob(Job):
    """A job (see there) that mixes what a bake has kept.

    given : words that ask for a bake, see `check_words`.
    live : whether a change started it, and the next one may end it.
    """

    def __init__(self, request: Request, scene: Any, view_layer: Any, given: Mapping[str, Any] = NOTHING, *,
                 live: bool = False) -> None:
        super().__init__(request, scene, view_layer)
        self.given, self.live = given, live
        self.progress.weights = WEIGHTS.copy()
        self._kept: cache.Kept | None = None
        # What the bake converted to meshes, as far as this file has them, by surface.
        self._converted: dict[str, Converted] = {}
        # (groups, 3), what each group's layer is multiplied by; and names of materials and objects whose other
        # reflectances are followed, with the scene that has them, if there are any.
        self._factors = np.empty((0, 3))
        self._colours: tuple[str, ...] = ()
        self._repainted: Scene | None = None

    def exporting(self, part_seconds: float = WINDOW_PART) -> Parts[None]:
        """Read what is kept, see whether it holds, and read the scene's reflectances if they are others.

        Raises
        ------
        RadiosityError
            See `relight` and `check_words`.
        """
        self._made = self.request.check_writable()
        with self._timed("read"):
            self._kept = kept = yield from aside(partial(cache.read, cache.find(self.request.output, self.scene_name)))
        check_words(kept.settings, self.given)
        scene, layer = self._place()
        with self._timed("check"):
            seen = yield from survey_parts(scene, layer, part_seconds)
            self._converted = present(kept.converted, seen)
            seen = as_before(seen, kept.seen, self._converted)
            refuse(changes(kept.seen, seen, kept.groups, follows=kept.bake.paths is not None))
            self._factors = np.array([group.factors(seen) for group in kept.groups])
            self._colours = tuple(reflect_otherwise(kept.seen, seen))
        if self._colours:
            with self._timed("export"):
                found = yield from surface_scene_parts(scene, layer, kept.settings, part_seconds)
                self._refuse_other_order(found)
                self._repainted = replace(found, surfaces=kept.surfaces)
        self.progress("export", 1.0)

    def _refuse_other_order(self, found: Scene) -> None:
        """Reflectances are followed triangle by triangle, in the order of the bake."""
        assert self._kept is not None
        kept = self._kept.surfaces
        names = {made.object: surface for surface, made in self._converted.items()}
        if [names.get(item.name, item.name) for item in found.surfaces] != [item.name for item in kept]:
            raise RadiosityError(f"{', '.join(self._colours)}: other base colors can't be followed, as meshes are in "
                                 "another order since the bake converted or replaced some: bake again")

    def finishing(self) -> Parts[Outcome]:
        """Put the results in their places, an object a part."""
        self.wait(threading.TIMEOUT_MAX)
        if self._failure is not None:
            raise self._failure
        self.refuse_cancelled()
        assert self._kept is not None
        assert self._bake is not None
        assert self._staged is not None
        done = replace(self.request, settings=self._kept.settings)
        with self._timed("write"):
            scene, layer = self._place()
            outputs, _ = yield from write_back(_exported(self._kept, self._converted), self._bake, self._staged, done,
                                               scene, layer, self.warnings)
            if done.save is not None:
                blend_file.save_copy(done.save)
        full = self._report(outputs)
        if done.report_path is not None:
            report.write(full, done.report_path)
        self.progress("write", 1.0)
        return Outcome.of(full)

    def _baked(self) -> Bake:
        assert self._kept is not None
        kept = self._kept
        strengths = {group.name: rgb for group, rgb in zip(kept.groups, self._factors, strict=True)}
        with self._timed("mix" if self._repainted is None else "solve"):
            return solver_relight(kept.bake, replace(kept.settings, only=()), strengths, self._repainted,
                                  lambda _, fraction: self.progress("light", fraction), self._cancel.is_set)

    def _use(self, done: Bake) -> None:
        assert self._kept is not None
        self.progress("write", 0.0)
        self.refuse_cancelled()
        with self._timed("write"):
            self._staged = stage(done, replace(self.request, settings=self._kept.settings), self.blend)

    def _report(self, outputs: list[dict[str, Any]]) -> dict[str, Any]:
        """As a bake's; the error is that of the bake, for the lights that it had, and so are materials, but for those
        that reflect otherwise now. Where the light goes is known of the bake's lights alone."""
        assert self._kept is not None
        assert self._bake is not None
        kept = self._kept
        return {
            **kept.bake.report,
            "scene": bpy.data.filepath or self.scene_name,
            "blender": compat.version(),
            "settings": kept.settings.as_dict(),
            "stages": [{"name": name, "seconds": value, "rays": 0} for name, value in self._seconds.items()],
            "rays": 0,
            "energy": None,
            "materials": [row for row in kept.bake.report["materials"] if row["name"] not in self._colours],
            "groups": _told(kept.groups, self._factors),
            **_recoloured(self._bake, self._colours),
            "outputs": outputs,
            "warnings": self.warnings,
            "peak_memory_bytes": peak_memory_bytes(),
            "seconds": time.perf_counter() - self._started,
        }


def check_words(kept: Settings, given: Mapping[str, Any]) -> None:
    """Refuse words that ask for another bake than the one that is kept.

    Raises
    ------
    SettingsError
        With the first of them.
    """
    before = kept.as_dict()
    for word in BAKED_IN:
        if word in given and _plain(given[word]) != _plain(before[word]):
            raise SettingsError(f"{word} is {given[word]!r}, and the kept light was baked with {before[word]!r}: leave "
                                "it away, or bake again")


def _plain(value: Any) -> Any:
    return list(value) if isinstance(value, tuple) else value


def _exported(kept: cache.Kept, made: Mapping[str, Converted]) -> Exported:
    """What writing back needs of an export: surfaces with their corners, of triangles without a shape."""
    count = sum(surface.count for surface in kept.surfaces)
    scene = Scene(np.zeros((1, 3)), np.zeros((count, 3), np.int32), surfaces=kept.surfaces)
    return Exported(scene, tuple(_as_it_is(binding, made.get(binding.surface)) for binding in kept.bindings),
                    kept.settings)


def _as_it_is(binding: Binding, made: Converted | None) -> Binding:
    """The bake may have converted the surface, or applied the modifiers that stood in the way of storing its result."""
    if made is not None:
        return bound_to(binding, bpy.data.objects[made.object])
    item = bpy.data.objects.get(binding.object)
    if item is None or item.type != "MESH" or item.modifiers or len(item.data.loops) != binding.corner_count:
        return binding
    return replace(binding, same_topology=True)


def _told(groups: Sequence[Group], factors: Float) -> list[dict[str, Any]]:
    return [{"name": group.name, "baked": list(group.tint), "now": [float(value) for value in rgb]}
            for group, rgb in zip(groups, factors, strict=True)]


def _recoloured(bake: Bake, names: Sequence[str]) -> dict[str, Any]:
    """What the report says of reflectances that were followed, if any were."""
    if "recoloured" not in bake.report:
        return {}
    return {"recoloured": {"names": list(names), **bake.report["recoloured"]}}


def relight_command(request: Request, scene: Any, view_layer: Any, given: Mapping[str, Any]) -> int:
    """Relight and wait for it, with progress and warnings on the terminal; Ctrl C cancels. The exit code.

    Raises
    ------
    RadiosityError
        See `RelightJob.exporting`.
    """
    outcome: Outcome = wait_for(RelightJob(request, scene, view_layer, given))
    print_outcome(outcome.report, request, outcome.exit_code, verb="relit")
    return outcome.exit_code

"""Relight: new lamp strengths and base colours into images that are baked already, from what a bake kept, without a
ray.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ..solver.errors import SettingsError
from ..solver.relight import relight as solver_relight
from ..solver.result import Bake
from ..solver.scene import Scene
from ..solver.settings import Settings
from . import blend_file, cache, compat, report
from .binding import Binding
from .changes import changes, reflect_otherwise, refuse
from .export import Exported, export_surfaces
from .job import Job, Outcome
from .light_groups import Group
from .memory import peak_memory_bytes
from .parts import whole
from .request import Request, remove_empty
from .staging import stage
from .summary import print_outcome, print_warnings
from .survey import survey
from .warn import Warnings
from .write_back import write_back

Float = NDArray[np.floating[Any]]

# Words of the settings that kept light was baked with: another value needs another bake.
BAKED_IN = ("target", "uv_layer", "resolution", "texel_density", "max_pages", "atlas", "quantity", "passes", "only",
            "footprint", "margin", "seed", "error")


@dataclass(frozen=True, eq=False)
class Relit:
    """Kept light in its new strength.

    bake : as a bake would give it. factors : (groups, 3), what each group's layer was multiplied by.
    colours : names of materials and objects whose other reflectances were followed.
    """

    kept: cache.Kept
    bake: Bake
    factors: Float
    colours: tuple[str, ...]


def relight(request: Request, scene: Any, view_layer: Any, warnings: Warnings) -> Outcome:
    """Mix the kept groups of a scene anew and write the results; settings are those of the bake.

    Raises
    ------
    RadiosityError
        If nothing is kept, if it does not hold any more (says what has changed), or if results can't be written.
    """
    Job.refuse_second()
    started = time.perf_counter()
    stages: dict[str, float] = {}
    made = request.check_writable()
    try:
        relit = relit_scene(cache.find(request.output, scene.name), scene, view_layer, stages)
        start = time.perf_counter()
        done = replace(request, settings=relit.kept.settings)
        exported = _exported(relit.kept)
        staged = stage(relit.bake, done)
        try:
            outputs = whole(write_back(exported, relit.bake, staged, done, scene, view_layer, warnings))
        finally:
            staged.close()
        if done.save is not None:
            blend_file.save_copy(done.save)
        stages["write"] = time.perf_counter() - start
        full = _report(relit, done, scene, outputs, warnings, stages, time.perf_counter() - started)
        if done.report_path is not None:
            report.write(full, done.report_path)
    finally:
        remove_empty(made)
    return Outcome(full, 0)


def relit_scene(folder: Path, scene: Any, view_layer: Any, stages: dict[str, float] | None = None) -> Relit:
    """What is kept in a folder, lit as the scene's lights are now; nothing is written.

    Raises
    ------
    RadiosityError
        See `relight`.
    """
    clock = _Clock({} if stages is None else stages)
    kept = cache.read(folder)
    clock.lap("read")
    seen = survey(scene, view_layer)
    follows = kept.bake.paths is not None
    refuse(changes(kept.seen, seen, kept.groups, follows=follows))
    factors = np.array([group.factors(seen) for group in kept.groups])
    colours = reflect_otherwise(kept.seen, seen)
    clock.lap("check")
    repainted = None
    if colours:
        repainted = replace(export_surfaces(scene, view_layer, kept.settings), surfaces=kept.surfaces)
        clock.lap("export")
    strengths = {group.name: rgb for group, rgb in zip(kept.groups, factors, strict=True)}
    bake = solver_relight(kept.bake, replace(kept.settings, only=()), strengths, repainted)
    clock.lap("mix" if repainted is None else "solve")
    return Relit(kept, bake, factors, tuple(colours))


def check_words(kept: Settings, given: dict[str, Any]) -> None:
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


def _exported(kept: cache.Kept) -> Exported:
    """What writing back needs of an export: surfaces with their corners, of triangles without a shape."""
    count = sum(surface.count for surface in kept.surfaces)
    scene = Scene(np.zeros((1, 3)), np.zeros((count, 3), np.int32), surfaces=kept.surfaces)
    return Exported(scene, tuple(_as_it_is(binding) for binding in kept.bindings), kept.settings)


def _as_it_is(binding: Binding) -> Binding:
    """The bake may have applied the modifiers that stood in the way of storing its result."""
    item = bpy.data.objects.get(binding.object)
    if item is None or item.type != "MESH" or item.modifiers or len(item.data.loops) != binding.corner_count:
        return binding
    return replace(binding, same_topology=True)


def _report(relit: Relit, request: Request, scene: Any, outputs: list[dict[str, Any]], warnings: Warnings,
            stages: dict[str, float], seconds: float) -> dict[str, Any]:
    """As a bake's; the error is that of the bake, for the lights that it had."""
    kept = relit.kept
    return {
        **kept.bake.report,
        "scene": bpy.data.filepath or scene.name,
        "blender": compat.version(),
        "settings": kept.settings.as_dict(),
        "stages": [{"name": name, "seconds": value, "rays": 0} for name, value in stages.items()],
        "rays": 0,
        "groups": _told(kept.groups, relit.factors),
        **_colours(relit),
        "outputs": outputs,
        "warnings": warnings,
        "peak_memory_bytes": peak_memory_bytes(),
        "seconds": seconds,
    }


def _told(groups: Sequence[Group], factors: Float) -> list[dict[str, Any]]:
    return [{"name": group.name, "baked": list(group.tint), "now": [float(value) for value in rgb]}
            for group, rgb in zip(groups, factors, strict=True)]


def _colours(relit: Relit) -> dict[str, Any]:
    """What the report says of reflectances that were followed, if any were."""
    if "recoloured" not in relit.bake.report:
        return {}
    return {"recoloured": {"names": list(relit.colours), **relit.bake.report["recoloured"]}}


class _Clock:
    """Seconds between laps, by name."""

    def __init__(self, seconds: dict[str, float]) -> None:
        self._seconds, self._last = seconds, time.perf_counter()

    def lap(self, name: str) -> None:
        """Time since the last one."""
        now = time.perf_counter()
        self._seconds[name], self._last = now - self._last, now


def relight_command(request: Request, scene: Any, view_layer: Any, given: dict[str, Any]) -> int:
    """Relight and tell of it on the terminal; the exit code.

    Raises
    ------
    RadiosityError
        See `relight`, and `check_words` for the words that were given.
    """
    warnings: Warnings = []
    check_words(cache.read(cache.find(request.output, scene.name)).settings, given)
    try:
        outcome = relight(request, scene, view_layer, warnings)
    finally:
        print_warnings(warnings)
    print_outcome(outcome.report, request, outcome.exit_code, verb="relit")
    return outcome.exit_code

"""What will bake and what will not, and why: the export of a bake without the bake."""

from __future__ import annotations

from typing import Any

from .export import Exported, export_scene
from .request import Request, remove_empty
from .summary import print_warnings
from .warn import Warnings


def check(request: Request, scene: Any, view_layer: Any) -> int:
    """Print a line an object and a line a warning; returns the exit code that a bake would end with at its start.

    Raises
    ------
    RadiosityError
        What a bake would fail with.
    """
    warnings: Warnings = []
    try:
        exported = export_scene(scene, view_layer, request.settings, warnings)
        remove_empty(request.check_writable())
    finally:
        print_warnings(warnings)
    for line in lines(exported):
        print(line, flush=True)
    return 0


def lines(exported: Exported) -> list[str]:
    """One line an object, and a last one for the light."""
    told = [f"{'bakes' if binding.receives else 'blocks only':<12}{binding.surface}: {surface.count} triangles"
            for surface, binding in zip(exported.scene.surfaces, exported.bindings, strict=True)]
    scene = exported.scene
    emissive = int(scene.emission.any(axis=1).sum())  # type: ignore[union-attr]
    sky = "black" if scene.sky.is_black else "constant" if scene.sky.radiance.ndim == 1 else "map"
    return [*told, f"{'light':<12}{len(scene.lights)} lamps, {emissive} emissive triangles, sky {sky}"]

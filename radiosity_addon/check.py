"""What will bake and what will not, or badly, and why: one list before a bake.

    what a bake itself would say      the export, with all its warnings
    check_meshes.py                   no_faces, flipped, non_manifold, overlapping, giant
    check_views.py                    back_seen
    check_lights.py                   no_power, no_size
    check_materials.py                non_diffuse, bright, missing_image
    check_layout.py                   uv_overlap, uv_stretch, uv_density, uv_no_area, uv_outside, no_lumels
    check_cost.py                     lumels, memory, time
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ..solver.errors import RadiosityError
from ..solver.geometry import Geometry
from ..solver.settings import Settings
from . import compat, interrupts, report
from .check_cost import Cost, expected_cost
from .check_layout import check_layout
from .check_lights import check_lights
from .check_materials import check_images, check_materials
from .check_meshes import check_faces, check_meshes
from .check_views import check_views
from .export import Exported, export_scene
from .request import Request, remove_empty
from .summary import print_warnings
from .visible import rendered_objects
from .warn import Warnings, warn


@dataclass(frozen=True, eq=False)
class Findings:
    """What was found.

    Attributes
    ----------
    warnings : one a finding: object, code, message.
    exported : the scene as it would bake; None if it would not, and then `failure` says why.
    cost : what the bake would about take.
    """

    warnings: Warnings
    exported: Exported | None
    cost: Cost | None
    failure: RadiosityError | None


def find(scene: Any, view_layer: Any, settings: Settings, convert: bool = False) -> Findings:
    """Look at everything; nothing is changed. `convert` as for `export_scene`."""
    warnings: Warnings = []
    view_layer.update()  # objects that were just made are not listed before
    check_lights(view_layer, warnings)
    check_images(_materials(view_layer), warnings)
    try:
        exported = export_scene(scene, view_layer, settings, warnings, convert)
        check_materials(exported.materials, warnings)
        check_faces(view_layer, exported.bindings, warnings)
        check_meshes(exported.scene, _places(view_layer), warnings)
        geometry = Geometry(exported.scene)
        check_views(geometry, scene, warnings)
        lumels = check_layout(exported.scene, exported.settings, warnings)
    except RadiosityError as failure:
        warn(warnings, "", "error", str(failure))
        return Findings(warnings, None, None, failure)
    return Findings(warnings, exported, expected_cost(geometry, exported.settings, lumels), None)


def check(request: Request, scene: Any, view_layer: Any) -> int:
    """Print a line an object and a line a finding; returns the exit code that a bake would end with at its start.

    Raises
    ------
    RadiosityError
        What a bake would fail with, or Cancelled.
    """
    request.refuse_names()
    found = find(scene, view_layer, request.settings, request.apply_modifiers)
    interrupts.refuse()
    print_warnings(entry for entry in found.warnings if entry["code"] != "error")
    if request.report is not None:
        remove_empty(Request(request.settings, report=request.report).check_writable())
        request.report.parent.mkdir(parents=True, exist_ok=True)
        report.write(as_report(found, request.settings, scene), request.report)
    if found.failure is not None:
        raise found.failure
    remove_empty(request.check_writable())
    for line in lines(found):
        print(line, flush=True)
    return 0


def as_report(found: Findings, settings: Settings, scene: Any) -> dict[str, Any]:
    """The list for other programs: as report.json has it, without a bake."""
    receivers = [binding for binding in found.exported.bindings if binding.receives] if found.exported else []
    return {
        "scene": bpy.data.filepath or scene.name,
        "blender": compat.version(),
        "settings": settings.as_dict(),
        "bakes": [binding.surface for binding in receivers],
        "triangles": len(found.exported.scene.triangles) if found.exported else None,
        "expected": {"lumels": found.cost.lumels, "memory_bytes": found.cost.memory_bytes,
                     "seconds": found.cost.seconds} if found.cost else None,
        "materials": list(found.exported.materials) if found.exported else [],
        "warnings": found.warnings,
    }


def lines(found: Findings) -> list[str]:
    """One line an object, one for the light, and what the bake takes."""
    exported = found.exported
    if exported is None:
        return []
    told = [f"{'bakes' if binding.receives else 'blocks only':<12}{binding.surface}: {surface.count} triangles"
            for surface, binding in zip(exported.scene.surfaces, exported.bindings, strict=True)]
    scene = exported.scene
    emissive = int(scene.emission.any(axis=1).sum())  # type: ignore[union-attr]
    sky = "black" if scene.sky.is_black else "constant" if scene.sky.radiance.ndim == 1 else "map"
    told.append(f"{'light':<12}{len(scene.lights)} lamps, {emissive} emissive triangles, sky {sky}")
    if found.cost is not None:
        told.append(f"{'takes':<12}{found.cost.line()}")
    return told


def _places(view_layer: Any) -> dict[str, NDArray[np.floating[Any]]]:
    """Where lamps and cameras are, by name."""
    return {item.name: np.array(item.matrix_world.translation, np.float64) for item in view_layer.objects
            if item.type == "CAMERA" or (item.type == "LIGHT" and item.data.type != "SUN")}


def _materials(view_layer: Any) -> list[Any]:
    """The materials of the objects that a render shows, each once."""
    used = {slot.material.name_full: slot.material for item in rendered_objects(view_layer)
            for slot in item.material_slots if slot.material is not None}
    return list(used.values())

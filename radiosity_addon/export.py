"""The Blender scene as the solver's arrays: this is where everything Blender ends.

    what a render shows     meshes with modifiers, instances, curves and text as meshes       visible.py
    who is baked            and whether the result can be stored                              receiving.py
    triangles               normals, materials, textures                                      assembly.py
    lamps, sky                                                                                lights.py, world.py
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..solver.errors import NothingToBake
from ..solver.lights import Light
from ..solver.scene import Scene, Sky
from ..solver.settings import Settings
from . import cycles, preview
from .assembly import Assembly
from .binding import Binding
from .giants import with_fair_shares
from .lamp_nodes import Emissions, read_emissions
from .lights import export_lights, lamp_data
from .linking import Linking
from .receiving import choose_receivers
from .units import per_blender_unit
from .visible import shown_meshes
from .warn import Warnings
from .world import read_world


@dataclass(frozen=True, eq=False)
class Exported:
    """The solver's scene, and where in Blender each of its surfaces came from.

    Attributes
    ----------
    scene : the arrays.
    bindings : one a surface of the scene, in the same order.
    settings : for the solver: `only` is settled already by `Surface.receives`.
    materials : the report's rows on what becomes of each material.
    """

    scene: Scene
    bindings: tuple[Binding, ...]
    settings: Settings
    materials: tuple[dict[str, Any], ...] = ()


def export_scene(scene: Any, view_layer: Any, settings: Settings, warnings: Warnings,
                 convert: bool = False) -> Exported:
    """Read the whole scene.

    Parameters
    ----------
    scene, view_layer : bpy scene, and its layer to bake.
    settings : what to bake.
    warnings : gets what the user should know.
    convert : whether curves, text and generated instances are baked too, as they will become meshes (`conversion`).

    Raises
    ------
    SceneError, SettingsError, NothingToBake
        With the object, the value and the next step.
    """
    parts = export_parts(scene, view_layer, settings, warnings, convert)
    while True:
        try:
            next(parts)
        except StopIteration as end:
            exported: Exported = end.value
            return exported


def export_parts(scene: Any, view_layer: Any, settings: Settings, warnings: Warnings,
                 convert: bool = False) -> Generator[None, None, Exported]:
    """`export_scene` in parts: a window can draw and answer between them, and nobody may change the scene."""
    settings = per_blender_unit(settings, scene, warnings)
    # A view of an older bake would be read as light of its own.
    with preview.suspended():
        sky, suns = read_world(scene.world, warnings)
    yield
    with preview.suspended():
        emissions = read_emissions(lamp_data(scene), warnings)
    yield
    with preview.suspended():
        assembly, bindings, lamps = cycles.with_render_depsgraph(
            scene, view_layer, lambda depsgraph: _collect(depsgraph, settings, emissions, warnings, convert))
    yield
    with preview.suspended():
        # Only now: Cycles can't bake materials while the dependency graph is handed out, which is a render.
        assembly.materials.evaluate(scene.frame_current)
    yield
    return _lit(assembly, bindings, (*lamps, *suns), sky, settings, warnings)


def export_surfaces(scene: Any, view_layer: Any, settings: Settings) -> Scene:
    """What `export_scene` gives, without lights and without warnings: shapes and what they reflect.

    Raises
    ------
    SceneError, SettingsError, NothingToBake
        As `export_scene`.
    """
    unheard: Warnings = []
    with preview.suspended():
        assembly, _, _ = cycles.with_render_depsgraph(
            scene, view_layer, lambda depsgraph: _collect(depsgraph, settings, {}, unheard, convert=True))
        assembly.materials.evaluate(scene.frame_current)
    return assembly.scene((), Sky())


def _collect(depsgraph: Any, settings: Settings, emissions: Emissions, warnings: Warnings,
             convert: bool) -> tuple[Assembly, tuple[Binding, ...], tuple[Light, ...]]:
    shown = shown_meshes(depsgraph, warnings)
    if not shown:
        raise NothingToBake("a render of the scene shows no mesh with faces: add one, or make it visible in renders")
    bindings = choose_receivers(shown, settings, warnings, convert)
    linking = Linking(depsgraph, shown)
    assembly = Assembly(settings, linking, warnings)
    for item, binding in zip(shown, bindings, strict=True):
        assembly.add(item, binding)
    return assembly, bindings, export_lights(depsgraph, linking, warnings, emissions)


def _lit(assembly: Assembly, bindings: tuple[Binding, ...], lights: tuple[Light, ...], sky: Sky,
         settings: Settings, warnings: Warnings) -> Exported:
    made = with_fair_shares(assembly.scene(lights, sky), settings, warnings)
    if not any(surface.receives for surface in made.surfaces):
        raise NothingToBake("no object that is to be baked has an opaque face with an area")
    if not made.lights and made.sky.is_black and not np.asarray(made.emission).any():
        raise NothingToBake("the scene has no light: add a lamp, an emissive material, or light in the world")
    bindings = tuple(replace(binding, receives=surface.receives)
                     for binding, surface in zip(bindings, made.surfaces, strict=True))
    return Exported(made, bindings, replace(settings, only=()), tuple(assembly.materials.rows.values()))

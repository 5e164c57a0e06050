"""The Blender scene as the solver's arrays: this is where everything Blender ends.

    what a render shows     meshes with modifiers, instances, curves and text as meshes       visible.py
    who is baked            and whether the result can be stored                              receiving.py
    triangles               normals, materials, textures                         surfaces.py, assembly.py
    lamps, sky                                                                                lights.py, world.py
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, closing, nullcontext
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from ..solver.errors import NothingToBake
from ..solver.lights import Light
from ..solver.scene import Scene, Sky
from ..solver.settings import Settings
from .binding import NO_OPAQUE_FACE, Binding
from .cycles_elsewhere import Elsewhere
from .giants import with_fair_shares
from .lamp_nodes import CODE, Emissions, emission_parts
from .lights import lamp_data
from .parts import ENDLESS, Parts, aside, whole
from .surfaces import Surfaces, surface_parts
from .units import per_blender_unit
from .warn import Warnings
from .working_space import tell_working_space
from .world import World, needs_render, rendered_world, world_parts
from .world_render import COARSE

# Is given a scene that has no sky yet, to be called in another thread; the parts that bring a coarse sky with its suns;
# and settings.
Glance = Callable[[Callable[[], Scene], Parts[World], Settings], Parts[None]]


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
    return whole(export_parts(scene, view_layer, settings, warnings, convert))


def export_parts(scene: Any, view_layer: Any, settings: Settings, warnings: Warnings, convert: bool = False,
                 part_seconds: float = ENDLESS,
                 glance: Glance | None = None) -> Parts[Exported]:
    """`export_scene` in parts: a window can draw and answer between them, and nobody may change the scene.

    Parameters
    ----------
    part_seconds : how long a part may take, about, where it can be cut.
    glance : its parts come first.
    """
    settings = per_blender_unit(settings, scene, warnings)
    tell_working_space(warnings)
    with _cycles_elsewhere(part_seconds) as elsewhere:
        world = rendered_world(scene, view_layer)
        if elsewhere is not None and needs_render(world):
            elsewhere.bring([world])
        emissions = yield from emission_parts(lamp_data(scene), scene, view_layer, warnings, part_seconds)
        if glance is not None:
            yield from _glanced(scene, view_layer, settings, emissions, convert, part_seconds, glance, elsewhere)
        found = yield from surface_parts(scene, view_layer, settings, emissions, warnings, convert, part_seconds)
        assembly = found.assembly
        yield from aside(assembly.settle)
        yield from assembly.materials.read_images()
        sky, suns = yield from world_parts(world, warnings, None, part_seconds, elsewhere)
        yield from assembly.materials.evaluate(scene.frame_current, elsewhere)
    return (yield from aside(partial(_lit, found, (*found.lamps, *suns), sky, settings, warnings)))


def _glanced(scene: Any, view_layer: Any, settings: Settings, emissions: Emissions, convert: bool,
             part_seconds: float, glance: Glance, elsewhere: Elsewhere | None) -> Parts[None]:
    """Show what can be told of a scene at once: images by their mean, materials that Cycles has not seen yet.

    A viewport with the same objects is not asked to draw anew, and modifiers have done their work for it already.
    """
    found = yield from surface_parts(scene, view_layer, settings, emissions, [], convert, part_seconds, roughly=True)
    yield from found.assembly.materials.glance_at_images()

    def dark() -> Scene:
        found.assembly.settle()
        return found.assembly.scene(found.lamps, Sky())

    sky = world_parts(rendered_world(scene, view_layer), [], COARSE, elsewhere=elsewhere)
    yield from glance(dark, sky, settings)


def _cycles_elsewhere(part_seconds: float) -> AbstractContextManager[Elsewhere | None]:
    """Another Blender for what Cycles has to look at; None where nobody waits."""
    return closing(Elsewhere()) if part_seconds < ENDLESS else nullcontext()


def export_surfaces(scene: Any, view_layer: Any, settings: Settings) -> Scene:
    """`surface_scene_parts` at once."""
    return whole(surface_scene_parts(scene, view_layer, settings))


def surface_scene_parts(scene: Any, view_layer: Any, settings: Settings,
                        part_seconds: float = ENDLESS) -> Parts[Scene]:
    """What `export_parts` gives, without lights and without warnings: shapes and what they reflect.

    Raises
    ------
    SceneError, SettingsError, NothingToBake
        As `export_scene`.
    """
    assembly = (yield from surface_parts(scene, view_layer, settings, {}, [], True, part_seconds)).assembly
    yield from aside(assembly.settle)
    yield from assembly.materials.read_images()
    with _cycles_elsewhere(part_seconds) as elsewhere:
        yield from assembly.materials.evaluate(scene.frame_current, elsewhere)
    return (yield from aside(lambda: assembly.scene((), Sky())))


def _lit(found: Surfaces, lights: tuple[Light, ...], sky: Sky, settings: Settings,
         warnings: Warnings) -> Exported:
    """The whole, of arrays alone."""
    made = with_fair_shares(found.assembly.scene(lights, sky), settings, warnings)
    if not any(surface.receives for surface in made.surfaces):
        raise NothingToBake(NO_OPAQUE_FACE)
    if not made.lights and made.sky.is_black and not np.asarray(made.emission).any():
        raise NothingToBake(_without_light(warnings))
    bindings = tuple(replace(binding, receives=surface.receives)
                     for binding, surface in zip(found.bindings, made.surfaces, strict=True))
    return Exported(made, bindings, replace(settings, only=()), tuple(found.assembly.materials.rows.values()))


def _without_light(warnings: Warnings) -> str:
    """What to say of a scene without light: lamps that are there and give none go first."""
    told = next((f"lamp {entry['object']!r}: {entry['message']}" for entry in reversed(warnings)
                 if entry["code"] == CODE), "add a lamp, an emissive material, or light in the world")
    return f"the scene has no light: {told}"

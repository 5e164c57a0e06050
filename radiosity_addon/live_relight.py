"""Live relight: while it is switched on, lamps, base colours and materials in slots that were changed update the baked
images a moment later; in a window by an operator that works beside the user.
"""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Callable
from typing import Any

import bpy
import numpy as np

from ..solver.errors import RadiosityError
from . import cache
from .baked_light import VIEW_MARK
from .digest import digest
from .job import Job
from .knobs import knobs_of, rest_of
from .relight import RelightJob, relight
from .relight_request import kept_in, relight_request
from .slots import own_materials
from .world import rendered_world

# Seconds without a change until the images are updated: a slider that is being dragged does not wait for them.
PAUSE = 0.3
# What of a lamp says how strong it is; what this Blender lacks is left out.
STRENGTH = ("energy", "color", "exposure", "use_temperature", "temperature", "normalize")
# What of it can't be followed, and is told: it throws other light then. Places count to a micrometre.
SHAPE = ("type", "shape", "size", "size_y", "shadow_soft_size", "spread", "angle", "spot_size", "spot_blend")
DIGITS = 6
LIGHTS = (bpy.types.Light, bpy.types.World, bpy.types.Material, bpy.types.NodeTree)

# By the scene's name: the lights when its images were last updated, and what stood in the way of that.
_known: dict[str, str] = {}
_problems: dict[str, str] = {}
# What starts a relight in a window that shows a scene, if anything does.
_starters: list[Callable[[Any], None]] = []


def problem(scene: Any) -> str:
    """Why the scene's images could not be updated; "" if they were."""
    return _problems.get(scene.name, "") if scene.radiosity.live_relight else ""


def tell_problem(scene_name: str, text: str) -> None:
    """Something stands in the way of an update."""
    _problems[scene_name] = text


def start_in_window(start: Callable[[Any], None] | None) -> None:
    """What is called with a scene to update it in a window; None: nothing any more."""
    _starters[:] = [] if start is None else [start]


def switched(settings: Any, _context: Any) -> None:
    """The switch was turned: what is there now is where changes start from."""
    scene = settings.id_data
    _problems.pop(scene.name, None)
    if settings.live_relight:
        _known[scene.name] = lights_of(scene)


def attach() -> None:
    """Listen to changes."""
    bpy.app.handlers.depsgraph_update_post.append(_changed)
    bpy.app.handlers.frame_change_post.append(_frame_changed)


def detach() -> None:
    """Listen no longer."""
    for handlers, listener in ((bpy.app.handlers.depsgraph_update_post, _changed),
                               (bpy.app.handlers.frame_change_post, _frame_changed)):
        if listener in handlers:
            handlers.remove(listener)
    if bpy.app.timers.is_registered(update):
        bpy.app.timers.unregister(update)
    _known.clear()
    _problems.clear()


def lights_of(scene: Any) -> str:
    """A sum of all lights, and of materials where they are followed: quick, and the same again when images are updated.
    """
    lamps = [(item.name, item.hide_render, [_plain(getattr(item.data, name, None)) for name in (*STRENGTH, *SHAPE)],
              np.round(item.matrix_world, DIGITS), knobs_of(item.data), rest_of(item.data),
              [item.name in layer.objects for layer in scene.view_layers])
             for item in scene.objects if item.type == "LIGHT"]
    hidden = [collection.name for collection in bpy.data.collections if collection.hide_render]
    own = [material for material in bpy.data.materials if VIEW_MARK not in material]
    materials = {material.name_full: knobs_of(material) for material in own}
    folder = kept_in(scene)
    # Of what is not followed no attempt is made.
    colours: list[Any] = []
    if folder is not None and cache.follows_colours(folder):
        colours = [rest_of(material) for material in own]
        colours += [(item.name, [getattr(material, "name_full", "") for material in own_materials(item)])
                    for item in scene.objects]
    return digest(lamps, hidden, materials, knobs_of(rendered_world(scene, scene.view_layers[0])), colours)


def update() -> float | None:
    """Update the images of all scenes that want it and whose lights have changed; seconds until it is to be called
    again, where something is on its way now."""
    for scene in bpy.data.scenes:
        if not scene.radiosity.live_relight:
            continue
        now = lights_of(scene)
        if _known.get(scene.name) == now:
            continue
        if Job.current is not None:
            if isinstance(Job.current, RelightJob) and Job.current.live:
                # It shows what is old already.
                Job.current.cancel()
            return PAUSE
        _known[scene.name] = now
        _problems.pop(scene.name, None)
        if kept_in(scene) is None:
            _problems[scene.name] = "no light groups are kept: bake with groups"
            continue
        if _starters and not bpy.app.background:
            _starters[0](scene)
            continue
        try:
            relight(relight_request(scene, Namespace()), scene, scene.view_layers[0])
        except RadiosityError as error:
            _problems[scene.name] = str(error)
    return None


@bpy.app.handlers.persistent
def _changed(scene: Any, depsgraph: Any) -> None:
    if any(map(_may_matter, depsgraph.updates)):
        _update_soon(scene)


@bpy.app.handlers.persistent
def _frame_changed(scene: Any, _depsgraph: Any) -> None:
    # A render that goes through frames comes back to the one that is shown.
    if not bpy.app.is_job_running("RENDER"):
        _update_soon(scene)


def _update_soon(scene: Any) -> None:
    if not scene.radiosity.live_relight or bpy.app.background:
        return
    if bpy.app.timers.is_registered(update):
        bpy.app.timers.unregister(update)
    bpy.app.timers.register(update, first_interval=PAUSE)


def _may_matter(change: Any) -> bool:
    """Whether a change may be one of light or of materials; slots are told of as an object's shading or shape."""
    block = change.id
    return isinstance(block, LIGHTS) or (isinstance(block, bpy.types.Object) and (
        block.type == "LIGHT" or change.is_updated_shading or change.is_updated_geometry))


def _plain(value: Any) -> Any:
    return tuple(value) if hasattr(value, "__len__") else value

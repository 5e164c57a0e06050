"""Views of a bake in the viewport: the baked look, lux in false colours, figures of the patches. One at a time.

What a view changes is kept beside it (see `slots.py`), and `hide` puts everything back as it was.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from functools import partial
from typing import Any

import bpy

from ..solver.errors import NothingToBake
from . import false_colour, leaks, lux, slots
from .baked_light import TO_RADIANCE, VIEW_MARK, Key, key_of, light_group
from .results import Result, results
from .unlit import Unlit
from .view_settings import BAKED, LEAKS, LUX, OFF

# Custom property of a scene: its colour management while false colours are shown without it.
TRANSFORM = "radiosity_transform"
PLAIN = {"view_transform": "Standard", "look": "None", "exposure": 0.0, "gamma": 1.0}


def show(scene: Any, mode: str, *, plane: bool = False) -> int:
    """Switch a view on, another one off; the number of objects that it shows.

    With `plane` there is a working plane to show, be there baked objects or not.

    Raises
    ------
    NothingToBake
        If there is nothing that it could show.
    """
    hide()
    if mode == LEAKS:
        _plain_colours(scene)
        count = leaks.show(scene)
    else:
        found = [result for result in results(scene) if mode == BAKED or result.quantity != "radiosity"]
        if not found and not plane:
            raise NothingToBake("no object holds a bake that this view can show: bake radiance, irradiance or "
                                "illuminance first")
        if mode == LUX:
            _plain_colours(scene)
        make = _lux_materials(scene) if mode == LUX else _unlit_materials()
        count = sum(slots.cover(result.item, make(result)) for result in found)
    scene.radiosity_view.mode = mode
    return count


def hide() -> bool:
    """Put every material slot back, and remove what the view made; whether there was one."""
    scene = shown_scene()
    slots.uncover_all()
    # Objects before the meshes and materials that they use.
    for collection in (bpy.data.objects, bpy.data.meshes, bpy.data.materials, bpy.data.node_groups):
        for made in [item for item in collection if item.library is None and VIEW_MARK in item]:
            collection.remove(made)
    for each in bpy.data.scenes:
        if each.library is None:
            _own_colours(each)
            each.radiosity_view.mode = OFF
    return scene is not None


def shown_scene() -> Any:
    """The scene that shows a view; None if none does."""
    return next((scene for scene in bpy.data.scenes if scene.radiosity_view.mode != OFF), None)


def suspended() -> AbstractContextManager[None]:
    """The user's own materials for a while: whoever reads or renders the scene wants these."""
    return slots.uncovered()


def refresh() -> None:
    """Show the present results where older ones are shown; a view that has nothing left to show goes off."""
    scene = shown_scene()
    if scene is None:
        return
    mode = scene.radiosity_view.mode
    try:
        if mode == LUX:
            lux.keep(scene, lux.measure(scene, bpy.context.evaluated_depsgraph_get()), surfaces=True)
        show(scene, mode)
    except NothingToBake:
        hide()


def _unlit_materials() -> Callable[[Result], Callable[[Any], Any]]:
    kept: dict[Key, Unlit] = {}

    def make(result: Result) -> Callable[[Any], Any]:
        key = key_of(result)
        if key not in kept:
            kept[key] = Unlit(light_group(result, TO_RADIANCE[result.quantity]), result.quantity == "radiosity")
        return kept[key].material

    return make


def _lux_materials(scene: Any) -> Callable[[Result], Callable[[Any], Any]]:
    view = scene.radiosity_view
    scale = false_colour.scale_group(view.scale_low, view.scale_high, view.scale_step)
    kept: dict[Key, Callable[[Any], Any]] = {}

    def make(result: Result) -> Callable[[Any], Any]:
        key = key_of(result)
        if key not in kept:
            light = light_group(result, TO_RADIANCE[result.quantity])
            kept[key] = slots.one_for_each(partial(false_colour.material_of_light, light, scale))
        return kept[key]

    return make


def _plain_colours(scene: Any) -> None:
    """Show colours as they are, so that they are those of the legend."""
    settings = scene.view_settings
    scene[TRANSFORM] = {name: getattr(settings, name) for name in PLAIN}
    for name, value in PLAIN.items():
        setattr(settings, name, value)


def _own_colours(scene: Any) -> None:
    """The scene's own colour management again."""
    kept = scene.get(TRANSFORM)
    if kept is None:
        return
    for name in PLAIN:
        setattr(scene.view_settings, name, kept[name])
    del scene[TRANSFORM]

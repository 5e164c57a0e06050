"""What a render shows, or the viewport, gone through in parts.

Blender hands a render's view of the scene out for one call only, so each part asks for it anew, and goes on where the
last one ended. To ask takes as long as the scene's modifiers do, and lets all viewports draw the scene from its start:
a part goes on for half as long again at least. What the viewport shows is there already.
"""

from __future__ import annotations

import time
from functools import partial
from typing import Any, Protocol

import bpy

from . import cycles, preview
from .parts import Parts

# A part goes on for as long as it took to begin, times this, however short it is to be: reading takes three times its
# own seconds at worst.
WORTH = 0.5


class Clock:
    """Tells a part when it has lasted long enough; the time until it is first asked is how long it took to begin."""

    def __init__(self, seconds: float) -> None:
        self._begun, self._seconds = time.perf_counter(), seconds
        self._until: float | None = None

    def is_over(self) -> bool:
        """Whether the part should end."""
        now = time.perf_counter()
        if self._until is None:
            self._until = max(self._begun + self._seconds, now + WORTH * (now - self._begun))
        return now > self._until


class Step(Protocol):
    """Does some of what is to be done with a dependency graph; whether nothing is left."""

    def __call__(self, depsgraph: Any, clock: Clock) -> bool:
        """See above."""
        ...


def walk(scene: Any, view_layer: Any, step: Step, part_seconds: float, *, as_rendered: bool = True) -> Parts[None]:
    """Call `step` with a render's dependency graph, or else the viewport's, part by part, until nothing is left to do.

    Materials are the user's own, whatever is shown.

    Raises
    ------
    SceneError
        If the view layer is switched off for rendering; and whatever `step` raises.
    """
    done = False
    while not done:
        now = partial(step, clock=Clock(part_seconds))
        # A view of an older bake would be read as light of its own.
        with preview.suspended():
            if as_rendered:
                done = cycles.with_render_depsgraph(scene, view_layer, now)
            else:
                view_layer.update()
                done = now(view_layer.depsgraph)
        yield


def viewport_shows_the_same(view_layer: Any) -> bool:
    """Whether the viewport shows those objects that a render does, if not with the same modifiers."""
    shown = {item for item in view_layer.objects if item.visible_get(view_layer=view_layer)}
    return shown == _rendered(view_layer.layer_collection)


def _rendered(layer: Any) -> set[bpy.types.Object]:
    """The objects of a layer's collection, and of those in it, that a render shows."""
    if layer.collection.hide_render:
        return set()
    own = () if layer.exclude else layer.collection.objects
    return {item for item in own if not item.hide_render}.union(*map(_rendered, layer.children))

"""What a render shows, gone through in parts.

Blender hands a render's view of the scene out for one call only, so each part asks for it anew, and goes on where the
last one ended. To ask takes as long as the scene's modifiers do, and lets all viewports draw the scene from its start:
a part goes on for half as long again at least. Where a window's viewport shows the same, that is there already.
"""

from __future__ import annotations

import time
from functools import partial
from typing import Any, Protocol

from . import cycles, preview
from .parts import ENDLESS, Parts
from .viewport_match import has_the_same_objects, is_the_same

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


def walk(scene: Any, view_layer: Any, step: Step, part_seconds: float, *, roughly: bool = False) -> Parts[None]:
    """Call `step` with a render's dependency graph, part by part, until nothing is left to do.

    In a window it is the viewport's if that shows the same; `roughly`, too if it shows the same objects, with whatever
    modifiers. Materials are the user's own, whatever is shown.

    Raises
    ------
    SceneError
        If the view layer is switched off for rendering; and whatever `step` raises.
    """
    from_viewport = part_seconds < ENDLESS and (has_the_same_objects(view_layer) if roughly
                                                else is_the_same(scene, view_layer))
    done = False
    while not done:
        now = partial(step, clock=Clock(part_seconds))
        # A view of an older bake would be read as light of its own.
        with preview.suspended():
            if from_viewport:
                view_layer.update()
                done = now(view_layer.depsgraph)
            else:
                done = cycles.with_render_depsgraph(scene, view_layer, now)
        yield

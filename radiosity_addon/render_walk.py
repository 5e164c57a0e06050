"""What a render shows, gone through in parts.

Blender hands a render's view of the scene out for one call only, so each part asks for it anew, and goes on where the
last one ended. To ask takes as long as the scene's modifiers do: a part lasts for a multiple of it.
"""

from __future__ import annotations

import time
from functools import partial
from typing import Any, Protocol

from . import cycles, preview
from .parts import Parts

# A part goes on for as long as it took to begin, times this, however short it is to be.
WORTH = 1.0


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


def walk(scene: Any, view_layer: Any, step: Step, part_seconds: float) -> Parts[None]:
    """Call `step` with a render's dependency graph, part by part, until nothing is left to do.

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
            done = cycles.with_render_depsgraph(scene, view_layer, now)
        yield

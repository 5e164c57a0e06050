"""A bake that can be watched: a first look, drafts, and the result, each shown as soon as it is there.

    first look   a few thousand places of the scene, as soon as its shapes are read      first_look.py
    unwrap       the layout that drafts and result share
    drafts       the whole way of the light, coarser: what "Good Enough" keeps
    result       as a bake in background makes it

Nothing of the .blend is touched before the end: the looks are drawn over the viewport (`look_overlay`).
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from ..solver.bake import bake
from ..solver.errors import Cancelled, RadiosityError
from ..solver.geometry import Geometry
from ..solver.layout import Layout, make_layout
from ..solver.result import Bake
from ..solver.scene import Scene
from ..solver.settings import Settings
from .first_look import Shapes, first_look
from .job import Job
from .layouts import with_shared_layouts
from .look import look_at
from .parts import PAUSE, Parts, aside, beside
from .progress import STAGE_WEIGHTS, Progress
from .request import Request
from .warn import warn
from .world import World

FIRST_LOOK, DRAFT = "first look", "draft"
# A draft's error, and the part of the result's resolution that it has. A draft is made only where the result is to be
# so many times better: else it would take a good part of the result's own time.
DRAFTS = ((0.3, 0.5), (0.06, 1.0))
WORTH = 3.0
# Part of a bake's time that drafts take, as `progress.STAGE_WEIGHTS`.
DRAFT_WEIGHT = 15.0


@dataclass(frozen=True)
class Step:
    """One bake on the way to the result."""

    settings: Settings
    layout: Layout | None
    is_result: bool = False


class LiveJob(Job):
    """A job (see there) with looks on the way: `look` is the newest, for the viewport."""

    def __init__(self, request: Request, scene: Any, view_layer: Any) -> None:
        super().__init__(request, scene, view_layer)
        head = {name: STAGE_WEIGHTS[name] for name in ("export", "unwrap")}
        self.progress.weights = {**head, DRAFT: DRAFT_WEIGHT, **STAGE_WEIGHTS}
        self._enough = threading.Event()
        self._kept: Bake | None = None
        self._glance = self._look_first

    @property
    def can_keep(self) -> bool:
        """Whether there is a draft that could be kept."""
        return self._kept is not None

    def good_enough(self) -> None:
        """End the work and keep the last draft; without one yet, end with the first."""
        self._enough.set()

    def give_up(self, *, keep: bool) -> None:
        """End the work, with the last draft if there is one and it is to be kept, else with nothing."""
        if keep and self.can_keep:
            self.good_enough()
        else:
            self.cancel()

    def _look_first(self, scene: Callable[[], Scene], sky: Parts[World], settings: Settings) -> Parts[None]:
        """Take a first look at a coarse scene; the rest is read afterwards, as both would share one interpreter."""
        try:
            with self._timed(FIRST_LOOK):
                shapes, light = yield from beside(lambda: Shapes(scene()), sky)
                self.look = yield from aside(partial(first_look, shapes, light, settings, self._cancel.is_set))
        except RadiosityError:
            # What is wrong with the scene itself the bake tells; what Cycles has not evaluated yet may be wrong here.
            return
        # It is to be seen before anything else is read.
        yield PAUSE

    def _baked(self) -> Bake:
        assert self._exported is not None
        assert self._groups is not None
        with self._timed("unwrap"):
            scene, settings = with_shared_layouts(self._exported.scene, self._exported.bindings,
                                                  self._exported.settings, self.warnings, self._unwrapping)
            layout = None
            if settings.target == "lightmap":
                layout = make_layout(scene, settings, self.warnings, self._unwrapping)
        # Made once: Embree's build takes all cores, and a window that draws a draft meanwhile would have none.
        geometry = Geometry(scene)
        for step in steps(settings, layout):
            try:
                self._kept = self._step(geometry, step)
            except Cancelled:
                # Cancelled, or good enough: then the last draft stays.
                if self._cancel.is_set() or self._kept is None:
                    raise
                break
            self.look = look_at(scene, self._kept, settings.quantity, f"error {step.settings.error:.2g}")
        assert self._kept is not None
        if "good_enough" in self._kept.report and self.request.groups != "none":
            self._groups = self._groups.none()
            warn(self.warnings, "", "no_groups", "good enough keeps no light groups: let the bake end to relight")
        return self._kept

    def _step(self, geometry: Geometry, step: Step) -> Bake:
        assert self._groups is not None
        if step.is_result:
            return bake(geometry.scene, step.settings, self.progress, self._is_over, self._groups.for_solver,
                        step.layout, keep_paths=self.request.keep_paths, geometry=geometry)
        with self._timed(DRAFT):
            draft = bake(geometry.scene, step.settings, self._as_stage(DRAFT), self._is_over, layout=step.layout,
                         geometry=geometry)
        # The wish is the user's, the estimate the draft's own.
        error = {**draft.report["error"], "wanted": self.request.settings.error}
        return replace(draft, report={**draft.report, "error": error, "good_enough": True})

    def _is_over(self) -> bool:
        return self._cancel.is_set() or (self._enough.is_set() and self._kept is not None)

    def _as_stage(self, name: str) -> Callable[[str, float], None]:
        """Progress of a bake of its own as one stage of this one."""
        inside = Progress()

        def tell(stage: str, fraction: float) -> None:
            inside(stage, fraction)
            self.progress(name, inside.fraction)

        return tell


def steps(settings: Settings, layout: Layout | None) -> list[Step]:
    """The drafts, coarse to fine, and the result."""
    drafts = [Step(replace(settings, error=error, margin=math.ceil(settings.margin * part)), _smaller(layout, part))
              for error, part in DRAFTS if error > WORTH * settings.error]
    return [*drafts, Step(settings, layout, is_result=True)]


def _smaller(layout: Layout | None, part: float) -> Layout | None:
    """The same layout in smaller images."""
    if layout is None:
        return None
    pages = tuple(replace(page, width=max(4, round(page.width * part)), height=max(4, round(page.height * part)))
                  for page in layout.pages)
    return replace(layout, pages=pages)

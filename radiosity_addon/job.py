"""A bake from start to end: export and write-back in Blender's thread, the long work in a thread of its own.

The worker touches arrays and files alone and never bpy. In the window a timer looks after it, and Blender's thread
works in parts; elsewhere the caller waits.
"""

from __future__ import annotations

import shutil
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy

from ..solver.bake import bake
from ..solver.errors import Cancelled, RadiosityError
from ..solver.result import Bake
from . import blend_file, compat, report
from .export import Exported, Glance, export_parts
from .interrupts import cancelling
from .keeping import KeptGroups
from .layouts import with_shared_layouts
from .look import Look
from .parts import ENDLESS, WINDOW_PART, Parts, whole
from .progress import Progress, Terminal
from .receiving import tell_passed_over
from .request import Request, remove_empty
from .staging import Staged, stage
from .summary import print_warnings
from .warn import Warnings
from .write_back import write_back

# Exit code of a bake whose results are written, but not as exact as was asked for.
ERROR_NOT_REACHED = 4
# Seconds between two looks at the worker.
TICK = 0.05


@dataclass(frozen=True)
class Outcome:
    """What came of a bake: the report, and the exit code that tells of it."""

    report: dict[str, Any]
    exit_code: int

    @classmethod
    def of(cls, full: dict[str, Any]) -> Outcome:
        """Of a bake that is written."""
        return cls(full, 0 if report.reached(full) else ERROR_NOT_REACHED)


class Job:
    """One bake. In this order: `export`, `start`, wait until `is_done`, `finish`; `close` in any case.

    `exporting` and `finishing` are the same in parts, for a window.
    """

    # The one that is on its way, if any: a second one is refused.
    current: Job | None = None

    def __init__(self, request: Request, scene: Any, view_layer: Any) -> None:
        """Raises RadiosityError if another job is on its way."""
        Job.refuse_second()
        Job.current = self
        self.request = request
        self.warnings: Warnings = []
        self.progress = Progress()
        self.scene_name, self._layer_name = scene.name, view_layer.name
        self.blend = bpy.data.filepath
        # What the viewport shows of the work, if anything (see `live`).
        self.look: Look | None = None
        self._started = time.perf_counter()
        self._seconds: dict[str, float] = {}
        self._cancel = threading.Event()
        self._thread: threading.Thread | None = None
        self._exported: Exported | None = None
        self._groups: KeptGroups | None = None
        self._bake: Bake | None = None
        # Files that are written, and not in their places yet.
        self._staged: Staged | None = None
        self._staged_groups: Path | None = None
        # Is given a coarse scene as soon as there is one (see `export_parts`).
        self._glance: Glance | None = None
        self._failure: BaseException | None = None
        self._made: list[Path] = []

    @classmethod
    def refuse_second(cls) -> None:
        """Raise RadiosityError if a job is on its way."""
        if cls.current is not None:
            raise RadiosityError("a bake is already on its way: wait for it, or press Esc to cancel it")

    def export(self) -> None:
        """Read the scene, and see that results can be written. Raises RadiosityError."""
        whole(self.exporting(ENDLESS))

    def exporting(self, part_seconds: float = WINDOW_PART) -> Parts[None]:
        """`export` in parts of about so many seconds, so that a window can go on between them."""
        with self._timed("export"):
            self._made = self.request.check_writable()
            scene, layer = self._place()
            tell_passed_over(self.request.passed_over, self.warnings)
            self._exported = yield from export_parts(scene, layer, self.request.settings, self.warnings,
                                                     self.request.apply_modifiers, part_seconds, self._glance)
            yield
            self._groups = yield from KeptGroups.of(self._exported.scene, scene, layer, self.request, part_seconds)
        self.progress("export", 1.0)

    def start(self) -> None:
        """Set the worker off."""
        self._thread = threading.Thread(target=self._work, name="radiosity bake", daemon=True)
        self._thread.start()

    @property
    def is_done(self) -> bool:
        """Whether the worker has ended, in whatever way."""
        return self._thread is None or not self._thread.is_alive()

    @property
    def is_baked(self) -> bool:
        """Whether the long work is over, with a result."""
        return self._bake is not None

    def cancel(self) -> None:
        """Ask the worker to stop."""
        self._cancel.set()

    def give_up(self, *, keep: bool) -> None:
        """End the work with nothing: here is nothing to keep before the end."""
        self.cancel()

    def refuse_cancelled(self) -> None:
        """Raise Cancelled if the user wants to stop."""
        if self._cancel.is_set():
            raise Cancelled("the bake was cancelled: nothing was changed")

    def wait(self, seconds: float) -> None:
        """Give the worker some time."""
        if self._thread is not None:
            self._thread.join(seconds)

    def finish(self) -> Outcome:
        """Put the results in their places. Raises what the worker raised, or RadiosityError."""
        return whole(self.finishing())

    def finishing(self) -> Parts[Outcome]:
        """`finish` in parts, so that a window can go on between them."""
        self.wait(threading.TIMEOUT_MAX)
        if self._failure is not None:
            raise self._failure
        self.refuse_cancelled()
        assert self._exported is not None
        assert self._bake is not None
        assert self._staged is not None
        assert self._groups is not None
        with self._timed("write"):
            scene, layer = self._place()
            self._add_solver_warnings()
            outputs, bindings = yield from write_back(self._exported, self._bake, self._staged, self.request, scene,
                                                      layer, self.warnings)
            made = yield from self._groups.converted(self._exported.bindings, bindings, scene, layer)
            self._groups.place(self._staged_groups, made)
            yield
            if self.request.save is not None:
                blend_file.save_copy(self.request.save)
        full = report.complete(
            self._bake.report, scene=bpy.data.filepath or self.scene_name, blender=compat.version(),
            settings=self.request.settings, outputs=outputs, warnings=self.warnings, stages=self._seconds,
            seconds=time.perf_counter() - self._started, materials=self._exported.materials)
        if self.request.report_path is not None:
            report.write(full, self.request.report_path)
        self.progress("write", 1.0)
        return Outcome.of(full)

    def close(self) -> None:
        """End the worker and make room for the next job; folders that were made for nothing go."""
        self.cancel()
        self.wait(threading.TIMEOUT_MAX)
        if self._staged is not None:
            self._staged.close()
        if self._staged_groups is not None:
            shutil.rmtree(self._staged_groups, ignore_errors=True)
        remove_empty(self._made)
        if Job.current is self:
            Job.current = None

    def _work(self) -> None:
        try:
            self._bake = self._baked()
            self._use(self._bake)
        except BaseException as error:  # noqa: BLE001 - it is raised again in Blender's thread, by finish()
            self._failure = error

    def _baked(self) -> Bake:
        """The long work."""
        assert self._exported is not None
        assert self._groups is not None
        with self._timed("unwrap"):
            scene, settings = with_shared_layouts(self._exported.scene, self._exported.bindings,
                                                  self._exported.settings, self.warnings, self._unwrapping)
        return bake(scene, settings, progress=self.progress, cancelled=self._cancel.is_set,
                    groups=self._groups.for_solver, keep_paths=self.request.keep_paths)

    def _use(self, done: Bake) -> None:
        """What the worker does with its bake: all files are written beside their places."""
        assert self._exported is not None
        assert self._groups is not None
        self.progress("write", 0.0)
        self.refuse_cancelled()
        with self._timed("write"):
            self._staged = stage(done, self.request, self.blend)
            self._staged_groups = self._groups.stage(done, self._exported, self.request)

    def _unwrapping(self, fraction: float) -> None:
        self.progress("unwrap", fraction)
        self.refuse_cancelled()

    def _add_solver_warnings(self) -> None:
        assert self._bake is not None
        self.warnings.extend(entry for entry in self._bake.report.get("warnings", []) if entry not in self.warnings)

    def _place(self) -> tuple[Any, Any]:
        """Scene and view layer, found by name: undo and file loads make new ones while a bake runs."""
        scene = bpy.data.scenes.get(self.scene_name)
        layer = scene.view_layers.get(self._layer_name) if scene is not None else None
        if layer is None:
            raise RadiosityError(f"scene {self.scene_name!r} or its view layer {self._layer_name!r} was removed "
                                 "during the bake: bake again")
        return scene, layer

    @contextmanager
    def _timed(self, name: str) -> Iterator[None]:
        start = time.perf_counter()
        yield
        self._seconds[name] = self._seconds.get(name, 0.0) + time.perf_counter() - start


def run(request: Request, scene: Any, view_layer: Any) -> Outcome:
    """Bake and wait for it, with progress and warnings on the terminal; Ctrl C cancels.

    Raises
    ------
    RadiosityError
        With its exit code.
    """
    outcome: Outcome = wait_for(Job(request, scene, view_layer))
    return outcome


def wait_for(job: Any) -> Any:
    """Run a job, or one of its kind, to its end as `run` does; what it finishes with."""
    terminal = Terminal(job.progress)
    try:
        with cancelling(job.cancel):
            job.export()
            job.start()
            while not job.is_done:
                job.wait(TICK)
                terminal.show()
            terminal.close()
            return job.finish()
    finally:
        job.close()
        print_warnings(job.warnings)

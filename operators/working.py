"""What all operators share that work beside the user: what they are asked, and a job in the window, looked after by a
timer.
"""

from __future__ import annotations

import time
from typing import Any

from bpy.props import StringProperty

from ..radiosity_addon import look_overlay
from ..radiosity_addon.job import Job
from ..radiosity_addon.look import Look
from ..radiosity_addon.parts import Parts, some
from ..solver.errors import Cancelled, RadiosityError
from .status import redraw_looks, redraw_views, show_status

# Seconds between two looks at the work, and between two changes of what is told of it.
TICK, TOLD = 0.02, 0.1
# What is told while the results can't be written.
WAITS = "waits to write its result: end the tool in Edit Mode"
# Operators that look after a job in the window by now.
_running: list[Working] = []


def end_all(context: Any) -> None:
    """End all operators and their jobs: Blender takes the classes away and asks none of them."""
    for operator in list(_running):
        operator.cancel(context)


def is_free(operator: Any) -> bool:
    """Whether no job is on its way; where one is, the operator's tooltip says why it can't be called."""
    if Job.current is not None:
        operator.poll_message_set("A bake is on its way: wait for it, or press Esc to cancel it")
        return False
    return True


class Asked:
    """A part of an operator that is asked for as the command line is, one at a time."""

    options: StringProperty(  # type: ignore[valid-type]
        name="Options", description="Options of the command line that go before the panel's settings",
        options={"SKIP_SAVE"})

    @classmethod
    def poll(cls, context: Any) -> bool:
        return is_free(cls) and context.scene is not None


class Working:
    """A part of an operator: `_begin` from its `invoke`, and `_tell` what came of the job."""

    # What the status bar calls the work.
    doing = "Radiosity"

    def _begin(self, context: Any, job: Job) -> set[str]:
        self._job = job
        self._parts: Parts[Any] | None = job.exporting()
        self._look: Look | None = None
        self._told, self._line, self._waits = 0.0, "", False
        self._drawings, self._rested = look_overlay.drawings(), False
        manager = context.window_manager
        manager.progress_begin(0, 100)
        self._timer = manager.event_timer_add(TICK, window=context.window)
        manager.modal_handler_add(self)
        _running.append(self)
        redraw_views(context)
        return {"RUNNING_MODAL"}

    def modal(self, context: Any, event: Any) -> set[str]:
        """Read the scene part by part, show how far the worker is, write the results part by part; Esc cancels."""
        if event.type == "ESC" and event.value == "PRESS":
            self._give_up(context)
            return {"RUNNING_MODAL"}
        if event.type != "TIMER":
            # Nobody changes the scene while it is read or written to.
            return {"PASS_THROUGH"} if self._parts is None else {"RUNNING_MODAL"}
        try:
            outcome = self._tick(context)
        except RadiosityError as error:
            self._end(context)
            return self._failed(error)
        except BaseException:
            self._end(context)
            raise
        if outcome is None:
            return {"PASS_THROUGH"}
        self._end(context)
        return self._tell(outcome)

    def _give_up(self, context: Any) -> None:
        """Esc was pressed."""
        self._job.cancel()

    def _tick(self, context: Any) -> Any:
        """One step of the work that is Blender's thread's; what came of the job, at its end."""
        if self._rests():
            return None
        self._tell_progress(context)
        look = self._job.look
        is_ready = look_overlay.is_ready(look)
        if not is_ready or look is not self._look:
            # The view first.
            if is_ready or look_overlay.prepare(look):
                self._look = look
                redraw_looks(context)
            return None
        if self._parts is None:
            if not self._job.is_done:
                return None
            if self._waits:
                self._job.refuse_cancelled()
                return None
            self._parts = self._job.finishing()
        elif not self._job.is_baked:
            self._job.refuse_cancelled()
        try:
            some(self._parts)
        except StopIteration as end:
            self._parts = None
            if end.value is None:
                self._job.start()
            return end.value
        return None

    def _rests(self) -> bool:
        """Whether a viewport was drawn just now: the window answers the user before more is worked, every other time
        at least."""
        before, self._drawings = self._drawings, look_overlay.drawings()
        self._rested = before != self._drawings and not self._rested
        return self._rested

    def _tell_progress(self, context: Any) -> None:
        """In the status bar and the panels, now and then, if there is news."""
        now, progress = time.monotonic(), self._job.progress
        self._waits = self._job.is_done and self._parts is None and _is_edit_mode_in_use(context)
        line = WAITS if self._waits else progress.line()
        if now - self._told >= TOLD and self._line != line:
            self._told, self._line = now, line
            context.window_manager.progress_update(round(progress.fraction * 100))
            show_status(context, f"{self.doing} {self._line} (Esc cancels)")

    def cancel(self, context: Any) -> None:
        """Blender ends the operator: a file is loaded, or the window closed."""
        self._end(context)

    def _end(self, context: Any) -> None:
        _running.remove(self)
        if self._parts is not None:
            self._job.cancel()
            self._parts.close()
        self._job.close()
        context.window_manager.event_timer_remove(self._timer)
        context.window_manager.progress_end()
        show_status(context, None)
        redraw_views(context)

    def _failed(self, error: RadiosityError) -> set[str]:
        self.report({"WARNING"} if isinstance(error, Cancelled) else {"ERROR"}, str(error))  # type: ignore[attr-defined]
        return {"CANCELLED"}

    def _tell(self, outcome: Any) -> set[str]:
        raise NotImplementedError


def _is_edit_mode_in_use(context: Any) -> bool:
    """Whether a tool may work on a mesh in Edit Mode just now, as one that moves vertices: it can't be left then."""
    windows = context.window_manager.windows
    if not any(item.mode == "EDIT" for window in windows for item in window.view_layer.objects):
        return False
    return any(not operator.bl_idname.startswith("RADIOSITY_OT_")
               for window in windows for operator in window.modal_operators)

"""Run by Blender in its window: presses Compare with Cycles, Esc in the middle, then once more to the end.

Started as `drive.py` is, with a job of tab, operator, shots, save and result; its results: seconds from Esc to the end,
the longest time that the window did not answer while Cycles baked, the images, and what the image editor shows.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy

sys.path.insert(0, str(Path(__file__).parent))
import drive  # type: ignore[import-not-found]

# Seconds between two looks at the window, and that a comparison of the small scene may take.
TICK, LONGEST = 0.02, 240.0
# Times that the button is pressed until it takes.
TRIES = 3


def run(seen: str) -> Iterator[float]:
    """Press the button; go on when Cycles bakes."""
    window, _, _ = drive.sidebar()
    for _ in range(TRIES):
        # What the last run reported pops up under the mouse, goes when the mouse does, and takes a click until then.
        drive.move(window, window.width // 4, window.height // 4)
        yield 1.0
        yield from drive.press_button(drive.JOB["operator"])
        yield 2.0
        if stage():
            break
    end = time.monotonic() + LONGEST
    while not stage().startswith("Cycles"):
        if not stage() or time.monotonic() > end:
            raise TimeoutError(f"Cycles does not start: {stage() or 'nothing runs'}")
        yield TICK
    drive.photograph(seen)


def stage() -> str:
    """What the job is at; "" when none runs."""
    job = job_class().current
    return job.progress.line() if job is not None else ""


def job_class() -> Any:
    """The extension's own class of jobs."""
    name = next(name for name in sys.modules if name.endswith(".radiosity_lightmaps.radiosity_addon.job"))
    return sys.modules[name].Job


def until_done(longest_gap: str) -> Iterator[float]:
    """Wait for the end, and note the longest time between two looks."""
    end, last, gap = time.monotonic() + LONGEST, time.monotonic(), 0.0
    while stage():
        yield TICK
        now = time.monotonic()
        gap, last = max(gap, now - last), now
        if now > end:
            raise TimeoutError(f"still at {stage()}")
    drive.SEEN[longest_gap] = gap


def open_panel() -> None:
    """Only the part for comparing stands open, so that its button is in sight."""
    for name in dir(bpy.types):
        cls = getattr(bpy.types, name)
        if name.startswith("RADIOSITY_PT_") and getattr(cls, "bl_parent_id", ""):
            closed = name != "RADIOSITY_PT_compare"
            bpy.utils.unregister_class(cls)
            cls.bl_options = {"DEFAULT_CLOSED"} if closed else set()
            bpy.utils.register_class(cls)


def image_editor() -> bpy.types.Area:
    """The largest other area as an image editor."""
    areas = [area for area in bpy.context.window_manager.windows[0].screen.areas if area.type != "VIEW_3D"]
    largest = max(areas, key=lambda area: area.width * area.height)
    largest.type = "IMAGE_EDITOR"
    return largest


def steps() -> Iterator[float]:
    """The whole visit."""
    for name, value in drive.JOB["settings"].items():
        setattr(bpy.context.scene.radiosity, name, value)
    bpy.context.scene.radiosity_compare.seconds = 60
    editor = image_editor()
    open_panel()
    yield from drive.open_tab(drive.JOB["tab"])
    yield from run("compare-1-running")
    window, _, _ = drive.sidebar()
    pressed = time.monotonic()
    window.event_simulate("ESC", "PRESS")
    window.event_simulate("ESC", "RELEASE")
    yield from until_done("gap_cancelled")
    drive.SEEN["seconds_to_cancel"] = time.monotonic() - pressed
    drive.SEEN["images_after_cancel"] = [image.name for image in bpy.data.images]
    bpy.context.scene.radiosity_compare.seconds = 5
    yield from run("compare-2-running")
    yield from until_done("gap_running")
    yield 2.0
    drive.photograph("compare-3-done")
    drive.SEEN["images"] = [image.name for image in bpy.data.images]
    drive.SEEN["shown"] = editor.spaces.active.image.name if editor.spaces.active.image else ""


if __name__ == "__main__":
    drive.begin(steps(), "compare-error")

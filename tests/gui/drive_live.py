"""Run by Blender in its window: watches bakes by mouse, ends them in every way, and times the window meanwhile.

Started as `drive.py` is, with a job of tab, shots, settings, fingerprint and result. Its results: the longest times
that the window did not answer, by what went on ("idle" is before any bake, "write" the end of one), the longest of
these that the extension itself had the window's thread work, in one go, and the longest that another thread waited for
the interpreter; seconds by the clock, and of threads, from the button until the first look is drawn; seconds from Esc
to the end; how the file differs afterwards; what the report says of a kept draft. At the end Blender is quit in the
middle of a bake. With "short" in the job, one bake alone is watched, until a draft is drawn, then cancelled.
"""

from __future__ import annotations

import json
import os
import resource
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import bpy

sys.path.insert(0, str(Path(__file__).parent))
import drive  # type: ignore[import-not-found]

# Seconds between two looks at the window, that it is watched idle, and that anything may take.
TICK, IDLE, LONGEST = 0.01, 3.0, 240.0
# Seconds between two times that a thread asks for the interpreter.
ASKED = 0.005
# Times that the button is pressed until it takes.
TRIES = 3
# Seconds for a new look to be drawn in software.
SHOWN = 3.0
# Clock ticks of the kernel in a second.
TICKS = os.sysconf("SC_CLK_TCK")
GAPS: dict[str, float] = {}
OWN: dict[str, float] = {}
HELD: dict[str, float] = {}
# Seconds of threads that have ended, by kind, and of the window's thread in our code; times that a viewport was drawn.
SPENT: dict[str, float] = {}
# Seconds that Blender's threads, and all of the machine's, had worked when the button was pressed; the titles of looks
# that a viewport has drawn since.
PRESSED: dict[str, float] = {}
DRAWN: set[str] = set()
# The titles of looks that there were since.
TITLES: list[str] = []


def module(name: str) -> Any:
    """One of the extension's own."""
    return sys.modules[next(full for full in sys.modules if full.endswith(f".radiosity_lightmaps.{name}"))]


def current() -> Any:
    """The job that is on its way, or None."""
    return module("radiosity_addon.job").Job.current


def time_own_calls() -> None:
    """Note how long the extension keeps the window's thread busy: seconds of its work, whatever else runs here."""
    bake, overlay = module("operators.bake").RADIOSITY_OT_bake, module("radiosity_addon.look_overlay")

    def timed(call: Callable[..., Any], name: str) -> Callable[..., Any]:
        def with_clock(*arguments: Any) -> Any:
            # A software driver takes its memory as it first draws a look, which a graphics card has by itself, and a
            # virtual machine may be slow to hand it out: of drawing, what the kernel does is left out.
            clock = user_time if name == "draw" else time.thread_time
            job, begun, result = current(), clock(), None
            TITLES.extend(filter(None, [title()]))
            stage = "idle" if job is None else name or job.progress.stage
            try:
                result = call(*arguments)
            finally:
                what = stage if result is None else "write"
                taken = clock() - begun
                OWN[what] = max(OWN.get(what, 0.0), taken)
                SPENT["window"] = SPENT.get("window", 0.0) + taken
            return result

        return with_clock

    bake._begin = noted(bake._begin)
    bake._tick = timed(bake._tick, "")
    overlay.detach()
    overlay._draw = counted(timed(overlay._draw, "draw"))
    overlay.attach()


def user_time() -> float:
    """Seconds that this thread has worked outside of the kernel."""
    return resource.getrusage(resource.RUSAGE_THREAD).ru_utime


def counted(call: Callable[..., Any]) -> Callable[..., Any]:
    """Note how often a 3D viewport is drawn, and with which looks."""
    def with_count(*arguments: Any) -> Any:
        SPENT["drawn"] = SPENT.get("drawn", 0.0) + 1
        done = call(*arguments)
        # A large look is drawn in more than one go.
        job, drawn = current(), module("radiosity_addon.look_overlay")._drawn
        if job is not None and drawn and drawn[-1].is_whole and drawn[-1].look is job.look:
            DRAWN.add(title())
        return done

    return with_count


def noted(call: Callable[..., Any]) -> Callable[..., Any]:
    """Note what had been worked when a bake begins."""
    def with_note(*arguments: Any) -> Any:
        DRAWN.clear()
        TITLES.clear()
        SPENT.clear()
        PRESSED.update(blender=time.process_time(), helpers=helped(), machine=worked())
        return call(*arguments)

    return with_note


def worked() -> float:
    """Seconds that the machine's cores have worked, or were kept by others of the host's."""
    user, nice, system, _, _, *interrupts = Path("/proc/stat").read_text(encoding="ascii").split("\n")[0].split()[1:9]
    return sum(map(int, (user, nice, system, *interrupts))) / TICKS


def helped() -> float:
    """Seconds that Blender's child processes have worked, those that have ended included."""
    ticks = 0
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            _, parent, *fields = stat.read_text(encoding="ascii", errors="replace").rpartition(")")[2].split()
        except OSError:
            continue
        if int(parent) == os.getpid():
            ticks += int(fields[9]) + int(fields[10])
    ended = os.times()
    return ticks / TICKS + ended.children_user + ended.children_system


def watch_interpreter() -> None:
    """Note how long a thread waits for the interpreter, by what goes on."""
    def ask() -> None:
        while True:
            job, begun = current(), time.monotonic()
            time.sleep(ASKED)
            what = "idle" if job is None else job.progress.stage
            HELD[what] = max(HELD.get(what, 0.0), time.monotonic() - begun - ASKED)

    threading.Thread(target=ask, name="watch", daemon=True).start()


def time_threads() -> None:
    """Note the seconds of all threads that Python starts from now on."""
    run = threading.Thread.run

    def with_clock(self: threading.Thread) -> None:
        begun = time.thread_time()
        try:
            run(self)
        finally:
            SPENT[self.name.split("-")[0]] = SPENT.get(self.name.split("-")[0], 0.0) + time.thread_time() - begun

    threading.Thread.run = with_clock  # type: ignore[method-assign]


def title() -> str:
    """What is shown; "" where nothing is."""
    job = current()
    return job.look.title if job is not None and job.look is not None else ""


def watch(done: Callable[[], bool]) -> Iterator[float]:
    """Wait, and note how long the window did not answer, by what went on."""
    end, last = time.monotonic() + LONGEST, time.monotonic()
    while not done():
        job = current()
        before = "idle" if job is None else job.progress.stage
        yield TICK
        now = time.monotonic()
        what = "write" if job is not None and current() is None else before
        GAPS[what], last = max(GAPS.get(what, 0.0), now - last), now
        if now > end:
            raise TimeoutError(f"still at {before}")


def start() -> Iterator[float]:
    """Press the bake button until it takes."""
    window, _, _ = drive.sidebar()
    for _ in range(TRIES):
        # What the last run reported pops up under the mouse, goes when the mouse does, and takes a click until then.
        drive.move(window, window.width // 4, window.height // 4)
        yield 1.0
        yield from drive.press_button("radiosity.bake")
        if current() is not None:
            return
    raise TimeoutError("no bake starts")


def differences(before: Any) -> list[str]:
    """What the file holds other than before."""
    bpy.context.view_layer.update()
    fingerprints = drive.load(drive.JOB["fingerprint"])
    return list(fingerprints.differences(before, fingerprints.fingerprint()))


def seconds_to_draw() -> float:
    """Of the clock, to draw the whole window once."""
    window, _, _ = drive.sidebar()
    begun = time.monotonic()
    with bpy.context.temp_override(window=window):
        bpy.ops.wm.redraw_timer(type="DRAW_WIN_SWAP", iterations=1)
    return time.monotonic() - begun


def cancelled(before: Any) -> Iterator[float]:
    """Watch a bake up to its first draft, then press Esc."""
    drive.SEEN["seconds_to_draw"] = seconds_to_draw()
    yield from start()
    # The window goes on once the picture is on the screen.
    yield from watch(lambda: "first look" in DRAWN)
    drive.SEEN["seconds_to_look"], machine = current().progress.elapsed, worked() - PRESSED["machine"]
    SPENT["blender"] = time.process_time() - PRESSED["blender"]
    SPENT["helpers"] = helped() - PRESSED["helpers"]
    drive.SEEN["spent_to_look"] = {**SPENT, "others": machine - SPENT["blender"] - SPENT["helpers"]}
    yield SHOWN
    yield from drive.shot("large-1-first-look" if drive.JOB.get("short") else "live-1-first-look")
    if drive.JOB.get("short"):
        yield from watch(lambda: any(shown.startswith("error") for shown in DRAWN))
    else:
        yield from watch(lambda: title().startswith("error"))
        yield SHOWN
        yield from drive.shot("live-2-draft")
        yield from watch(lambda: title() == "error 0.06")
        yield SHOWN
        yield from drive.shot("live-3-finer")
    window, _, _ = drive.sidebar()
    pressed = time.monotonic()
    window.event_simulate("ESC", "PRESS")
    window.event_simulate("ESC", "RELEASE")
    yield from watch(lambda: current() is None)
    drive.SEEN["seconds_to_cancel"] = time.monotonic() - pressed
    drive.SEEN["after_cancel"] = differences(before)


def kept(before: Any) -> Iterator[float]:
    """Press Good Enough once a draft is shown, then undo."""
    yield from start()
    yield from watch(lambda: title().startswith("error"))
    yield from drive.press_button("radiosity.good_enough")
    yield from watch(lambda: current() is None)
    drive.SEEN["kept"] = TITLES[-1]
    yield from drive.shot("live-4-kept")
    report = json.loads((Path(bpy.data.filepath).parent / "lightmaps" / "report.json").read_text(encoding="utf-8"))
    drive.SEEN["report"] = {name: report.get(name) for name in ("error", "good_enough", "outputs", "stages")}
    drive.SEEN["after_keep"] = differences(before)
    yield from drive.undo("undo")
    drive.SEEN["after_undo"] = differences(before)


def loaded_meanwhile() -> Iterator[float]:
    """Load the file anew in the middle of a bake."""
    yield from start()
    yield from watch(lambda: title() != "")
    job = current()
    bpy.ops.wm.open_mainfile(filepath=bpy.data.filepath, load_ui=False)
    yield 1.0
    drive.SEEN["runs_after_load"] = current() is not None or not job.is_done


def steps() -> Iterator[float]:
    """The whole visit."""
    for name, value in drive.JOB["settings"].items():
        setattr(bpy.context.scene.radiosity, name, value)
    time_own_calls()
    time_threads()
    watch_interpreter()
    yield from drive.open_tab(drive.JOB["tab"])
    yield from drive.view_camera()
    over = time.monotonic() + IDLE
    yield from watch(lambda: time.monotonic() > over)
    bpy.ops.ed.undo_push(message="before")
    before = drive.load(drive.JOB["fingerprint"]).fingerprint()
    yield from cancelled(before)
    if drive.JOB.get("short"):
        return
    yield from kept(before)
    yield from loaded_meanwhile()
    yield from start()
    yield from watch(lambda: title() != "")
    drive.SEEN["runs_at_quit"] = current() is not None


if __name__ == "__main__":
    drive.begin(steps(), "live-error", gaps=GAPS, own=OWN, held=HELD)

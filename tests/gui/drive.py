"""Run by Blender in its window: goes through a visit by mouse, takes pictures, and writes down what it saw.

`blender --enable-event-simulate SCENE.blend --python drive.py`, with DRIVE_JOB set to a JSON object:
tab : the sidebar's tab to open.
settings : values of the scene's settings, as the panel's fields would get them; views : those of its views.
visit : the steps, [["verb", argument, ...], ...]; each verb is a function below.
shots : folder for the pictures of the whole screen.
result : the JSON file to write, {"error": ..., "seen": ...}.
fingerprint : path of the module that tells all that a .blend holds.

No operator is called to do what a button does: tabs and buttons are found by moving and clicking.
"""

from __future__ import annotations

import importlib.util
import json
import os
import subprocess
import time
import traceback
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy

JOB = json.loads(os.environ["DRIVE_JOB"])
# Pixels between two tries down the strip of tabs, and down the panel; both are smaller than what is looked for.
TAB_STEP, BUTTON_STEP = 10, 14
# Seconds for the window to handle a move of the mouse, and to draw what a click changed.
MOVE, DRAW = 0.03, 0.3
# Seconds between two looks at an operator that runs, and that it may run.
TICK, LONGEST = 0.1, 240.0
SEEN: dict[str, Any] = {"differences": {}, "shading": {}, "mode": {}, "results": {}}


def load(path: str) -> Any:
    """A file as a module."""
    spec = importlib.util.spec_from_file_location(Path(path).stem, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


MARKS: dict[str, Any] = {}
# Height at which the button of an operator was last seen, pixels, and the operator that was last seen at a height.
HEIGHTS: dict[str, int] = {}
FOUND: dict[int, str] = {}
ENGINE: dict[str, str] = {}


def viewport() -> tuple[Any, Any]:
    """The window and its 3D viewport."""
    window = bpy.context.window_manager.windows[0]
    return window, next(area for area in window.screen.areas if area.type == "VIEW_3D")


def region_of(area: Any, kind: str) -> Any:
    """A part of an area."""
    return next(region for region in area.regions if region.type == kind)


def sidebar() -> tuple[Any, Any, Any]:
    """The window, its 3D viewport and the viewport's sidebar."""
    window, area = viewport()
    return window, area, region_of(area, "UI")


def move(window: Any, x: int, y: int) -> None:
    """Move the mouse."""
    window.event_simulate("MOUSEMOVE", "NOTHING", x=x, y=y)


def click(window: Any, x: int, y: int) -> None:
    """Move the mouse and click its left button."""
    move(window, x, y)
    window.event_simulate("LEFTMOUSE", "PRESS", x=x, y=y)
    window.event_simulate("LEFTMOUSE", "RELEASE", x=x, y=y)


def photograph(name: str) -> None:
    """The whole screen as PNG; Blender's own screenshot is black under llvmpipe."""
    subprocess.run(["import", "-window", "root", str(Path(JOB["shots"]) / f"{name}.png")], check=True)


def shot(name: str) -> Iterator[float]:
    """Let the window draw, and photograph it."""
    yield DRAW
    photograph(name)


def under_mouse(window: Any, area: Any, region: Any, what: str) -> str:
    """What the button under the mouse would run ("python_command") or change ("data_path"); "" over anything else."""
    operator = getattr(bpy.ops.ui, f"copy_{what}_button")
    with bpy.context.temp_override(window=window, area=area, region=region):
        if not operator.poll():
            return ""
        operator(**({"full_path": True} if what == "data_path" else {}))
    return str(bpy.context.window_manager.clipboard)


def open_tab(name: str) -> Iterator[float]:
    """Click down the strip of tabs until the wanted one is open."""
    window, area = viewport()
    area.spaces[0].show_region_ui = True
    yield 1.0
    _, _, region = sidebar()
    for y in range(region.y + region.height - TAB_STEP, region.y, -TAB_STEP):
        click(window, region.x + region.width - 10, y)
        yield 0.1
        if region.active_panel_category == name:
            return
    raise LookupError(f"no tab {name!r} in the sidebar")


def look(window: Any, area: Any, region: Any, y: int) -> Iterator[float]:
    """Move to a height in the panel, and write down which operator's button is there."""
    move(window, region.x + (region.width - 20) // 2, y)
    yield MOVE
    FOUND[y] = under_mouse(window, area, region, "python_command").removeprefix("bpy.ops.").split("(")[0]
    HEIGHTS[FOUND[y]] = y


def survey() -> Iterator[float]:
    """Look where all buttons are, while the viewport is quickly drawn."""
    window, area, region = sidebar()
    for y in range(region.y + region.height - BUTTON_STEP, region.y, -BUTTON_STEP):
        yield from look(window, area, region, y)


def press_button(operator: str) -> Iterator[float]:
    """Move down the panel until the button of the operator is under the mouse, and click it."""
    window, area, region = sidebar()
    top = region.y + region.height - BUTTON_STEP
    # Where it was last seen, then below that, for panels grow; then everywhere.
    known = HEIGHTS.get(operator, region.y)
    for y in (*range(known, region.y, -BUTTON_STEP), *range(top, region.y, -BUTTON_STEP)):
        yield from look(window, area, region, y)
        if FOUND[y] == operator:
            click(window, region.x + (region.width - 20) // 2, y)
            # A short operator has ended before what it changed is drawn.
            for _ in range(round(DRAW / TICK)):
                yield TICK
                count_tick(operator)
            return
    raise LookupError(f"no button of {operator} in the panel")


def count_tick(operator: str) -> bool:
    """Whether the operator runs, and the window with it; counted."""
    verb, name = operator.split(".")[1], f"ticks of {operator}"
    runs = any(running.bl_idname.lower().endswith(f"_ot_{verb}") for running in viewport()[0].modal_operators)
    SEEN[name] = SEEN.get(name, 0) + runs
    return runs


def press(operator: str) -> Iterator[float]:
    """Press a button, and wait while its operator runs."""
    yield from press_button(operator)
    yield from wait(operator)
    # Away from the button: what was reported pops up under the mouse, takes a click, and goes when the mouse does.
    window, area = viewport()
    move(window, area.x + area.width // 3, area.y + area.height // 2)
    yield 1.0
    SEEN["mode"][operator] = bpy.context.scene.radiosity_view.mode
    SEEN["shading"][operator] = area.spaces[0].shading.type


def cancel(operator: str) -> Iterator[float]:
    """Press a button, then Esc as soon as its operator runs; write down whether it ran, and how many rows lux has."""
    yield from press_button(operator)
    SEEN[f"ran {operator}"] = count_tick(operator)
    window, _ = viewport()
    window.event_simulate("ESC", "PRESS")
    window.event_simulate("ESC", "RELEASE")
    yield from wait(operator)
    SEEN["rows after Esc"] = [row.name for row in bpy.context.scene.radiosity_view.rows]
    yield 1.0


def wait(operator: str) -> Iterator[float]:
    """Wait while the operator runs, with the window alive."""
    end, ticks = time.monotonic() + LONGEST, 0
    while count_tick(operator):
        if time.monotonic() > end:
            raise TimeoutError(f"{operator} still runs after {LONGEST:g} s")
        ticks += 1
        if ticks == 2:
            yield from shot(f"{operator.split('.')[1]}-runs")
        yield TICK


def idle(seconds: float) -> Iterator[float]:
    """Let the viewport draw."""
    yield seconds


def render_with(engine: str) -> Iterator[float]:
    """Show the viewport rendered by an engine, as its shading button does; "" shows it solid."""
    ENGINE.setdefault("own", bpy.context.scene.render.engine)
    bpy.context.scene.render.engine = engine or ENGINE["own"]
    viewport()[1].spaces[0].shading.type = "RENDERED" if engine else "SOLID"
    yield DRAW


def view_camera() -> Iterator[float]:
    """Look through the scene's camera, without gizmos."""
    space = viewport()[1].spaces[0]
    space.region_3d.view_perspective, space.region_3d.view_camera_zoom = "CAMERA", 20
    space.show_gizmo = False
    yield DRAW


def flip(name: str, path: str) -> Iterator[float]:
    """Click a check box of an object in the properties editor, which takes the viewport's place for it."""
    window, area = viewport()
    item = bpy.data.objects[name]
    bpy.context.view_layer.objects.active = item
    area.type = "PROPERTIES"
    yield 1.0
    area.spaces[0].context = "OBJECT"
    yield 1.0
    region = region_of(area, "WINDOW")
    wanted = f'bpy.data.objects["{name}"].{path}'
    for y in range(region.y + region.height - BUTTON_STEP, region.y, -BUTTON_STEP):
        x = region.x + region.width // 2
        move(window, x, y)
        yield MOVE
        if under_mouse(window, area, region, "data_path") == wanted:
            click(window, x, y)
            yield from shot("object")
            area.type = "VIEW_3D"
            yield 1.0
            return
    raise LookupError(f"no check box of {wanted} in the properties")


def mark(name: str, undoable: bool) -> Iterator[float]:
    """Remember all that the file holds, and let undo come back to here if asked."""
    bpy.context.view_layer.update()
    MARKS[name] = load(JOB["fingerprint"]).fingerprint()
    # Last: to read attributes takes them away from what the undo step shares with the file.
    if undoable:
        bpy.ops.ed.undo_push(message=name)
    yield DRAW


def compare(name: str, called: str) -> Iterator[float]:
    """Write down how the file differs from what was remembered."""
    bpy.context.view_layer.update()
    fingerprints = load(JOB["fingerprint"])
    SEEN["differences"][called] = fingerprints.differences(MARKS[name], fingerprints.fingerprint())
    yield DRAW


def undo(verb: str) -> Iterator[float]:
    """Undo the last step, or "redo" it."""
    window, area = viewport()
    with bpy.context.temp_override(window=window, area=area, region=region_of(area, "WINDOW")):
        getattr(bpy.ops.ed, verb)()
    yield 1.0


def change(name: str, attribute: str, value: Any) -> Iterator[float]:
    """Set an attribute of an object; of the scene's settings with "" for the name."""
    setattr(bpy.data.objects[name] if name else bpy.context.scene.radiosity, attribute, value)
    yield DRAW


def note_results(called: str) -> Iterator[float]:
    """Write down which objects have a result."""
    SEEN["results"][called] = [item.name for item in bpy.data.objects if "radiosity_result" in item]
    yield DRAW


def save(path: str) -> Iterator[float]:
    """Write a copy of the file as it is now."""
    bpy.ops.wm.save_as_mainfile(filepath=path, copy=True)
    yield DRAW


VERBS = {step.__name__: step for step in (
    view_camera, survey, shot, save, press, cancel, idle, render_with, flip, mark, compare, undo,
    change, note_results)}


def steps() -> Iterator[float]:
    """The whole visit."""
    scene = bpy.context.scene
    for group, settings in ((scene.radiosity, JOB["settings"]), (scene.radiosity_view, JOB.get("views", {}))):
        for name, value in settings.items():
            setattr(group, name, value)
    bpy.context.scene.cycles.preview_samples = 1
    yield from open_tab(JOB["tab"])
    for verb, *arguments in JOB["visit"]:
        start = time.monotonic()
        yield from VERBS[verb](*arguments)
        print(f"drive: {verb} {' '.join(map(str, arguments))}: {time.monotonic() - start:.1f} s", flush=True)


def begin(visit: Iterator[float], shown: str, **more: Any) -> None:
    """Go through a visit, a step at a time; at its end, or on an error, of which `shown` is the picture, write the
    result, `more` beside what was seen, and leave.
    """
    def tick() -> float | None:
        error = ""
        try:
            return next(visit)
        except StopIteration:
            pass
        except Exception:  # noqa: BLE001 - whatever went wrong belongs into the result, and the window must close
            error = traceback.format_exc()
            photograph(shown)
        told = {"error": error, "seen": {**SEEN, **more}}
        Path(JOB["result"]).write_text(json.dumps(told), encoding="utf-8")
        bpy.ops.wm.quit_blender()
        return None

    # A visit may load files.
    bpy.app.timers.register(tick, first_interval=2.0, persistent=True)


if __name__ == "__main__":
    begin(steps(), "error")

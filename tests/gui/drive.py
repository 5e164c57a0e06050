"""Run by Blender in its window: opens the sidebar, clicks the tab and the button, and waits until the bake ends.

`blender --enable-event-simulate SCENE.blend --python drive.py`, with DRIVE_JOB set to a JSON object:
tab, operator : what to click, e.g. "Radiosity" and "radiosity.bake".
settings : values of the scene's settings, as the panel's fields would get them.
shots : folder for the pictures of the whole screen.
save : the .blend to write at the end; result : the JSON file to write, {"error": ..., "seen": ...}.

No operator is called to bake: tabs and buttons are found by moving and clicking.
"""

from __future__ import annotations

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
TAB_STEP, BUTTON_STEP = 10, 6
# Seconds for the window to draw what an event changed.
DRAW = 0.2
# Seconds that a bake of the small scene may take.
LONGEST_BAKE = 240.0
SEEN: dict[str, Any] = {}


def sidebar() -> tuple[Any, Any, Any]:
    """The window, its 3D viewport and the viewport's sidebar."""
    window = bpy.context.window_manager.windows[0]
    area = next(area for area in window.screen.areas if area.type == "VIEW_3D")
    return window, area, next(region for region in area.regions if region.type == "UI")


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


def operator_under_mouse(window: Any, area: Any, region: Any) -> str:
    """What the button under the mouse would run, as Python; "" over anything else."""
    with bpy.context.temp_override(window=window, area=area, region=region):
        if not bpy.ops.ui.copy_python_command_button.poll():
            return ""
        bpy.ops.ui.copy_python_command_button()
    return str(bpy.context.window_manager.clipboard)


def open_tab(name: str) -> Iterator[float]:
    """Click down the strip of tabs until the wanted one is open."""
    window, area, region = sidebar()
    area.spaces[0].show_region_ui = True
    yield 2.0
    for y in range(region.y + region.height - TAB_STEP, region.y, -TAB_STEP):
        click(window, region.x + region.width - 10, y)
        yield DRAW
        if region.active_panel_category == name:
            return
    raise LookupError(f"no tab {name!r} in the sidebar")


def press_button(operator: str) -> Iterator[float]:
    """Move down the panel until the button of the operator is under the mouse, and click it."""
    window, area, region = sidebar()
    x = region.x + (region.width - 20) // 2
    for y in range(region.y + region.height - BUTTON_STEP, region.y, -BUTTON_STEP):
        move(window, x, y)
        yield DRAW
        if operator_under_mouse(window, area, region).startswith(f"bpy.ops.{operator}("):
            photograph("2-button")
            click(window, x, y)
            yield DRAW
            return
    raise LookupError(f"no button of {operator} in the panel")


def wait_for_bake(operator: str) -> Iterator[float]:
    """Wait while the operator runs, with the window alive."""
    window, _, _ = sidebar()
    verb = operator.split(".")[1]
    end = time.monotonic() + LONGEST_BAKE
    SEEN["ticks_while_baking"] = 0
    while any(running.bl_idname.lower().endswith(f"_ot_{verb}") for running in window.modal_operators):
        if time.monotonic() > end:
            raise TimeoutError(f"{operator} still runs after {LONGEST_BAKE:g} s")
        SEEN["ticks_while_baking"] += 1
        if SEEN["ticks_while_baking"] == 2:
            photograph("3-baking")
        yield 0.1


def steps() -> Iterator[float]:
    """The whole visit."""
    for name, value in JOB["settings"].items():
        setattr(bpy.context.scene.radiosity, name, value)
    yield from open_tab(JOB["tab"])
    photograph("1-tab")
    yield from press_button(JOB["operator"])
    yield from wait_for_bake(JOB["operator"])
    yield 1.0
    photograph("4-done")
    bpy.ops.wm.save_as_mainfile(filepath=JOB["save"])


VISIT = steps()


def tick() -> float | None:
    """One step a call; at the end, or on an error, write the result and leave."""
    error = ""
    try:
        return next(VISIT)
    except StopIteration:
        pass
    except Exception:  # noqa: BLE001 - whatever went wrong belongs into the result, and the window must close
        error = traceback.format_exc()
        photograph("error")
    Path(JOB["result"]).write_text(json.dumps({"error": error, "seen": SEEN}), encoding="utf-8")
    bpy.ops.wm.quit_blender()
    return None


if __name__ == "__main__":
    bpy.app.timers.register(tick, first_interval=2.0)

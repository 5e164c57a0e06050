"""Run by Blender in its window: changes modes, workspaces and the extension itself while bakes are on their way.

Started as `drive.py` is, with a job of shots, settings and result. Its results: what a bake that is started in Edit
Mode tells and leaves; modes and UV maps after Tab was pressed in the middle of one, and whether that bake waited while
vertices were moved; the texts of all status bars by workspace, after each bake; whether a bake can start once the
extension was switched off and on in the middle of one.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import bpy

sys.path.insert(0, str(Path(__file__).parent))
import drive  # type: ignore[import-not-found]

MODULE = "bl_ext.user_default.radiosity_lightmaps"
# Seconds between two looks, that a bake of the small scene may take, and that one may be seen to wait.
TICK, LONGEST, WAITED = 0.05, 240.0, 2.0
STATUS: dict[str, Any] = {}


def current() -> Any:
    """The job that is on its way, or None."""
    return sys.modules[f"{MODULE}.radiosity_addon.job"].Job.current


def watch_status() -> None:
    """Note the text of each workspace's status bar."""
    set_text = bpy.types.WorkSpace.status_text_set

    def noted(self: Any, text: Any) -> None:
        STATUS[self.name] = text
        set_text(self, text)

    bpy.types.WorkSpace.status_text_set = noted


def left_texts() -> list[str]:
    """Workspaces whose status bars show a text."""
    return [name for name, text in STATUS.items() if text is not None]


def run(operator: str, **options: Any) -> set[str]:
    """Call an operator in the viewport, as its key does."""
    window, area = drive.viewport()
    family, verb = operator.split(".")
    with bpy.context.temp_override(window=window, area=area, region=drive.region_of(area, "WINDOW")):
        return set(getattr(getattr(bpy.ops, family), verb)("INVOKE_DEFAULT", **options))


def tab(mode: str) -> None:
    """Enter or leave Edit Mode."""
    run("object.mode_set", mode=mode)


def until(done: Callable[[], bool]) -> Iterator[float]:
    """Wait."""
    end = time.monotonic() + LONGEST
    while not done():
        if time.monotonic() > end:
            raise TimeoutError("the bake does not go on")
        yield TICK


def begin() -> Iterator[float]:
    """Start a bake, and go on when its worker works and tells of it."""
    run("radiosity.bake")
    yield from until(lambda: current() is None or (current().progress.fraction > 0.1 and bool(left_texts())))


def end() -> Iterator[float]:
    """Wait for its end."""
    yield from until(lambda: current() is None)
    yield 0.5


def uv_maps() -> dict[str, list[str]]:
    """The UV maps of all meshes."""
    return {item.name: item.data.uv_layers.keys() for item in bpy.data.objects if item.type == "MESH"}


def reports() -> str:
    """All that Blender has told, as its Info editor lists it; another area is one for a moment."""
    window, _ = drive.viewport()
    area = next(area for area in window.screen.areas if area.type == "PROPERTIES")
    area.type = "INFO"
    with bpy.context.temp_override(window=window, area=area, region=drive.region_of(area, "WINDOW")):
        bpy.ops.info.select_all(action="SELECT")
        bpy.ops.info.report_copy()
    area.type = "PROPERTIES"
    return str(bpy.context.window_manager.clipboard)


def edited_before() -> Iterator[float]:
    """Press the button in Edit Mode."""
    tab("EDIT")
    run("radiosity.bake")
    yield from end()
    drive.SEEN["reports"], drive.SEEN["after_refused"] = reports(), uv_maps()
    tab("OBJECT")


def edited_meanwhile() -> Iterator[float]:
    """Press Tab in the middle of a bake, then move a vertex until some time after its worker has ended."""
    yield from begin()
    tab("EDIT")
    run("mesh.select_all", action="SELECT")
    run("transform.translate")
    yield from until(lambda: current().is_done)
    yield WAITED
    window, _ = drive.viewport()
    drive.SEEN["waits"] = current() is not None
    drive.SEEN["waits_text"] = list(STATUS.values())
    drive.photograph("modes-1-waits")
    window.event_simulate("RIGHTMOUSE", "PRESS", x=window.width // 3, y=window.height // 2)
    window.event_simulate("RIGHTMOUSE", "RELEASE", x=window.width // 3, y=window.height // 2)
    yield from end()
    drive.SEEN["mode_after"] = bpy.context.mode
    drive.SEEN["after_tab"] = uv_maps()
    bpy.ops.ed.undo()
    yield 1.0
    drive.SEEN["after_undo"] = uv_maps()


def other_workspace() -> Iterator[float]:
    """Change the workspace in the middle of a bake."""
    window, _ = drive.viewport()
    first = window.workspace
    yield from begin()
    drive.SEEN["told_in"] = left_texts()
    window.workspace = bpy.data.workspaces["Modeling"]
    yield from end()
    window.workspace = first
    yield 1.0
    drive.SEEN["left_texts"] = left_texts()
    drive.photograph("modes-2-workspace")


def switched_off() -> Iterator[float]:
    """Switch the extension off and on in the middle of a bake, then bake."""
    yield from begin()
    job = current()
    bpy.ops.preferences.addon_disable(module=MODULE)
    drive.SEEN["runs_after_off"] = not job.is_done
    drive.SEEN["texts_after_off"] = left_texts()
    yield 1.0
    bpy.ops.preferences.addon_enable(module=MODULE)
    # Blender forgets the operator that it took away with the window's next event.
    window, _ = drive.viewport()
    drive.move(window, window.width // 3, window.height // 2)
    yield 1.0
    for name, value in drive.JOB["settings"].items():
        setattr(bpy.context.scene.radiosity, name, value)
    yield from begin()
    drive.SEEN["starts_after_on"] = current() is not None
    yield from end()
    drive.SEEN["after_on"] = uv_maps()


def steps() -> Iterator[float]:
    """The whole visit."""
    for name, value in drive.JOB["settings"].items():
        setattr(bpy.context.scene.radiosity, name, value)
    watch_status()
    bpy.context.view_layer.objects.active = bpy.data.objects["Floor"]
    yield 1.0
    yield from edited_before()
    bpy.ops.ed.undo_push(message="before")
    yield from edited_meanwhile()
    yield from other_workspace()
    yield from switched_off()


if __name__ == "__main__":
    drive.begin(steps(), "modes-error")

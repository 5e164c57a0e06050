"""A comparison in Blender's image editors."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy

from .baked_images import MARK
from .compare import Compared

BOARD = "Radiosity Compare"
# Images of single maps that are loaded beside the board, those with the most error first.
MOST_MAPS = 4


def show(done: Compared) -> int:
    """Load what was written as images of the file, and show the board in the image editors that are open; how many."""
    board = _load(BOARD, done.files["board"], "sRGB")
    folder = done.files["numbers"].parent
    for row in done.report["outputs"][:MOST_MAPS]:
        for kind in ("ours", "cycles", "error"):
            _load(f"{row['image']} {kind}", folder / row[kind], "Linear Rec.709")
    shown = 0
    for space, is_open in _image_editors():
        if is_open or space.image is None:
            space.image = board
            shown += is_open
    return shown


def _load(name: str, path: Path, space: str) -> Any:
    """The file as an image called `name`; one of ours of that name is replaced where it is shown."""
    image = bpy.data.images.load(str(path), check_existing=False)
    image.colorspace_settings.name = space
    image[MARK] = True
    old = bpy.data.images.get(name)
    if old is not None and old.library is None and MARK in old:
        old.user_remap(image)
        bpy.data.images.remove(old)
    image.name = name
    return image


def _image_editors() -> Iterator[tuple[Any, bool]]:
    """The image editors of all screens, and whether a window shows them now."""
    visible = {window.screen.name for window in bpy.context.window_manager.windows}
    for screen in bpy.data.screens:
        for area in screen.areas:
            if area.type == "IMAGE_EDITOR":
                yield area.spaces.active, screen.name in visible

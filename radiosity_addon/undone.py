"""Results after an undo. UV maps and packed images come back, files that a bake has replaced do not: where a file holds
another layout than the image that comes back, there is no result.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import bpy

from . import preview
from .baked_images import LAYOUT, MARK
from .exr_writer import text_attribute
from .results import RESULT, forget


def attach() -> None:
    """Look after each undo and redo."""
    for handlers in (bpy.app.handlers.undo_post, bpy.app.handlers.redo_post):
        handlers.append(_looked_after)


def detach() -> None:
    """And no longer."""
    for handlers in (bpy.app.handlers.undo_post, bpy.app.handlers.redo_post):
        if _looked_after in handlers:
            handlers.remove(_looked_after)


@bpy.app.handlers.persistent
def _looked_after(_scene: Any, _depsgraph: Any) -> None:
    if forget_replaced():
        preview.refresh()


def forget_replaced() -> bool:
    """Take the results off objects whose images' files hold another layout now; whether there were any."""
    replaced = {image for image in bpy.data.images if _is_replaced(image)}
    found = [item for item in bpy.data.objects if RESULT in item and item.library is None
             and item.get(MARK) in replaced]
    for item in found:
        forget(item)
        # A later redo has to read it anew.
        item.update_tag()
    return bool(found)


def _is_replaced(image: Any) -> bool:
    if image.library is not None or LAYOUT not in image or image.packed_file is not None:
        return False
    path = Path(bpy.path.abspath(image.filepath))
    # One that is not there, as on a drive that is away, may come back.
    return os.path.isfile(path) and text_attribute(path, LAYOUT) != str(image[LAYOUT])

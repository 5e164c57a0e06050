"""What a long operator shows while it runs."""

from __future__ import annotations

from typing import Any


def show_status(context: Any, text: str | None) -> None:
    """A text in the status bar, None for Blender's own; the panels draw their bar anew."""
    if context.workspace is not None:
        context.workspace.status_text_set(text)
    for window in context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "VIEW_3D":
                area.tag_redraw()

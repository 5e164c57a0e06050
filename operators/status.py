"""What a long operator shows while it runs."""

from __future__ import annotations

from typing import Any

import bpy

# Workspaces that show a text of ours, by their address: it lasts as long as the file is open.
_told: set[int] = set()


def show_status(context: Any, text: str | None) -> None:
    """A text in the status bar, None for Blender's own; the panels draw their bar anew.

    It stands in the present workspace alone: the user may have changed it.
    """
    present = context.workspace if text is not None else None
    for workspace in bpy.data.workspaces:
        if workspace != present and workspace.as_pointer() in _told:
            workspace.status_text_set(None)
    _told.clear()
    if present is not None:
        present.status_text_set(text)
        _told.add(present.as_pointer())
    # Not the view itself, which may be slow to draw.
    _redraw(context, "UI")


def redraw_views(context: Any) -> None:
    """Let all 3D viewports draw anew."""
    for area in _viewports(context):
        area.tag_redraw()


def redraw_looks(context: Any) -> None:
    """Let what all 3D viewports show draw anew, without their panels."""
    _redraw(context, "WINDOW")


def _redraw(context: Any, kind: str) -> None:
    """Let the regions of a kind of all 3D viewports draw anew."""
    for area in _viewports(context):
        for region in area.regions:
            if region.type == kind:
                region.tag_redraw()


def _viewports(context: Any) -> list[Any]:
    return [area for window in context.window_manager.windows for area in window.screen.areas
            if area.type == "VIEW_3D"]

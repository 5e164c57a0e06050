"""Findings on the user's UV map: overlaps, stretch, parts that have no room or lie outside."""

from __future__ import annotations

from ..solver.lumels import lumels
from ..solver.scene import Scene
from ..solver.settings import Settings
from .warn import Warnings


def check_layout(scene: Scene, settings: Settings, warnings: Warnings) -> int:
    """Tell of the UV map that is to be used as it is; the number of lumels that it gives, 0 where none was named.

    Raises
    ------
    NothingToBake
        If it gives none.
    """
    if settings.target != "lightmap" or settings.uv_layer is None:
        return 0
    return len(lumels(scene, settings, warnings))

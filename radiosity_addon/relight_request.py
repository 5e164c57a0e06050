"""The request of a relight from the panel: only where things are; how to bake is what it was."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path
from typing import Any

import bpy

from ..solver.errors import RadiosityError
from . import cache
from .request import Request, folder_beside, not_own
from .settings import ADVICE


def relight_request(scene: Any, options: Namespace) -> Request:
    """Where images go, with options that go before the scene's settings.

    Raises
    ------
    SettingsError
        If there is no folder to write to.
    """
    given, kept = vars(options), scene.radiosity
    pack, output = given.get("pack", kept.pack), given.get("output")
    if output is None and not pack and (kept.target == "lightmap" or bpy.data.filepath):
        output = folder_beside(bpy.data.filepath, kept.output, advice=ADVICE)
    save = not_own(given.get("save"), bpy.data.filepath)
    return Request(output=output, report=given.get("report"), save=save, pack=pack,
                   apply_modifiers=given.get("apply_modifiers", kept.apply_modifiers),
                   group_layers=given.get("group_layers", kept.group_layers))


def kept_in(scene: Any) -> Path | None:
    """The folder of the groups that are kept for a scene; None if there are none."""
    try:
        folder = cache.find(relight_request(scene, Namespace()).output, scene.name)
    except RadiosityError:
        return None
    return folder if cache.is_kept(folder) else None

"""The request of the button in the panel, and of `bpy.ops.radiosity.bake()`."""

from __future__ import annotations

from argparse import Namespace
from typing import Any

import bpy

from ..solver.errors import NothingToBake
from .command import WORDS
from .request import Request, folder_beside
from .settings import ADVICE, settings_of


def request_in(context: Any, options: Namespace) -> Request:
    """The scene's settings, the selection, and options that go before both.

    Images are packed into the .blend, or linked to files in the output folder; vertex colours need no folder.

    Raises
    ------
    SettingsError
        On a value that makes no sense, or if there is no folder to write to.
    NothingToBake
        If the selection is asked for and holds no mesh.
    """
    given = vars(options)
    kept = context.scene.radiosity
    only: tuple[str, ...] = ()
    if kept.only_selected and "only" not in given:
        selected = (item for item in context.view_layer.objects if item.select_get())
        only = tuple(item.name for item in selected if item.type == "MESH" or item.instance_type == "COLLECTION")
        if not only:
            raise NothingToBake("no mesh is selected: select some, or switch off Selected Only")
    settings = settings_of(context.scene, {name: given[name] for name in WORDS if name in given}, only)
    pack, output = given.get("pack", kept.pack), given.get("output")
    if output is None and not pack and (settings.target == "lightmap" or bpy.data.filepath):
        output = folder_beside(bpy.data.filepath, kept.output, advice=ADVICE)
    save = given.get("save")
    return Request(settings, output, given.get("report"), save, pack,
                   given.get("apply_modifiers", kept.apply_modifiers or save is not None))

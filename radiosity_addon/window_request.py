"""The request of the button in the panel, and of `bpy.ops.radiosity.bake()`."""

from __future__ import annotations

from argparse import Namespace
from typing import Any

import bpy

from ..solver.errors import NothingToBake
from ..solver.settings import Settings
from .command import WORDS
from .object_settings import is_excluded
from .request import Request, folder_beside, not_own
from .settings import ADVICE, groups_of, settings_of


def settings_in(context: Any, options: Namespace) -> Settings:
    """The scene's settings, the selection, and options that go before both.

    Raises
    ------
    SettingsError
        On a value that makes no sense.
    NothingToBake
        If the selection is asked for and holds no mesh.
    """
    given = vars(options)
    kept = context.scene.radiosity
    only: tuple[str, ...] = ()
    if kept.only_selected and "only" not in given:
        selected = (item for item in context.view_layer.objects if item.select_get() and not is_excluded(item))
        only = tuple(item.name for item in selected if item.type == "MESH" or item.instance_type == "COLLECTION")
        if not only:
            raise NothingToBake("no mesh is selected that is not excluded: select some, or switch off Selected Only")
    return settings_of(context.scene, {name: given[name] for name in WORDS if name in given}, only)


def request_in(context: Any, options: Namespace) -> Request:
    """What to bake and where to: images are packed, or linked to files in the output folder.

    Vertex colours need no folder; where there is one, it gets the report.

    Raises
    ------
    SettingsError
        On a value that makes no sense, or if there is no folder to write to.
    NothingToBake
        If the selection is asked for and holds no mesh.
    """
    given = vars(options)
    kept = context.scene.radiosity
    settings = settings_in(context, options)
    pack, output = given.get("pack", kept.pack), given.get("output")
    if output is None and not pack and (settings.target == "lightmap" or bpy.data.filepath):
        output = folder_beside(bpy.data.filepath, kept.output, advice=ADVICE)
    save = not_own(given.get("save"), bpy.data.filepath)
    return Request(settings, output, given.get("report"), save, pack,
                   given.get("apply_modifiers", kept.apply_modifiers or save is not None),
                   groups_of(context.scene, given), given.get("group_layers", kept.group_layers),
                   given.get("reflectances", kept.reflectances))

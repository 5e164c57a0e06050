"""The request of the button in the panel, and of `bpy.ops.radiosity.bake()`."""

from __future__ import annotations

from argparse import Namespace
from typing import Any

import bpy

from ..solver.errors import NothingToBake
from ..solver.settings import Settings
from .command import WORDS
from .object_settings import is_excluded
from .receiving import CONVERTIBLE
from .request import Request, folder_beside, not_own
from .settings import ADVICE, groups_of, settings_of


def settings_in(context: Any, options: Namespace, *, convert: bool = False) -> Settings:
    """The scene's settings, the selection, and options that go before both.

    With `convert` curves and text count as selected meshes, as they will become meshes (`conversion`).

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
        selected = _selected(context)
        shapes = _shapes(context)
        only = tuple(item.name for item in selected if item.type == "MESH" or item.instance_type == "COLLECTION"
                     or (convert and item in shapes))
        if not only and shapes:
            raise NothingToBake(f"no mesh is selected, and {shapes[0].name!r} is a {shapes[0].type.lower()}: convert "
                                "it to a mesh (Object > Convert), or switch on Apply Modifiers, with which a bake does")
        if not only:
            raise NothingToBake("no mesh is selected that is not excluded: select some, or switch off Selected Only")
    return settings_of(context.scene, {name: given[name] for name in WORDS if name in given}, only)


def passed_over(context: Any, options: Namespace, *, convert: bool) -> tuple[str, ...]:
    """Names of the selected curves and text that a bake of the selection leaves out: those that become no meshes."""
    if convert or not context.scene.radiosity.only_selected or "only" in vars(options):
        return ()
    return tuple(item.name for item in _shapes(context))


def _selected(context: Any) -> list[Any]:
    return [item for item in context.view_layer.objects if item.select_get() and not is_excluded(item)]


def _shapes(context: Any) -> list[Any]:
    """What is selected and has faces, but no mesh of its own."""
    return [item for item in _selected(context) if item.type in CONVERTIBLE and _has_faces(item, context)]


def _has_faces(item: Any, context: Any) -> bool:
    """Whether an object without a mesh of its own is shown as one: a path is not."""
    shown = item.evaluated_get(context.evaluated_depsgraph_get())
    try:
        mesh = shown.to_mesh()
        return mesh is not None and len(mesh.polygons) > 0
    finally:
        shown.to_mesh_clear()


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
    save = not_own(given.get("save"), bpy.data.filepath)
    convert = given.get("apply_modifiers", kept.apply_modifiers or save is not None)
    settings = settings_in(context, options, convert=convert)
    pack, output = given.get("pack", kept.pack), given.get("output")
    if output is None and not pack and (settings.target == "lightmap" or bpy.data.filepath):
        output = folder_beside(bpy.data.filepath, kept.output, advice=ADVICE)
    return Request(settings, output, given.get("report"), save, pack,
                   convert, groups_of(context.scene, given), given.get("group_layers", kept.group_layers),
                   given.get("reflectances", kept.reflectances), passed_over(context, options, convert=convert))

"""Which of the shown meshes are baked, and whether their results can be stored."""

from __future__ import annotations

import difflib
from collections import Counter
from collections.abc import Sequence, Set
from typing import Any

import bpy
import numpy as np

from ..solver.errors import NothingToBake, SceneError, SettingsError
from ..solver.settings import Settings
from .binding import Binding
from .mesh_arrays import corner_vertices
from .mesh_layers import MOST_UV_MAPS, UV_MARK
from .object_settings import is_excluded
from .visible import Shown
from .warn import Warnings, warn

# Of one object no more than so many generated instances become meshes: grass is not baked blade by blade.
MOST_GENERATED = 256
# Types of objects that are shown as meshes and have none of their own.
CONVERTIBLE = frozenset({"CURVE", "SURFACE", "FONT", "META"})
# What to do about what has no mesh of its own.
CONVERT = "convert it to a mesh (Object > Convert), or let a bake do so (--apply-modifiers)"


def choose_receivers(shown: Sequence[Shown], settings: Settings, warnings: Warnings,
                     convert: bool = False, carriers: Set[str] = frozenset()) -> tuple[Binding, ...]:
    """One binding a shown mesh, in the same order.

    Parameters
    ----------
    shown, settings : what there is, and what to bake.
    warnings : gets what is not baked, and why.
    convert : whether what has no mesh of its own will be given one (see `conversion`), so that it can be baked.
    carriers : names of objects that show more than meshes of their own (see there), which would vanish by that.

    Raises
    ------
    SettingsError
        If `only` names what is not there, or a UV map is missing.
    SceneError
        If an object that `only` names can't be written to.
    NothingToBake
        If no object is left to receive light.
    """
    _check_names(shown, settings.only)
    generated = Counter(item.original.name for item in shown if not item.own_mesh)
    bindings = tuple(_bind(item, settings, warnings, _no_conversion(item, convert, generated, carriers))
                     for item in shown)
    if not any(binding.receives for binding in bindings):
        raise NothingToBake("no object can receive light: see the warnings above, or name others with --only")
    return bindings


def tell_passed_over(names: Sequence[str], warnings: Warnings) -> None:
    """Tell of selected objects that are left out, since they have no mesh."""
    for name in names:
        kind = bpy.data.objects[name].type.lower()
        warn(warnings, name, "not_baked", f"is not baked, it is a {kind} and has no mesh that could hold the result: "
             f"{CONVERT}")


def names_of(item: Shown) -> set[str]:
    """The names by which `only` may call it."""
    return {item.name, item.original.name, *([item.instancer] if item.instancer else [])}


def _no_conversion(item: Shown, convert: bool, generated: Counter[str], carriers: Set[str]) -> str:
    """What to do about a mesh that was made on the way and will be given no object; "" if it will, or has one."""
    name = item.original.name
    if item.own_mesh:
        return ""
    if not convert:
        return CONVERT
    if generated[name] > MOST_GENERATED:
        advice = ("join them (Realize Instances in the nodes)" if item.original.type == "MESH" else
                  "convert it to a mesh (Object > Convert)")
        return (f"of one object a bake converts no more than {MOST_GENERATED} meshes, and it makes {generated[name]}: "
                f"{advice}")
    if name in carriers:
        return ("a bake can't convert it, as it shows other objects or hair too, which would vanish: make the "
                "instances real (Object > Apply > Make Instances Real)")
    if item.original.type == "MESH" and item.original.data.shape_keys is not None:
        return ("a bake can't convert it, as its shape keys would be lost: apply these first (Object Data > Shape Keys "
                "> Apply All Shape Keys)")
    return ""


def _bind(item: Shown, settings: Settings, warnings: Warnings, no_conversion: str) -> Binding:
    named = bool(settings.only) and not names_of(item).isdisjoint(settings.only)
    wanted = named or not settings.only
    linked = item.original.library is not None or (item.own_mesh and item.original.data.library is not None)
    excluded = is_excluded(item.original)
    if excluded and named:
        raise SceneError(f"object {item.name!r} is excluded from bakes: untick Exclude in its object properties "
                         "(Radiosity Lightmaps), or don't name it")
    wanted = wanted and not excluded
    obstacle = _obstacle(item, settings, linked, no_conversion) if wanted else ""
    if obstacle and named:
        raise SceneError(f"object {item.name!r} {obstacle}")
    if obstacle:
        # One line for all instances that one object makes.
        name = item.name if item.own_mesh else item.original.name
        warn(warnings, name, "not_baked", f"is not baked, it {obstacle}")
    same = item.own_mesh and (_is_plain(item.original) or _same_topology(item.mesh, item.original.data))
    mesh = item.original.data.name if item.own_mesh else ""
    layout = ("" if not item.own_mesh else f"mesh {mesh}" if same else f"object {item.original.name}")
    return Binding(item.name, item.original.name, item.instancer, mesh, wanted and not obstacle, same, layout,
                   len(item.mesh.loops), linked)


def _obstacle(item: Shown, settings: Settings, linked: bool, no_conversion: str) -> str:
    """Why a mesh can't be baked, with what to do; "" if it can.

    Raises
    ------
    SettingsError
        If it lacks the UV map that was asked for.
    """
    uses_own_uv = settings.target == "lightmap" and settings.uv_layer is not None
    has_uv = uses_own_uv and settings.uv_layer in item.mesh.uv_layers
    if not item.own_mesh and not has_uv and (no_conversion or linked or uses_own_uv):
        kind = "geometry nodes" if item.original.type == "MESH" else f"a {item.original.type.lower()}"
        return f"is made by {kind} and has no mesh that could hold the result: {no_conversion or CONVERT}"
    if uses_own_uv and not has_uv:
        layers = ", ".join(repr(layer.name) for layer in item.mesh.uv_layers) or "none"
        raise SettingsError(f"object {item.name!r} has no UV map {settings.uv_layer!r} (it has {layers}): "
                            "add it, choose another, or name the objects to bake with --only")
    if not uses_own_uv and settings.target == "lightmap" and item.own_mesh and not _has_room(item.original.data):
        return (f"has {len(item.original.data.uv_layers)} UV maps and Blender takes no more: remove one, or bake with "
                "one of them (--uv-layer)")
    if linked and not has_uv:
        library = item.original.library or item.original.data.library
        return (f"is linked from {library.filepath} and can't be written to: make it local "
                "(Object > Relations > Make Local > All) or use a UV map that it has (--uv-layer)")
    return ""


def _has_room(mesh: Any) -> bool:
    """Whether the mesh can hold our UV map."""
    return len(mesh.uv_layers) < MOST_UV_MAPS or mesh.get(UV_MARK, "") in mesh.uv_layers


def _is_plain(item: Any) -> bool:
    """Whether nothing makes another mesh of an object's own."""
    return not item.modifiers and item.data.shape_keys is None


def _same_topology(evaluated: Any, original: Any) -> bool:
    """Whether corner i of one mesh is corner i of the other."""
    if len(evaluated.loops) != len(original.loops) or len(evaluated.polygons) != len(original.polygons):
        return False
    return bool(np.array_equal(corner_vertices(evaluated), corner_vertices(original)))


def _check_names(shown: Sequence[Shown], only: Sequence[str]) -> None:
    there = set().union(*(names_of(item) for item in shown)) if shown else set()
    for name in only:
        if name in there:
            continue
        item = bpy.data.objects.get(name)
        if item is not None and item.type not in CONVERTIBLE | {"MESH", "EMPTY"}:
            raise SettingsError(f"only names {name!r}, which is a {item.type.lower()}: name meshes")
        if item is not None:
            raise SettingsError(f"only names {name!r}, which a render does not show or which has no faces: "
                                "switch on its visibility in renders")
        close = difflib.get_close_matches(name, there, n=1)
        hint = f"did you mean {close[0]!r}?" if close else f"choose from {', '.join(sorted(there)[:8])}"
        raise SettingsError(f"only names {name!r}, which the scene does not have: {hint}")

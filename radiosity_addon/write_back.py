"""Results into Blender: image files, images, UV maps, colour attributes. Files first; the .blend changes last."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ..solver.result import Bake
from ..solver.scene import Surface
from . import baked_images, mesh_layers, patch_mesh, preview
from .baked_images import MARK
from .binding import Binding
from .blend_file import leave_edit_mode
from .claims import Claims
from .conversion import convert
from .export import Exported
from .modifiers import apply_modifiers
from .names import KEY_BYTES, block_name, fitted
from .parts import Parts
from .report import relative_to_report
from .request import Request
from .results import forget, remember, result_of
from .staging import Staged
from .warn import Warnings, warn

Float = NDArray[np.floating[Any]]


def write_back(exported: Exported, bake: Bake, staged: Staged, request: Request, scene: Any, view_layer: Any,
               warnings: Warnings) -> Parts[tuple[list[dict[str, Any]], tuple[Binding, ...]]]:
    """Put all results in their places, an object a part.

    Parameters
    ----------
    staged : the bake's files.

    Returns
    -------
    The report's `outputs`, one entry an object; and where the surfaces are bound now, some of them converted.

    Raises
    ------
    OutputError
        If a file can't be put in its place; the .blend is as it was then.
    """
    # Where meshes are made anew, whatever is edited would be missing from them or have another shape.
    anew = request.apply_modifiers and any(binding.receives and not (binding.mesh and binding.same_topology)
                                           for binding in exported.bindings)
    for name in leave_edit_mode(view_layer, None if anew else _data_of(exported.bindings)):
        warn(warnings, name, "left_edit_mode", "was being edited when the bake ended: it left Edit Mode, in which no "
             "result can be stored")
    if request.apply_modifiers:
        bindings = convert(scene, view_layer, exported.bindings, warnings)
        exported = replace(exported, bindings=bindings)
        yield
    outputs = yield from _write(exported, bake, staged, request, scene, view_layer, warnings)
    if bake.patches is not None:
        patch_mesh.store(bake.patches, [binding.instancer or binding.object for binding in exported.bindings])
        yield
    scene.radiosity_view.rows.clear()
    preview.refresh()
    return outputs, exported.bindings


def _write(exported: Exported, bake: Bake, staged: Staged, request: Request, scene: Any, view_layer: Any,
           warnings: Warnings) -> Parts[list[dict[str, Any]]]:
    if request.settings.target == "vertex":
        stored = yield from _store(exported, bake, request, scene, view_layer, warnings)
        _forget_overwritten(exported.bindings, stored, request, warnings)
        for binding in exported.bindings:
            if binding.receives:
                _remember(binding, request, stored.get(binding.surface))
        return [_entry(binding, request, attribute=stored.get(binding.surface))
                for binding in exported.bindings if binding.receives]
    claims = Claims(_baked(exported.bindings), request.save)
    names = claims.free_names(page.name for page in bake.lightmaps)
    paths, layers = staged.place(names, request.output, claims) if request.output is not None else ([], [])
    _tell_kept(claims, bake, names, paths, request, warnings)
    images = []
    for number, name in enumerate(names):
        images.append(baked_images.linked_image(name, paths[number], bpy.data.filepath, pack=request.pack) if paths
                      else baked_images.packed_image(name, staged.images[number]))
        yield
    stored = yield from _store(exported, bake, request, scene, view_layer, warnings)
    _forget_overwritten(exported.bindings, stored, request, warnings)
    outputs = []
    for binding, page in zip(exported.bindings, bake.page_of_surface, strict=True):
        if binding.receives:
            _remember(binding, request, stored.get(binding.surface), images[page] if page >= 0 else None)
        if page < 0:
            continue
        name = relative_to_report(paths[page], request.report_path) if paths else images[page].name
        height, width = bake.lightmaps[page].pixels.shape[:2]
        outputs.append(_entry(binding, request, uv_layer=stored.get(binding.surface), image=name,
                              resolution=[int(width), int(height)]))
        if layers:
            outputs[-1]["groups"] = relative_to_report(layers[page], request.report_path)
    return outputs


def _entry(binding: Binding, request: Request, **fields: Any) -> dict[str, Any]:
    return {"object": binding.surface, "target": request.settings.target, "uv_layer": None, "image": None,
            "resolution": None, **fields}


def _remember(binding: Binding, request: Request, layer: str | None, image: Any = None) -> None:
    """Let the object know its result, where an object is shown once and is ours to write to.

    An image without a layer is its own, and it has no result: an earlier layer lays out another image.
    """
    item = bpy.data.objects.get(binding.object)
    if item is None or binding.instancer or item.library is not None:
        return
    if layer is not None:
        remember(item, request.settings.target, request.settings.quantity, layer, image)
        return
    forget(item)
    if image is not None:
        item[MARK] = image


def _baked(bindings: Sequence[Binding]) -> set[str]:
    """Names of the objects that get a result; of instances none does."""
    return {binding.object for binding in bindings if binding.receives and not binding.instancer}


def _data_of(bindings: Sequence[Binding]) -> set[Any]:
    """The meshes of all surfaces, baked or not."""
    items = (bpy.data.objects.get(binding.object) for binding in bindings)
    return {item.data for item in items if item is not None}


def _tell_kept(claims: Claims, bake: Bake, names: Sequence[str], paths: Sequence[Path], request: Request,
               warnings: Warnings) -> None:
    """Tell of images that stay although all was baked, of files that are replaced, and of another .blend's."""
    for page, name in zip(bake.lightmaps, names, strict=True):
        holder = claims.holders.get(block_name(page.name))
        if holder is not None and not request.settings.only:
            warn(warnings, holder, "image_kept", f"is not baked now and still shows the image {page.name!r}: this "
                 f"light is in {name!r}; bake that object too, or Clear before, to have it in {page.name!r}")
    for file, name in claims.lost.items():
        warn(warnings, "", "file_replaced", f"the lightmap {file!r} held the light of {name!r} too, which is not baked "
             "now, and was replaced: give another output folder, or go on from the .blend that was saved with the bake")
    if claims.others:
        file, blend = next(iter(claims.others.items()))
        written = ", ".join(repr(path.name) for path in paths)
        warn(warnings, "", "other_blend", f"the lightmap {file!r} was baked from {blend!r} and stays, this light is in "
             f"{written}; the folder's report.json is replaced: give each .blend an output folder of its own")


def _forget_overwritten(bindings: Sequence[Binding], stored: dict[str, str], request: Request,
                        warnings: Warnings) -> None:
    """Take their results off objects beside the bake, on whose meshes it has put other layouts or colours."""
    if request.settings.target == "lightmap" and request.settings.uv_layer is not None:
        return
    written = {(bpy.data.objects[binding.object].data, stored[binding.surface]): binding.surface
               for binding in bindings if binding.surface in stored}
    baked = _baked(bindings)
    for item in bpy.data.objects:
        result = result_of(item) if item.name not in baked else None
        if result is not None and (item.data, result.layer) in written:
            forget(item)
            other = written[item.data, result.layer]
            warn(warnings, item.name, "result_lost", f"shares its mesh with {other!r}, whose bake has put other light "
                 "on it: it has no result any more, bake both together")


def _store(exported: Exported, bake: Bake, request: Request, scene: Any, view_layer: Any,
           warnings: Warnings) -> Parts[dict[str, str]]:
    """Put UV maps or colours on the meshes; what each surface got: its layer's name."""
    uv_layer = request.settings.uv_layer if request.settings.target == "lightmap" else None
    # What is too thin for where it lies has no place in a lightmap.
    receivers = [(index, binding) for index, binding in enumerate(exported.bindings)
                 if binding.receives and (bake.corner_colours is not None or bake.page_of_surface[index] >= 0)]
    if uv_layer is not None:
        return {binding.surface: uv_layer for _, binding in receivers}
    # Generated meshes that were not converted would vanish with the modifiers.
    making = {binding.object for binding in exported.bindings if not binding.mesh}
    blocked = [binding for _, binding in receivers if not binding.same_topology and binding.object not in making]
    applied: set[str] = set()
    if blocked and request.apply_modifiers:
        applied = apply_modifiers(scene, view_layer, blocked, warnings)
        yield
    stored: dict[str, str] = {}
    done: dict[str, str] = {}
    for index, binding in receivers:
        mesh = _mesh_of(binding, applied, request.apply_modifiers, warnings)
        if mesh is None:
            continue
        surface = exported.scene.surfaces[index]
        if request.settings.target == "vertex":
            assert bake.corner_colours is not None
            name = _attribute_name(binding, exported.bindings)
            stored[binding.surface] = mesh_layers.put_colours(
                mesh, name, _on_corners(surface, bake.corner_colours[index], len(mesh.loops)))
        else:
            # Surfaces of one layout have the same coordinates: the mesh is written once.
            if binding.layout not in done:
                done[binding.layout] = mesh_layers.put_uv(
                    mesh, _on_corners(surface, bake.uv[index], len(mesh.loops)), binding.object)
            stored[binding.surface] = done[binding.layout]
        yield
    return stored


def _mesh_of(binding: Binding, applied: set[str], apply: bool, warnings: Warnings) -> Any:
    """The mesh that takes a surface's results, or None with a warning; `apply` if modifiers were to be applied."""
    item = bpy.data.objects.get(binding.object)
    if item is None or (item.type != "MESH" and binding.mesh):
        warn(warnings, binding.surface, "not_stored", "was deleted or renamed during the bake: bake again")
        return None
    if not binding.mesh:
        warn(warnings, binding.surface, "not_stored",
             "has no mesh that could hold the result: let it be converted (--apply-modifiers)")
        return None
    if not binding.same_topology and binding.object not in applied:
        names = ", ".join(modifier.name for modifier in item.modifiers) or "shape"
        warn(warnings, binding.surface, "not_stored",
             f"its modifiers ({names}) make other corners than its mesh has, so the mesh can't hold the result: "
             f"{_on_modifiers(item, apply)}, or bake with a UV map of your own (--uv-layer)")
        return None
    if item.data.is_editmode:
        warn(warnings, binding.surface, "not_stored", "is in Edit Mode: leave it (Tab) and bake again")
        return None
    if len(item.data.loops) != binding.corner_count:
        warn(warnings, binding.surface, "not_stored",
             f"its mesh had {binding.corner_count} corners and now has {len(item.data.loops)}: bake again")
        return None
    return item.data


def _on_modifiers(item: Any, apply: bool) -> str:
    """What to do about the modifiers of an object; `apply` if they were to be applied."""
    if item.data.shape_keys is not None:
        keys = ", ".join(key.name for key in item.data.shape_keys.key_blocks)
        return (f"its shape keys ({keys}) would be lost if a bake applied them, so apply these first (Object Data > "
                "Shape Keys > Apply All Shape Keys)")
    if apply:
        return ("they show instances or hair too, which would vanish if a bake applied them, so make the instances "
                "real first (Object > Apply > Make Instances Real)")
    return "apply them (--apply-modifiers does)"


def _on_corners(surface: Surface, values: Float | None, corner_count: int) -> Float:
    """Values of triangle corners (count, 3, k) put on the mesh's corners (corner_count, k)."""
    assert values is not None
    assert surface.corner_ids is not None
    corners = np.zeros((corner_count, values.shape[2]), np.float32)
    corners[surface.corner_ids] = values
    return corners


def _attribute_name(binding: Binding, bindings: Sequence[Binding]) -> str:
    """A mesh that several surfaces show gets a colour attribute for each of them."""
    alone = sum(other.receives and other.layout == binding.layout for other in bindings) == 1
    return mesh_layers.COLOURS if alone else fitted(f"{mesh_layers.COLOURS}_{binding.surface}", KEY_BYTES)

"""Where light leaks and where it goes: figures of the last bake's patches as a heat map on both sides of surfaces."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ..solver.closure import PatchTable
from ..solver.errors import NothingToBake
from . import false_colour, patch_mesh, patch_paint
from .baked_light import VIEW_MARK
from .false_colour import SPAN

Float = NDArray[np.floating[Any]]

NAME = "Radiosity Leaks"
TITLES = {"back_faces": "Rays that meet back faces", "escaped": "Rays that meet nothing",
          "absorbed": "Absorbed, W/m2", "leaving": "Leaving, W/m2"}
# How far the map lies above the surfaces, as part of the diagonal of all patches: below it they would flicker.
LIFT = 5e-4
# A scale of shares is no shorter than this.
LEAST_SHARE = 0.01


def figure(table: PatchTable, name: str) -> Float:
    """(p,) float32: one of the figures of `TITLES`."""
    return 1 - table.row_sum if name == "escaped" else np.asarray(getattr(table, name))


def is_share(name: str) -> bool:
    """Whether a figure is a part of rays, else it is W/m2."""
    return name in ("back_faces", "escaped")


def worst_first(table: PatchTable, name: str) -> NDArray[np.intp]:
    """Patches in the order of their figure, those with nothing left out; shares count times the patch's area."""
    value = figure(table, name) * (table.area if is_share(name) else 1)
    order = np.argsort(-value, kind="stable")
    return order[value[order] > 0]


def show(scene: Any) -> int:
    """Add the map of the scene's figure to a scene; the number of patches.

    Raises
    ------
    NothingToBake
        If there are no figures.
    """
    found = patch_mesh.load()
    if found is None:
        raise NothingToBake("the file holds no figures of patches: bake first")
    (table, objects), view = found, scene.radiosity_view
    values = figure(table, view.figure)
    top = float(values.max(initial=0))
    if not is_share(view.figure) and len(table):
        top = min(top, SPAN * float(np.average(values, weights=table.area)))
    view.scale_low, view.scale_high = 0.0, false_colour.nice_top(max(top, LEAST_SHARE * is_share(view.figure)))
    view.scale_step = false_colour.nice_step(view.scale_high)
    view.scale_title = TITLES[view.figure]
    mesh = _map(table, values, patch_paint.pieces(bpy.context.evaluated_depsgraph_get(), set(objects)))
    scale = false_colour.scale_group(0.0, view.scale_high, view.scale_step, isolines=False)
    mesh.materials.append(false_colour.material_of_attribute("figure", scale, shaded=True))
    show_only(scene, NAME, mesh)
    return len(table)


def show_only(scene: Any, name: str, mesh: Any) -> Any:
    """A new object of a view: seen in the viewport, left out of renders and bakes, not selectable."""
    item = bpy.data.objects.new(name, mesh)
    mesh[VIEW_MARK] = item[VIEW_MARK] = True
    item.hide_render = item.hide_select = True
    scene.collection.objects.link(item)
    return item


def place(table: PatchTable, objects: Sequence[str], index: int, context: Any) -> str:
    """Move the 3D cursor to a patch and select its object alone; the object's name."""
    context.scene.cursor.location = table.middle[index].tolist()
    name = str(objects[table.surface[index]])
    item = context.view_layer.objects.get(name)
    if item is not None and context.mode == "OBJECT":
        for other in context.view_layer.objects:
            other.select_set(other == item)
        context.view_layer.objects.active = item
    return name


def _map(table: PatchTable, values: Float, corners: Float) -> Any:
    """A mesh of pieces (n, 3, 3) of surfaces, each side with its patch's value in the face attribute "figure"."""
    patch, normals = patch_paint.nearest(table, corners)
    lift = LIFT * np.linalg.norm(np.ptp(table.middle, axis=0)) if len(table) else 0.0
    met = np.flatnonzero(patch >= 0)
    both = np.concatenate([corners, corners[:, ::-1]])
    mesh = polygons(NAME, both[met] + (lift * normals[met])[:, None])
    shown = np.ascontiguousarray(values[patch[met]], np.float32)
    mesh.attributes.new("figure", "FLOAT", "FACE").data.foreach_set("value", shown)
    return mesh


def polygons(name: str, corners: Float) -> Any:
    """A mesh of polygons (n, sides, 3) that share no vertex."""
    mesh = bpy.data.meshes.new(name)
    count, sides = corners.shape[:2]
    mesh.vertices.add(sides * count)
    mesh.vertices.foreach_set("co", corners.astype(np.float32).ravel())
    mesh.loops.add(sides * count)
    mesh.loops.foreach_set("vertex_index", np.arange(sides * count, dtype=np.int32))
    mesh.polygons.add(count)
    mesh.polygons.foreach_set("loop_start", np.arange(0, sides * count, sides, dtype=np.int32))
    mesh.update(calc_edges=True)
    return mesh

"""Where light leaks and where it goes: the patches of the last bake as coloured squares on the surfaces.

Each square lies at the middle of its patch, faces as it does, and has its area; patches of curved or broken surfaces
have other shapes than their squares.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ..solver.closure import PatchTable
from ..solver.errors import NothingToBake
from . import false_colour, patch_mesh
from .baked_light import VIEW_MARK

Float = NDArray[np.floating[Any]]

NAME = "Radiosity Leaks"
TITLES = {"back_faces": "Rays that meet back faces", "escaped": "Rays that meet nothing",
          "absorbed": "Absorbed, W/m2", "leaving": "Leaving, W/m2"}
# How far the squares lie above the surfaces, as part of the diagonal of all patches: below it they would flicker.
LIFT = 5e-4
# The brightest patches in a hundred may leave the scale: a lamp would take all of it.
MOST = 99
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
    """Add the squares to a scene, coloured by the scene's figure; their number.

    Raises
    ------
    NothingToBake
        If there are no figures.
    """
    found = patch_mesh.load()
    if found is None:
        raise NothingToBake("the file holds no figures of patches: bake first")
    table, view = found[0], scene.radiosity_view
    values = figure(table, view.figure)
    top = float(values.max(initial=0) if is_share(view.figure) else np.percentile(values, MOST) if len(values) else 0)
    view.scale_low, view.scale_high = 0.0, false_colour.nice_top(max(top, LEAST_SHARE * is_share(view.figure)))
    view.scale_step = false_colour.nice_step(view.scale_high)
    view.scale_title = TITLES[view.figure]
    mesh = _squares(table)
    mesh.attributes.new("figure", "FLOAT", "FACE").data.foreach_set("value", np.ascontiguousarray(values, np.float32))
    scale = false_colour.scale_group(0.0, view.scale_high, view.scale_step, isolines=False)
    mesh.materials.append(false_colour.material_of_attribute("figure", scale))
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


def _squares(table: PatchTable) -> Any:
    """A mesh with a square a patch."""
    normal = table.normal.astype(np.float64)
    # Patches are parts of boxes along the axes: their squares lie along them too.
    axis = np.eye(3)[(np.argmax(np.abs(normal), axis=1) + 1) % 3]
    right = axis - normal * (axis * normal).sum(axis=1, keepdims=True)
    right /= np.maximum(np.linalg.norm(right, axis=1, keepdims=True), 1e-30)
    up = np.cross(normal, right)
    half = np.sqrt(table.area)[:, None] / 2
    lift = LIFT * np.linalg.norm(np.ptp(table.middle, axis=0)) if len(table) else 0.0
    middle = table.middle + lift * normal
    corners = np.stack([middle + half * (a * right + b * up) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))], axis=1)
    return quads(NAME, corners)


def quads(name: str, corners: Float) -> Any:
    """A mesh of quads (n, 4, 3) that share no vertex."""
    mesh = bpy.data.meshes.new(name)
    count = len(corners)
    mesh.vertices.add(4 * count)
    mesh.vertices.foreach_set("co", corners.astype(np.float32).ravel())
    mesh.loops.add(4 * count)
    mesh.loops.foreach_set("vertex_index", np.arange(4 * count, dtype=np.int32))
    mesh.polygons.add(count)
    mesh.polygons.foreach_set("loop_start", np.arange(0, 4 * count, 4, dtype=np.int32))
    mesh.update(calc_edges=True)
    return mesh

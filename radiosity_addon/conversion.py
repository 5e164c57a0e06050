"""Curves, text, metaballs and instances made by geometry nodes become meshes of their own, so that they can hold light.

Nothing is lost: what they came from stays in the .blend, hidden from renders and from the viewport.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import bpy
from mathutils import Matrix

from . import cycles, linking
from .binding import Binding
from .modifiers import apply_modifiers
from .stand_in import is_free, stand_in
from .visible import shown_meshes
from .warn import Warnings, warn

# Difference of an object's matrix from the one that was asked for, relative to its largest value, that counts as shear.
SHEAR = 1e-4


def convert(scene: Any, view_layer: Any, bindings: Sequence[Binding], warnings: Warnings) -> tuple[Binding, ...]:
    """Make an object of every surface that is baked and has no mesh of its own; the bindings lead there afterwards.

    So does every other surface of the same source, baked or not: the source shows nothing any more.
    """
    baked = {binding.object for binding in bindings
             if binding.receives and not binding.mesh and not binding.linked}
    wanted = {binding.surface: binding for binding in bindings if binding.object in baked and not binding.mesh}
    if not wanted:
        return tuple(bindings)
    made = cycles.with_render_depsgraph(scene, view_layer, lambda depsgraph: _meshes(depsgraph, set(wanted)))
    sources = defaultdict(list)
    for surface in made:
        sources[wanted[surface].object].append(surface)
    told = linking.told()
    objects: dict[str, Any] = {}
    applied: set[str] = set()
    for name, surfaces in sources.items():
        source = bpy.data.objects[name]
        homes = _homes(source, scene, is_instanced=any(wanted[surface].instancer for surface in surfaces))
        for surface in surfaces:
            objects[surface] = item = _placed(f"{surface} mesh", *made[surface], homes)
            stand_in(item, source, bpy.data.objects.get(wanted[surface].instancer), told, warnings)
        own = [binding for binding in bindings if binding.object == name and binding.mesh]
        if own:
            # Its modifiers made them: they would be there twice.
            applied |= apply_modifiers(scene, view_layer, own, warnings)
        else:
            _hide(source)
        what = f"{len(surfaces)} meshes" if len(surfaces) > 1 else f"mesh {objects[surfaces[0]].name!r}"
        kept = "its modifiers were applied" if own else "it stays, hidden"
        warn(warnings, name, "converted", f"was converted to {what}, so that there is a mesh that can hold the result; "
             f"{kept} (--no-apply-modifiers leaves it as it is, and bakes without it)")
    return tuple(_rebound(binding, objects, applied) for binding in bindings)


def _meshes(depsgraph: Any, wanted: set[str]) -> dict[str, tuple[Any, Matrix]]:
    """Copies of the meshes of surfaces, and where they stand."""
    return {item.name: (copied(item.mesh, item.materials), Matrix(item.matrix.tolist()))
            for item in shown_meshes(depsgraph, []) if item.name in wanted}


def copied(mesh: Any, materials: Sequence[Any]) -> Any:
    """A mesh of its own, of an evaluated one and the materials that it is shown with."""
    made = mesh.copy()
    made.materials.clear()
    for material in materials:
        made.materials.append(material.original if material is not None else None)
    return made


def _homes(source: Any, scene: Any, *, is_instanced: bool) -> list[Any]:
    """The collections for what a source becomes: its own, where they can be changed.

    In a collection that is shown by instances too, these would show it once more.
    """
    own = [] if is_instanced else source.users_collection
    free = [each for each in own if is_free(each)]
    shown = {scene.collection, *scene.collection.children_recursive}
    return free if len(free) == len(own) and not shown.isdisjoint(free) else [scene.collection, *free]


def _placed(name: str, mesh: Any, matrix: Matrix, homes: Sequence[Any]) -> Any:
    """An object of a mesh in some collections, with `matrix` to world space."""
    item = bpy.data.objects.new(name, mesh)
    mesh.name = item.name
    for collection in homes:
        collection.objects.link(item)
    item.matrix_world = matrix
    # Its place, rotation and scale alone; `matrix_world` says what it was told until Blender looks again.
    off = max(abs(a - b) for row, other in zip(item.matrix_basis, matrix, strict=True)
              for a, b in zip(row, other, strict=True))
    if off > SHEAR * max(abs(value) for row in matrix for value in row):
        # An object has no shear: the mesh takes it.
        mesh.transform(matrix)
        item.matrix_world = Matrix()
    return item


def _hide(source: Any) -> None:
    """Hide an object; of metaballs the whole family, or another of it would take its place."""
    family = [source]
    if source.type == "META":
        stem = source.name.partition(".")[0]
        family = [item for item in bpy.data.objects if item.type == "META" and item.name.partition(".")[0] == stem]
    for item in family:
        item.hide_render = item.hide_viewport = True


def bound_to(binding: Binding, item: Any) -> Binding:
    """The binding of a surface that has become a mesh object of its own."""
    return replace(binding, object=item.name, instancer="", mesh=item.data.name, same_topology=True,
                   layout=f"object {item.name}")


def _rebound(binding: Binding, objects: dict[str, Any], applied: set[str]) -> Binding:
    item = objects.get(binding.surface)
    if item is not None:
        return bound_to(binding, item)
    return replace(binding, same_topology=True) if binding.object in applied else binding

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

from . import cycles
from .binding import Binding
from .modifiers import apply_modifiers
from .visible import shown_meshes
from .warn import Warnings, warn

# Difference of an object's matrix from the one that was asked for, relative to its largest value, that counts as shear.
SHEAR = 1e-4


def convert(scene: Any, view_layer: Any, bindings: Sequence[Binding], warnings: Warnings) -> tuple[Binding, ...]:
    """Make an object of every surface that is baked and has no mesh of its own; the bindings lead there afterwards."""
    wanted = {binding.surface: binding for binding in bindings
              if binding.receives and not binding.mesh and not binding.linked}
    if not wanted:
        return tuple(bindings)
    made = cycles.with_render_depsgraph(scene, view_layer, lambda depsgraph: _meshes(depsgraph, set(wanted)))
    objects = {surface: _place(wanted[surface], mesh, matrix, scene) for surface, (mesh, matrix) in made.items()}
    sources = defaultdict(list)
    for surface in objects:
        sources[wanted[surface].object].append(surface)
    applied: set[str] = set()
    for name, surfaces in sources.items():
        own = [binding for binding in bindings if binding.object == name and binding.mesh and not binding.instancer]
        if own:
            # Its modifiers made them: they would be there twice.
            applied |= apply_modifiers(scene, view_layer, own, warnings)
        else:
            _hide(bpy.data.objects[name])
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


def _place(binding: Binding, mesh: Any, matrix: Matrix, scene: Any) -> Any:
    """An object of a mesh, in the collections of what it came from; of an instance of a collection, in the scene's."""
    item = bpy.data.objects.new(f"{binding.surface} mesh", mesh)
    mesh.name = item.name
    source = () if binding.instancer else bpy.data.objects[binding.object].users_collection
    for collection in [each for each in source if each.library is None] or [scene.collection]:
        collection.objects.link(item)
    item.matrix_world = matrix
    if max(abs(a - b) for row, other in zip(item.matrix_world, matrix, strict=True)
           for a, b in zip(row, other, strict=True)) > SHEAR * max(abs(value) for row in matrix for value in row):
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


def _rebound(binding: Binding, objects: dict[str, Any], applied: set[str]) -> Binding:
    item = objects.get(binding.surface)
    if item is not None:
        return replace(binding, object=item.name, instancer="", mesh=item.data.name, same_topology=True,
                       layout=f"object {item.name}")
    return replace(binding, same_topology=True) if binding.object in applied else binding

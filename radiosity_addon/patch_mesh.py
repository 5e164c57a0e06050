"""The figures of a bake's patches, kept in the .blend as the points of a mesh that nothing shows."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ..solver.closure import PatchTable
from .baked_images import MARK
from .mesh_arrays import read

NAME = "Radiosity Patches"
# Custom property of the mesh: the names of the objects that `surface` counts, as JSON.
OBJECTS = "radiosity_objects"
FIGURES = ("area", "row_sum", "back_faces", "leaving", "absorbed")


def store(table: PatchTable, objects: Sequence[str]) -> None:
    """Keep a table in place of an older one; `objects` are the names that its `surface` counts."""
    remove()
    mesh = bpy.data.meshes.new(NAME)
    mesh[MARK] = True
    mesh[OBJECTS] = json.dumps(list(objects))
    mesh.use_fake_user = True
    mesh.vertices.add(len(table))
    mesh.vertices.foreach_set("co", table.middle.astype(np.float32).ravel())
    _put(mesh, "facing", "FLOAT_VECTOR", "vector", table.normal)
    _put(mesh, "surface", "INT", "value", table.surface)
    for name in FIGURES:
        _put(mesh, name, "FLOAT", "value", getattr(table, name))


def kept() -> Any:
    """The mesh that holds the last bake's table; None where there is none."""
    return next((mesh for mesh in bpy.data.meshes if mesh.library is None and OBJECTS in mesh), None)


def load() -> tuple[PatchTable, list[str]] | None:
    """The last bake's table and the names of its objects."""
    mesh = kept()
    if mesh is None:
        return None
    figures: dict[str, NDArray[Any]] = {name: read(mesh.attributes[name].data, "value", np.float32) for name in FIGURES}
    table = PatchTable(
        middle=read(mesh.vertices, "co", np.float32, 3).astype(np.float64),
        normal=read(mesh.attributes["facing"].data, "vector", np.float32, 3),
        surface=read(mesh.attributes["surface"].data, "value", np.int32), **figures)
    return table, json.loads(mesh[OBJECTS])


def remove() -> None:
    """Forget the table."""
    mesh = kept()
    if mesh is not None:
        bpy.data.meshes.remove(mesh)


def _put(mesh: Any, name: str, kind: str, field: str, values: NDArray[Any]) -> None:
    mesh.attributes.new(name, kind, "POINT").data.foreach_set(field, np.ascontiguousarray(values).ravel())

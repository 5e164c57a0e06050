"""Meshes put together to one scene of triangles."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..solver.lights import Light
from ..solver.scene import Scene, Sky, Surface
from ..solver.settings import Settings
from .binding import Binding
from .linking import Linking
from .mesh_arrays import MeshArrays, degenerate, read_mesh, read_uv, triangle_normals
from .object_settings import density_of
from .surface_materials import Columns, Slot, SurfaceMaterials
from .visible import Shown
from .warn import Warnings, warn

Float = NDArray[np.floating[Any]]
Int = NDArray[np.int32]


class Assembly:
    """Collects meshes, their materials and textures; `settle()` and then `scene()` give the whole."""

    def __init__(self, settings: Settings, linking: Linking, warnings: Warnings) -> None:
        self.settings = settings
        self.linking = linking
        self.warnings = warnings
        self.surfaces: list[Surface] = []
        self._parts: dict[str, list[NDArray[Any]]] = {name: [] for name in (
            "vertices", "triangles", "normals", "casts_shadow", "seen")}
        self._meshes: dict[int, MeshArrays] = {}
        self._unsettled: list[Callable[[], None]] = []
        self.materials = SurfaceMaterials(warnings)
        self._columns: list[Columns] = []
        self._vertex_count = 0
        self._triangle_count = 0
        self._smooth = False

    def add(self, item: Shown, binding: Binding) -> Surface:
        """One shown mesh as a surface.

        Raises
        ------
        SceneError
            If the mesh or a texture can't be used.
        """
        mesh = self._mesh(item)
        slots = [self.materials.slot(material) for material in item.materials] or [self.materials.slot(None)]
        # Blender draws a face whose slot is not there with the last one.
        slot = np.clip(mesh.material_index, 0, len(slots) - 1)
        keep = self._kept(item, mesh, slot, slots)
        mesh, slot = mesh.take(keep), slot[keep]
        # A mirror turns the winding over, but the front stays where Blender's normal points.
        order = [0, 2, 1] if np.linalg.det(item.matrix[:3, :3]) < 0 else [0, 1, 2]
        triangles = mesh.triangles[:, order]
        self._unsettled.append(partial(self._place, mesh, item.matrix, order))
        self._smooth |= mesh.corner_normals is not None
        count = len(triangles)
        self._put("triangles", triangles + self._vertex_count)
        self._put("casts_shadow", np.full(count, "visible_shadow" not in item.missed))
        self._put("seen", np.full(count, "visible_diffuse" not in item.missed))
        self._columns.append(self.materials.columns(item, mesh, slot, slots, order))
        lightmap_uv = None
        if binding.receives and self.settings.target == "lightmap" and self.settings.uv_layer is not None:
            lightmap_uv = read_uv(item.mesh, self.settings.uv_layer)[mesh.corner_ids[:, order]]
        surface = Surface(item.name, self._triangle_count, count, lightmap_uv, binding.receives and count > 0,
                          density_of(item.original), corner_ids=np.ascontiguousarray(mesh.corner_ids[:, order]),
                          links=self.linking.of(item.original))
        self.surfaces.append(surface)
        self._vertex_count += len(mesh.positions)
        self._triangle_count += count
        return surface

    def settle(self) -> None:
        """Put all that was added where it stands in the world; needs no bpy, and comes before `scene`."""
        for place in self._unsettled:
            place()
        self._unsettled.clear()

    def _place(self, mesh: MeshArrays, matrix: NDArray[np.float64], order: list[int]) -> None:
        positions = mesh.positions @ matrix[:3, :3].T + matrix[:3, 3]
        self._put("vertices", positions)
        self._put("normals", _world_normals(mesh, matrix, positions, mesh.triangles[:, order], order))

    def forget_meshes(self) -> None:
        """Another dependency graph has other meshes, some of them where these were."""
        self._meshes.clear()

    def scene(self, lights: Sequence[Light], sky: Sky) -> Scene:
        """Everything that was added, lit."""
        joined = {name: np.concatenate(parts) for name, parts in self._parts.items()}
        column = {name: np.concatenate([columns[name] for columns in self._columns]) for name in self._columns[0]}
        # A radiance L that is the same in all directions leaves a surface as exitance pi L.
        column["emission"] = column["emission"] * np.float32(np.pi)
        # What diffuse rays don't see lights nothing.
        column["emission"] = column["emission"] * joined["seen"][:, None]
        surfaces = tuple(surface if surface.links is None or column["emission"][surface.triangles].any()
                         else replace(surface, links=None) for surface in self.surfaces)
        textures = tuple(self.materials.textures)
        if not textures:
            del column["uv"]
        return Scene(
            vertices=joined["vertices"], triangles=joined["triangles"], casts_shadow=joined["casts_shadow"],
            seen=joined["seen"],
            corner_normals=joined["normals"] if self._smooth else None, textures=textures,
            material_names=tuple(self.materials.names), lights=tuple(lights), sky=sky, surfaces=surfaces,
            **column)

    def _put(self, name: str, array: NDArray[Any]) -> None:
        self._parts[name].append(array)

    def _mesh(self, item: Shown) -> MeshArrays:
        key = item.mesh.as_pointer()
        if key not in self._meshes:
            self._meshes[key] = read_mesh(item.mesh, item.name)
        return self._meshes[key]

    def _kept(self, item: Shown, mesh: MeshArrays, slot: Int, slots: list[Slot]) -> NDArray[np.intp]:
        """The triangles that take part: those with area whose material is opaque."""
        empty = degenerate(mesh.positions @ item.matrix[:3, :3].T, mesh.triangles)
        if empty.any():
            faces = len(np.unique(mesh.face[empty]))
            warn(self.warnings, item.name, "zero_area",
                 f"{faces} of {len(np.unique(mesh.face))} faces have parts without area and get no light there: "
                 "merge vertices by distance (Mesh > Merge) or delete them")
        clear = np.array([one.shading.passes_light for one in slots])[slot]
        keep = np.flatnonzero(~empty & ~clear)
        if not len(keep):
            why = "all its faces let light through" if clear.all() else "no face of it has any area"
            warn(self.warnings, item.name, "not_baked", f"is not baked, {why}: give it another material or mesh")
        return keep


def _world_normals(mesh: MeshArrays, matrix: NDArray[np.float64], positions: Float, triangles: Int,
                   order: list[int]) -> Float:
    """(t, 3, 3) float32 unit corner normals in world space."""
    own = np.repeat(triangle_normals(positions, triangles)[:, None], 3, axis=1).astype(np.float32)
    if mesh.corner_normals is None:
        return own
    linear = matrix[:3, :3]
    # Normals go with the inverse transpose; times the determinant's size it is the cofactor matrix, which
    # exists for flattened objects too.
    cofactor = np.cross(linear[[1, 2, 0]], linear[[2, 0, 1]])
    if np.linalg.det(linear) < 0:
        cofactor = -cofactor
    normals = mesh.corner_normals[:, order].astype(np.float64) @ cofactor.T
    length = np.linalg.norm(normals, axis=2, keepdims=True)
    usable = length > 1e-20
    return np.where(usable, normals / np.where(usable, length, 1), own).astype(np.float32)

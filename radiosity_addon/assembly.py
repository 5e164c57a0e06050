"""Meshes put together to one scene of triangles."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..solver.lights import Light
from ..solver.scene import Scene, Sky, Surface, Texture
from ..solver.settings import Settings
from .binding import Binding
from .images import read_texture
from .materials import HIGHEST, Shading, read_material
from .mesh_arrays import MeshArrays, degenerate, read_mesh, read_uv, triangle_normals
from .object_settings import density_of
from .sockets import Colour, ImageUse
from .visible import Shown
from .warn import Warnings, warn

Float = NDArray[np.floating[Any]]
Int = NDArray[np.int32]


class Assembly:
    """Collects meshes, their materials and textures; `scene()` gives the whole."""

    def __init__(self, settings: Settings, warnings: Warnings) -> None:
        self.settings = settings
        self.warnings = warnings
        self.surfaces: list[Surface] = []
        self._parts: dict[str, list[NDArray[Any]]] = {name: [] for name in (
            "vertices", "triangles", "reflectance", "emission", "normals", "uv", "reflectance_texture",
            "emission_texture", "material")}
        self._meshes: dict[int, MeshArrays] = {}
        self._shadings: dict[str, tuple[int, Shading]] = {}
        self._textures: dict[tuple[str, bool], int] = {}
        self.textures: list[Texture] = []
        self.material_names: list[str] = []
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
        slots = [self._shading(material) for material in item.materials] or [self._shading(None)]
        # Blender draws a face whose slot is not there with the last one.
        slot = np.clip(mesh.material_index, 0, len(slots) - 1)
        keep = self._kept(item, mesh, slot, slots)
        mesh, slot = mesh.take(keep), slot[keep]
        positions = mesh.positions @ item.matrix[:3, :3].T + item.matrix[:3, 3]
        # A mirror turns the winding over, but the front stays where Blender's normal points.
        order = [0, 2, 1] if np.linalg.det(item.matrix[:3, :3]) < 0 else [0, 1, 2]
        triangles = mesh.triangles[:, order]
        normals = _world_normals(mesh, item.matrix, positions, triangles, order)
        self._smooth |= mesh.corner_normals is not None
        count = len(triangles)
        self._put("vertices", positions)
        self._put("triangles", triangles + self._vertex_count)
        self._put("normals", normals)
        self._put_materials(item, mesh, slot, slots, order)
        lightmap_uv = None
        if binding.receives and self.settings.target == "lightmap" and self.settings.uv_layer is not None:
            lightmap_uv = read_uv(item.mesh, self.settings.uv_layer)[mesh.corner_ids[:, order]]
        surface = Surface(item.name, self._triangle_count, count, lightmap_uv, binding.receives and count > 0,
                          density_of(item.original), corner_ids=np.ascontiguousarray(mesh.corner_ids[:, order]))
        self.surfaces.append(surface)
        self._vertex_count += len(positions)
        self._triangle_count += count
        return surface

    def scene(self, lights: Sequence[Light], sky: Sky) -> Scene:
        """Everything that was added, lit."""
        joined = {name: np.concatenate(parts) for name, parts in self._parts.items()}
        return Scene(
            vertices=joined["vertices"], triangles=joined["triangles"], reflectance=joined["reflectance"],
            emission=joined["emission"], corner_normals=joined["normals"] if self._smooth else None,
            uv=joined["uv"] if self.textures else None, textures=tuple(self.textures),
            reflectance_texture=joined["reflectance_texture"], emission_texture=joined["emission_texture"],
            material=joined["material"], material_names=tuple(self.material_names), lights=tuple(lights), sky=sky,
            surfaces=tuple(self.surfaces))

    def _put(self, name: str, array: NDArray[Any]) -> None:
        self._parts[name].append(array)

    def _mesh(self, item: Shown) -> MeshArrays:
        key = item.mesh.as_pointer()
        if key not in self._meshes:
            self._meshes[key] = read_mesh(item.mesh, item.name)
        return self._meshes[key]

    def _shading(self, material: Any) -> tuple[int, Shading]:
        name = material.name_full if material is not None else ""
        if name not in self._shadings:
            self._shadings[name] = (len(self.material_names), read_material(material, self.warnings))
            self.material_names.append(name or "(no material)")
        return self._shadings[name]

    def _kept(self, item: Shown, mesh: MeshArrays, slot: Int, slots: list[tuple[int, Shading]]) -> NDArray[np.intp]:
        """The triangles that take part: those with area whose material is opaque."""
        empty = degenerate(mesh.positions @ item.matrix[:3, :3].T, mesh.triangles)
        if empty.any():
            faces = len(np.unique(mesh.face[empty]))
            warn(self.warnings, item.name, "zero_area",
                 f"{faces} of {len(np.unique(mesh.face))} faces have parts without area and get no light there: "
                 "merge vertices by distance (Mesh > Merge) or delete them")
        clear = np.array([shading.passes_light for _, shading in slots])[slot]
        keep = np.flatnonzero(~empty & ~clear)
        if not len(keep):
            why = "all its faces let light through" if clear.all() else "no face of it has any area"
            warn(self.warnings, item.name, "not_baked", f"is not baked, {why}: give it another material or mesh")
        return keep

    def _put_materials(self, item: Shown, mesh: MeshArrays, slot: Int, slots: list[tuple[int, Shading]],
                       order: list[int]) -> None:
        """Reflectance, emission, textures and texture coordinates of each triangle."""
        shadings = [shading for _, shading in slots]
        self._put("reflectance", np.array([s.reflectance.factor for s in shadings], np.float32)[slot].reshape(-1, 3))
        # A radiance L that is the same in all directions leaves a surface as exitance pi L.
        emission = np.array([s.emission.factor for s in shadings], np.float32)[slot] * np.float32(np.pi)
        self._put("emission", emission.reshape(-1, 3))
        self._put("material", np.array([index for index, _ in slots], np.int32)[slot])
        uv = np.zeros((len(slot), 3, 2), np.float32)
        textures = {name: np.full(len(slot), -1, np.int32) for name in ("reflectance", "emission")}
        for number, shading in enumerate(shadings):
            rows = np.flatnonzero(slot == number)
            if not len(rows):
                continue
            uses = {"reflectance": shading.reflectance, "emission": shading.emission}
            for name, colour in uses.items():
                if colour.image is not None:
                    textures[name][rows] = self._texture(colour, name == "reflectance", number, slots)
            image = shading.reflectance.image or shading.emission.image
            if image is not None:
                corners = mesh.corner_ids[rows][:, order]
                uv[rows] = self._texture_coordinates(item, image, corners, self.material_names[slots[number][0]])
            self._check_one_layout(shading, self.material_names[slots[number][0]])
        self._put("uv", uv)
        self._put("reflectance_texture", textures["reflectance"])
        self._put("emission_texture", textures["emission"])

    def _texture(self, colour: Colour, reflects: bool, number: int, slots: list[tuple[int, Shading]]) -> int:
        """Index of the image among the scene's textures."""
        assert colour.image is not None
        key = (colour.image.image.name_full, reflects)
        if key not in self._textures:
            material = self.material_names[slots[number][0]]
            texture = read_texture(colour.image.image, material, self.warnings)
            if reflects and texture.pixels.max() >= 1:
                if texture.pixels.max() > 1:
                    warn(self.warnings, material, "reflectance", f"its image {texture.name!r} has values up to "
                         f"{texture.pixels.max():g}: they are held to {HIGHEST}, choose a darker one")
                texture = Texture(np.minimum(texture.pixels, np.float32(HIGHEST)), texture.name)
            self._textures[key] = len(self.textures)
            self.textures.append(texture)
        return self._textures[key]

    def _texture_coordinates(self, item: Shown, image: ImageUse, corners: Int, material: str) -> Float:
        """(n, 3, 2) float32 coordinates in the image of the triangles with these corners."""
        layers = item.mesh.uv_layers
        layer = image.uv_map or next((layer.name for layer in layers if layer.active_render), "")
        if layer not in layers:
            lacks = f"no UV map {layer!r}" if layer else "no UV map"
            warn(self.warnings, item.name, "texture", f"has {lacks} for image {image.image.name!r} of material "
                 f"{material!r}: the image's first pixel is used, unwrap the object")
            return np.zeros((len(corners), 3, 2), np.float32)
        uv = read_uv(item.mesh, layer)[corners].astype(np.float64)
        placed = uv @ image.matrix[:, :2].T + image.matrix[:, 2]
        if not np.isfinite(placed).all():
            warn(self.warnings, item.name, "texture", f"its UV map {layer!r} has values that are not finite: "
                 "they count as 0, unwrap again")
            placed = np.nan_to_num(placed, nan=0.0, posinf=0.0, neginf=0.0)
        return np.asarray(placed, np.float32)

    def _check_one_layout(self, shading: Shading, material: str) -> None:
        first, second = shading.reflectance.image, shading.emission.image
        if first is not None and second is not None and (
                first.uv_map != second.uv_map or not np.array_equal(first.matrix, second.matrix)):
            warn(self.warnings, material, "texture", "lays its base colour and its emission out differently: "
                 "both are laid out as the base colour")


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

"""A Blender mesh as arrays: one `foreach_get` a kind of data.

Attributes are copied as they lie in memory. The same by way of vertices, corners and faces is asked of Blender one by
one, and takes 50 to 300 times as long (measured in 5.0.1).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..solver.errors import SceneError

Float = NDArray[np.floating[Any]]
Int = NDArray[np.int32]

# Blender turns an infinite coordinate into the largest float; areas of anything so far out can't be held, metres.
FARTHEST = 1e12
# A triangle whose height is below this part of its longest side can't be told from a line in float32.
DEGENERATE_RATIO = 1e-7


@dataclass(frozen=True, eq=False)
class MeshArrays:
    """Triangles of one mesh in its own space.

    Attributes
    ----------
    positions : (v, 3) float64.
    triangles : (t, 3) int32 vertices.
    corner_ids : (t, 3) int32 corners (loops) of the mesh.
    face : (t,) int32 face of the mesh.
    material_index : (t,) int32 slot; -1 or beyond the slots is possible.
    corner_normals : (t, 3, 3) float32, or None where no face is smooth.
    corner_count : corners of the whole mesh.
    """

    positions: Float
    triangles: Int
    corner_ids: Int
    face: Int
    material_index: Int
    corner_normals: Float | None
    corner_count: int

    def take(self, rows: NDArray[Any]) -> MeshArrays:
        """The same mesh with the triangles at `rows` only."""
        normals = None if self.corner_normals is None else self.corner_normals[rows]
        return MeshArrays(self.positions, self.triangles[rows], self.corner_ids[rows], self.face[rows],
                          self.material_index[rows], normals, self.corner_count)


def read(collection: Any, attribute: str, dtype: type, width: int = 1) -> NDArray[Any]:
    """All values of an attribute of a Blender collection: (n,) or (n, width)."""
    values: NDArray[Any] = np.empty(len(collection) * width, dtype)
    collection.foreach_get(attribute, values)
    return values.reshape(-1, width) if width > 1 else values


def read_mesh(mesh: Any, name: str) -> MeshArrays:
    """Triangulate and read a mesh.

    Parameters
    ----------
    mesh : evaluated bpy mesh.
    name : of its object, for messages.

    Raises
    ------
    SceneError
        If a coordinate is not finite, or farther out than `FARTHEST`.
    """
    mesh.calc_loop_triangles()
    positions = read(mesh.attributes["position"].data, "vector", np.float32, 3).astype(np.float64)
    bad = np.flatnonzero(~(np.abs(positions) < FARTHEST).all(axis=1))
    if len(bad):
        where = ", ".join(f"{value:g}" for value in positions[bad[0]])
        raise SceneError(f"object {name!r}: vertex {bad[0]} is at ({where}), {len(bad)} such in all: "
                         "delete or move them in Edit Mode, or remove the modifier that makes them")
    corner_ids = read(mesh.loop_triangles, "loops", np.int32, 3)
    face = read(mesh.loop_triangle_polygons, "value", np.int32)
    corner_vertex = corner_vertices(mesh)
    material_index = _of_faces(mesh, "material_index", np.int32)
    triangles = corner_vertex[corner_ids]
    normals = _shading_normals(mesh, positions, triangles, corner_ids, face)
    return MeshArrays(positions, triangles, corner_ids, face, material_index[face], normals, len(corner_vertex))


def read_uv(mesh: Any, layer: str) -> Float:
    """(corners, 2) float32: a UV map of the mesh; KeyError if there is none of that name."""
    return read(mesh.uv_layers[layer].uv, "vector", np.float32, 2)


def corner_vertices(mesh: Any) -> Int:
    """(corners,) int32 vertex of each corner."""
    return read(mesh.attributes[".corner_vert"].data, "value", np.int32)


def _of_faces(mesh: Any, name: str, dtype: type) -> NDArray[Any]:
    """(faces,) an attribute of the faces; where there is none Blender takes it for zero."""
    attribute = mesh.attributes.get(name)
    return np.zeros(len(mesh.polygons), dtype) if attribute is None else read(attribute.data, "value", dtype)


def degenerate(positions: Float, triangles: Int) -> NDArray[np.bool_]:
    """(t,) bool: triangles without area (see `DEGENERATE_RATIO`)."""
    corners = positions[triangles]
    side = np.roll(corners, -1, axis=1) - corners
    twice_area = np.linalg.norm(np.cross(side[:, 0], side[:, 1]), axis=1)
    longest_squared = (side**2).sum(axis=2).max(axis=1, initial=0)
    return np.asarray(twice_area <= DEGENERATE_RATIO * longest_squared)


def _shading_normals(mesh: Any, positions: Float, triangles: Int, corner_ids: Int, face: Int) -> Float | None:
    """(t, 3, 3) float32 corner normals; a flat face's triangles have their own, as Cycles shades them.

    Custom normals count on flat faces too, in Cycles as here. None where no face is smooth.
    """
    smooth = ~_of_faces(mesh, "sharp_face", np.bool_)[face]
    if mesh.has_custom_normals:
        return read(mesh.corner_normals, "vector", np.float32, 3)[corner_ids]
    if not smooth.any():
        return None
    normals = read(mesh.corner_normals, "vector", np.float32, 3)[corner_ids]
    normals[~smooth] = triangle_normals(positions, triangles[~smooth])[:, None]
    return normals


def triangle_normals(positions: Float, triangles: Int) -> Float:
    """(t, 3) float64 unit normals by the right-hand rule; zero where there is no area."""
    corners = positions[triangles]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    return np.divide(normal, length, out=np.zeros_like(normal), where=length > 0)

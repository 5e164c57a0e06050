"""Some triangles of an evaluated mesh with all that shader nodes may ask of them: as arrays, and as a mesh again.

The arrays outlive the dependency graph; the mesh made of them is a temporary one, of triangles only, so that each of
them can have its own place in a UV map.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from .mesh_arrays import MeshArrays, read
from .mesh_layers import MOST_UV_MAPS

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]

# Kinds of attributes: the property that holds a value, its dtype and width.
KINDS: dict[str, tuple[str, type, int]] = {
    "FLOAT": ("value", np.float32, 1), "INT": ("value", np.int32, 1), "INT8": ("value", np.int32, 1),
    "BOOLEAN": ("value", np.bool_, 1), "FLOAT_VECTOR": ("vector", np.float32, 3), "FLOAT2": ("vector", np.float32, 2),
    "FLOAT_COLOR": ("color", np.float32, 4), "BYTE_COLOR": ("color", np.float32, 4),
}
# What the mean of a kind's values is.
MEANS = {"FLOAT_VECTOR": "FLOAT_VECTOR", "FLOAT2": "FLOAT2", "FLOAT_COLOR": "FLOAT_COLOR", "BYTE_COLOR": "FLOAT_COLOR"}
# What a mesh of triangles has by itself.
BUILT_IN = frozenset({"position", "material_index", "sharp_face", "sharp_edge", "custom_normal"})
# UV map that a temporary mesh is baked over.
BAKE_UV = "radiosity bake"


@dataclass(frozen=True, eq=False)
class MeshPart:
    """Triangles of a mesh.

    Attributes
    ----------
    positions, undeformed : (v, 3) float32; the latter are where "Generated" coordinates come from.
    triangles : (t, 3) int32 vertices.
    corner_normals : (t, 3, 3) float32 or None.
    attributes : name, kind, domain (POINT, CORNER or FACE) and values of every attribute.
    active_uv, active_colour : names of the layers that nodes without a name mean; "" for none.
    texture_space : location and size that make generated coordinates, (2, 3) float32.
    """

    positions: Float
    undeformed: Float
    triangles: Int
    corner_normals: Float | None
    attributes: tuple[tuple[str, str, str, NDArray[Any]], ...]
    active_uv: str
    active_colour: str
    texture_space: Float

    def uv(self, name: str) -> Float | None:
        """(t, 3, 2) coordinates of a UV map, "" for the active one; None if it is not there."""
        return next((values for other, kind, domain, values in self.attributes
                     if other == (name or self.active_uv) and kind == "FLOAT2" and domain == "CORNER"), None)


def take_part(mesh: Any, arrays: MeshArrays, weights: dict[str, Float]) -> MeshPart:
    """The triangles in `arrays` with all attributes of the mesh that they come from, and weights of its vertices."""
    attributes = [(name, "FLOAT", "POINT", values) for name, values in weights.items()]
    for attribute in mesh.attributes:
        if attribute.name.startswith(".") or attribute.name in BUILT_IN or attribute.data_type not in KINDS:
            continue
        kind, domain = attribute.data_type, attribute.domain
        values = read(attribute.data, *KINDS[kind])
        if domain == "EDGE":
            # Triangles have edges of their own.
            values, kind, domain = _mean_of_edges(mesh, values), MEANS.get(kind, "FLOAT"), "POINT"
        index = {"POINT": None, "CORNER": arrays.corner_ids, "FACE": arrays.face}.get(domain, False)
        if index is not False:
            attributes.append((attribute.name, kind, domain, values if index is None else values[index]))
    space = np.array([mesh.texspace_location[:], mesh.texspace_size[:]], np.float32)
    return MeshPart(read(mesh.vertices, "co", np.float32, 3), read(mesh.vertices, "undeformed_co", np.float32, 3),
                    arrays.triangles, arrays.corner_normals, tuple(attributes), *active_layers(mesh), space)


def active_layers(mesh: Any) -> tuple[str, str]:
    """Names of the UV map and the colour attribute that nodes without a name mean; "" for none."""
    colours = mesh.color_attributes
    colour = colours[colours.render_color_index].name if 0 <= colours.render_color_index < len(colours) else ""
    return next((layer.name for layer in mesh.uv_layers if layer.active_render), ""), colour


def _mean_of_edges(mesh: Any, values: NDArray[Any]) -> NDArray[Any]:
    """(vertices,) or (vertices, width): the mean of the edges at each vertex."""
    ends = read(mesh.edges, "vertices", np.int32, 2)
    total = np.zeros((len(mesh.vertices), *values.shape[1:]))
    for column in ends.T:
        np.add.at(total, column, values)
    count = np.bincount(ends.ravel(), minlength=len(total)).reshape(-1, *[1] * (values.ndim - 1))
    return np.asarray(total / np.maximum(count, 1), np.float32)


def at_corners(mesh: Any, arrays: MeshArrays, name: str) -> Float | None:
    """(t, 3, 2) first two numbers of an attribute at the triangles' corners, a UV map or not; None if there is none."""
    attribute = mesh.attributes.get(name)
    if attribute is None or attribute.data_type not in KINDS:
        return None
    index = {"POINT": arrays.triangles, "CORNER": arrays.corner_ids, "FACE": arrays.face[:, None]}.get(attribute.domain)
    if index is None:
        return None
    kind, dtype, width = KINDS[attribute.data_type]
    values = read(attribute.data, kind, dtype, width).reshape(-1, width)[index]
    return np.broadcast_to(values[..., :2], (len(index), 3, 2))


def make_mesh(part: MeshPart, bake_uv: Float) -> list[Any]:
    """Temporary meshes: the part with a UV map to bake over, and what it needs; the caller removes them all.

    Parameters
    ----------
    bake_uv : (t, 3, 2) coordinates of the map `BAKE_UV`.
    """
    mesh = _triangles("radiosity bake", part.positions, part.triangles)
    made = [mesh]
    kept = [entry for entry in part.attributes if entry[1] == "FLOAT2" and entry[2] == "CORNER"]
    # Blender takes eight UV maps: one that nodes hardly ask for makes room.
    spare = {entry[0] for entry in kept if entry[0] != part.active_uv}
    dropped = sorted(spare)[-1:] if len(kept) >= MOST_UV_MAPS else []
    for name, kind, domain, values in part.attributes:
        if name not in dropped:
            layer = mesh.attributes.new(name, kind, domain)
            layer.data.foreach_set(KINDS[kind][0], np.ascontiguousarray(values).ravel())
    # Made last and found by name: adding a layer moves the others in memory.
    mesh.attributes.new(BAKE_UV, "FLOAT2", "CORNER").data.foreach_set("vector", bake_uv.ravel())
    if part.active_uv:
        mesh.uv_layers[part.active_uv].active_render = True
    if part.active_colour:
        mesh.color_attributes.render_color_index = mesh.color_attributes.find(part.active_colour)
    if part.corner_normals is not None:
        mesh.polygons.foreach_set("use_smooth", np.ones(len(part.triangles), bool))
        mesh.normals_split_custom_set(part.corner_normals.reshape(-1, 3))
    if not np.array_equal(part.undeformed, part.positions):
        mesh.texture_mesh = _triangles("radiosity undeformed", part.undeformed, part.triangles)
        made.append(mesh.texture_mesh)
    for one in made:
        one.use_auto_texspace = False
        one.texspace_location, one.texspace_size = part.texture_space
    return made


def _triangles(name: str, positions: Float, triangles: Int) -> Any:
    mesh = bpy.data.meshes.new(name)
    mesh.vertices.add(len(positions))
    mesh.vertices.foreach_set("co", np.ascontiguousarray(positions, np.float32).ravel())
    mesh.loops.add(triangles.size)
    mesh.loops.foreach_set("vertex_index", np.ascontiguousarray(triangles, np.int32).ravel())
    mesh.polygons.add(len(triangles))
    mesh.polygons.foreach_set("loop_start", np.arange(0, triangles.size, 3, dtype=np.int32))
    mesh.polygons.foreach_set("use_smooth", np.zeros(len(triangles), bool))
    mesh.update(calc_edges=True)
    return mesh

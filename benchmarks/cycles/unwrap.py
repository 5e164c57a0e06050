"""The receivers' layout, by xatlas, scaled so that every object has about the same lumels per area."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import xatlas
from numpy.typing import NDArray

Float = NDArray[np.floating[Any]]

# Texels between two charts, so that neither reads the other's lumels.
GAP = 3
# xatlas starts charts at texel centres, where a rounding error decides what is covered: half a texel further on, a
# wall's edge lies between two texels.
TO_TEXEL_BORDERS = 0.5
# Corners closer than this are one corner to the layout, metres.
WELD = 1e-5
# From this many triangles on, charts are kept below the area's MANY_CHARTS-th part, for speed.
MANY_TRIANGLES = 20_000
MANY_CHARTS = 200


def base_density(areas: Float, factors: Float, lumels: int) -> float:
    """Texels per metre at which objects of these areas (m2), each `factor` times as dense, hold `lumels` lumels."""
    return math.sqrt(lumels / float((areas * np.square(factors)).sum()))


def world_area(made: Any) -> float:
    """Area of an object's surface, m2."""
    made.data.calc_loop_triangles()
    return _area(world_positions(made)[_triangle_corners(made.data, "vertices")])


def world_positions(made: Any) -> Float:
    """(v, 3) float64, metres: an object's vertices, up to its place (rotated and scaled, not moved)."""
    position = np.empty(len(made.data.vertices) * 3)
    made.data.vertices.foreach_get("co", position)
    return np.asarray(position.reshape(-1, 3) @ np.array(made.matrix_world)[:3, :3].T)


def triangle_uv(mesh: Any, layer: str) -> Float:
    """(t, 3, 2) float32, the corners of the mesh's triangles in a UV layer."""
    mesh.calc_loop_triangles()
    uv = np.empty(len(mesh.loops) * 2, np.float32)
    mesh.uv_layers[layer].uv.foreach_get("vector", uv)
    return np.asarray(uv.reshape(-1, 2)[_triangle_corners(mesh, "loops")])


def _triangle_corners(mesh: Any, attribute: str) -> NDArray[np.int32]:
    index = np.empty(len(mesh.loop_triangles) * 3, np.int32)
    mesh.loop_triangles.foreach_get(attribute, index)
    return index.reshape(-1, 3)


def packed_texels(made: Any, density: float) -> tuple[Float, int]:
    """Charts of an object of triangles, packed at `density` texels per metre.

    Returns
    -------
    (3 t, 2) coordinates of the corners in texels, from 0; and the side in texels of the square that holds them.
    """
    mesh = made.data
    if len(mesh.loops) != 3 * len(mesh.polygons):
        raise ValueError(f"object {made.name!r} has faces of more than three corners: cut them into triangles first")
    corner = np.empty(len(mesh.loops), np.int32)
    mesh.loops.foreach_get("vertex_index", corner)
    position, triangles = world_positions(made), corner.reshape(-1, 3)
    # Scenes come with their corners apart; charts only grow across triangles that share them.
    welded = np.unique(np.round(position / WELD).astype(np.int64), axis=0, return_index=True, return_inverse=True)
    atlas = xatlas.Atlas()
    atlas.add_mesh(position[welded[1]].astype(np.float32), welded[2].reshape(-1)[triangles].astype(np.uint32))
    chart_options, pack_options = xatlas.ChartOptions(), xatlas.PackOptions()
    if len(triangles) > MANY_TRIANGLES:
        # Chart growth is far worse than linear in a chart's triangles: bound it where there are many.
        chart_options.max_chart_area = _area(position[triangles]) / MANY_CHARTS
    pack_options.padding, pack_options.texels_per_unit, pack_options.bilinear = GAP, density, False
    atlas.generate(chart_options=chart_options, pack_options=pack_options)
    _, packed, uv = atlas.get_mesh(0)
    # xatlas gives each axis its own [0, 1]: back to texels.
    extent = np.array([atlas.width, atlas.height], np.float64)
    texels = uv[packed.reshape(-1)] * extent + TO_TEXEL_BORDERS
    return np.asarray(texels), int(np.ceil(texels.max()))


def write_layer(made: Any, layer: str, uv: Float) -> None:
    """Give an object the UV layer `layer` with the corners' coordinates (3 t, 2).

    The layer that textures read stays the one they read: only the active layer changes, which a bake writes through.
    """
    mesh = made.data
    textured = next((other.name for other in mesh.uv_layers if other.active_render), None)
    made_layer = mesh.uv_layers.new(name=layer, do_init=False)
    if made_layer is None or made_layer.name != layer:
        raise ValueError(f"object {made.name!r} can't hold one more UV map: it has {len(mesh.uv_layers)}")
    mesh.uv_layers.active = made_layer
    if textured is not None:
        mesh.uv_layers[textured].active_render = True
    mesh.uv_layers[layer].uv.foreach_set("vector", np.ascontiguousarray(uv, np.float32).ravel())
    mesh.update()


def _area(corner: Float) -> float:
    cross = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    return float(np.linalg.norm(cross, axis=1).sum() / 2)

"""Texels become receivers: every texel whose centre a triangle covers gets a position, a normal and a footprint."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .components import components, shared_edges
from .errors import NothingToBake
from .layout import Layout, flat_triangles, make_layout
from .pieces import originals, weld
from .raster import Coverage, holds_centre, rasterise, to_texels
from .receivers import Lumels, Page, Receivers
from .scene import Scene, surface_of_triangle
from .settings import Settings
from .uv_faults import warn_of_distortion

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]
Warnings = list[dict[str, Any]]

# Lumels handled at once: about 100 MB of temporary arrays.
CHUNK = 1 << 18
# Part of an object's lumels that may be claimed twice before it is told, a fraction: UV maps made by hand touch.
OVERLAP_TOLERANCE = 1e-3
# How far a UV may leave [0, 1] before it is told.
OUTSIDE_TOLERANCE = 1e-4
# Layout coordinates that differ by less are one, for what hangs together (a quarter of a texel at 16,384).
UV_WELD = 2.0**-16


def lumels(scene: Scene, settings: Settings, warnings: Warnings, progress: Any = None,
           layout: Layout | None = None) -> Lumels:
    """Lay out all receiving objects and list the lumels.

    Parameters
    ----------
    scene, settings : see there.
    warnings : a list that gets a dict {object, code, message} for each thing the user should know: `uv_overlap`,
        `uv_outside`, `uv_stretch`, `uv_density`, `uv_no_area`, `zero_area`, `no_lumels`.
    progress : callable(fraction) or None; what it raises (`Cancelled`) ends the work.
    layout : from `make_layout`, where it is made already; its warnings were told then.

    Raises
    ------
    NothingToBake
        If no object receives light.
    UnwrapError
        If no layout can be made.
    """
    layout = layout or make_layout(scene, settings, warnings, progress)
    warn_of_distortion(scene, settings, warnings)
    flat = flat_triangles(scene)
    corners, members = _by_page(scene, layout)
    node = _nodes(scene, layout.uv)
    covers = [_cover(page, uv[~flat[triangles]], triangles[~flat[triangles]], node)
              for page, uv, triangles in zip(layout.pages, corners, members, strict=True)]
    _warn(scene, layout, covers, corners, members, flat, warnings)
    if not any((cover.owner >= 0).any() for cover in covers):
        raise NothingToBake("no texel is covered by any object: give more resolution, or check the lightmap UVs")
    return _assemble(scene, layout, covers, _charts(scene, node))


def _by_page(scene: Scene, layout: Layout) -> tuple[list[Float], list[Int]]:
    """The layout's triangles page by page: their corners (t, 3, 2), and which of the scene's they are (t,)."""
    corners, members = [], []
    for page in range(len(layout.pages)):
        on_page = np.flatnonzero(layout.page_of_surface == page)
        layouts = [uv for uv in (layout.uv[s] for s in on_page) if uv is not None]
        corners.append(np.concatenate(layouts))
        members.append(np.concatenate([np.arange(scene.surfaces[s].first,
                                                 scene.surfaces[s].first + scene.surfaces[s].count) for s in on_page]))
    return corners, members


def _cover(page: Page, uv: Float, triangles: Int, node: Int) -> Coverage:
    """The page's texels and the scene's triangles that own them. A second copy of a triangle that has the same place in
    the layout receives the same light: the two overlap, and nothing is lost.
    """
    cover = rasterise(uv, page.width, page.height)
    if len(cover.overlapped):
        first = originals(node[triangles]) == np.arange(len(triangles))
        if not first.all():
            uv, triangles = uv[first], triangles[first]
            cover = rasterise(uv, page.width, page.height)
    return Coverage(np.where(cover.owner >= 0, triangles[cover.owner], -1).astype(np.int32), cover.overlapped)


def _assemble(scene: Scene, layout: Layout, covers: list[Coverage], chart: NDArray[np.int32]) -> Lumels:
    """Fill the lumels' arrays, chunk by chunk."""
    pixels = [np.flatnonzero(cover.owner >= 0) for cover in covers]
    n = sum(len(pixel) for pixel in pixels)
    position, normal = np.empty((n, 3), np.float32), np.empty((n, 3), np.float32)
    barycentric, footprint = np.empty((n, 2), np.float32), np.empty((n, 2, 2), np.float32)
    triangle, page_index, texel = np.empty(n, np.int32), np.empty(n, np.int32), np.empty((n, 2), np.int32)
    layout_uv = np.zeros((len(scene.triangles), 3, 2), np.float32)
    for surface, uv in zip(scene.surfaces, layout.uv, strict=True):
        if uv is not None:
            layout_uv[surface.triangles] = uv
    start = 0
    for index, (page, cover, pixel) in enumerate(zip(layout.pages, covers, pixels, strict=True)):
        page_index[start:start + len(pixel)] = index
        for first in range(0, len(pixel), CHUNK):
            part = pixel[first:first + CHUNK]
            to = slice(start + first, start + first + len(part))
            triangle[to] = own = cover.owner[part]
            texel[to] = centre = np.stack([part % page.width, part // page.width], axis=1)
            texels = to_texels(layout_uv[own], page.width, page.height)
            weight, footprint[to] = barycentric_at(texels, centre)
            barycentric[to] = weight
            position[to], normal[to] = place(scene, own, weight)
        start += len(pixel)
    receivers = Receivers(position, normal, triangle, barycentric, footprint, texel=texel)
    return Lumels(receivers, surface_of_triangle(scene)[triangle], page_index, np.concatenate(pixels).astype(np.int64),
                  chart[triangle], layout.pages, layout.page_of_surface, layout.uv, chart)


def barycentric_at(corner: Float, point: Float) -> tuple[Float, Float]:
    """Weights of corners 1 and 2 at a point of the layout, and their change by one texel to the right and up.

    Parameters
    ----------
    corner : (n, 3, 2) float64, texels.
    point : (n, 2), texels.

    Returns
    -------
    (n, 2) float64 in the triangle, and (n, 2, 2) float64: [texel step, corner].
    """
    a, b = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    twice_area = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    # point = corner0 + u a + v b, solved for (u, v) by Cramer's rule.
    step = np.stack([np.stack([b[:, 1], -a[:, 1]], axis=1), np.stack([-b[:, 0], a[:, 0]], axis=1)], axis=1)
    step /= twice_area[:, None, None]
    offset = point - corner[:, 0]
    weight = offset[:, :1] * step[:, 0] + offset[:, 1:] * step[:, 1]
    weight = np.maximum(weight, 0)
    return weight / np.maximum(weight.sum(axis=1, keepdims=True), 1), step


def place(scene: Scene, triangle: Int, weight: Float) -> tuple[Float, Float]:
    """Position relative to the scene's origin and unit shading normal, (n, 3) float64 each.

    Parameters
    ----------
    triangle : (n,) int, with area.
    weight : (n, 2), weights of the triangle's corners 1 and 2.
    """
    corners = scene.vertices[scene.triangles[triangle]] - scene.origin
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    position = corners[:, 0] + weight[:, :1] * a + weight[:, 1:] * b
    geometric = np.cross(a, b)
    geometric /= np.linalg.norm(geometric, axis=1, keepdims=True)
    if scene.corner_normals is None:
        return position, geometric
    shading = scene.corner_normals[triangle].astype(np.float64)
    normal = shading[:, 0] + weight[:, :1] * (shading[:, 1] - shading[:, 0])
    normal += weight[:, 1:] * (shading[:, 2] - shading[:, 0])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    # Normals that cancel out say nothing: the triangle's own.
    usable = length > 1e-6
    return position, np.where(usable, normal / np.where(usable, length, 1), geometric)


def charts_of_triangles(scene: Scene, uv: Sequence[Float | None]) -> NDArray[np.int32]:
    """(t,) int32: as `Lumels.chart_of_triangle`."""
    return _charts(scene, _nodes(scene, uv))


def _nodes(scene: Scene, layout: Sequence[Float | None]) -> Int:
    """(t, 3) int64: corners at the same place in space and in the layout have the same number."""
    steps = int(1 / UV_WELD)
    key = weld(scene.vertices)[scene.triangles] * (steps * steps)
    for item, uv in zip(scene.surfaces, layout, strict=True):
        if uv is not None:
            grid = np.rint(uv.astype(np.float64) * steps).astype(np.int64) % steps
            key[item.triangles] += grid[:, :, 0] * steps + grid[:, :, 1]
    return np.asarray(np.unique(key, return_inverse=True)[1]).reshape(-1, 3)


def _charts(scene: Scene, node: Int) -> NDArray[np.int32]:
    """(t,) int32 connected piece of the layout: joined are triangles of one object that share an edge of it."""
    surface = surface_of_triangle(scene)
    first, second, _, _ = shared_edges(node)
    same = surface[first] == surface[second]
    return components(len(node), first[same], second[same]).astype(np.int32)


def _warn(scene: Scene, layout: Layout, covers: list[Coverage], corners: list[Float], members: list[Int],
          flat: NDArray[np.bool_], warnings: Warnings) -> None:
    """Tell of objects whose layout loses light: overlaps, parts outside, triangles without area."""
    surface = surface_of_triangle(scene)
    count = len(scene.surfaces)
    lumel_count, doubled, lost = np.zeros(count, int), np.zeros(count, int), np.zeros(count, int)
    for page, cover, uv, triangles in zip(layout.pages, covers, corners, members, strict=True):
        owner = cover.owner[cover.owner >= 0]
        lumel_count += np.bincount(surface[owner], minlength=count)
        doubled += np.bincount(surface[cover.owner[cover.overlapped]], minlength=count)
        empty = flat[triangles]
        held = holds_centre(uv[empty], page.width, page.height)
        lost += np.bincount(surface[triangles[empty][held]], minlength=count)
    for index, (item, layout_uv) in enumerate(zip(scene.surfaces, layout.uv, strict=True)):
        if layout_uv is None:
            continue
        tell = lambda code, message, name=item.name: warnings.append(  # noqa: E731
            {"object": name, "code": code, "message": message})
        if doubled[index] > max(1, OVERLAP_TOLERANCE * lumel_count[index]):
            tell("uv_overlap", f"{doubled[index]} of {lumel_count[index]} lumels are covered more than once by the "
                 "lightmap UV and show the light of one place only: unwrap without overlaps")
        outside = ((layout_uv < -OUTSIDE_TOLERANCE) | (layout_uv > 1 + OUTSIDE_TOLERANCE)).any(axis=(1, 2)).sum()
        if outside:
            tell("uv_outside", f"{outside} of {item.count} triangles leave [0, 1] in the lightmap UV and get no lumels "
                 "there: pack the UV islands into the image")
        if lost[index]:
            tell("zero_area", f"{lost[index]} triangles without area in space lie over texels and get no lumels: "
                 "merge vertices by distance")
        if not lumel_count[index]:
            tell("no_lumels", "covers no texel centre: give it more resolution or a larger part of the lightmap UV")

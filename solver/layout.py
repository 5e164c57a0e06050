"""Where each object's light goes: images, their sizes, and the objects' coordinates in them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .atlas import rounded, unwrap
from .errors import NothingToBake, SettingsError
from .receivers import Page
from .scene import Scene
from .settings import DEFAULT_PAGE, MAX_RESOLUTION, Settings

Float = NDArray[np.floating[Any]]
Warnings = list[dict[str, Any]]

# A triangle whose height is below this part of its own largest coordinate has no area in space: float32 can't tell it
# from a line.
FLAT = 1e-7


@dataclass(frozen=True, eq=False)
class Layout:
    """Images and what lies where in them; fields as in `receivers.Lumels`."""

    pages: tuple[Page, ...]
    page_of_surface: NDArray[np.int32]
    uv: tuple[Float | None, ...]


def receiving(scene: Scene, settings: Settings) -> list[int]:
    """The indices of the objects that are baked.

    Raises
    ------
    SettingsError
        If `only` names an object that is not there.
    NothingToBake
        If none is left.
    """
    names = {surface.name for surface in scene.surfaces}
    unknown = sorted(set(settings.only) - names)
    if unknown:
        raise SettingsError(f"only names {', '.join(map(repr, unknown))}, which the scene lacks: check the name")
    chosen = [index for index, surface in enumerate(scene.surfaces) if surface.receives and surface.count
              and (not settings.only or surface.name in settings.only)]
    if not chosen:
        raise NothingToBake("no mesh receives light: let at least one be a receiver")
    return chosen


def make_layout(scene: Scene, settings: Settings, warnings: Warnings, progress: Any = None) -> Layout:
    """The user's own UV where given, else an unwrap, in images sized as the settings ask."""
    chosen = receiving(scene, settings)
    own = [index for index in chosen if scene.surfaces[index].lightmap_uv is not None]
    rest = [index for index in chosen if scene.surfaces[index].lightmap_uv is None]
    uv: list[Float | None] = [None] * len(scene.surfaces)
    page_of_surface = np.full(len(scene.surfaces), -1, np.int32)
    sides: list[tuple[int, int]] = []
    groups: list[list[int]] = []
    if own:
        groups = [[index] for index in own] if settings.atlas != "shared" else [own]
        sides = [(side, side) for side in _own_sides(scene, settings, groups, warnings)]
        for page, group in enumerate(groups):
            page_of_surface[group] = page
            for index in group:
                uv[index] = scene.surfaces[index].lightmap_uv
    if rest:
        atlas = unwrap(scene, settings, rest, flat_triangles(scene), progress)
        for index, page, layout in zip(rest, atlas.page, atlas.uv, strict=True):
            uv[index] = layout
            page_of_surface[index] = page + len(sides) if page >= 0 else -1
            if page < 0:
                warnings.append({"object": scene.surfaces[index].name, "code": "zero_area",
                                 "message": "no triangle has an area: it gets no lumels"})
        sides += atlas.sides
    return Layout(_named(scene, settings, sides, page_of_surface), page_of_surface, tuple(uv))


def flat_triangles(scene: Scene) -> NDArray[np.bool_]:
    """(t,) bool: triangles without area in space (see `FLAT`)."""
    corners = scene.vertices[scene.triangles] - scene.origin
    side = np.roll(corners, -1, axis=1) - corners
    twice_area = np.linalg.norm(np.cross(side[:, 0], side[:, 1]), axis=1)
    longest = np.sqrt((side**2).sum(axis=2)).max(axis=1, initial=0)
    return np.asarray(twice_area <= FLAT * np.abs(corners).max(axis=(1, 2), initial=0) * longest)


def world_areas(scene: Scene) -> Float:
    """(t,) float64 areas in space, m2."""
    corners = scene.vertices[scene.triangles]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return np.asarray(np.linalg.norm(normal, axis=1) / 2)


def _own_sides(scene: Scene, settings: Settings, groups: list[list[int]], warnings: Warnings) -> list[int]:
    """The side of each image over the user's UV, pixels: density * sqrt(world area / UV area).

    Without resolution or density all images together get as many pixels as `max_pages` pages of `DEFAULT_PAGE`.
    """
    if settings.resolution is not None:
        return [settings.resolution] * len(groups)
    areas = world_areas(scene)
    per_density = np.zeros(len(groups))  # metres that the image's side spans
    for page, group in enumerate(groups):
        surfaces = [scene.surfaces[index] for index in group]
        world = sum(float(areas[item.triangles].sum()) * item.density**2 for item in surfaces)
        layout = sum(_uv_area(item.lightmap_uv) for item in surfaces)
        per_density[page] = np.sqrt(world / layout) if layout > 0 else 0
    density = settings.texel_density
    if density is None:
        budget = settings.max_pages * DEFAULT_PAGE**2
        density = float(np.sqrt(budget / max(float((per_density**2).sum()), 1e-30)))
    for span, group in zip(per_density, groups, strict=True):
        if density * span > MAX_RESOLUTION:
            warnings.append({"object": scene.surfaces[group[0]].name, "code": "density_lowered",
                             "message": f"would need an image of {density * span:.0f} pixels a side and gets "
                             f"{MAX_RESOLUTION}: lower texel_density, or give it more of the UV map"})
    return [rounded(density * span) for span in per_density]


def _uv_area(uv: Float | None) -> float:
    if uv is None:
        return 0.0
    a, b = (uv[:, 1] - uv[:, 0]).astype(np.float64), (uv[:, 2] - uv[:, 0]).astype(np.float64)
    return float(np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum() / 2)


def _named(scene: Scene, settings: Settings, sides: list[tuple[int, int]],
           page_of_surface: NDArray[np.int32]) -> tuple[Page, ...]:
    """Pages called after their only object, or counted where objects share them."""
    shared = settings.effective_atlas == "shared"
    pages: list[Page] = []
    used: set[str] = set()
    counter = 0
    for page, (width, height) in enumerate(sides):
        members = np.flatnonzero(page_of_surface == page)
        if not shared and len(members) == 1:
            stem = f"Lightmap_{scene.surfaces[members[0]].name}"
        else:
            counter += 1
            stem = f"Lightmap_{counter}"
        name = stem
        while name in used:
            counter += 1
            name = f"{stem}_{counter}"
        used.add(name)
        pages.append(Page(name, width, height))
    return tuple(pages)

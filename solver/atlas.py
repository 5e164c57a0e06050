"""Unwrapped objects on pages: how many, how large, at what density, who lies where."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .charts import Charts, numbered, of_first
from .errors import UnwrapError
from .faces import corners_of_faces, faces
from .packing import Packer, largest_density
from .pieces import lowest_first, originals, weld
from .scene import Scene
from .settings import DEFAULT_PAGE, MAX_RESOLUTION, Settings
from .unwrap import flatten

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]
Progress = Callable[[float], None]

# Texels between charts: a 256th of the page, so that the charts stay apart on the first mip levels, within these.
# Two is the least that bilinear filtering can't see across.
LEAST_PADDING, MOST_PADDING, PADDING_PART = 2, 8, 256
# Where the wider padding would take this part of a page, the least is used instead.
PADDING_TOO_MUCH = 0.25
# With a texel density, one more page is begun where this side would be exceeded, pixels.
PAGE_LIMIT = 4096
# Smallest side of a page whose size is chosen by density, and what every such side is a multiple of, pixels.
MIN_SIDE, SIDE_STEP = 16, 4
# Boxes fill about this part of a page.
EXPECTED_FILL = 0.93
# Tries to find the side of a page at a density; each gives as much as was missing.
SIDE_STEPS = 32
# Part of the time that flattening takes, for progress.
FLATTENING = 0.9


@dataclass(frozen=True, eq=False)
class Atlas:
    """Where unwrapped objects lie.

    Parameters
    ----------
    sides : (width, height) of each page, pixels.
    page : of each object that was given, its page; -1 for one without any area.
    uv : of each object (count, 3, 2) float32 in its page's [0, 1]^2; None for one without any area.
    """

    sides: list[tuple[int, int]]
    page: Int
    uv: list[Float | None]


def unwrap(scene: Scene, settings: Settings, objects: list[int], flat: NDArray[np.bool_],
           progress: Progress | None = None) -> Atlas:
    """Unwrap objects and pack each onto one page.

    Parameters
    ----------
    objects : indices into `scene.surfaces`.
    flat : (t,) bool, triangles without area: each gets one point of its object's layout.
    progress : told the fraction done; what it raises ends the work.

    Raises
    ------
    UnwrapError
        If the charts do not fit.
    """
    triangle = np.concatenate([np.arange(scene.surfaces[o].first, scene.surfaces[o].first + scene.surfaces[o].count)
                               for o in objects])
    owner = np.repeat(np.arange(len(objects)), [scene.surfaces[o].count for o in objects])
    node = weld(scene.vertices)[scene.triangles[triangle]] + owner[:, None] * len(scene.vertices)
    solid = ~flat[triangle]
    face = faces(_mesh_corners(scene, objects))
    # A second copy of a face receives the same light: it shares the lumels of the first.
    original = originals(node)
    copy = solid & _whole_copies(face, original)
    solid &= ~copy
    uv = np.zeros((len(triangle), 3, 2), np.float32)
    page = np.full(len(objects), -1)
    if not solid.any():
        return Atlas([], page, [None] * len(objects))
    positions = scene.vertices[scene.triangles[triangle[solid]]] - scene.origin
    flattening = (lambda part: progress(part * FLATTENING)) if progress else None
    charts = flatten(positions, node[solid], numbered(face[solid]), flattening)
    factor = np.array([scene.surfaces[o].density for o in objects])
    charts = replace(charts, uv=charts.uv * factor[owner[solid]][:, None, None])
    sheets = _sheets(charts, owner[solid], settings)
    sides = []
    index = np.flatnonzero(solid)
    for number, sheet in enumerate(sheets):
        packed = sheet.packer.pack(sheet.density, sheet.width)
        height = sheet.height or rounded(packed.height)
        uv[index[sheet.members]] = packed.uv / (sheet.width, height)
        page[np.unique(owner[index[sheet.members]])] = number
        sides.append((sheet.width, height))
    turn = lowest_first(node)
    uv[np.flatnonzero(copy)[:, None], turn[copy]] = uv[original[copy][:, None], turn[original[copy]]]
    _place_flat(uv, node, face, solid | copy)
    if progress is not None:
        progress(1.0)
    parts = np.split(uv, np.flatnonzero(np.diff(owner)) + 1)
    return Atlas(sides, page, [part if page[o] >= 0 else None for o, part in enumerate(parts)])


@dataclass(frozen=True, eq=False)
class _Sheet:
    """A page in the making: which triangles, at what density; a height of 0 is as much as the charts need."""

    members: Int
    packer: Packer
    density: float
    width: int
    height: int


def _sheets(charts: Charts, owner: Int, settings: Settings) -> list[_Sheet]:
    """Pages for the charts, as the settings ask."""
    alone = settings.effective_atlas == "object"
    if settings.texel_density is not None or (alone and settings.resolution is None):
        density = settings.texel_density or _affordable(charts, settings.max_pages * DEFAULT_PAGE**2)
        groups = _alone(owner) if alone else _few_pages(charts, owner, settings.max_pages, density)
        return [_sized(charts, members, density, square=not alone) for members in groups]
    if alone:
        groups = _alone(owner)
        side = settings.resolution or DEFAULT_PAGE
        return [sheet for members in groups for sheet in _filled(charts, [members], side)]
    groups = _balanced(charts, owner, settings.max_pages)
    if settings.resolution is not None:
        return _filled(charts, groups, settings.resolution)
    side = DEFAULT_PAGE
    while True:  # nobody asked for this size: where the charts do not fit, it grows
        try:
            return _filled(charts, groups, side)
        except UnwrapError:
            side *= 2
            if side > MAX_RESOLUTION:
                raise


def _filled(charts: Charts, groups: list[Int], side: int) -> list[_Sheet]:
    """Pages of a given side at the largest density that they have room for, the same on all."""
    padding = _padding(side)
    packers = [Packer(charts.take(members), padding) for members in groups]
    try:
        density = largest_density(packers, side)
        crowded = any(packer.padded_area(density) - packer.covered_area(density) > PADDING_TOO_MUCH * side**2
                      for packer in packers)
    except UnwrapError:
        crowded = True
        if padding == LEAST_PADDING:
            raise
    if crowded and padding > LEAST_PADDING:
        packers = [Packer(packer.charts, LEAST_PADDING) for packer in packers]
        density = largest_density(packers, side)
    return [_Sheet(members, packer, density, side, side) for members, packer in zip(groups, packers, strict=True)]


def _sized(charts: Charts, members: Int, density: float, square: bool) -> _Sheet:
    """A page that is as large as its charts need at a density; square, or cut to the height that is used."""
    taken = charts.take(members)
    side = int(np.sqrt(Packer(taken, LEAST_PADDING).padded_area(density) / EXPECTED_FILL))
    packer = Packer(taken, _padding(side))
    side = rounded(max(np.sqrt(packer.padded_area(density) / EXPECTED_FILL), packer.sizes(density)[1][:, 0].max()))
    for _ in range(SIDE_STEPS):
        if side >= MAX_RESOLUTION:
            break
        height = packer.height(density, side)
        if height <= side:
            return _Sheet(members, packer, density, side, side if square else 0)
        side = rounded(max(side + SIDE_STEP, (side + min(height, 2 * side)) / 2))
    raise UnwrapError(f"texel_density {density:g} needs a page of more than {MAX_RESOLUTION} pixels: lower it, "
                      "raise max_pages, or bake fewer objects")


def rounded(side: float) -> int:
    """A side that an image may have, pixels, from one that it should have."""
    return int(np.clip(np.ceil(side / SIDE_STEP) * SIDE_STEP, MIN_SIDE, MAX_RESOLUTION))


def _padding(side: int) -> int:
    return int(np.clip(side // PADDING_PART, LEAST_PADDING, MOST_PADDING))


def _alone(owner: Int) -> list[Int]:
    """One group of triangles an object."""
    order = np.argsort(owner, kind="stable")
    return np.split(order, np.flatnonzero(np.diff(owner[order])) + 1)


def _balanced(charts: Charts, owner: Int, pages: int) -> list[Int]:
    """Groups of whole objects with about the same area: the largest first, each to the emptiest page (Graham 1969)."""
    objects = _alone(owner)
    _, side = charts.boxes()
    area = [float(side[np.unique(charts.chart[members])].prod(axis=1).sum()) for members in objects]
    filled = np.zeros(min(pages, len(objects)))
    groups: list[list[Int]] = [[] for _ in filled]
    for index in np.argsort(-np.array(area), kind="stable"):
        emptiest = int(filled.argmin())
        filled[emptiest] += area[index]
        groups[emptiest].append(objects[index])
    return [np.sort(np.concatenate(group)) for group in groups if group]


def _few_pages(charts: Charts, owner: Int, most: int, density: float) -> list[Int]:
    """As few groups as fit on pages of `PAGE_LIMIT` at a density, `most` at most."""
    area = Packer(charts, _padding(PAGE_LIMIT)).padded_area(density)
    least = int(np.ceil(area / (EXPECTED_FILL * PAGE_LIMIT**2)))
    return _balanced(charts, owner, min(max(least, 1), most))


def _affordable(charts: Charts, budget: int) -> float:
    """The density at which the charts of all objects, padded, cover a number of texels."""
    packer = Packer(charts, LEAST_PADDING)
    low, high = 0.0, float(np.sqrt(budget / max(float(packer.side.prod(axis=1).sum()), 1e-300)))
    for _ in range(SIDE_STEPS):
        middle = (low + high) / 2
        low, high = (middle, high) if packer.padded_area(middle) <= EXPECTED_FILL * budget else (low, middle)
    return high


def _mesh_corners(scene: Scene, objects: list[int]) -> Int:
    """(t, 3) int64: the same number for the same corner of the same object's mesh, where that is known."""
    corners, start = [], 0
    for surface in (scene.surfaces[o] for o in objects):
        corner = np.arange(3 * surface.count).reshape(-1, 3) if surface.corner_ids is None else surface.corner_ids
        corners.append(corner.astype(np.int64) + start)
        start += int(corner.max(initial=-1)) + 1
    return np.concatenate(corners)


def _whole_copies(face: Int, original: Int) -> NDArray[np.bool_]:
    """(t,) bool: triangles of faces all of whose triangles are copies of those of one other face."""
    copied = original != np.arange(len(original))
    of = face[original]
    single = copied & (of == of_first(face, of)) & (of != face)
    count = int(face.max(initial=-1)) + 1
    return np.asarray((np.bincount(face, single, count) == np.bincount(face, minlength=count))[face])


def _place_flat(uv: Float, node: Int, face: Int, solid: NDArray[np.bool_]) -> None:
    """Give corners of triangles without area the place in the layout that the same corner of the face has elsewhere,
    else one that their triangle's corners have anywhere, if there is one.
    """
    if solid.all():
        return
    place = np.unique(node, return_inverse=True)[1].reshape(node.shape)
    anywhere = _held(place, uv, solid)
    here = _held(corners_of_faces(face, place), uv, solid)
    options = np.concatenate([here, anywhere], axis=1)
    usable = np.isfinite(options[:, :, 0])
    point = np.nan_to_num(options[np.arange(len(options)), usable.argmax(axis=1)])
    uv[~solid] = np.where(usable[:, :3, None], here, point[:, None])


def _held(place: Int, uv: Float, solid: NDArray[np.bool_]) -> Float:
    """(f, 3, 2) what triangles that are solid have at the numbered places of those that are not; NaN for nothing."""
    held = np.full((int(place.max()) + 1, 2), np.nan, np.float32)
    held[place[solid]] = uv[solid]
    return np.asarray(held[place[~solid]])

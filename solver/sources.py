"""Which emissive triangles are lamps (shadow rays end on them), and which are left to the gather."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .emission_pieces import emission_pieces, mean_exitance
from .geometry import Geometry
from .lights import Light
from .linking import Linked, Links
from .mesh_emitter import group_emitters

Float = NDArray[np.floating[Any]]
Int = NDArray[np.int32]

# Triangles that emit more than this many times the scene's mean exitance are lamps. Below it, gather rays find them
# often enough, and a furnace, where everything emits alike, has no lamp at all. Surfaces with links are lamps however
# faint they are: gather rays mind no links.
LAMP_CONTRAST = 8.0


def light_sources(geometry: Geometry) -> tuple[tuple[Light, ...], NDArray[np.bool_]]:
    """The scene's lamps about its origin, emissive triangles among them, and a mask (t,) of those triangles."""
    lamps, is_lamp, _ = sources_by_kind(geometry, np.zeros(len(geometry.area), np.int32))
    return lamps, is_lamp


def sources_by_kind(geometry: Geometry, kinds: Int) -> tuple[tuple[Light, ...], NDArray[np.bool_], Int]:
    """The same, where triangles of unlike kinds (t,) are never one lamp, and the kinds of lamps after the scene's."""
    scene = geometry.scene
    lamps = tuple(light.translated(-scene.origin) for light in scene.lights if np.any(light.colour))
    exitance = mean_exitance(geometry)
    brightness = exitance.mean(axis=1)
    total_area = float(geometry.area.sum())
    if not brightness.any():
        return lamps, np.zeros(len(brightness), bool), np.empty(0, np.int32)
    mean = float((brightness * geometry.area).sum() / max(total_area, 1e-30))
    links, link = _links(geometry)
    bright = (brightness > LAMP_CONTRAST * mean) | ((link > 0) & (brightness > 0))
    is_lamp = bright & (geometry.area > 0)
    pieces = emission_pieces(geometry, np.flatnonzero(is_lamp), exitance)
    found: list[int] = []
    both = (kinds * len(links) + link)[pieces.triangle]
    for number in np.unique(both):
        own = both == number
        emitters = group_emitters(pieces.corners[own], pieces.exitance[own])
        linked = links[number % len(links)]
        lamps += emitters if linked is None else tuple(Linked(emitter, linked) for emitter in emitters)
        found += [int(number // len(links))] * len(emitters)
    return lamps, is_lamp, np.array(found, np.int32)


def _links(geometry: Geometry) -> tuple[list[Links | None], Int]:
    """The links that surfaces have, none first, and which of them each triangle has (t,)."""
    surfaces = geometry.scene.surfaces
    links = list(dict.fromkeys([None, *(surface.links for surface in surfaces)]))
    number_of = {one: number for number, one in enumerate(links)}
    return links, np.array([number_of[surface.links] for surface in surfaces], np.int32)[geometry.surface]

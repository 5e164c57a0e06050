"""What is wrong with meshes, as far as light minds: faces turned over or in one place, edges of more than two faces.

All of it bakes, and some of it badly: whoever asks tells the user.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .components import shared_edges
from .geometry import Geometry
from .islands import Islands
from .pieces import originals, weld
from .sampling import mixed
from .scene import Scene
from .visibility import Visibility

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]

# Triangles whose middles are looked at for others in the same place, at most; of more, evenly spread ones.
MOST_PROBES = 1 << 18
# Faces lie in one place if they are nearer than this many ray offsets, and face alike to this cosine.
REACH, ALIKE = 4.0, 0.999
# How often triangles are halved: of the pairs that lie on one another, one in 2^HALVINGS is never told apart.
HALVINGS = 6
# Directions in which a place is looked out of, to see whether it lies inside a closed surface.
LOOKS = 14


@dataclass(frozen=True, eq=False)
class Faults:
    """Of each surface of a scene.

    turned : (s,) int, edges whose two faces are turned against each other.
    crowded : (s,) int, edges with more than two faces.
    doubled : (s,) int, triangles on which another one lies, facing the same way.
    partner : (s,) int32, the surface that most of those belong to; -1 for none.
    """

    turned: Int
    crowded: Int
    doubled: Int
    partner: NDArray[np.int32]


def find_faults(scene: Scene) -> Faults:
    """Look at all surfaces of a scene."""
    count = len(scene.surfaces)
    surface = np.repeat(np.arange(count), [item.count for item in scene.surfaces])
    # Surfaces share no edges: what touches is not one mesh.
    node = weld(scene.vertices)[scene.triangles] + surface[:, None] * len(scene.vertices)
    first, second, side, other = shared_edges(node)
    start = node[first, side]
    alike = start == node[second, other]  # both run along the edge in the same direction
    key = np.unique(_edge(node, first, side), return_inverse=True)[1].reshape(-1)
    pairs = np.bincount(key, minlength=1)[key]
    turned = np.bincount(surface[first[alike & (pairs == 1)]], minlength=count)
    several = np.unique(key[pairs > 1], return_index=True)[1]
    crowded = np.bincount(surface[first[pairs > 1]][several], minlength=count)
    doubled, partner = _doubled(scene, surface)
    return Faults(turned, crowded, doubled, partner)


def _edge(node: Int, triangle: Int, side: Int) -> Int:
    """(n,) int64: one number for an edge, whichever way it runs."""
    a, b = node[triangle, side].astype(np.int64), node[triangle, (side + 1) % 3].astype(np.int64)
    return np.asarray(np.minimum(a, b) * (int(node.max(initial=0)) + 1) + np.maximum(a, b))


def _doubled(scene: Scene, surface: Int) -> tuple[Int, NDArray[np.int32]]:
    """Triangles on whose middle another lies that faces the same way: how many of each surface, and of whom."""
    geometry, count = Geometry(scene), len(scene.surfaces)
    rows = np.flatnonzero(geometry.area > 0)
    rows = rows[np.linspace(0, len(rows) - 1, min(len(rows), MOST_PROBES)).astype(np.int64)] if len(rows) else rows
    third = np.full(len(rows), 1 / 3, np.float32)
    on_it, facing = lying_on(geometry, rows, geometry.point(rows, third, third), np.arange(len(geometry.area)))
    doubled = np.flatnonzero((on_it >= 0) & (facing > ALIKE))
    one, other = _copies(scene)
    pair = np.stack([np.append(rows[doubled], one), np.append(on_it[doubled], other)], axis=1)
    pair = pair[np.unique(pair[:, 0], return_index=True)[1]]
    owners, others = surface[pair[:, 0]], surface[pair[:, 1]]
    partner = np.full(count, -1, np.int32)
    pairs, times = np.unique(np.stack([owners, others], axis=1), axis=0, return_counts=True)
    for index in np.argsort(times, kind="stable"):
        partner[pairs[index, 0]] = pairs[index, 1]
    return np.bincount(owners, minlength=count), partner


def lying_on(geometry: Geometry, triangle: Int, points: Float, some: Int) -> tuple[Int, Float]:
    """Where points (n, 3) of triangles (n,) lie on another one of `some` (m,): that one (n,), -1 for none, and the
    cosine (n,) between the two. Of several, one that faces the same way is told.

    A ray meets one of two triangles in one place, always the same if they lie exactly in a plane. So triangles are
    halved by chance, several times, and what is of one half is looked for in the other.
    """
    normal, reach = geometry.normal[triangle], REACH * geometry.offset[triangle]
    start, straight_down = np.asarray(points + normal * reach[:, None], np.float32), np.asarray(-normal, np.float32)
    on_it, facing = np.full(len(triangle), -1, np.int64), np.full(len(triangle), -np.inf, np.float32)
    chance = mixed(np.arange(len(geometry.area), dtype=np.uint64), 0, 0)
    for bit in range(HALVINGS):
        half = (chance >> np.uint64(bit)) & np.uint64(1)
        for own in (0, 1):
            rows, others = np.flatnonzero(half[triangle] == own), some[half[some] != own]
            hits = Visibility(geometry.corners[others]).hits(start[rows], straight_down[rows])
            found = np.flatnonzero((hits.triangle >= 0) & (hits.distance < 2 * reach[rows]))
            rows, met = rows[found], others[hits.triangle[found]]
            cosine = np.einsum("ij,ij->i", geometry.normal[met], normal[rows])
            better = cosine > facing[rows]
            on_it[rows[better]], facing[rows[better]] = met[better], cosine[better]
    return on_it, facing


def _copies(scene: Scene) -> tuple[Int, Int]:
    """Triangles that have the same three corners as another, the same way round, and that other (n,) each."""
    first = originals(weld(scene.vertices)[scene.triangles])
    later = np.flatnonzero(first != np.arange(len(first)))
    return np.append(later, first[later]), np.append(first[later], later)


def inward(scene: Scene, places: Float) -> tuple[NDArray[np.bool_], Int]:
    """Closed surfaces that face the wrong way, as far as what is inside them tells.

    Parameters
    ----------
    places : (p, 3) metres: where lamps and cameras are.

    Returns
    -------
    hollow : (s,) bool: closed surfaces that face inward, with nothing inside them to see.
    around : (p,) int: the surface whose backs alone a place sees, as inside a box that faces outward; -1 for none.
    """
    hollow = np.zeros(len(scene.surfaces), bool)
    around = np.full(len(places), -1)
    corners = scene.vertices[scene.triangles]
    for index, item in enumerate(scene.surfaces):
        if not item.count:
            continue
        own = corners[item.triangles]
        low, high = own.min(axis=(0, 1)), own.max(axis=(0, 1))
        inside = np.flatnonzero(((places > low) & (places < high)).all(axis=1))
        islands = Islands.of(own)
        if islands.inverted.any() and not len(inside):
            others = np.delete(np.arange(len(corners)), np.arange(item.first, item.first + item.count))
            middle = corners[others].mean(axis=1)
            hollow[index] = islands.inverted.all() and not ((middle > low) & (middle < high)).all(axis=1).any()
        solid = islands.solid
        for place in inside if solid.any() else ():
            if _enclosed(own[solid], places[place]):
                around[place] = index
    return hollow, around


def _enclosed(corners: Float, place: Float) -> bool:
    """Whether a place sees nothing but backs of triangles (t, 3, 3)."""
    step = np.arange(LOOKS) + 0.5
    height, angle = 1 - 2 * step / LOOKS, step * np.pi * (3 - np.sqrt(5))
    flat = np.sqrt(1 - height**2)
    ways = np.stack([flat * np.cos(angle), flat * np.sin(angle), height], axis=1).astype(np.float32)
    near = np.asarray(corners - place, np.float32)
    hits = Visibility(near).hits(np.zeros_like(ways), ways)
    return bool(((hits.triangle >= 0) & ~hits.front).all())

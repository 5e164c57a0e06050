"""Radiosity systems with exact form factors: a closed cube, an uneven one, and two that are joined by a pin-hole.

A cube's walls are cut into n x n squares. The form factors between squares of parallel and of perpendicular walls are
fourfold differences of an antiderivative (Howell's C-13 and C-15; Gross, Spindler and Hahne 1981), so that all pairs
come out of two small tables.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.floating[Any]]


@dataclass(frozen=True, eq=False)
class System:
    """B = E + rho F B: form factors F (n, n), reflectance (n,), emission (n,) W/m2, areas (n,) m2."""

    F: Float
    reflectance: Float
    emission: Float
    areas: Float

    def radiosity(self) -> Float:
        """The solution (n,), by LU."""
        matrix = np.eye(len(self.areas)) - self.reflectance[:, None] * self.F
        return np.asarray(np.linalg.solve(matrix, self.emission))


def cube(side: int, reflectance: float) -> System:
    """A closed unit cube of 6 side^2 equal patches; the ceiling emits 1 W/m2."""
    F = cube_form_factors(side)
    return System(F, np.full(len(F), reflectance), _ceiling(side), np.full(len(F), 1 / side**2))


def two_rooms(side: int, reflectance: float) -> System:
    """Two unit cubes joined by a pin-hole; the ceiling of the first emits 1 W/m2.

    One patch of a wall of each is the hole: 1 / (6 side^2) of the room. What goes into it spreads in the other room as
    from a diffuser. 2 (6 side^2 - 1) patches.
    """
    F = cube_form_factors(side)
    hole = side // 2 * side + side // 2  # about the middle of the wall x = 0
    kept = np.delete(np.arange(len(F)), hole)
    room = F[np.ix_(kept, kept)]
    through = np.outer(F[kept, hole], F[hole, kept])
    both = np.block([[room, through], [through, room]])
    emission = np.concatenate([_ceiling(side)[kept], np.zeros(len(kept))])
    return System(both, np.full(len(both), reflectance), emission, np.full(len(both), 1 / side**2))


def uneven_cube(seed: int) -> System:
    """A closed unit cube of 102 patches: on each wall 16 of 1/64 m2 and one of 48/64; reflectances from .1 to .99."""
    whole = cube(8, 0.5)
    patch = np.repeat(np.arange(102), [*[1] * 16, 48] * 6)
    member = np.zeros((102, 384))
    member[patch, np.arange(384)] = 1
    areas = np.asarray(member @ whole.areas)
    F = (member * whole.areas) @ whole.F @ member.T / areas[:, None]
    generator = np.random.default_rng(seed)
    return System(F, generator.uniform(0.1, 0.99, 102), generator.random(102), areas)


def cube_form_factors(side: int) -> Float:
    """(6 side^2, 6 side^2) exact form factors between squares of a unit cube's walls: x = 0, x = 1, y = 0 ... z = 1."""
    parallel, perpendicular = _parallel_table(side), _perpendicular_table(side)
    grid = np.stack(np.meshgrid(np.arange(side), np.arange(side), indexing="ij"), axis=-1).reshape(-1, 2)
    walls = [(axis, far) for axis in range(3) for far in (0, 1)]
    F = np.zeros((6, side**2, 6, side**2))
    for i, (axis, far) in enumerate(walls):
        for j, (other, other_far) in enumerate(walls):
            if axis == other and far != other_far:
                apart = np.abs(grid[:, None] - grid[None])
                F[i, :, j] = parallel[apart[..., 0], apart[..., 1]]
            elif axis != other:
                third = 3 - axis - other
                mine, theirs = _coordinates(grid, axis), _coordinates(grid, other)
                from_edge = side - 1 - mine[other] if other_far else mine[other]
                to_edge = side - 1 - theirs[axis] if far else theirs[axis]
                along = np.abs(mine[third][:, None] - theirs[third])
                F[i, :, j] = perpendicular[from_edge[:, None], to_edge[None], along]
    return F.reshape(6 * side**2, -1)


def _coordinates(grid: NDArray[Any], axis: int) -> dict[int, NDArray[Any]]:
    """Indices along the two axes that a wall spans."""
    spanned = [k for k in range(3) if k != axis]
    return {spanned[0]: grid[:, 0], spanned[1]: grid[:, 1]}


def _parallel_table(side: int) -> Float:
    """F between squares of opposite walls, by how many squares they are displaced along both axes."""
    u = np.arange(-1, side + 1) / side
    x, y = np.meshgrid(u, u, indexing="ij")
    a, b = np.sqrt(x * x + 1), np.sqrt(y * y + 1)
    G = y * a * np.arctan(y / a) + x * b * np.arctan(x / b) - np.log(x * x + y * y + 1) / 2
    return np.asarray(_second_difference(_second_difference(G, 0), 1) / (2 * np.pi) * side**2)


def _perpendicular_table(side: int) -> Float:
    """F between squares of adjoining walls: both distances from the common edge, and the displacement along it."""
    edge, along = np.arange(side + 1) / side, np.arange(-1, side + 1) / side
    x, z, y = np.meshgrid(edge, edge, along, indexing="ij")
    r2 = x * x + z * z
    r = np.sqrt(r2)
    angle = np.arctan2(y, r)  # a quarter turn on the edge itself, where r makes it count for nothing
    total = np.where(r2 + y * y > 0, r2 + y * y, 1)
    G = y * r * angle - (r2 - y * y) * np.log(total) / 4
    return np.asarray(_second_difference(np.diff(np.diff(G, axis=0), axis=1), 2) / (2 * np.pi) * side**2)


def _second_difference(values: Float, axis: int) -> Float:
    """2 G(d) - G(d - h) - G(d + h): both integrals along one axis of squares displaced by d."""
    return -np.diff(np.diff(values, axis=axis), axis=axis)


def _ceiling(side: int) -> Float:
    emission = np.zeros(6 * side**2)
    emission[5 * side**2 :] = 1
    return emission

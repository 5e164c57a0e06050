"""Shapes that tests build scenes from: quads, boxes, spheres and bowls, as triangles with a value each.

A `Shape` is triangles with reflectance and emission; shapes are added with `+`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import reduce
from typing import Any

import numpy as np
from radiosity.solver import Scene

FLOOR, CEILING, WEST, EAST, SOUTH, NORTH = range(6)


@dataclass(frozen=True, eq=False)
class Shape:
    """Triangles (t, 3, 3) metres, with reflectance (t,) and emission (t,) W/m2."""

    corners: np.ndarray
    reflectance: np.ndarray
    emission: np.ndarray

    def __add__(self, other: Shape) -> Shape:
        return Shape(*(np.concatenate([getattr(self, name), getattr(other, name)])
                       for name in ("corners", "reflectance", "emission")))

    @property
    def middle(self) -> np.ndarray:
        """(t, 3): the middle of each triangle."""
        return np.asarray(self.corners.mean(axis=1))

    @property
    def cross(self) -> np.ndarray:
        """(t, 3): normals as long as twice the area."""
        first, second = (self.corners[:, corner] - self.corners[:, 0] for corner in (1, 2))
        return np.asarray(np.cross(first, second))

    @property
    def normal(self) -> np.ndarray:
        """(t, 3): unit normals."""
        return np.asarray(self.cross / np.linalg.norm(self.cross, axis=1, keepdims=True))

    @property
    def area(self) -> np.ndarray:
        """(t,): m2."""
        return np.asarray(np.linalg.norm(self.cross, axis=1) / 2)

    def moved(self, matrix: Any = 1.0, offset: Any = 0.0) -> Shape:
        """Turned by a matrix (3, 3) or scaled by a number, then shifted."""
        turned = self.corners * matrix if np.ndim(matrix) == 0 else self.corners @ np.asarray(matrix).T
        return replace(self, corners=turned + offset)

    def scene(self, **more: Any) -> Scene:
        """As a scene; its arguments may be given or replaced."""
        count = len(self.corners)
        given = {"reflectance": np.repeat(self.reflectance[:, None], 3, axis=1),
                 "emission": np.repeat(self.emission[:, None], 3, axis=1), **more}
        return Scene(self.corners.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3), **given)


def shape(corners: Any, reflectance: Any = 0.5, emission: Any = 0.0) -> Shape:
    """Triangles with one reflectance and emission, or one each."""
    corners = np.asarray(corners, float).reshape(-1, 3, 3)
    return Shape(corners, np.broadcast_to(np.asarray(reflectance, float), len(corners)).copy(),
                 np.broadcast_to(np.asarray(emission, float), len(corners)).copy())


def quad(origin: Any, u: Any, v: Any, reflectance: Any = 0.5, emission: Any = 0.0) -> Shape:
    """A parallelogram of two triangles that faces u x v."""
    a, u, v = (np.asarray(each, float) for each in (origin, u, v))
    return shape([[a, a + u, a + u + v], [a, a + u + v, a + v]], reflectance, emission)


def box(low: Any, high: Any, reflectance: Any = 0.5, emission: Any = 0.0, inward: bool = True) -> Shape:
    """Six walls of two triangles each, in the order FLOOR ... NORTH; a value for all or one for each wall."""
    low, high = np.asarray(low, float), np.asarray(high, float)
    x, y, z = np.diag(high - low)
    sides = [(low, x, y), (low + z, y, x), (low, y, z), (low + x, z, y), (low, z, x), (low + y, x, z)]
    rho, exitance = np.broadcast_to(reflectance, 6), np.broadcast_to(emission, 6)
    walls = [quad(origin, u, v, r, e) if inward else quad(origin, v, u, r, e)
             for (origin, u, v), r, e in zip(sides, rho, exitance, strict=True)]
    return reduce(Shape.__add__, walls)


def sphere_cap(angle: float, rings: int, segments: int, top: bool = False) -> Shape:
    """The part of the unit sphere within `angle` of its lowest (or highest) point, facing its centre."""
    polar, azimuth = np.linspace(0, angle, rings + 1), np.linspace(0, 2 * np.pi, segments + 1)
    point = np.stack([np.outer(np.sin(polar), np.cos(azimuth)), np.outer(np.sin(polar), np.sin(azimuth)),
                      np.broadcast_to(-np.cos(polar)[:, None], (rings + 1, segments + 1))], axis=-1)
    a, b, c, d = point[:-1, :-1], point[1:, :-1], point[1:, 1:], point[:-1, 1:]
    first, second = np.stack([a, b, c], axis=2), np.stack([a, c, d], axis=2)[1:]
    out = shape(np.concatenate([first.reshape(-1, 3, 3), second.reshape(-1, 3, 3)]))
    return out.moved(np.diag([1, -1, -1])) if top else out


def wall_points(low: Any, high: Any, side: int, number: int) -> tuple[np.ndarray, np.ndarray]:
    """number x number points evenly over one wall of a box, and its inward normals (n, 3) each."""
    corners = box(low, high).corners[2 * side]
    step = (np.arange(number) + 0.5) / number
    u, v = (each.reshape(-1, 1) for each in np.meshgrid(step, step))
    points = corners[0] + u * (corners[1] - corners[0]) + v * (corners[2] - corners[1])
    normal = np.cross(corners[1] - corners[0], corners[2] - corners[1])
    return points, np.broadcast_to(normal / np.linalg.norm(normal), points.shape)

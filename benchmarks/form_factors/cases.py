"""Pairs of polygons whose form factor is known: Howell's catalogue of configuration factors, and shadows on them.

Every value was computed again, with 30 digits or with two independent quadratures; the digits shown agree.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.floating[Any]]


@dataclass(frozen=True, eq=False)
class Case:
    """Polygons (n, 3) in metres, outward by the right-hand rule, and the form factor from a to b."""

    name: str
    about: str
    a: Float
    b: Float
    exact: float
    occluders: tuple[Float, ...] = ()


def level(x0: float, x1: float, y0: float, y1: float, z: float) -> Float:
    """A rectangle of constant z that faces up."""
    return np.array([[x0, y0, z], [x1, y0, z], [x1, y1, z], [x0, y1, z]], float)


def facing_down(x0: float, x1: float, y0: float, y1: float, z: float) -> Float:
    """A rectangle of constant z that faces down."""
    return level(x0, x1, y0, y1, z)[::-1]


def upright(y0: float, y1: float, z0: float, z1: float, x: float = 0.0) -> Float:
    """A rectangle of constant x that faces along +x."""
    return np.array([[x, y0, z0], [x, y1, z0], [x, y1, z1], [x, y0, z1]], float)


def wing(degrees: float) -> Float:
    """A unit square that shares the y axis's edge with [0, 1]^2 (z = 0), opened by so many degrees, facing it."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([[0, 0, 0], [0, 1, 0], [c, 1, s], [c, 0, s]], float)


def disc(radius: float, z: float, corners: int, x: float = 0.0) -> Float:
    """A regular polygon of a disc's area that faces up: its form factors are off by about 1/corners^2."""
    angle = 2 * np.pi * np.arange(corners) / corners
    size = radius * np.sqrt(2 * np.pi / (corners * np.sin(2 * np.pi / corners)))
    return np.stack([x + size * np.cos(angle), size * np.sin(angle), np.full(corners, z)], axis=1)


UNIT = level(0, 1, 0, 1, 0)
CEILING = facing_down(0, 1, 0, 1, 1)
PARALLEL = 0.19982489569839

UNOCCLUDED = (
    Case("P-01", "parallel unit squares, gap 1", UNIT, CEILING, PARALLEL),
    Case("P-02", "parallel 2 x 1, gap .5", level(0, 2, 0, 1, 0), facing_down(0, 2, 0, 1, 0.5), 0.5089886690414),
    Case("P-03", "parallel unit squares, gap .01", UNIT, facing_down(0, 1, 0, 1, 0.01), 0.9804166029260),
    Case("P-04", "parallel unit squares, gap 100", UNIT, facing_down(0, 1, 0, 1, 100), 3.1828866733e-5),
    Case("P-05", "unit squares, 90 degrees, shared edge", UNIT, wing(90), 0.2000437760754),
    Case("P-06", "2 x 1 to .5 x 1 upright, shared edge", level(0, 2, 0, 1, 0), upright(0, 1, 0, 0.5), 0.07865027050598),
    Case("P-07", "parallel, displaced", UNIT, facing_down(0.5, 2, 1, 3, 1.5), 0.09920383877349),
    Case("P-08", "perpendicular, apart", level(0.5, 1.5, 0, 1, 0), upright(1, 3, 0.5, 2), 0.05925389678734),
    Case("P-09", "perpendicular, one shared corner", UNIT, upright(1, 2, 0, 1), 0.04059223010156),
    Case("P-10a", "30 degrees, shared edge", UNIT, wing(30), 0.6190283230908),
    Case("P-10b", "45 degrees, shared edge", UNIT, wing(45), 0.4833476954789),
    Case("P-10c", "60 degrees, shared edge", UNIT, wing(60), 0.3709053211501),
    Case("P-11a", "120 degrees, shared edge", UNIT, wing(120), 0.0866150011183),
    Case("P-11b", "135 degrees, shared edge", UNIT, wing(135), 0.0483094478018),
    Case("P-11c", "150 degrees, shared edge", UNIT, wing(150), 0.0213453254127),
    Case("P-26", "strips 1 x 100, gap 1", level(0, 1, 0, 100, 0), facing_down(0, 1, 0, 100, 1), 0.4114200244705),
)

OCCLUDED = (
    Case("P-14", "P-01, occluder in the middle", UNIT, CEILING, 0.0995062945996, (level(0.25, 0.75, 0.25, 0.75, 0.5),)),
    Case("P-15", "P-01, occluder over a quarter", UNIT, CEILING, 0.75 * PARALLEL, (level(0, 0.5, 0, 0.5, 0.5),)),
    Case("P-16", "P-01, occluder near and wide", UNIT, CEILING, 0.0065496720830,
         (level(0.05, 0.95, 0.05, 0.95, 0.25),)),
)

BY_NAME = {case.name: case for case in UNOCCLUDED + OCCLUDED}

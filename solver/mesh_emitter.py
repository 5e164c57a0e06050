"""Emissive triangles that are sampled together as one lamp.

A group has one chromaticity, lies close together, and knows whether it is the skin of a solid, whose inside no ray
from outside need look for.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .errors import SceneError
from .islands import Islands
from .lamp_checks import put
from .lights import LightSample, aimed, inside_box
from .panel_draw import PanelDraw
from .panels import Panels, panels, partners
from .polygon import Sides, polygons_form_factor

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]

# Triangles above which summing a closed form costs more than the shadow rays that it saves.
CLOSED_FORM_TRIANGLES = 64
# Keeps 0 / 0 away where nothing shines.
TINY = float(np.finfo(np.float64).tiny)
# Difference of the parts of red, green and blue in two triangles' light, up to which they have one chromaticity.
CHROMATICITY_STEP = 1e-3
# Up to this many separate pieces of emissive surface, each is a lamp of its own; more are grouped by place alone.
FEW_ISLANDS = 256
# Above this many chromaticities, splitting by channel is thought of.
MANY_COLOURS = 16
# What the closed form sums with and without the backs of triangles.
SIDES: dict[bool, Sides] = {True: "both", False: "front"}


@dataclass(frozen=True, eq=False)
class MeshEmitter:
    """Emissive triangles that are sampled together, in proportion to their flux.

    Parameters
    ----------
    name : for messages.
    corners : (k, 3, 3) float64, metres.
    radiance : (k, 3) W/(m2 sr), rows that are multiples of one another: one ray's weight is one number, so a group
        has one chromaticity (see `group_emitters`).
    two_sided : shines from both sides, as Blender's emission does; else from the one its corners turn
        counter-clockwise on.
    closed_box : (2, 3) lowest and highest corner, metres, of the closed surfaces that all of the triangles are of and
        face out of: from outside of the box only their fronts can be seen, so no ray is sent to their backs. None where
        nothing is known.
    """

    name: str
    corners: Float
    radiance: Float
    two_sided: bool = True
    closed_box: Float | None = None
    _pieces: _Pieces = field(init=False, repr=False)

    def __post_init__(self) -> None:
        corners, radiance = np.array(self.corners, np.float64), np.array(self.radiance, np.float64)
        if corners.ndim != 3 or corners.shape[1:] != (3, 3) or not len(corners) or not np.isfinite(corners).all():
            raise SceneError(f"emitter {self.name!r}: corners {corners.shape} must be (k, 3, 3), k > 0, finite")
        if radiance.shape != (len(corners), 3) or not np.isfinite(radiance).all() or (radiance < 0).any():
            raise SceneError(f"emitter {self.name!r}: radiance must be ({len(corners)}, 3), >= 0 and finite")
        pieces = _Pieces.of(panels(corners, radiance), radiance)
        mixed = radiance[pieces.triangle] - radiance[pieces.triangle].sum(axis=1, keepdims=True) * pieces.chromaticity
        mixed = mixed[np.abs(pieces.normal).any(axis=1)]  # a triangle without area has no say
        if np.abs(mixed).max(initial=0) > 2 * CHROMATICITY_STEP * radiance.sum(axis=1).max(initial=0):
            raise SceneError(f"emitter {self.name!r} mixes colours: split it by chromaticity, as group_emitters does")
        put(self, corners=corners, radiance=radiance, _pieces=pieces)
        if self.closed_box is not None:
            put(self, closed_box=np.array(self.closed_box, np.float64).reshape(2, 3))

    @property
    def colour(self) -> Float:
        """(3,) float32: the flux of one side / pi."""
        return self._pieces.colour

    @property
    def normals(self) -> Float:
        """(k, 3) float32: unit normals of its flat pieces; zero for one without area."""
        return self._pieces.normal

    def power(self) -> Float:
        """(3,) float32: flux that leaves the triangles, W, of both sides if both shine."""
        return np.asarray(self.colour * np.float32(2 * np.pi if self.two_sided else np.pi))

    def irradiance(self, points: Float, normals: Float) -> Float | None:
        """Unoccluded irradiance (n, 3) float32, W/m2; None for more than `CLOSED_FORM_TRIANGLES` triangles."""
        if len(self.corners) > CLOSED_FORM_TRIANGLES:
            return None
        if not self.colour.any():
            return np.zeros((len(points), 3), np.float32)
        factor = np.zeros((len(points), 1), np.float32)
        back = self._sees_backs(points)
        for rows, sides in ((np.flatnonzero(back), SIDES[True]), (np.flatnonzero(~back), SIDES[False])):
            if len(rows):
                for outlines, strength in self._pieces.polygons:
                    some, facing = (np.take(array, rows, axis=0) for array in (points, normals))
                    factor[rows] += polygons_form_factor(some, facing, outlines, strength, sides)
        return np.asarray(factor * self._pieces.chromaticity, np.float32)

    def _sees_backs(self, points: Float) -> NDArray[np.bool_]:
        """(n,) whether the backs of the triangles light the points, as far as can be told without rays."""
        if self.closed_box is None or not self.two_sided:
            return np.full(len(points), self.two_sided)
        return inside_box(points, *self.closed_box.astype(np.float32))

    def sample(self, points: Float, normals: Float, uv: Float) -> LightSample:
        """Points spread over the panels by flux: the first number picks the panel and is stretched again."""
        pieces = self._pieces
        if len(pieces.limit) == 1:
            chosen, u, v = np.zeros(len(points), np.intp), uv[:, 0], uv[:, 1]
        else:
            chosen, u = pieces.choose(uv[:, 0])
            v = uv[:, 1]
        target, scale = pieces.draw.targets(points, chosen, u, v)
        return aimed(points, normals, target, np.take(pieces.normal, chosen, axis=0), self._sees_backs(points), scale)

    def pieces(self) -> tuple[NDArray[Any], ...]:
        """Corner, two sides and normal (k, 3) of its flat pieces; whether each is a parallelogram, the upper limit of
        its share of the flux in [0, 1], and its exitance over `colour`, (k,) each."""
        some = self._pieces
        # Exactly 1 from the last piece on that shines, so that every number below 1 finds one.
        shares = some.limit.astype(np.float64)
        shares = np.where(shares >= shares[-1], 1.0, shares)
        brightness = self.radiance[some.triangle].sum(axis=1) * np.pi / max(float(some.colour.sum()), TINY)
        return some.corner, some.first, some.second, some.normal, some.square, shares, brightness

    def translated(self, offset: Float) -> MeshEmitter:
        """The same triangles, moved by (3,) metres."""
        box = None if self.closed_box is None else self.closed_box + offset
        return MeshEmitter(self.name, self.corners + offset, self.radiance, self.two_sided, box)


@dataclass(frozen=True, eq=False)
class _Pieces:
    """Panels as sampling reads them, float32: a corner and the two sides from it, unit normals, (k, 3) each; whether
    they are parallelograms (k,); upper limits (k,) of their shares of the flux; one triangle of each (k,); chromaticity
    and colour (3,) of the group; for the closed form outlines, with the exitance (k, 1) of each; where samples go."""

    corner: Float
    first: Float
    second: Float
    normal: Float
    square: NDArray[np.bool_]
    limit: Float
    triangle: Int
    chromaticity: Float
    colour: Float
    polygons: list[tuple[Float, Float]]
    draw: PanelDraw

    @classmethod
    def of(cls, flat: Panels, radiance: Float) -> _Pieces:
        cross = np.cross(flat.first, flat.second)
        parallelogram = np.linalg.norm(cross, axis=1)
        normal = cross / np.maximum(parallelogram, np.finfo(np.float64).tiny)[:, None]
        area = np.where(flat.square, parallelogram, parallelogram / 2)
        radiance = radiance[flat.triangle]
        flux = area @ radiance
        limit = np.cumsum(area * radiance.sum(axis=1)) / max(float(flux.sum()), TINY)
        corner, first, second, normal, limit, chromaticity, colour = (array.astype(np.float32) for array in (
            flat.corner, flat.first, flat.second, normal, limit, flux / max(float(flux.sum()), TINY), flux))
        polygons = []
        for square in (True, False):
            rows, outlines = flat.outlines(square)
            if len(rows):
                polygons.append((outlines, radiance[rows].sum(axis=1, keepdims=True) * np.pi))
        return cls(corner, first, second, normal, flat.square, limit, flat.triangle, chromaticity, colour, polygons,
                   PanelDraw(flat.corner, flat.first, flat.second, flat.square))

    def choose(self, u: Float) -> tuple[NDArray[np.intp], Float]:
        """Panel for each u in [0, 1), and where in the panel's share u lies, in [0, 1]."""
        last = int(np.searchsorted(self.limit, self.limit[-1]))  # panels after it send nothing
        chosen = np.minimum(np.searchsorted(self.limit, u, side="right"), last)
        low = np.where(chosen > 0, self.limit[chosen - 1], 0)
        return chosen, np.clip((u - low) / np.maximum(self.limit[chosen] - low, np.finfo(np.float32).tiny), 0, 1)


def group_emitters(
    corners: Float, exitance: ArrayLike, most_triangles: int = CLOSED_FORM_TRIANGLES
) -> tuple[MeshEmitter, ...]:
    """Emissive triangles as lamps, called "emission" with a number.

    Parameters
    ----------
    corners : (t, 3, 3) float64, metres; triangles hang together where corners are equal to the last bit.
    exitance : (t, 3) W/m2 of each side (radiance times pi), as `Scene.emission`; dark triangles are left out.
    most_triangles : of a group.

    Notes
    -----
    A ray's weight is one number, so the triangles of a group must share a chromaticity; their brightness may differ.
    A textured mesh with a colour for each triangle would fall into as many groups: it is split into red, green and
    blue lamps instead, which is exact too.
    """
    exitance = np.asarray(exitance, np.float64)
    lit = np.flatnonzero(exitance.any(axis=1))
    if not len(lit):
        return ()
    corners, radiance = np.asarray(corners, np.float64)[lit], exitance[lit] / np.pi
    islands = Islands.of(corners)
    corners = np.where(islands.inverted[:, None, None], corners[:, ::-1], corners)
    centre = _centres(corners, radiance)
    parts = []
    for rows, colours in _by_colour(radiance, most_triangles):
        for island in _by_label(islands.label, rows) if len(islands.box) <= FEW_ISLANDS else [rows]:
            parts += [(some, colours) for some in _clusters(centre, island, most_triangles)]
    return tuple(MeshEmitter(f"emission.{number}", corners[rows], colours[rows], closed_box=islands.box_around(rows))
                 for number, (rows, colours) in enumerate(parts))


def _by_colour(radiance: Float, most_triangles: int) -> list[tuple[Int, Float]]:
    """Rows of one chromaticity each, with their radiance; or one channel each, where that makes fewer groups."""
    parts = np.round(radiance / radiance.sum(axis=1, keepdims=True) / CHROMATICITY_STEP)
    kind = np.unique(parts, axis=0, return_inverse=True)[1].reshape(-1)
    kinds = int(kind.max()) + 1
    if kinds > max(MANY_COLOURS, 3 * len(radiance) // most_triangles):
        return [(np.flatnonzero(radiance[:, channel]), radiance * np.eye(3)[channel]) for channel in range(3)
                if radiance[:, channel].any()]
    return [(rows, radiance) for rows in _by_label(kind, np.arange(len(radiance)))]


def _by_label(label: Int, rows: Int) -> list[Int]:
    """The rows, one array a label."""
    order = rows[np.argsort(label[rows], kind="stable")]
    return np.split(order, np.flatnonzero(np.diff(label[order])) + 1)


def _centres(corners: Float, radiance: Float) -> Float:
    """(t, 3) the middle of each triangle, or of the parallelogram that it is half of, so that halves stay together."""
    centre = corners.mean(axis=1)
    other = partners(corners, radiance)[:, 0]
    return np.where(other[:, None] >= 0, (centre + centre[other]) / 2, centre)


def _clusters(centre: Float, rows: Int, most: int) -> list[Int]:
    """Rows in boxes of at most `most` triangles: halved at the median along the longest side."""
    waiting, done = [rows], []
    while waiting:
        some = waiting.pop()
        if len(some) <= most:
            done.append(np.sort(some))
            continue
        longest = int(np.argmax(np.ptp(centre[some], axis=0)))
        order = some[np.argsort(centre[some, longest], kind="stable")]
        waiting += [order[len(order) // 2:], order[:len(order) // 2]]
    return done

"""The most that lamps can give to blocks of receivers, whatever stands between them.

    E <= colour  (n . D + r + rho) / d_min  (m . D + rho) / d_min  / d_min^2        D from the block to the lamp

for a block with normal n in a sphere of radius rho, and a flat lamp with normal m in a sphere of radius r;
d_min = |D| - r - rho (after Walter et al. 2005, Lightcuts, whose clusters are boxes).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .area_lamp import Area
from .blocks import Blocks
from .lamps import Point, Sun
from .lights import Light
from .linking import Linked, Reach
from .luminaire import Luminaire
from .mesh_emitter import MeshEmitter
from .sky_patch import SkyPatch

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]

# A lamp nearer than this part of the two spheres' radii is near: the bound says little there.
NEAR = 0.25
# Part of the two spheres' radii by which a usual receiver is nearer to the lamp, or turned to it, than the block.
TYPICAL = 0.3
# A lamp's radius over its distance from which on the weights of rays to it differ much.
WIDE = 0.2
# Slack for float32, part of the distance.
ROUNDING = 1e-5
# Sine of the angle between normals of a lamp that counts as flat.
FLATNESS = 1e-3


@dataclass(frozen=True, eq=False)
class LightBounds:
    """What bounds ask of each of m lamps, float32, metres and W/m2 (means of the channels).

    centre, radius : (m, 3), (m,) a sphere that holds the lamp; the centre of a sun is the direction towards it, and
        its radius what its half angle adds to a cosine at most.
    strength : (m,) `Light.colour`, times what slats gather in one direction.
    soft, floor : (m,) what is added to the squared distance, and its least value: the irradiance stays finite.
    axis, thickness : (m, 3), (m,) normal of a flat lamp, and half of its thickness; inf for one that is not flat.
    two_sided : (m,) bool.
    far : (m,) bool, a sun.
    broad : (m,) bool, whether the weights of rays to it may differ much wherever they start.
    unknown : (m,) bool, a lamp of a kind that is not known here: it counts as near everywhere.
    reach : which lamps reach which blocks; None: all of them all.
    """

    centre: Float
    radius: Float
    strength: Float
    soft: Float
    floor: Float
    axis: Float
    thickness: Float
    two_sided: NDArray[np.bool_]
    far: NDArray[np.bool_]
    broad: NDArray[np.bool_]
    unknown: NDArray[np.bool_]
    reach: Reach | None = None

    @classmethod
    def of(cls, lights: Sequence[Light], reach: Reach | None = None) -> LightBounds:
        """Of lamps about the scene's origin."""
        columns = [_bounds(light) for light in lights]
        kinds = (np.float32,) * 7 + (bool,) * 4
        bounds: list[Any] = [np.array([column[part] for column in columns], kind) for part, kind in enumerate(kinds)]
        return replace(cls(*bounds), reach=reach)

    def of_all(self, blocks: Blocks) -> tuple[Float, Float, NDArray[np.bool_]]:
        """`of_pairs` of every block and lamp: (b, m) each."""
        return self.of_pairs(blocks, np.arange(len(blocks))[:, None], np.arange(len(self.strength))[None, :])

    def of_pairs(self, blocks: Blocks, block: Int, lamp: Int) -> tuple[Float, Float, NDArray[np.bool_]]:
        """What a block's receivers can get from a lamp: usually, and at most, float32 W/m2; and whether the lamp is
        near (then the second is no bound). For pairs of block and lamp, whose shapes broadcast."""
        far = self.far[lamp]
        offset = [self.centre[lamp, axis] - np.where(far, 0, blocks.centre[block, axis]) for axis in range(3)]
        distance = np.sqrt(offset[0] ** 2 + offset[1] ** 2 + offset[2] ** 2)
        facing = sum(offset[axis] * blocks.normal[block, axis] for axis in range(3))
        leaving = sum(offset[axis] * -self.axis[lamp, axis] for axis in range(3))
        leaving = np.where(self.two_sided[lamp], np.abs(leaving), leaving)
        size, rho = self.radius[lamp], np.where(far, 0, blocks.radius[block])
        near = self.unknown[lamp] | (~far & (distance * (1 - ROUNDING) - rho - size <= NEAR * (rho + size)))
        given = [self._given(lamp, distance, facing + blocks.spread[block] * part * (distance + (rho + size) * part),
                             leaving, size * part, rho * part, NEAR * (rho + size)) for part in (TYPICAL, 1.0)]
        if self.reach is not None and not self.reach.is_everywhere:
            reached = self.reach.lamps[lamp, blocks.kind[block]]
            given, near = [one * reached for one in given], near & reached
        return given[0], given[1], np.asarray(near)

    def _given(self, lamp: Int, distance: Float, facing: Float, leaving: Float, size: Float, rho: Float,
               nearest: Float) -> Float:
        far = self.far[lamp]
        reach = rho + ROUNDING * distance
        least = np.maximum(distance - np.where(far, 0, reach + size), np.maximum(nearest, np.float32(1e-12)))
        cosines = np.clip((facing + reach + size) / least, 0, 1) * np.clip(
            (leaving + reach + self.thickness[lamp]) / least, 0, 1)
        # A round lamp's distance is to its middle, a flat one's to its nearest point.
        soft = self.soft[lamp]
        squared = np.where(soft > 0, np.maximum(distance - reach, 0), least) ** 2 + soft
        squared = np.where(far, 1, np.maximum(squared, np.maximum(self.floor[lamp], np.float32(1e-24))))
        return np.asarray(self.strength[lamp] * cosines / squared, np.float32)

    def wide(self, blocks: Blocks, block: Int, lamp: Int) -> NDArray[np.bool_]:
        """Whether rays to different points of the lamp may differ much in weight, for pairs of block and lamp."""
        offset = self.centre[lamp] - blocks.centre[block]
        distance = np.sqrt((offset**2).sum(axis=1)) - blocks.radius[block]
        always = self.unknown[lamp] | self.broad[lamp]
        return np.asarray(always | (~self.far[lamp] & (self.radius[lamp] > WIDE * distance)))


def _bounds(light: Light) -> tuple[Any, ...]:
    """One lamp's row: centre, radius, strength, soft, floor, axis, thickness, two_sided, far, broad, unknown."""
    strength = float(np.mean(light.colour))
    nowhere, any_way = np.zeros(3), (np.zeros(3), np.inf, True)
    if isinstance(light, Linked):
        return _bounds(light.lamp)
    if isinstance(light, Luminaire) and light.is_dimmed:
        return *_bounds(light.lamp)[:-2], True, False
    if isinstance(light, SkyPatch):
        # It may give all of its light wherever the surface turns.
        return nowhere, 1.0, strength, 0.0, 0.0, *any_way, True, True, False
    if isinstance(light, Sun):
        sine, cosine = float(np.sin(light.angle / 2)), float(np.cos(light.angle / 2))
        return (-light.direction, sine + 1 - cosine, strength * 2 / (1 + cosine), 0.0, 0.0, *any_way, True,
                sine > WIDE, False)
    if isinstance(light, Point):
        squared = float(light.radius**2)
        soft, floor = (0.0, squared) if light.sphere else (squared, squared)
        return light.position, light.radius, strength, soft, floor, *any_way, False, False, False
    if isinstance(light, Area):
        reach = float(max(np.linalg.norm(light.axis_u + sign * light.axis_v) for sign in (1, -1))) / 2
        return (light.centre, reach, strength * light.gathering, 0.0, light.area / np.pi, light.normal, 0.0, False,
                False, light.spread < np.pi, False)
    if isinstance(light, MeshEmitter):
        return _mesh_bounds(light, strength)
    return nowhere, 0.0, strength, 0.0, 0.0, *any_way, False, True, True


def _mesh_bounds(light: MeshEmitter, strength: float) -> tuple[Any, ...]:
    corners = light.corners.reshape(-1, 3)
    centre = (corners.min(axis=0) + corners.max(axis=0)) / 2
    radius = float(np.linalg.norm(corners - centre, axis=1).max())
    brightest = float(light.radiance.mean(axis=1).max())
    # The irradiance is pi times the brightest radiance at most.
    floor = strength / (np.pi * brightest) if brightest > 0 else 0.0
    normals = light.normals
    axis = normals[np.argmax(np.abs(normals).sum(axis=1))]
    if (np.linalg.norm(np.cross(normals, axis), axis=1) > FLATNESS).any() or (
            not light.two_sided and (normals @ axis < 0).any()):
        return centre, radius, strength, 0.0, floor, np.zeros(3), np.inf, True, False, False, False
    thickness = float(np.abs((corners - centre) @ axis).max()) + FLATNESS * radius
    return centre, radius, strength, 0.0, floor, axis, thickness, light.two_sided, False, False, False

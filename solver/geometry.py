"""The scene made ready for rays: float32 about the scene's origin, with normals, areas and surface lookups."""

from __future__ import annotations

from copy import copy
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from .cutouts import CutoutVisibility
from .ray_kinds import RayKinds
from .scene import Scene, surface_of_triangle
from .textures import looked_up
from .visibility import OFFSET, Visibility

if TYPE_CHECKING:
    from .buried import Buried

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]


class Geometry:
    """Triangles about the scene's origin.

    Attributes
    ----------
    corners : (t, 3, 3) float32, metres, relative to `scene.origin`.
    normal : (t, 3) float32 unit geometric normals; zero for a triangle without area.
    area : (t,) float32, m2.
    offset : (t,) float32, metres: how far off a triangle a ray starts.
    """

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        relative = (scene.vertices - scene.origin)[scene.triangles]
        cross = np.cross(relative[:, 1] - relative[:, 0], relative[:, 2] - relative[:, 0])
        length = np.linalg.norm(cross, axis=1)
        self.corners = np.asarray(relative, np.float32)
        self.area = np.asarray(length / 2, np.float32)
        self.normal = np.asarray(cross / np.maximum(length, 1e-300)[:, None], np.float32)
        self.offset = np.abs(self.corners).max(axis=(1, 2), initial=1e-30) * np.float32(OFFSET)
        self._base = np.ascontiguousarray(self.corners[:, 0])
        self._edge1 = np.ascontiguousarray(self.corners[:, 1] - self.corners[:, 0])
        self._edge2 = np.ascontiguousarray(self.corners[:, 2] - self.corners[:, 0])
        self._reflectance, self._emission = np.asarray(scene.reflectance), np.asarray(scene.emission)
        self._reflectance_texture = np.asarray(scene.reflectance_texture)
        self._emission_texture = np.asarray(scene.emission_texture)
        self._textured = bool((self._reflectance_texture >= 0).any())
        self._shadows: dict[bytes, Visibility] = {}

    def in_light_of(self, scene: Scene) -> Geometry:
        """The same triangles in a scene that differs by its lamps and sky alone."""
        other = copy(self)
        other.scene = scene
        return other

    @cached_property
    def buried(self) -> Buried:
        """Which points lie under faces that touch theirs."""
        from .buried import Buried

        return Buried(self)

    @cached_property
    def visibility(self) -> Visibility:
        """The rays' side of it."""
        casts_shadow, seen = np.asarray(self.scene.casts_shadow), np.asarray(self.scene.seen)
        if casts_shadow.all() and seen.all():
            return self._visibility_of(np.arange(len(self.corners)))
        return RayKinds(self._visibility_of(np.flatnonzero(seen)), np.flatnonzero(seen),
                        self._visibility_of(np.flatnonzero(casts_shadow)))

    @cached_property
    def solid(self) -> Visibility:
        """Rays that every triangle stops, whatever shadows it casts and holes it has."""
        return self.visibility if type(self.visibility) is Visibility else Visibility(self.corners)

    @cached_property
    def surface(self) -> NDArray[np.int32]:
        """(t,) int32: the surface that each triangle is of."""
        return surface_of_triangle(self.scene)

    def shadows_of(self, blockers: NDArray[np.bool_]) -> Visibility:
        """Shadow rays that some surfaces only stop: (s,) bool, or one for all. Made when first asked for, so then not
        by several threads."""
        if blockers.all():
            return self.visibility
        key = blockers.tobytes()
        if key not in self._shadows:
            stops = np.broadcast_to(blockers, len(self.scene.surfaces))[self.surface]
            self._shadows[key] = self._visibility_of(np.flatnonzero(stops & np.asarray(self.scene.casts_shadow)))
        return self._shadows[key]

    def _visibility_of(self, rows: Int) -> Visibility:
        """Rays against some of the triangles."""
        holed = (np.asarray(self.scene.opacity) < 1) | (np.asarray(self.scene.opacity_texture) >= 0)
        if holed[rows].any():
            return CutoutVisibility(self.corners[rows], self.offset[rows], holed[rows],
                                    lambda triangle, u, v: self.opacity(rows[triangle], u, v))
        return Visibility(self.corners[rows])

    def point(self, triangle: Int, u: Float, v: Float) -> Float:
        """(n, 3) float32: the point at barycentric (u, v) of each triangle."""
        out: Float = np.take(self._edge1, triangle, axis=0)
        out *= u[:, None]
        second = np.take(self._edge2, triangle, axis=0)
        second *= v[:, None]
        out += second
        out += np.take(self._base, triangle, axis=0)
        return out

    def shading_normal(self, triangle: Int, u: Float, v: Float) -> Float:
        """(n, 3) float32 unit normals, interpolated where the surface is smooth."""
        corner = self.scene.corner_normals
        if corner is None:
            return np.asarray(np.take(self.normal, triangle, axis=0))
        corners = np.take(corner.reshape(-1, 9), triangle, axis=0)
        blended = corners[:, :3] * (1 - u - v)[:, None]
        blended += corners[:, 3:6] * u[:, None]
        blended += corners[:, 6:] * v[:, None]
        length = np.sqrt(np.einsum("ij,ij->i", blended, blended))
        unit = blended / np.maximum(length, 1e-6)[:, None]
        lost = np.flatnonzero(~(length > 1e-6))
        unit[lost] = self.normal[triangle[lost]]
        return np.asarray(unit)

    def lifted(self, points: Float, triangle: Int, front: NDArray[np.bool_]) -> Float:
        """The points, moved off their triangles to the side asked for, so that a ray does not meet its start."""
        offset = self.offset[triangle]
        return np.asarray(points + np.take(self.normal, triangle, axis=0) * np.where(front, offset, -offset)[:, None])

    def reflectance(self, triangle: Int, u: Float, v: Float, share: Float | None = None) -> Float:
        """(n, 3) float32 diffuse reflectance at barycentric points, or about them: of pieces of surface that are such a
        share (n,) of twice their triangle."""
        out: Float = np.take(self._reflectance, triangle, axis=0)
        if self._textured:
            out = out * self._textures(self._reflectance_texture, triangle, u, v, share)
            np.minimum(out, 1.0, out=out)
        return out

    def emission(self, triangle: Int, u: Float, v: Float, share: Float | None = None) -> Float:
        """(n, 3) float32 radiant exitance (W/m2) at or about barycentric points, as `reflectance`."""
        out: Float = np.take(self._emission, triangle, axis=0)
        if (self._emission_texture[triangle] >= 0).any():
            out = out * self._textures(self._emission_texture, triangle, u, v, share)
        return out

    def opacity(self, triangle: Int, u: Float, v: Float) -> Float:
        """(n,) float32: part of the rays that is stopped at barycentric points."""
        texture = self._textures(np.asarray(self.scene.opacity_texture), triangle, u, v)
        return np.asarray(np.asarray(self.scene.opacity)[triangle] * texture[:, 0])

    @cached_property
    def _width_in_image(self) -> Float:
        """(t,) the root of twice each triangle's area in its image, in parts of the image."""
        corner = np.asarray(self.scene.uv)
        first, second = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
        return np.asarray(np.sqrt(np.abs(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0])))

    def _textures(self, index_of: Int, triangle: Int, u: Float, v: Float, share: Float | None = None) -> Float:
        out = np.ones((len(triangle), 3), np.float32)
        index = index_of[triangle]
        if self.scene.uv is None:
            return out
        order = np.argsort(index, kind="stable")
        bounds = np.searchsorted(index[order], np.arange(len(self.scene.textures) + 1))
        for number, texture in enumerate(self.scene.textures):
            rows = order[bounds[number]:bounds[number + 1]]
            if len(rows):
                corner = np.take(self.scene.uv, triangle[rows], axis=0)
                weight_u, weight_v = u[rows, None], v[rows, None]
                place = corner[:, 0] * (1 - weight_u - weight_v) + corner[:, 1] * weight_u + corner[:, 2] * weight_v
                width = None
                if share is not None:
                    width = np.take(self._width_in_image, triangle[rows]) * np.sqrt(share[rows])
                out[rows] = looked_up(texture, place, width)
        return out

"""The scene as the solver sees it: frozen arrays, validated once, trusted afterwards.

Nothing here knows Blender, and nothing on this side knows where a lumel lies in an image except
`Surface.lightmap_uv`, which only the receivers read.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .errors import SceneError
from .lights import Light
from .linking import Links, links_of
from .textures import MipMap

Float = NDArray[np.floating[Any]]


@dataclass(frozen=True, eq=False)
class Texture:
    """An image in linear light, repeated in both directions, looked up with bilinear filtering.

    Parameters
    ----------
    pixels : (height, width, 3) float32; row 0 is v = 0 (the bottom), as Blender keeps images. Shared with the caller,
        who leaves them as they are: images are large.
    name : for messages.
    """

    pixels: Float
    name: str = "texture"

    def __post_init__(self) -> None:
        pixels = np.ascontiguousarray(_array(f"texture {self.name!r}", self.pixels, np.float32, copy=False))
        if pixels.ndim != 3 or pixels.shape[2] != 3 or 0 in pixels.shape:
            raise SceneError(f"texture {self.name!r} has shape {pixels.shape}: give (height, width, 3)")
        if not np.isfinite(pixels).all() or pixels.min() < 0:
            raise SceneError(f"texture {self.name!r} has a value that is negative or not finite: mend the image")
        object.__setattr__(self, "pixels", _frozen(pixels.view()))

    @cached_property
    def mean(self) -> Float:
        """(3,) float32 of all pixels."""
        # Down the columns first, which takes a tenth of the time of both at once.
        return np.asarray(self.pixels.mean(axis=0).mean(axis=0))

    @cached_property
    def smaller(self) -> MipMap:
        """Smaller images of it."""
        return MipMap.of(self.pixels)


@dataclass(frozen=True, eq=False)
class Sky:
    """The light from where no surface is: radiance by direction.

    Parameters
    ----------
    radiance : (3,) for a constant sky, or (height, width, 3) for an equirectangular map, W / (m2 sr). Row 0 looks
        straight down (-z); a direction (x, y, z) is found at column (.5 - atan2(y, x) / (2 pi)) * width and row
        (1 - acos(z) / pi) * height, so that the middle column looks along +x, as Blender's environment maps do. Of a
        small bright spot, as a sun, rays find little by chance: `solver.sky_lamps.peel` makes lamps of such.
    """

    radiance: Float = field(default_factory=lambda: np.zeros(3, np.float32))

    def __post_init__(self) -> None:
        radiance = _array("the sky's radiance", self.radiance, np.float32)
        if radiance.shape != (3,) and (radiance.ndim != 3 or radiance.shape[2] != 3 or 0 in radiance.shape):
            raise SceneError(f"sky radiance has shape {radiance.shape}: give (3,) or (height, width, 3)")
        if not np.isfinite(radiance).all() or radiance.min() < 0:
            raise SceneError("the sky's radiance is negative or not finite: check the world's colour and strength")
        object.__setattr__(self, "radiance", _frozen(radiance))

    @cached_property
    def is_black(self) -> bool:
        """Whether no light comes from the sky."""
        return not self.radiance.any()


@dataclass(frozen=True, eq=False)
class Surface:
    """One object: a run of the scene's triangles that is baked together.

    Parameters
    ----------
    name : the object's name, as messages and the report call it.
    first, count : its triangles are `first ... first + count - 1`.
    lightmap_uv : (count, 3, 2) float32, the corners' coordinates in the user's lightmap UV, or None to unwrap.
    receives : whether it gets lumels; if not it still blocks, reflects and emits.
    density : factor on the texel density of this object.
    corner_ids : (count, 3) int32, for every triangle corner the index of the mesh's own corner (loop); None
        counts 0 ... 3 count - 1. Written back by the vertex target.
    links : whom its emission reaches, and who stops it; None: everybody, as for surfaces that do not emit.
    """

    name: str
    first: int
    count: int
    lightmap_uv: Float | None = None
    receives: bool = True
    density: float = 1.0
    corner_ids: NDArray[np.int32] | None = None
    links: Links | None = None

    def __post_init__(self) -> None:
        if not (np.isfinite(self.density) and self.density > 0):
            raise SceneError(f"object {self.name!r}: its density is {self.density}: give a finite factor above 0")
        if self.corner_ids is not None:
            ids = _indices(f"object {self.name!r}: corner_ids", self.corner_ids, (self.count, 3), 0, 2**31)
            object.__setattr__(self, "corner_ids", _frozen(ids))
        if self.lightmap_uv is not None:
            uv = _array(f"object {self.name!r}: lightmap_uv", self.lightmap_uv, np.float32)
            if uv.shape != (self.count, 3, 2):
                raise SceneError(f"object {self.name!r}: lightmap_uv has shape {uv.shape}, not ({self.count}, 3, 2)")
            if not np.isfinite(uv).all():
                raise SceneError(f"object {self.name!r}: its lightmap UV holds a value that is not finite: unwrap it")
            object.__setattr__(self, "lightmap_uv", _frozen(uv))

    @property
    def triangles(self) -> slice:
        """The object's triangles in the scene's arrays."""
        return slice(self.first, self.first + self.count)


@dataclass(frozen=True, eq=False)
class Scene:
    """Triangles with reflectance and emission, lamps and a sky. Both sides of a triangle reflect and emit.

    Parameters
    ----------
    vertices : (v, 3) float64, metres, world space.
    triangles : (t, 3) int32 indices; counter-clockwise seen from the front.
    reflectance : diffuse reflectance rho in [0, 1]: a number, (3,), (t,) or (t, 3); kept as (t, 3) float32. Three
        numbers are always the three channels.
    emission : radiant exitance of each side, W/m2 (radiance times pi): shaped the same; kept as (t, 3) float32.
    corner_normals : (t, 3, 3) float32 unit shading normals at the corners, or None for flat triangles.
    uv : (t, 3, 2) float32 texture coordinates, or None.
    textures : images that `reflectance_texture` and `emission_texture` point to.
    opacity : part of the rays that a triangle stops, both ways; the others go on unchanged: a number or (t,).
    casts_shadow, seen : whether shadow rays towards lamps meet a triangle, and whether gather rays do: bool or (t,).
    reflectance_texture, emission_texture, opacity_texture : (t,) int32 index into `textures`, -1 for none; what the
        texture says is multiplied by `reflectance`, `emission` or `opacity` (of which its first channel counts).
    material : (t,) int32 index into `material_names`, for messages; None where nothing is known.
    lights : lamps (see `solver.lights`).
    sky : light from outside.
    surfaces : the objects, in the order of their triangles; empty means one object called "scene".

    Raises
    ------
    SceneError
        If a shape, an index, or a value (not finite, negative, reflectance above 1) can't be used.
    """

    vertices: Float
    triangles: NDArray[np.integer[Any]]
    reflectance: ArrayLike = 0.5
    emission: ArrayLike = 0.0
    corner_normals: Float | None = None
    uv: Float | None = None
    textures: tuple[Texture, ...] = ()
    reflectance_texture: NDArray[np.integer[Any]] | None = None
    emission_texture: NDArray[np.integer[Any]] | None = None
    opacity: ArrayLike = 1.0
    casts_shadow: ArrayLike = True
    seen: ArrayLike = True
    opacity_texture: NDArray[np.integer[Any]] | None = None
    material: NDArray[np.integer[Any]] | None = None
    material_names: tuple[str, ...] = ()
    lights: Sequence[Light] = ()
    sky: Sky = field(default_factory=Sky)
    surfaces: tuple[Surface, ...] = ()

    def __post_init__(self) -> None:
        put = lambda name, value: object.__setattr__(self, name, value)  # noqa: E731
        vertices = _array("vertices", self.vertices, np.float64)
        if vertices.ndim != 2 or vertices.shape[1] != 3:
            raise SceneError(f"vertices have shape {vertices.shape}: give (v, 3)")
        if not np.isfinite(vertices).all():
            row = int(np.flatnonzero(~np.isfinite(vertices).all(axis=1))[0])
            raise SceneError(f"vertex {row} is at {vertices[row].tolist()}: every coordinate must be finite")
        triangles = _indices("triangles", self.triangles, (None, 3), 0, len(vertices))
        count = len(triangles)
        put("vertices", _frozen(vertices))
        put("triangles", _frozen(triangles))
        for name, limit in (("reflectance_texture", len(self.textures)), ("emission_texture", len(self.textures)),
                            ("opacity_texture", len(self.textures)), ("material", len(self.material_names))):
            value = getattr(self, name)
            put(name, _frozen(np.full(count, -1, np.int32) if value is None
                              else _indices(name, value, (count,), -1, limit)))
        reflectance = _per_triangle("reflectance", self.reflectance, count)
        if reflectance.size and reflectance.max() > 1:
            triangle = int(np.argmax(reflectance.max(axis=1)))
            raise SceneError(f"{self.whose(triangle)}: reflectance {reflectance[triangle].tolist()} is above 1")
        put("reflectance", _frozen(reflectance))
        put("emission", _frozen(_per_triangle("emission", self.emission, count)))
        for name, shape in (("corner_normals", (count, 3, 3)), ("uv", (count, 3, 2))):
            value = getattr(self, name)
            if value is not None:
                array = _array(name, value, np.float32)
                if array.shape != shape or not np.isfinite(array).all():
                    raise SceneError(f"{name} has shape {array.shape} or is not finite: give {shape}, finite")
                put(name, _frozen(array))
        opacity = _each("opacity", self.opacity, np.float32, count)
        if count and not (0 <= opacity.min() and opacity.max() <= 1):
            raise SceneError(f"opacity runs from {opacity.min():g} to {opacity.max():g}: give values from 0 to 1")
        put("opacity", _frozen(opacity))
        for name in ("casts_shadow", "seen"):
            put(name, _frozen(_each(name, getattr(self, name), np.bool_, count)))
        put("lights", tuple(self.lights))
        if not isinstance(self.sky, Sky):
            raise SceneError(f"sky is {self.sky!r}: give a Sky")
        surfaces = tuple(self.surfaces) or (Surface("scene", 0, count),)
        following = 0
        for surface in surfaces:
            if surface.first != following or surface.count < 0:
                raise SceneError(f"object {surface.name!r} has {surface.count} triangles from {surface.first}: let "
                                 f"those of each object follow those of the one before, here from {following}")
            following += surface.count
        if following != count:
            raise SceneError(f"the surfaces cover {following} of {count} triangles")
        put("surfaces", surfaces)
        for light in self.lights:
            links_of(light).check(len(surfaces), f"lamp {light.name!r}")
        for surface in surfaces:
            if surface.links is not None:
                surface.links.check(len(surfaces), f"object {surface.name!r}")

    def whose(self, triangle: int) -> str:
        """The material of a triangle, for messages; the triangle itself where no material is known."""
        material = int(np.asarray(self.material)[triangle])
        return f"material {self.material_names[material]!r}" if material >= 0 else f"triangle {triangle}"

    @cached_property
    def origin(self) -> Float:
        """(3,) float64: the point that the solver moves to zero, so that float32 keeps its digits: the median of the
        objects' middles, since one that is far away must not take them from all others."""
        corners = (self.vertices[self.triangles[surface.triangles]].reshape(-1, 3)
                   for surface in self.surfaces if surface.count)
        middles = [(own.min(axis=0) + own.max(axis=0)) / 2 for own in corners]
        return np.sort(middles, axis=0)[(len(middles) - 1) // 2] if middles else np.zeros(3)


def with_mean_texture(scene: Scene, factor: ArrayLike, texture: ArrayLike | None) -> Float:
    """(t, 3) float32: a triangle's factor, as `Scene.reflectance`, times the mean of its texture, where it has one."""
    means = np.array([*(item.mean for item in scene.textures), np.ones(3)], np.float32)
    return np.asarray(np.asarray(factor) * means[np.asarray(texture)], np.float32)


def surface_of_triangle(scene: Scene) -> NDArray[np.int32]:
    """(t,) int32, the object that each triangle of the scene belongs to."""
    surface = np.full(len(scene.triangles), -1, np.int32)
    for index, item in enumerate(scene.surfaces):
        surface[item.triangles] = index
    return surface


def _per_triangle(name: str, value: ArrayLike, count: int) -> Float:
    array = _array(name, value, np.float32, copy=False)
    if array.shape == (count,) and count != 3:
        array = array[:, None]
    try:
        array = np.broadcast_to(array, (count, 3))
    except ValueError:
        raise SceneError(f"{name} has shape {array.shape}: give a number, (3,), ({count},) or ({count}, 3)") from None
    if not np.isfinite(array).all() or (count and array.min() < 0):
        raise SceneError(f"{name} holds a value that is negative or not finite: give finite values from 0")
    return np.array(array, np.float32)


def _each(name: str, value: ArrayLike, dtype: Any, count: int) -> Any:
    """(count,) of a value for all or one for each."""
    array = _array(name, value, dtype, copy=False)
    if array.shape not in ((), (1,), (count,)):
        raise SceneError(f"{name} has shape {array.shape}: give a value for all, or ({count},)")
    return np.array(np.broadcast_to(array, (count,)))


def _indices(name: str, value: Any, shape: tuple[int | None, ...], low: int, high: int) -> NDArray[np.int32]:
    """A copy as int32, of a shape of which None may be any, with values from low to high - 1."""
    array = np.asarray(value)
    whole = array.dtype.kind in "iu" or (array.dtype.kind == "f" and bool((array % 1 == 0).all()))
    if not whole or len(array.shape) != len(shape) or any(
            wanted not in (None, given) for wanted, given in zip(shape, array.shape, strict=True)):
        wanted_shape = ", ".join("t" if side is None else str(side) for side in shape)
        raise SceneError(f"{name} are {array.dtype} {array.shape}: give whole numbers ({wanted_shape})")
    if array.size and not (low <= array.min() and array.max() < high):
        raise SceneError(f"{name} run from {array.min()} to {array.max()}: give numbers from {low} to {high - 1}")
    return np.array(array, np.int32)


def _array(name: str, value: Any, dtype: Any, *, copy: bool = True) -> NDArray[Any]:
    """As an array of a type; a copy, so that the caller's stays as it is and his own."""
    try:
        return np.array(value, dtype, order="C") if copy else np.asarray(value, dtype)
    except (ValueError, TypeError) as cause:
        raise SceneError(f"{name}: not an array of numbers ({cause})") from None


def _frozen(array: Any) -> Any:
    array.flags.writeable = False
    return array

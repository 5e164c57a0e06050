"""Materials that can't be read from their nodes, evaluated by Cycles: every part of them as an image, or one colour.

Each material on each mesh gets images of its own over `triangle_cells`, one sample in the middle of every texel. What
depends on where the object is (its coordinates, its colour, geometry in world space) is evaluated for each object.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import partial
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ..solver.errors import RadiosityError
from . import cycles
from .compat import version
from .cycles_elsewhere import Elsewhere
from .digest import digest
from .materials import PARTS, Shading
from .mesh_part import BAKE_UV, MeshPart, make_mesh
from .named_values import Named
from .parts import PAUSE, Parts, aside
from .shader_views import show_part
from .shown_images import images
from .shown_nodes import shows
from .triangle_cells import MARGIN, Cells, place_cells

Float = NDArray[np.floating[Any]]

# Texels of one material on one mesh at most, and of all together, about.
MOST_TEXELS, ALL_TEXELS = 1 << 20, 1 << 23
LEAST_TEXELS = 1 << 12
# Side of a texel that is aimed at on the mesh, metres; finer where an image of the material is.
TEXEL = 0.01
# A part whose texels differ by less than this, relative, is one colour.
EVEN = 1e-5
# Metres that are lost in rounding, and not 0, which would switch the modifier off.
NO_MOVE = 1e-20
# Bytes of results that are kept for the next bake.
CACHE_BYTES = 1 << 28
# Nodes by which a material may look different on each object that shows the same mesh.
BY_PLACE = frozenset({
    "ShaderNodeObjectInfo", "ShaderNodeNewGeometry", "ShaderNodeTexCoord", "ShaderNodeVectorTransform",
    "ShaderNodeAttribute", "ShaderNodeTangent", "ShaderNodeNormalMap", "ShaderNodeCameraData", "ShaderNodeParticleInfo",
    "ShaderNodeAmbientOcclusion", "ShaderNodeBevel", "ShaderNodeWireframe"})

_cache: OrderedDict[str, Float] = OrderedDict()


@dataclass(frozen=True, eq=False)
class Subject:
    """A material on a mesh, as Cycles needs it.

    Attributes
    ----------
    material : the original bpy material.
    part : the triangles.
    matrix : (4, 4) of the object; colour, index and random number of it, as its Object Info says.
    named : what Attribute nodes ask of it by name.
    """

    material: Any
    part: MeshPart
    matrix: Float
    colour: tuple[float, ...]
    index: int
    random: float
    named: Named


@dataclass(frozen=True, eq=False)
class Request:
    """A material on a mesh that is to be evaluated.

    Attributes
    ----------
    subject : both.
    shading : what was read of the material.
    digest : of everything that the result depends on.
    """

    subject: Subject
    shading: Shading
    digest: str

    def parts(self) -> list[str]:
        """The parts to evaluate: those that were guessed, and those with an image, as all share one layout."""
        guessed = self.shading.guessed_parts
        if guessed == {"lost"}:
            return ["lost"]
        images = {name for name, colour in (("reflectance", self.shading.reflectance),
                                            ("emission", self.shading.emission)) if colour.image is not None}
        return [name for name in PARTS if name in guessed | images]


@dataclass(frozen=True, eq=False)
class Evaluated:
    """What Cycles made of a request.

    Attributes
    ----------
    parts : by name, (height, width, 3) float32 at the texels inside the cells, or (3,) where it is one colour.
    cells : layout of the triangles.
    """

    parts: dict[str, Float]
    cells: Cells


def request(item: Any, material: Any, part: MeshPart, shading: Shading, named: Named) -> Request:
    """A request for a shown mesh and one of its (evaluated) materials; call it while the dependency graph lives."""
    tree = material.node_tree
    own = (item.matrix, tuple(item.original.color), item.original.pass_index, item.random, named)
    total = digest(tree, part, own if shows(tree, BY_PLACE) else None, material.pass_index, version(),
                   shading.guessed_parts)
    return Request(Subject(material.original, part, *own), shading, total)


def materials_to_ask(requests: Sequence[Request], frame: int) -> list[Any]:
    """The materials that Cycles has to look at: what was evaluated before is in memory."""
    budget = _budget(requests)
    return list({one.subject.material.name_full: one.subject.material for one in requests
                 if any(_key(one, name, budget, frame) not in _cache for name in one.parts())}.values())


def evaluate(requests: Sequence[Request], frame: int, elsewhere: Elsewhere | None = None) -> Parts[list[Evaluated]]:
    """Results of all requests, each a part; those that were made before come from memory.

    Parameters
    ----------
    frame : number of the frame, for what is animated.
    elsewhere : another Blender; with None, and what that does not know, Cycles works in this one.

    Raises
    ------
    RadiosityError
        If Cycles is not there or fails.
    """
    budget = _budget(requests)
    found = []
    for one in requests:
        found.append((yield from _evaluate(one, budget, frame, elsewhere)))
    return found


def _budget(requests: Sequence[Request]) -> int:
    """Texels of each."""
    return max(LEAST_TEXELS, min(MOST_TEXELS, ALL_TEXELS // max(len(requests), 1)))


def _key(one: Request, name: str, budget: int, frame: int) -> str:
    return f"{one.digest} {name} {budget} {frame}"


def _evaluate(one: Request, budget: int, frame: int, elsewhere: Elsewhere | None) -> Parts[Evaluated]:
    subject = one.subject
    sides = [image.size[:] for image in images(subject.material.node_tree) if image.size[0]]
    cells = yield from aside(partial(_cells, one, sides, budget))
    parts = {}
    for name in one.parts():
        key = _key(one, name, budget, frame)
        if key not in _cache:
            if elsewhere is not None and elsewhere.knows(subject.material):
                pixels = yield from elsewhere.ask(
                    do="bake", material=subject.material.name, name=name, frame=frame, part=plain(subject.part),
                    cells=plain(cells),
                    subject=(subject.matrix, subject.colour, subject.index, subject.random, subject.named))
            else:
                yield PAUSE
                pixels = bake(subject, name, cells, frame)
                yield
            _remember(key, (yield from aside(partial(_simple, pixels, cells))))
        _cache.move_to_end(key)
        parts[name] = _cache[key]
    return Evaluated(parts, cells)


def _cells(one: Request, sides: Sequence[Sequence[int]], budget: int) -> Cells:
    """Where each triangle lies; `sides` are those of the images that the material shows."""
    return place_cells(_wanted_steps(one, sides), budget)


def _wanted_steps(one: Request, sides: Sequence[Sequence[int]]) -> Float:
    """(t,) texels along each triangle's longest leg: by its size in space, or by the pixels that lie on it."""
    part = one.subject.part
    corners = part.positions[part.triangles] @ np.asarray(one.subject.matrix, np.float32)[:3, :3].T
    steps = _longest(corners) / TEXEL
    layouts = [values for _, kind, domain, values in part.attributes if kind == "FLOAT2" and domain == "CORNER"]
    for uv in layouts if sides else ():
        largest = np.max(sides, axis=0).astype(np.float32)
        steps = np.maximum(steps, np.nan_to_num(_longest(uv * largest), posinf=0))
    return np.asarray(steps)


def _longest(corners: Float) -> Float:
    """(t,) longest side of triangles (t, 3, k)."""
    return np.asarray(np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2).max(axis=1))


def plain(data: Any) -> tuple[Any, ...]:
    """The fields of a dataclass."""
    return tuple(getattr(data, field.name) for field in fields(data))


def bake(one: Subject, name: str, cells: Cells, frame: int) -> Float:
    """What Cycles makes of a part of a material, as `cycles.bake_emission`.

    Raises
    ------
    RadiosityError
        If Cycles is not there or fails.
    """
    meshes = make_mesh(one.part, cells.uv(MARGIN))
    groups: list[Any] = []
    copy = one.material.copy()
    item = bpy.data.objects.new("radiosity bake", meshes[0])
    try:
        groups = show_part(copy, name, one.random, one.named)
        meshes[0].materials.append(copy)
        item.matrix_world = one.matrix.T.tolist()
        item.color, item.pass_index = one.colour, one.index
        if len(meshes) > 1:
            # Blender asks for undeformed coordinates only where a modifier deforms: this one moves nothing.
            item.modifiers.new("radiosity", "DISPLACE").strength = NO_MOVE
        pixels = cycles.bake_emission(item, BAKE_UV, cells.width, cells.height, frame)
    except RuntimeError as cause:
        raise RadiosityError(f"{str(cause).strip().splitlines()[0]}") from cause
    finally:
        bpy.data.objects.remove(item)
        for mesh in meshes:
            bpy.data.meshes.remove(mesh)
        bpy.data.materials.remove(copy)
        for group in groups:
            bpy.data.node_groups.remove(group)
    return pixels


def _simple(pixels: Float, cells: Cells) -> Float:
    """Colours over the cells, black outside of them; or one colour where they are all the same.

    Raises
    ------
    RadiosityError
        If Cycles left out a texel.
    """
    inside = cells.inside()
    seen = pixels[inside]
    if not (seen[:, 3] > 0).all():
        raise RadiosityError(f"{int((seen[:, 3] <= 0).sum())} texels were left out")
    colours = np.nan_to_num(seen[:, :3], nan=0.0, posinf=0.0, neginf=0.0)
    if np.ptp(colours, axis=0).max() <= EVEN * max(float(np.abs(colours).max()), 1e-30):
        return np.array(colours[0])
    image = np.zeros((cells.height, cells.width, 3), np.float32)
    image[inside] = colours
    return image


def _remember(key: str, values: Float) -> None:
    _cache[key] = values
    while sum(kept.nbytes for kept in _cache.values()) > CACHE_BYTES and len(_cache) > 1:
        _cache.popitem(last=False)


def forget() -> None:
    """Give the memory of kept results back."""
    _cache.clear()

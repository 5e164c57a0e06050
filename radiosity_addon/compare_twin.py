"""The diffuse twin of an exported scene, as files that another Blender builds it from (see `compare_child.py`).

What Cycles is given is what the bake was given: triangles, shading normals, reflectance, emission and textures of the
solver's own arrays, laid out as the bake laid them out. Lamps and world are the user's own, so that reading them is
put to the test too. Everything that a diffuse bake leaves out is told by the warnings of the export.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ..solver.pieces import originals, weld
from ..solver.result import Bake
from ..solver.scene import Scene, surface_of_triangle
from .compare_linking import kinds, masks
from .compare_score import layout_of
from .lamp_places import is_rendered, lights_diffuse_surfaces
from .linking import Linking
from .visible import shown_meshes
from .world import rendered_world

Float = NDArray[np.floating[Any]]

# Shading normals this near to the face's own are the face's own: Blender keeps custom normals in 16 bits.
FLAT = 1e-3
# Cycles divides its diffuse light by the surface's colour; a channel that is black would have no light.
LEAST_REFLECTANCE = 1e-4
GEOMETRY, LAMPS = "twin.npz", "lamps.blend"


@dataclass(frozen=True)
class Placed:
    """Data of a lamp or a camera at one place: its name, the rows of its matrix to world space, and what a lamp is
    linked to (`compare_linking.masks`), empty for all."""

    data: str
    matrix: list[list[float]]
    links: list[list[bool]] = field(default_factory=list)


@dataclass(frozen=True)
class Stage:
    """What is not a surface, by the names that it has in `LAMPS`.

    lights : lamps, instances included;  world, camera : of the scene, or None;  size : of a render, pixels.
    """

    lights: tuple[Placed, ...]
    world: str | None
    camera: Placed | None
    size: tuple[int, int]

    def as_dict(self) -> dict[str, Any]:
        """As JSON takes it."""
        return asdict(self)


def write_stage(scene: Any, depsgraph: Any, folder: Path) -> Stage:
    """Write lamps, world and camera to a .blend of their own; the open file stays as it is.

    Parameters
    ----------
    scene : the bpy scene.
    depsgraph : its evaluated dependency graph, as for a render.
    folder : where `LAMPS` goes.
    """
    shown = shown_meshes(depsgraph, [])
    linking = Linking(depsgraph, shown)
    lights, blocks = [], set()
    for instance in depsgraph.object_instances:
        lamp = instance.object
        # As in `lights.export_lights`: what is hidden from diffuse rays lights no lightmap.
        if is_rendered(instance) and lights_diffuse_surfaces(instance):
            data = lamp.original.data
            blocks.add(data)
            links = linking.of(lamp)
            lights.append(Placed(data.name, _rows(instance.matrix_world),
                                 [] if links is None else masks(links, len(shown)).tolist()))
    camera = None
    if scene.camera is not None and scene.camera.type == "CAMERA":
        blocks.add(scene.camera.data)
        evaluated = scene.camera.evaluated_get(depsgraph)
        camera = Placed(scene.camera.data.name, _rows(evaluated.matrix_world))
    world = rendered_world(scene, depsgraph.view_layer)
    if world is not None:
        blocks.add(world)
    bpy.data.libraries.write(str(folder / LAMPS), blocks, path_remap="ABSOLUTE", fake_user=True)
    name = world.name if world is not None else None
    return Stage(tuple(lights), name, camera, (scene.render.resolution_x, scene.render.resolution_y))


def _rows(matrix: Any) -> list[list[float]]:
    return [list(row) for row in matrix]


def write_geometry(scene: Scene, bake: Bake, folder: Path) -> tuple[list[list[int]], NDArray[np.bool_]]:
    """Write the surfaces to `GEOMETRY`.

    Materials differ by emission, opacity, textures, page and group; reflectance is a colour of the mesh. A group's
    triangles have the same ray visibility: bit 0, whether they cast shadows; bit 1, whether bounced light sees them;
    and are of the same kind, from bit 2 on (`compare_linking.kinds`).

    Returns
    -------
    Each page's [width, height], and which triangles (t,) were left out (`copies`).
    """
    page, layout = layout_of(scene, bake)
    emission = np.asarray(scene.emission, np.float32) / np.float32(np.pi)
    kind, kind_surface, kind_links = kinds(scene)
    group = (_per_triangle(scene.casts_shadow, page) + 2 * _per_triangle(scene.seen, page)
             + 4 * _per_triangle(kind[surface_of_triangle(scene)], page))
    key = np.column_stack([emission, _per_triangle(scene.opacity, page), np.asarray(scene.reflectance_texture),
                           np.asarray(scene.emission_texture), np.asarray(scene.opacity_texture), page, group])
    left_out = copies(scene, group)
    kept = ~left_out
    used, triangles = np.unique(scene.triangles[kept], return_inverse=True)
    vertices = (scene.vertices[used] - scene.origin).astype(np.float32)
    materials, material = np.unique(key[kept].astype(np.float32), axis=0, return_inverse=True)
    # A texture of reflectances may not be black either.
    raised = set(np.unique(np.asarray(scene.reflectance_texture)))
    textures = {f"texture_{index}": np.maximum(texture.pixels, np.float32(LEAST_REFLECTANCE * (index in raised)))
                for index, texture in enumerate(scene.textures)}
    normals = _bent_normals(scene)
    np.savez(
        folder / GEOMETRY, vertices=vertices, triangles=triangles.reshape(-1, 3).astype(np.int32),
        origin=scene.origin, normals=normals[kept] if len(normals) else normals, page=page[kept], layout=layout[kept],
        group=group[kept], kind_surface=kind_surface, kind_links=kind_links,
        reflectance=np.maximum(np.asarray(scene.reflectance, np.float32)[kept], np.float32(LEAST_REFLECTANCE)),
        uv=scene.uv[kept] if scene.uv is not None else np.zeros((int(kept.sum()), 3, 2), np.float32),
        materials=materials, material=material.reshape(-1).astype(np.int32), **textures)
    return [[lightmap.pixels.shape[1], lightmap.pixels.shape[0]] for lightmap in bake.lightmaps], left_out


def copies(scene: Scene, group: Float) -> NDArray[np.bool_]:
    """(t,) triangles without holes that lie exactly on another one, face the same way and look the same; `group` (t,)
    tells their rays.

    They change no light, but in Cycles such triangles shade each other by chance, half of the light away or all of it.
    """
    first = originals(weld(scene.vertices)[scene.triangles])
    look = np.column_stack([np.asarray(scene.reflectance), np.asarray(scene.emission),
                            np.asarray(scene.reflectance_texture), np.asarray(scene.emission_texture), group])
    solid = (np.asarray(scene.opacity) >= 1) & (np.asarray(scene.opacity_texture) < 0)
    alike = solid & solid[first] & (look == look[first]).all(axis=1)
    return np.asarray(alike & (first != np.arange(len(first))))


def _per_triangle(value: Any, page: NDArray[np.int32]) -> Float:
    """(t,) float32 of a number or (t,) numbers."""
    return np.array(np.broadcast_to(np.asarray(value, np.float32), page.shape))


def _bent_normals(scene: Scene) -> Float:
    """(t, 3, 3) float32 shading normals, zero on the corners of flat triangles; (0, 3, 3) where all are flat."""
    if scene.corner_normals is None:
        return np.zeros((0, 3, 3), np.float32)
    corner = scene.vertices[scene.triangles]
    own = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    own /= np.maximum(np.linalg.norm(own, axis=1, keepdims=True), 1e-300)
    bent = np.abs(scene.corner_normals - own[:, None]).max(axis=(1, 2)) > FLAT
    if not bent.any():
        return np.zeros((0, 3, 3), np.float32)
    return np.where(bent[:, None, None], scene.corner_normals, np.float32(0))

"""The density view: a checker of lumels on every surface, coloured by pixels per metre.

Shown of what is baked, and before a bake of the UV map and resolution that are set. It is one of the views: the button
that shows the baked light, and Clear, put the materials back (`preview`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ..solver.errors import NothingToBake
from . import false_colour, preview, slots
from .baked_light import VIEW_MARK, add
from .images import srgb_to_linear
from .mesh_arrays import read, read_uv
from .results import result_of
from .units import metres_per_unit
from .unlit import only_shader
from .view_settings import BAKED

Float = NDArray[np.floating[Any]]

# A square of the checker is so many lumels wide.
SQUARE = 4
# The scale of colours reaches from a quarter to four times the usual density.
SPAN = 4.0
# What the dark squares keep of their colour.
DARK = 0.6


@dataclass(frozen=True, eq=False)
class Density:
    """Of one object: its UV map, the size of its image (pixels), and pixels per metre as the user sees metres."""

    item: Any
    layer: str
    size: tuple[int, int]
    pixels_per_metre: float


def densities(scene: Any) -> list[Density]:
    """Of all objects whose lightmap is baked, or whose UV map and resolution are set."""
    return [Density(item, layer, size, _pixels_per_metre(item, layer, size) / metres_per_unit(scene))
            for item, layer, size in _laid_out(scene)]


def show(scene: Any) -> list[Density]:
    """Cover the objects with the checker.

    Raises
    ------
    NothingToBake
        If no object has a layout yet.
    """
    preview.hide()
    found = densities(scene)
    if not found:
        raise NothingToBake("no object has a lightmap yet: bake, or set UV Map and Resolution")
    usual = float(np.median([each.pixels_per_metre for each in found]))
    for each in found:
        ratio = each.pixels_per_metre / max(usual, 1e-30)
        slots.cover(each.item, slots.one_for_each(partial(_material, each, ratio)))
    scene.radiosity_view.mode = BAKED
    return found


def _laid_out(scene: Any) -> Iterator[tuple[Any, str, tuple[int, int]]]:
    settings = scene.radiosity
    for item in scene.objects:
        if item.type != "MESH" or item.library is not None or not len(item.data.polygons):
            continue
        result = result_of(item)
        if result is not None and result.target == "lightmap":
            yield item, result.layer, (result.image.size[0], result.image.size[1])
        elif settings.resolution and settings.uv_layer in item.data.uv_layers:
            yield item, settings.uv_layer, (settings.resolution, settings.resolution)


def _pixels_per_metre(item: Any, layer: str, size: tuple[int, int]) -> float:
    """The root of pixels over area in space, over the whole object."""
    mesh = item.data
    mesh.calc_loop_triangles()
    corners = read(mesh.loop_triangles, "loops", np.int32, 3)
    matrix = np.array(item.matrix_world, np.float64)
    places = (read(mesh.vertices, "co", np.float32, 3) @ matrix[:3, :3].T)[read(mesh.loops, "vertex_index", np.int32)]
    uv = read_uv(mesh, layer).astype(np.float64) * size
    a, b = (places[corners[:, k]] - places[corners[:, 0]] for k in (1, 2))
    s, t = (uv[corners[:, k]] - uv[corners[:, 0]] for k in (1, 2))
    area = np.linalg.norm(np.cross(a, b), axis=1).sum()
    pixels = np.abs(s[:, 0] * t[:, 1] - s[:, 1] * t[:, 0]).sum()
    return float(np.sqrt(pixels / area)) if area > 0 else 0.0


def _material(density: Density, ratio: float) -> Any:
    """A checker along the UV map, in the colour of the density over the usual one."""
    part = np.clip(0.5 + np.log(max(ratio, 1e-9)) / (2 * np.log(SPAN)), 0, 1)
    colour = srgb_to_linear(false_colour.colour(np.array([part])))[0]
    made = bpy.data.materials.new(f"Radiosity Density {density.item.name}")
    made[VIEW_MARK] = True

    def tree(nodes: Any) -> Any:
        place = add(nodes, "ShaderNodeUVMap", -600)
        place.uv_map = density.layer
        scaled = add(nodes, "ShaderNodeVectorMath", -400, operation="MULTIPLY")
        scaled.inputs[1].default_value = (density.size[0] / SQUARE, density.size[1] / SQUARE, 1.0)
        checker, emission = add(nodes, "ShaderNodeTexChecker", -200), add(nodes, "ShaderNodeEmission")
        checker.inputs["Scale"].default_value = 1.0
        checker.inputs["Color1"].default_value = (*colour, 1.0)
        checker.inputs["Color2"].default_value = (*(colour * DARK), 1.0)
        nodes.links.new(place.outputs["UV"], scaled.inputs[0])
        nodes.links.new(scaled.outputs["Vector"], checker.inputs["Vector"])
        nodes.links.new(checker.outputs["Color"], emission.inputs["Color"])
        return emission.outputs["Emission"]

    only_shader(made, tree)
    return made

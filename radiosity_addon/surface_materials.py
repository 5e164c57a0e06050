"""Materials on triangles: reflectance, emission, opacity and textures, as columns of the solver's scene.

What can be read from the nodes is put down at once. Images are read by `read_images`, and what Cycles has to evaluate
is put in its place by `evaluate`, both after the dependency graph is gone: Cycles can't bake while we are a render
ourselves.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..solver.errors import RadiosityError
from ..solver.scene import Texture
from . import evaluate, shown_images
from .cycles_elsewhere import Elsewhere
from .evaluate import Evaluated, Request
from .images import mean_parts, texture_parts
from .materials import FAINT, HIGHEST, Shading, read_material, settled, tell_passing
from .mesh_arrays import MeshArrays
from .mesh_part import at_corners, take_part
from .named_values import named_values, vertex_weights
from .parts import Parts, aside
from .shown_nodes import shown_nodes, shows
from .sockets import Colour, ImageUse, is_live
from .triangle_cells import Cells
from .visible import Shown
from .warn import Warnings, warn

Float = NDArray[np.floating[Any]]
Int = NDArray[np.int32]
Columns = dict[str, NDArray[Any]]

# Nodes that look at what is around a point.
AROUND = frozenset({"ShaderNodeAmbientOcclusion", "ShaderNodeBevel"})
# Single precision, twice divided: a reflectance that is above 1 by less is 1.
ROUNDING = 1e-5
TEXTURES = ("reflectance_texture", "emission_texture", "opacity_texture")


@dataclass(frozen=True)
class Slot:
    """A material of an object: its place among the scene's materials, its shading, the (evaluated) bpy material."""

    number: int
    shading: Shading
    material: Any


@dataclass(frozen=True, eq=False)
class _Place:
    """Rows of some columns, with the names of their object and material, and the material's shading."""

    columns: Columns
    rows: NDArray[np.intp]
    object: str
    material: str
    shading: Shading


class SurfaceMaterials:
    """Collects the materials of all surfaces, and the textures that they use."""

    def __init__(self, warnings: Warnings) -> None:
        self.warnings = warnings
        self.names: list[str] = []
        self.textures: list[Texture] = []
        self.rows: dict[str, dict[str, Any]] = {}
        self._slots: dict[str, Slot] = {}
        self._read: dict[tuple[str, bool], int] = {}
        self._pending: list[tuple[_Place, Request, list[int]]] = []
        self._with_images: list[_Place] = []

    def knows(self, material: Any) -> bool:
        """Whether a material was read before, which takes its time."""
        return (material.name_full if material is not None else "") in self._slots

    def slot(self, material: Any) -> Slot:
        """A material as a slot; None is an empty one.

        Raises
        ------
        SceneError
            If Cycles has to look at it and the file of an image is missing.
        """
        name = material.name_full if material is not None else ""
        if name not in self._slots:
            shading = read_material(material, self.warnings)
            _tell_shadow(material, shading, self.warnings)
            if shading.guessed_parts:
                shown_images.require(material.node_tree, f"material {name!r}", read=True)
                shown_images.tell_animated(material.node_tree, name, "texture", shown_images.PRESENT, self.warnings)
            else:
                shading = settled(shading, name, self.warnings)
            self._slots[name] = Slot(len(self.names), shading, material)
            self.names.append(name or "(no material)")
            if shading.passes_light:
                self._note(self.names[-1], shading, np.zeros(3), shading.lost, shading.passing)
        # The bpy material is of this dependency graph, the rest of it is known.
        return replace(self._slots[name], material=material)

    def columns(self, item: Shown, mesh: MeshArrays, index: Int, slots: list[Slot], order: list[int]) -> Columns:
        """Columns for the triangles of a mesh, whose materials are `slots[index]`; corners in the given order."""
        count = len(index)
        columns: Columns = {
            "reflectance": np.zeros((count, 3), np.float32), "emission": np.zeros((count, 3), np.float32),
            "opacity": np.ones(count, np.float32), "uv": np.zeros((count, 3, 2), np.float32),
            "material": np.array([slot.number for slot in slots], np.int32)[index],
            **{name: np.full(count, -1, np.int32) for name in TEXTURES}}
        for number, slot in enumerate(slots):
            rows = np.flatnonzero(index == number)
            if len(rows):
                place = _Place(columns, rows, item.name, self.names[slot.number], slot.shading)
                self._put_slot(place, item, mesh.take(rows), slot, order)
        return columns

    def _put_slot(self, place: _Place, item: Shown, mesh: MeshArrays, slot: Slot, order: list[int]) -> None:
        shading = slot.shading
        self._lay_out(place, item, mesh, order)
        self._put_plain(place)
        if shading.guessed_parts:
            # Until then the guess stands here, with texture coordinates for its images.
            tree = slot.material.node_tree
            part = take_part(item.mesh, mesh, vertex_weights(tree, item))
            named = named_values(tree, item, place.material, self.warnings)
            request = evaluate.request(item, slot.material, part, shading, named)
            self._pending.append((place, request, order))
            if shows(tree, AROUND):
                warn(self.warnings, place.material, "material", "has Ambient Occlusion or Bevel nodes, which see "
                     "nothing here but the faces of this material on one object: bake them to an image first")
            if _differs_by_side(tree):
                warn(self.warnings, place.material, "material", "looks otherwise from behind (Backfacing): both sides "
                     "of its faces are baked as their front; for light to one side alone use an Area lamp")
        else:
            self._with_images.append(place)

    def glance_at_images(self) -> Parts[None]:
        """Put plain colours, about the means of images, where `read_images` will put these."""
        means: dict[tuple[str, bool], Float] = {}
        for place in self._with_images:
            for name, colour in (("reflectance", place.shading.reflectance), ("emission", place.shading.emission)):
                if colour.image is None:
                    continue
                reflects, image = name == "reflectance", colour.image.image
                key = (image.name_full, reflects)
                if key not in means:
                    means[key] = yield from mean_parts(image, place.material, HIGHEST if reflects else math.inf)
                    yield
                place.columns[name][place.rows] = colour.factor * means[key]

    def read_images(self) -> Parts[None]:
        """Read the images of all that was added, and put them in their places, a part each."""
        for place in self._with_images:
            yield from self._put(place)
            yield
        self._with_images.clear()

    def evaluate(self, frame: int, elsewhere: Elsewhere | None = None) -> Parts[None]:
        """Let Cycles evaluate what waits for it, a part each, and put it in its place; see `evaluate.evaluate`."""
        if not self._pending:
            return
        requests = [request for _, request, _ in self._pending]
        if elsewhere is not None:
            elsewhere.bring(evaluate.materials_to_ask(requests, frame))
        try:
            results = yield from evaluate.evaluate(requests, frame, elsewhere)
        except RadiosityError as cause:
            for place, _, _ in self._pending:
                warn(self.warnings, place.material, "material", f"could not be evaluated by Cycles on object "
                     f"{place.object!r} ({cause}): plain values are used instead, as told")
                yield from self._put(replace(place, shading=settled(place.shading, place.material, self.warnings)))
            return
        for (place, _, order), result in zip(self._pending, results, strict=True):
            yield from self._put_evaluated(place, result, order)
            yield

    def _put_plain(self, place: _Place) -> None:
        """Put down a shading, its images left away."""
        shading, columns, rows = place.shading, place.columns, place.rows
        columns["reflectance"][rows] = shading.reflectance.factor
        columns["emission"][rows] = shading.emission.factor
        columns["opacity"][rows] = shading.opacity

    def _put(self, place: _Place) -> Parts[None]:
        """Put down a shading that is settled, with its images."""
        shading, columns, rows = place.shading, place.columns, place.rows
        self._put_plain(place)
        mean = np.asarray(shading.reflectance.factor)
        for name, colour in (("reflectance", shading.reflectance), ("emission", shading.emission)):
            if colour.image is not None:
                number = yield from self._image_texture(colour, name == "reflectance", place.material)
                yield
                columns[f"{name}_texture"][rows] = number
                if name == "reflectance":
                    mean = mean * self.textures[number].mean
        self._note(place.material, shading, mean, shading.lost, shading.passing)

    def _put_evaluated(self, place: _Place, result: Evaluated, order: list[int]) -> Parts[None]:
        """Put down what Cycles made of a material."""
        shading, parts = place.shading, result.parts
        if set(parts) <= {"lost"}:
            lost = _lost(shading, result, result.cells.inside())
            yield from self._put(replace(place, shading=replace(
                settled(replace(shading, guesses=()), place.material, self.warnings), lost=lost)))
        else:
            yield from aside(partial(self._put_parts, place, result, order))

    def _put_parts(self, place: _Place, result: Evaluated, order: list[int]) -> None:
        """Put down the colours and images that Cycles made; touches no bpy."""
        shading, parts, inside = place.shading, result.parts, result.cells.inside()
        lost = _lost(shading, result, inside)
        reflected = parts.get("reflectance", np.array(shading.reflectance.factor, np.float32))
        emission = parts.get("emission", np.array(shading.emission.factor, np.float32))
        passing = np.clip(parts.get("passing", np.full(3, shading.passing, np.float32)), 0, 1)
        passing = np.where((emission > 0).any(axis=-1, keepdims=True), 0, passing)
        solid = 1 - passing
        reflectance = np.where(solid > FAINT, reflected / np.maximum(solid, FAINT), 0)
        if reflectance.max() >= 1 + ROUNDING:
            warn(self.warnings, place.material, "reflectance", f"its nodes reflect up to {reflectance.max():g} of the "
                 f"light: they are held to {HIGHEST}, choose a darker colour")
        passes = float(_mean(passing, inside).mean())
        tell_passing(replace(shading, passing=passes), place.material, self.warnings)
        place.columns["uv"][place.rows] = result.cells.uv()[:, order]
        self._part(place, "reflectance", np.clip(reflectance, 0, HIGHEST), result.cells)
        self._part(place, "emission", emission, result.cells)
        self._part(place, "opacity", np.where(solid < 1 - FAINT, solid, 1), result.cells)
        mean = _mean(np.clip(reflected, 0, 1), inside) / max(1 - passes, FAINT)
        self._note(place.material, shading, mean, lost, passes)

    def _part(self, place: _Place, name: str, values: Float, cells: Cells) -> None:
        """One colour (3,) or a texture (h, w, 3) into its column."""
        column = place.columns[name]
        if values.ndim == 1:
            column[place.rows] = values if column.ndim == 2 else values[0]
        else:
            column[place.rows] = 1
            place.columns[f"{name}_texture"][place.rows] = len(self.textures)
            pixels = np.array(np.maximum(values, 0), np.float32)
            cells.fill_rims(pixels)
            self.textures.append(Texture(pixels, f"{place.material} on {place.object}"))

    def _note(self, name: str, shading: Shading, reflectance: Float, lost: float, passing: float) -> None:
        """The material's row in the report; of one that many objects show, the first object's counts."""
        if name not in self.rows:
            self.rows[name] = {
                "name": name, "diffuse_reflectance": [round(float(value), 6) for value in reflectance],
                "passes": round(passing, 6), "not_carried": round(lost, 6), "reason": "; ".join(shading.reasons)}

    def _image_texture(self, colour: Colour, reflects: bool, material: str) -> Parts[int]:
        """Index of an image among the scene's textures."""
        assert colour.image is not None
        key = (colour.image.image.name_full, reflects)
        if key not in self._read:
            texture = yield from texture_parts(colour.image.image, material, self.warnings,
                                               HIGHEST if reflects else math.inf)
            self._read[key] = len(self.textures)
            self.textures.append(texture)
        return self._read[key]

    def _lay_out(self, place: _Place, item: Shown, mesh: MeshArrays, order: list[int]) -> None:
        """The coordinates in the shading's image, if it has one, of the triangles' corners."""
        image = place.shading.reflectance.image or place.shading.emission.image
        if image is not None:
            place.columns["uv"][place.rows] = self._coordinates(item, image, mesh, place.material)[:, order]

    def _coordinates(self, item: Shown, image: ImageUse, mesh: MeshArrays, material: str) -> Float:
        """(t, 3, 2) float32 coordinates in the image of the triangles' corners."""
        layer = image.uv_map or next((layer.name for layer in item.mesh.uv_layers if layer.active_render), "")
        uv = at_corners(item.mesh, mesh, layer)
        if uv is None:
            lacks = f"no UV map {layer!r}" if layer else "no UV map"
            warn(self.warnings, item.name, "texture", f"has {lacks} for image {image.image.name!r} of material "
                 f"{material!r}: the image's first pixel is used, unwrap the object")
            return np.zeros((len(mesh.triangles), 3, 2), np.float32)
        placed = uv.astype(np.float64) @ image.matrix[:, :2].T + image.matrix[:, 2]
        if not np.isfinite(placed).all():
            warn(self.warnings, item.name, "texture", f"its UV map {layer!r} has values that are not finite: "
                 "they count as 0, unwrap again")
            placed = np.nan_to_num(placed, nan=0.0, posinf=0.0, neginf=0.0)
        return np.asarray(placed, np.float32)


def _tell_shadow(material: Any, shading: Shading, warnings: Warnings) -> None:
    """Tell of what lets light through and is to throw the shadow of a solid."""
    lets_through = shading.passing > 0 or "passing" in shading.guessed_parts
    # Came with Blender 4.2's materials.
    if lets_through and not getattr(material, "use_transparent_shadow", True):
        warn(warnings, material.name, "material", "is to throw the shadow of a solid (Transparent Shadows is off): "
             "lamps shine through it here as other light does, make it opaque if they should not")


def _differs_by_side(tree: Any) -> bool:
    """Whether a material asks on which side of its faces it is seen."""
    return any(is_live(link) for node in shown_nodes(tree) if node.bl_idname == "ShaderNodeNewGeometry"
               for link in node.outputs["Backfacing"].links)


def _lost(shading: Shading, result: Evaluated, inside: NDArray[np.bool_]) -> float:
    """The part of the light that is not carried."""
    return float(_mean(result.parts["lost"], inside).mean()) if "lost" in result.parts else shading.lost


def _mean(values: Float, inside: NDArray[np.bool_]) -> Float:
    """(3,) mean of one colour (3,) or of an image where it counts."""
    if values.ndim == 1:
        return values
    weight = inside.reshape(-1).astype(np.float32)
    return np.asarray(weight @ values.reshape(-1, 3) / weight.sum())

"""What kept light depends on: sums of all shapes and reflectances, and how strong each light is.

Quick beside an export (arrays are summed as Blender holds them), so that a relight can look whether it still holds.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable
from dataclasses import asdict, dataclass, field, fields, is_dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..solver.lights import Light
from . import compat
from .digest import digest
from .knobs import knobs_of, rest_of
from .lamp_nodes import Emissions, emission_parts
from .lights import export_lights, lamp_data
from .linking import Linking
from .mesh_arrays import read
from .mesh_layers import COLOURS_MARK, UV_MARK
from .mesh_part import KINDS, active_layers
from .parts import ENDLESS, Parts, whole
from .reads import label, reads, what_is_read
from .render_walk import Clock, walk
from .shown_images import ANIMATED, images
from .sockets import Triple
from .visible import Shown, rendered_meshes
from .world import rendered_world

# Fields of lamps that say how strong they are.
STRENGTHS = frozenset({"flux", "irradiance_facing"})
# What of a mesh's attributes matters beside UV maps and colours: shape, smoothness, which material.
ATTRIBUTES = frozenset({"position", ".corner_vert", "sharp_face", "sharp_edge", "custom_normal", "material_index"})
# Component, type and count of the attributes that are read, by Blender's name of the type; the last is of normals.
TYPES = {**KINDS, "INT16_2D": ("value", np.int16, 2)}
LAYERS = frozenset({"FLOAT2", "FLOAT_COLOR", "BYTE_COLOR"})


@dataclass(frozen=True)
class Source:
    """A light: a sum of all of it but its strength, and the strengths of its parts, red, green and blue, by name."""

    shape: str
    strengths: dict[str, Triple]


@dataclass(frozen=True)
class Survey:
    """The scene at one moment.

    places, meshes : sums by object.
    materials : names by object.
    links : sums of what objects would be linked to as lights, by object, of those that are linked.
    missed : the kinds of rays that miss an object, by object, of those that are missed by any.
    read : sums of what an object's materials read of it, by object and name, of those that are read.
    lamps, surfaces, world : lights, `surfaces` by material.
    lamp_count : lamps that shine, instances counted one by one.
    """

    places: dict[str, str] = field(default_factory=dict)
    meshes: dict[str, str] = field(default_factory=dict)
    materials: dict[str, list[str]] = field(default_factory=dict)
    links: dict[str, str] = field(default_factory=dict)
    missed: dict[str, list[str]] = field(default_factory=dict)
    read: dict[str, dict[str, str]] = field(default_factory=dict)
    lamps: dict[str, Source] = field(default_factory=dict)
    surfaces: dict[str, Source] = field(default_factory=dict)
    world: Source = field(default_factory=lambda: Source("nothing", {}))
    lamp_count: int = 0

    def source(self, kind: str, name: str) -> Source | None:
        """A light of the kind "lamp", "material" or "world"; None if it is not there or off."""
        return self.world if kind == "world" else (self.lamps if kind == "lamp" else self.surfaces).get(name)

    def as_dict(self) -> dict[str, Any]:
        """As JSON holds it."""
        return asdict(self)

    @classmethod
    def of_dict(cls, kept: dict[str, Any]) -> Survey:
        """From what `as_dict` gave."""
        def source(entry: dict[str, Any]) -> Source:
            return Source(entry["shape"], {name: tuple(rgb) for name, rgb in entry["strengths"].items()})

        lights = {word: {name: source(entry) for name, entry in kept[word].items()} for word in ("lamps", "surfaces")}
        return cls(**{**kept, **lights, "world": source(kept["world"])})


def survey(scene: Any, view_layer: Any) -> Survey:
    """`survey_parts` at once."""
    return whole(survey_parts(scene, view_layer))


def survey_parts(scene: Any, view_layer: Any, part_seconds: float = ENDLESS) -> Parts[Survey]:
    """Look at a scene as a render shows it, by its own materials, whatever is shown.

    Raises
    ------
    SceneError
        As an export does.
    """
    world = rendered_world(scene, view_layer)
    emissions = yield from emission_parts(lamp_data(scene), scene, view_layer, [], part_seconds)
    looker = _Looker(emissions, world)
    yield from walk(scene, view_layer, looker.go_on, part_seconds)
    return looker.found


class _Looker:
    """Goes through what a render shows, from part to part."""

    def __init__(self, emissions: Emissions, world: Any) -> None:
        self.found = Survey()
        self._emissions, self._world = emissions, world
        self._reads: dict[str, frozenset[tuple[str, str]]] = {}
        self._done, self._lit = 0, False

    def go_on(self, depsgraph: Any, clock: Clock) -> bool:
        """Look at the lamps, then at materials, then at meshes; whether these were the last."""
        shown = rendered_meshes(depsgraph, [])
        linking = Linking(depsgraph, shown)
        if not self._lit:
            self._lit = True
            lamps = export_lights(depsgraph, linking, [], self._emissions)
            world = self._world.evaluated_get(depsgraph) if self._world is not None else None
            self.found = replace(self.found, lamps=_lamps(lamps), lamp_count=len(lamps),
                                 world=Source(rest_of(world), knobs_of(world)))
        for material in (material for item in shown for material in item.materials):
            if material is not None and material.name_full not in self.found.surfaces:
                self.found.surfaces[material.name_full] = _surface(material, depsgraph.scene.frame_current)
                self._reads[material.name_full] = reads(material)
                if clock.is_over():
                    return False
        known: dict[tuple[int, str], str] = {}
        while self._done < len(shown):
            self._add(shown[self._done], known, linking)
            self._done += 1
            if clock.is_over():
                break
        return self._done >= len(shown)

    def _add(self, item: Shown, known: dict[tuple[int, str], str], linking: Linking) -> None:
        """A mesh; `known` has sums of this dependency graph's meshes, which many objects may show."""
        def of_mesh(word: str, values: Callable[[], Any]) -> str:
            key = item.mesh.as_pointer(), word
            if key not in known:
                known[key] = digest(values())
            return known[key]

        self.found.places[item.name] = digest(np.round(item.matrix, 9))
        self.found.meshes[item.name] = of_mesh("", partial(_mesh, item.mesh))
        self.found.materials[item.name] = [material.name_full if material is not None else ""
                                           for material in item.materials]
        links = linking.of(item.original)
        if links is not None:
            self.found.links[item.name] = digest(links)
        if item.missed:
            self.found.missed[item.name] = list(item.missed)
        asked = {one for material in item.materials if material is not None for one in self._reads[material.name_full]}
        if asked:
            self.found.read[item.name] = {
                label(kind, name): of_mesh(name, value) if kind == "GEOMETRY" else digest(value())
                for kind, name in sorted(asked) for value in (partial(what_is_read, kind, name, item),)}


def _surface(material: Any, frame: int) -> Source:
    """A material; `frame` counts where it shows an image that changes with it."""
    moves = compat.uses_nodes(material) and any(image.source in ANIMATED for image in images(material.node_tree))
    return Source(digest(rest_of(material), frame if moves else None), knobs_of(material))


def _lamps(lights: tuple[Light, ...]) -> dict[str, Source]:
    """Lamps by their object's full name; its instances, and the channels of a pattern of several colours, are parts."""
    parts: dict[str, list[Light]] = defaultdict(list)
    for light in lights:
        parts[light.name].append(light)
    return {name: Source(digest([_shape(light) for light in found]),
                         {str(number): _strength(light) for number, light in enumerate(found)})
            for name, found in parts.items()}


def _strength(light: Light) -> Triple:
    red, green, blue = (float(value) for value in light.colour)
    return red, green, blue


def _shape(light: Light) -> list[Any]:
    """All fields of a lamp that say nothing of its strength; places to a nanometre, as float64 rounds on its way."""
    if not is_dataclass(light):
        return [repr(light)]
    kept = [(item.name, getattr(light, item.name)) for item in fields(light) if item.name not in STRENGTHS]
    return [type(light).__name__, *((name, np.round(value, 9) if isinstance(value, np.ndarray) else
                                     _shape(value) if isinstance(value, Light) else value) for name, value in kept)]


def _mesh(mesh: Any) -> list[Any]:
    """Names and values of what counts."""
    active = active_layers(mesh)
    ours = {mesh.get(UV_MARK, ""), *dict(mesh.get(COLOURS_MARK) or {}).values()}
    found: list[Any] = [len(mesh.vertices), len(mesh.loops), len(mesh.polygons), _starts(mesh)]
    for name in sorted(mesh.attributes.keys()):
        attribute = mesh.attributes[name]
        layer = attribute.data_type in LAYERS and name not in ours and not name.startswith(".")
        if not (name in ATTRIBUTES or layer) or attribute.data_type not in TYPES:
            continue
        values = read(attribute.data, *TYPES[attribute.data_type])
        # A layer of zeros says as little as none: such is the map that a mesh without any gets beside ours.
        if not layer or values.any():
            found += [name, attribute.domain, values, layer and name in active]
    if mesh.has_custom_normals:
        normals = np.empty(len(mesh.loops) * 3, np.float32)
        mesh.corner_normals.foreach_get("vector", normals)
        found.append(normals)
    return found


def _starts(mesh: Any) -> NDArray[np.int32]:
    starts = np.empty(len(mesh.polygons), np.int32)
    mesh.polygons.foreach_get("loop_start", starts)
    return starts

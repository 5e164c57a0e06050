"""What a lamp's nodes multiply its light with: read where they are plain, else evaluated by Cycles."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ..solver.luminaire import NATURAL, Fade, Falloff
from . import compat, lamp_render, shown_images
from .digest import digest
from .lamp_places import Place, looks, places_of
from .named_values import tell_named
from .parts import ENDLESS, Parts
from .sockets import Colour, Reader, feeding
from .warn import Warnings, warn

Float = NDArray[np.floating[Any]]

CODE = "lamp"
# Relative spread up to which a pattern is the same everywhere: a renderer's rounding.
EVEN = 1e-3
# Evaluated trees that are remembered, so that looking again at a scene that has not changed renders nothing.
MOST_KEPT = 256
# What a warning says of what nodes look at and a map of directions does not hold.
UNSEEN = {
    "length": "its nodes look at the distance to what they light (Ray Length): that counts as 1 m, use a Light Falloff "
              "node",
    "camera": "its nodes look at the camera: they see none, use another vector",
}
FADES: dict[str, Fade] = {"Quadratic": "quadratic", "Linear": "linear", "Constant": "constant"}


@dataclass(frozen=True, eq=False)
class LampEmission:
    """A lamp's nodes.

    factor : (3,) what its light is multiplied with everywhere, or where the pattern is highest.
    pattern : (h, w, 3) float32, the part of `factor` by direction; None: 1 everywhere.
    falloff : with distance.
    axes : those of the pattern's directions: the lamp's own as normals are turned into them, or as points are, which
        differs where its scale is uneven; or the world's.
    """

    factor: Float
    pattern: Float | None = None
    falloff: Falloff = NATURAL
    axes: Literal["normals", "points", "world"] = "normals"


# By the full name of the lamps' data and by their places; None stands for all.
Emissions = dict[str, dict[Place | None, LampEmission]]
# Evaluated trees, and what was to be told of them, by their digests.
_kept: dict[str, tuple[LampEmission, tuple[str, ...]]] = {}


def emission_parts(lights: Iterable[Any], scene: Any, view_layer: Any, warnings: Warnings,
                   part_seconds: float = ENDLESS) -> Parts[Emissions]:
    """The nodes of lamps, each a part. Renders, so not while rendering.

    Parameters
    ----------
    lights : bpy lights.
    scene, view_layer : that a render shows them in.
    warnings : gets what was not read as Cycles does.
    part_seconds : how long a part may take, about, where it can be cut.

    Raises
    ------
    SceneError
        If Cycles can't render a lamp's nodes, or the file of an image is missing.
    """
    found: Emissions = {}
    waiting: list[tuple[Any, Falloff, frozenset[str]]] = []
    for data in list(lights):
        emission = _read(data, warnings)
        if isinstance(emission, LampEmission):
            found[data.name_full] = {None: emission}
        else:
            waiting.append((data, emission, looks(data.node_tree)))
        yield
    placed = yield from places_of([data for data, _, seen in waiting if "place" in seen], scene, view_layer,
                                  part_seconds)
    for data, falloff, seen in waiting:
        found[data.name_full] = {}
        for place in placed.get(data.name_full, (None,)):
            found[data.name_full][place], messages = _evaluated(data, falloff, place, as_spot="uv" in seen)
            for message in messages:
                warn(warnings, data.name, CODE, message)
            yield
    return found


def _read(data: Any, warnings: Warnings) -> LampEmission | Falloff:
    """A lamp's nodes where they are plain, else its falloff, all that can be read of it."""
    if not compat.uses_nodes(data):
        return LampEmission(np.ones(3))
    output = data.node_tree.get_output_node("CYCLES")
    reader = _LampReader(data.name, warnings)
    if output is None or reader.source(output.inputs["Surface"]) is None:
        return LampEmission(np.zeros(3))
    _tell_unseen(data, reader)
    falloff = _falloff(data, reader)
    with reader.at(output.inputs["Surface"]) as source:
        if source.node.bl_idname == "ShaderNodeEmission":
            colour = reader.colour(source.node.inputs["Color"])
            strength = reader.number(source.node.inputs["Strength"])
            if not reader.guessed and colour.image is None:
                return LampEmission(np.array(colour.factor) * strength, None, falloff)
    shown_images.require(data.node_tree, f"lamp {data.name!r}")
    tell_named(data, CODE, warnings)
    shown_images.tell_animated(data.node_tree, data.name, CODE, shown_images.FIRST, warnings)
    return falloff


def _tell_unseen(data: Any, reader: _LampReader) -> None:
    """Tell of what a lamp's nodes look at and the lamp here does not know."""
    seen = looks(data.node_tree)
    for word in UNSEEN:
        if word in seen:
            reader.warn(UNSEEN[word])
    if "position" in seen and data.type in {"POINT", "SPOT"} and data.shadow_soft_size > 0:
        reader.warn("its nodes look at points of the lamp: its middle counts for all, give it a radius of 0")
    if "position" in seen and data.type == "SUN" and data.angle > 0:
        reader.warn("its nodes look at points of the sun: its middle counts for all")
    if "direction" in seen and data.type == "AREA":
        reader.warn("its nodes look at the direction of the light: that straight on counts for all")


def _evaluated(data: Any, falloff: Falloff, place: Place | None, *,
               as_spot: bool) -> tuple[LampEmission, tuple[str, ...]]:
    """A lamp's nodes as Cycles evaluates them, from memory if it has, and what to tell of them."""
    size = {"SPOT": lambda: (data.spot_size, as_spot), "AREA": lambda: (data.shape, data.size, data.size_y)}
    key = digest(data.type, size.get(data.type, tuple)(), place, data.node_tree)
    if key not in _kept:
        if len(_kept) >= MOST_KEPT:
            _kept.clear()
        if data.type == "SUN":
            _kept[key] = _sun(data, place)
        elif data.type == "AREA":
            _kept[key] = _face(data, falloff, place)
        else:
            _kept[key] = _pattern(data, falloff, place, as_spot=as_spot and data.type == "SPOT")
    return _kept[key]


def _pattern(data: Any, falloff: Falloff, place: Place | None, *,
             as_spot: bool) -> tuple[LampEmission, tuple[str, ...]]:
    """A point or spot lamp's nodes as Cycles evaluates them."""
    at = place or lamp_render.ORIGIN
    seen, distance = lamp_render.intensity_pattern(data, at, as_spot=as_spot)
    seen, messages = _finite(seen)
    pattern = np.maximum(seen / np.maximum(falloff.factor(distance), np.float32(1e-30))[..., None], 0)
    if as_spot:
        pattern = lamp_render.beyond_the_cone(pattern, at, float(data.spot_size))
    peak = pattern.max(axis=(0, 1)).astype(np.float64)
    if (np.ptp(pattern, axis=(0, 1)) <= EVEN * peak.max()).all():
        return LampEmission(pattern.mean(axis=(0, 1)).astype(np.float64), None, falloff), messages
    return LampEmission(peak, pattern / np.where(peak > 0, peak, 1).astype(np.float32), falloff,
                        "world" if place is not None else "points" if as_spot else "normals"), messages


def _sun(data: Any, place: Place | None) -> tuple[LampEmission, tuple[str, ...]]:
    """A sun's nodes as Cycles evaluates them along its axis."""
    seen, messages = _finite(lamp_render.sun_factor(data, place or lamp_render.ORIGIN))
    return LampEmission(np.maximum(seen, 0).astype(np.float64)), messages


def _finite(seen: Float) -> tuple[Float, tuple[str, ...]]:
    """Light with 0 where it is not finite, and what to tell of that."""
    if np.isfinite(seen).all():
        return seen, ()
    return (np.nan_to_num(seen, nan=0.0, posinf=0.0, neginf=0.0),
            ("its nodes give light that is not finite in some directions: it counts as none there",))


def _face(data: Any, falloff: Falloff, place: Place | None) -> tuple[LampEmission, tuple[str, ...]]:
    """An area lamp's nodes as Cycles evaluates them, the mean over its face."""
    seen = np.maximum(np.nan_to_num(lamp_render.face_pattern(data, place), nan=0.0, posinf=0.0, neginf=0.0), 0)
    # The picture is taken from a distance of 1 m.
    mean = seen.mean(axis=(0, 1)).astype(np.float64) / float(falloff.factor(np.ones(1))[0])
    varies = (np.ptp(seen, axis=(0, 1)) > EVEN * seen.max()).any()
    told = ("its light differs from place to place over its face: its mean colour is baked all over it",) * bool(varies)
    return LampEmission(mean, None, falloff), told


def _falloff(data: Any, reader: _LampReader) -> Falloff:
    """The lamp's Light Falloff node; it multiplies the light, wherever in the tree it stands."""
    used = [(node, output) for node in data.node_tree.nodes if node.bl_idname == "ShaderNodeLightFalloff"
            for output in node.outputs if any(feeding(link.to_socket) == output for link in output.links)]
    if not used:
        return NATURAL
    node, output = used[0]
    if len(used) > 1:
        reader.warn(f"it has several falloffs: {output.name} alone is baked")
    smooth = max(reader.number(node.inputs["Smooth"]), 0.0)
    if data.type == "SUN" and output.name != "Quadratic":
        reader.warn(f"its falloff ({output.name}) means nothing for a sun: it is left out")
        return NATURAL
    return Falloff(FADES[output.name], smooth if data.type != "SUN" else 0.0)


class _LampReader(Reader):
    """Reads a lamp's nodes; `guessed` tells whether they have to be evaluated."""

    def __init__(self, name: str, warnings: Warnings) -> None:
        super().__init__(name, warnings)
        self.guessed = False

    def warn(self, message: str) -> None:
        warn(self.warnings, self.material, CODE, message)

    def guess(self, message: str) -> None:
        self.guessed = True

    def colour(self, socket: Any) -> Colour:
        colour = super().colour(socket)
        self.guessed |= colour.image is not None
        return colour

    def number(self, socket: Any) -> float:
        with self.at(socket) as source:
            if source is not None and source.node.bl_idname == "ShaderNodeLightFalloff":
                return super().number(source.node.inputs["Strength"])
        return super().number(socket)

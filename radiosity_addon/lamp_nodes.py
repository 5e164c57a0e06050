"""What a lamp's nodes multiply its light with: read where they are plain, else evaluated by Cycles."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..solver.luminaire import NATURAL, Fade, Falloff
from . import compat, lamp_render, shown_images
from .digest import digest
from .named_values import tell_named
from .parts import Parts
from .sockets import Colour, Reader, feeding
from .warn import Warnings, warn

Float = NDArray[np.floating[Any]]

CODE = "lamp"
# Relative spread up to which a pattern is the same everywhere: a renderer's rounding.
EVEN = 1e-3
# Evaluated trees that are remembered, so that looking again at a scene that has not changed renders nothing.
MOST_KEPT = 256
FADES: dict[str, Fade] = {"Quadratic": "quadratic", "Linear": "linear", "Constant": "constant"}


@dataclass(frozen=True, eq=False)
class LampEmission:
    """A lamp's nodes.

    factor : (3,) what its light is multiplied with everywhere, or where the pattern is highest.
    pattern : (h, w, 3) float32, the part of `factor` by direction in the lamp's own axes; None: 1 everywhere.
    falloff : with distance.
    """

    factor: Float
    pattern: Float | None = None
    falloff: Falloff = NATURAL


Emissions = dict[str, LampEmission]
# Evaluated trees, and what was to be told of them, by their digests.
_kept: dict[str, tuple[LampEmission, tuple[str, ...]]] = {}


def emission_parts(lights: Iterable[Any], warnings: Warnings) -> Parts[Emissions]:
    """The nodes of lamps, by the full name of their data, each a part. Renders, so not while rendering.

    Parameters
    ----------
    lights : bpy lights.
    warnings : gets what was not read as Cycles does.

    Raises
    ------
    SceneError
        If Cycles can't render a lamp's nodes, or the file of an image is missing.
    """
    found: Emissions = {}
    for data in list(lights):
        found[data.name_full] = _read(data, warnings)
        yield
    return found


def _read(data: Any, warnings: Warnings) -> LampEmission:
    if not compat.uses_nodes(data):
        return LampEmission(np.ones(3))
    output = data.node_tree.get_output_node("CYCLES")
    reader = _LampReader(data.name, warnings)
    if output is None or reader.source(output.inputs["Surface"]) is None:
        return LampEmission(np.zeros(3))
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
    emission, messages = _evaluated(data, falloff)
    for message in messages:
        reader.warn(message)
    return emission


def _evaluated(data: Any, falloff: Falloff) -> tuple[LampEmission, tuple[str, ...]]:
    """A lamp's nodes as Cycles evaluates them, from memory if it has, and what to tell of them."""
    key = digest(data.type, data.node_tree)
    if key not in _kept:
        if len(_kept) >= MOST_KEPT:
            _kept.clear()
        _kept[key] = (_face if data.type == "AREA" else _pattern)(data, falloff)
    return _kept[key]


def _pattern(data: Any, falloff: Falloff) -> tuple[LampEmission, tuple[str, ...]]:
    """A point, spot or sun lamp's nodes as Cycles evaluates them."""
    messages: list[str] = []
    seen, distance = lamp_render.intensity_pattern(data)
    if not np.isfinite(seen).all():
        messages.append("its nodes give light that is not finite in some directions: it counts as none there")
        seen = np.nan_to_num(seen, nan=0.0, posinf=0.0, neginf=0.0)
    pattern = np.maximum(seen / np.maximum(falloff.factor(distance), np.float32(1e-30))[..., None], 0)
    if data.type == "SUN":
        # Its light leaves along -z alone.
        below = pattern[0].mean(axis=0)
        return LampEmission(below.astype(np.float64)), tuple(messages)
    peak = pattern.max(axis=(0, 1)).astype(np.float64)
    if (np.ptp(pattern, axis=(0, 1)) <= EVEN * peak.max()).all():
        return LampEmission(pattern.mean(axis=(0, 1)).astype(np.float64), None, falloff), tuple(messages)
    return LampEmission(peak, pattern / np.where(peak > 0, peak, 1).astype(np.float32), falloff), tuple(messages)


def _face(data: Any, falloff: Falloff) -> tuple[LampEmission, tuple[str, ...]]:
    """An area lamp's nodes as Cycles evaluates them, the mean over its face."""
    seen = np.maximum(np.nan_to_num(lamp_render.face_pattern(data), nan=0.0, posinf=0.0, neginf=0.0), 0)
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

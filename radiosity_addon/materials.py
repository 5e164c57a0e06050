"""What a material does to light, as far as diffuse light knows it: reflectance, emission, or letting light through.

Read from the node tree of the active output. What has no place in it (gloss, metal, glass) is told in a warning.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from . import compat
from .sockets import BLACK, Colour, Reader, Triple, luminance
from .warn import Warnings, warn

# What Blender shows where a slot is empty.
DEFAULT_GREY = 0.8
# A surface that passes more than this part of the light is left out of the scene, else it is opaque.
PASSES_LIGHT = 0.5


@dataclass(frozen=True)
class Shading:
    """A material as the solver needs it.

    Attributes
    ----------
    reflectance : diffuse reflectance.
    emission : radiance of each side, W / (m2 sr).
    transmittance : part of the light that goes straight on or is refracted, 0 to 1.
    """

    reflectance: Colour = BLACK
    emission: Colour = BLACK
    transmittance: float = 0.0

    @property
    def passes_light(self) -> bool:
        """Whether the surface is left out, so that light goes through; one that shines stays for its light's sake."""
        return self.transmittance > PASSES_LIGHT and self.emission.is_black


DEFAULT = Shading(Colour((DEFAULT_GREY,) * 3))


def read_material(material: Any, warnings: Warnings) -> Shading:
    """The material's shading; None (an empty slot) is Blender's default grey."""
    if material is None:
        return DEFAULT
    if not compat.uses_nodes(material):
        return _clamped(Shading(Colour(tuple(material.diffuse_color[:3]))), material.name, warnings)
    output = material.node_tree.get_output_node("CYCLES")
    reader = Reader(material.name, warnings)
    source = reader.source(output.inputs["Surface"]) if output is not None else None
    shading = _read_shader(source, reader) if source is not None else Shading()
    if output is not None and output.inputs["Displacement"].is_linked:
        warn(warnings, material.name, "material", "its displacement is not baked: apply it to the mesh")
    return _clamped(shading, material.name, warnings)


def _read_shader(socket: Any, reader: Reader) -> Shading:
    """The shading of the shader that leaves at an output socket."""
    read = SHADERS.get(socket.node.bl_idname)
    if read is None:
        reader.warn(f"its shader {socket.node.bl_label!r} is not known here and counts as black: "
                    "use Principled, Diffuse or Emission")
        return Shading()
    return read(socket.node, reader)


def _principled(node: Any, reader: Reader) -> Shading:
    _tell_bumps(node, reader)
    reflectance = reader.colour(node.inputs["Base Color"])
    strength = reader.number(node.inputs["Emission Strength"])
    emission = reader.colour(node.inputs["Emission Color"]).scaled(strength) if strength > 0 else BLACK
    metallic = reader.number(node.inputs["Metallic"])
    if metallic > 0:
        reader.warn(f"is metallic ({metallic:g}): it reflects as a matt surface of its base colour")
    transmission = reader.number(node.inputs["Transmission Weight"])
    alpha = reader.number(node.inputs["Alpha"])
    return _passing(Shading(reflectance, emission, 1 - alpha * (1 - transmission)), reader)


def _diffuse(node: Any, reader: Reader) -> Shading:
    _tell_bumps(node, reader)
    return Shading(reader.colour(node.inputs["Color"]))


def _tell_bumps(node: Any, reader: Reader) -> None:
    if reader.source(node.inputs["Normal"]) is not None:
        reader.warn("its bumps or normal map are not baked: light falls on the mesh as it is")


def _emission(node: Any, reader: Reader) -> Shading:
    return Shading(BLACK, reader.colour(node.inputs["Color"]).scaled(reader.number(node.inputs["Strength"])))


def _glossy(node: Any, reader: Reader) -> Shading:
    reader.warn(f"its shader {node.bl_label!r} reflects as a matt surface of its colour")
    return Shading(reader.colour(node.inputs["Color"]))


def _transparent(node: Any, reader: Reader) -> Shading:
    return _passing(Shading(transmittance=1.0), reader)


def _mix(node: Any, reader: Reader) -> Shading:
    factor = min(max(reader.number(node.inputs[0]), 0.0), 1.0)
    first, second = (_input_shading(node.inputs[index], reader) for index in (1, 2))
    return _sum(_scaled(first, 1 - factor), _scaled(second, factor), reader)


def _add(node: Any, reader: Reader) -> Shading:
    return _sum(_input_shading(node.inputs[0], reader), _input_shading(node.inputs[1], reader), reader)


def _input_shading(socket: Any, reader: Reader) -> Shading:
    source = reader.source(socket)
    return _read_shader(source, reader) if source is not None else Shading()


def _scaled(shading: Shading, factor: float) -> Shading:
    return Shading(shading.reflectance.scaled(factor), shading.emission.scaled(factor), shading.transmittance * factor)


def _sum(first: Shading, second: Shading, reader: Reader) -> Shading:
    return Shading(reader.sum(first.reflectance, second.reflectance), reader.sum(first.emission, second.emission),
                   min(first.transmittance + second.transmittance, 1.0))


def _passing(shading: Shading, reader: Reader) -> Shading:
    """Tell what becomes of a surface that lets part of the light through."""
    if shading.passes_light:
        reader.warn(f"lets {shading.transmittance:.0%} of the light through: its faces are left out and block nothing")
    elif shading.transmittance > 0:
        reader.warn(f"lets {shading.transmittance:.0%} of the light through: it counts as opaque")
    return shading


SHADERS: dict[str, Callable[[Any, Reader], Shading]] = {
    "ShaderNodeBsdfPrincipled": _principled,
    "ShaderNodeBsdfDiffuse": _diffuse,
    "ShaderNodeEmission": _emission,
    "ShaderNodeBsdfGlossy": _glossy,
    "ShaderNodeBsdfAnisotropic": _glossy,
    "ShaderNodeBsdfMetallic": lambda node, reader: _metal(node, reader),
    "ShaderNodeBsdfSheen": _glossy,
    "ShaderNodeBsdfToon": _glossy,
    "ShaderNodeSubsurfaceScattering": _glossy,
    "ShaderNodeBsdfTransparent": _transparent,
    "ShaderNodeBsdfGlass": _transparent,
    "ShaderNodeBsdfRefraction": _transparent,
    "ShaderNodeMixShader": _mix,
    "ShaderNodeAddShader": _add,
}


def _metal(node: Any, reader: Reader) -> Shading:
    reader.warn(f"its shader {node.bl_label!r} reflects as a matt surface of its base colour")
    return Shading(reader.colour(node.inputs["Base Color"]))


def _clamped(shading: Shading, name: str, warnings: Warnings) -> Shading:
    """Reflectance held to 1 at most, emission to 0 at least: more light out than in has no answer."""
    factor = np.asarray(shading.reflectance.factor)
    if shading.reflectance.image is None and (factor >= 1).any():
        warn(warnings, name, "reflectance",
             f"its base colour ({_numbers(shading.reflectance.factor)}) reflects all light or more: it is held to "
             f"{HIGHEST}, choose a darker one")
    if (factor < 0).any():
        warn(warnings, name, "reflectance",
             f"its base colour ({_numbers(shading.reflectance.factor)}) is negative: it is held to 0, choose another")
    if (np.asarray(shading.emission.factor) < 0).any():
        warn(warnings, name, "emission",
             f"its emission ({_numbers(shading.emission.factor)}) is negative: it is held to 0, choose another")
    held = shading.reflectance.clipped(0.0, HIGHEST if shading.reflectance.image is None else 1.0)
    return replace(shading, reflectance=held, emission=shading.emission.clipped(0.0, np.inf))


# Highest reflectance of a material: at 1 a closed room has no solution.
HIGHEST = 0.999


def _numbers(values: Triple) -> str:
    return ", ".join(f"{value:g}" for value in values)


def emits(shading: Shading) -> bool:
    """Whether any light leaves the material by itself."""
    return luminance(shading.emission) > 0

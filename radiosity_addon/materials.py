"""What a material does to light, as far as diffuse light knows it: what it reflects, sends out, and lets through.

Read from the node tree of the active output. What has no place in it (gloss, metal, refraction) is told in a warning
and counted in `lost`. What can't be read without evaluating nodes is guessed; `guesses` then says what, and `evaluate`
puts what Cycles makes of the nodes in place of the guess.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from . import compat
from .constants import mean_coat, mean_fresnel
from .sockets import BLACK, Colour, Reader, Triple, luminance
from .warn import Warnings, warn

# What Blender shows where a slot is empty.
DEFAULT_GREY = 0.8
# A surface that passes more than this part of the light counts as glass.
PASSES_LIGHT = 0.5
# A surface that stops less than this part of the light is left out of the scene.
FAINT = 1e-3
# Highest reflectance of a material: at 1 a closed room has no solution.
HIGHEST = 0.999
# What of a material may have to be evaluated; a factor between shaders belongs to all of them.
PARTS = ("reflectance", "emission", "passing", "lost")
ALL = "all"


@dataclass(frozen=True)
class Shading:
    """A material as the solver needs it.

    Attributes
    ----------
    reflectance : part of the light that comes that is sent back.
    emission : radiance of each side, W / (m2 sr).
    passing : part of the light that goes on behind the surface, 0 to 1.
    lost : part of the light that comes that is sent on by other than diffuse reflection, and where: reasons.
    refracted : part of the light that goes on changed: bent, scattered or tinted.
    guesses : (part, message) of what was guessed.
    """

    reflectance: Colour = BLACK
    emission: Colour = BLACK
    passing: float = 0.0
    lost: float = 0.0
    refracted: float = 0.0
    reasons: tuple[str, ...] = ()
    guesses: tuple[tuple[str, str], ...] = field(default=())

    @property
    def guessed_parts(self) -> frozenset[str]:
        """The parts that were guessed and are not known to be zero."""
        whole = any(part == ALL for part, _ in self.guesses)
        there = {"reflectance": not self.reflectance.is_black, "emission": not self.emission.is_black,
                 "passing": self.passing > 0, "lost": self.lost > 0}
        return frozenset({part for part, _ in self.guesses if part != ALL}
                         | ({part for part in PARTS if there[part]} if whole else set()))

    @property
    def opacity(self) -> float:
        """Part of the rays that the surface stops; one that shines stops all, for its light's sake."""
        return 1 - self.passing if self.emission.is_black else 1.0

    @property
    def passes_light(self) -> bool:
        """Whether the surface is left out, so that light goes through."""
        return self.opacity < FAINT and "passing" not in self.guessed_parts


DEFAULT = Shading(Colour((DEFAULT_GREY,) * 3))


class MaterialReader(Reader):
    """A reader that keeps its guesses apart from its warnings: Cycles may know better."""

    def __init__(self, material: str, warnings: Warnings) -> None:
        super().__init__(material, warnings)
        self.guesses: list[tuple[str, str]] = []
        self._part = ALL

    def guess(self, message: str) -> None:
        """Keep what was guessed, and for what."""
        if (self._part, message) not in self.guesses:
            self.guesses.append((self._part, message))

    def weight(self, socket: Any) -> float:
        """A number in 0 ... 1 that all parts are multiplied by; the rest of the light goes through."""
        before = len(self.guesses)
        value = _unit(self.number(socket))
        self.guesses += [("passing", message) for _, message in self.guesses[before:]]
        return value

    @contextmanager
    def part(self, name: str) -> Iterator[None]:
        """What is guessed meanwhile concerns this part alone."""
        before, self._part = self._part, name
        yield
        self._part = before


def read_material(material: Any, warnings: Warnings) -> Shading:
    """The material's shading, before `settled`; None (an empty slot) is Blender's default grey."""
    if material is None:
        return DEFAULT
    if not compat.uses_nodes(material):
        return Shading(Colour(tuple(material.diffuse_color[:3])))
    output = material.node_tree.get_output_node("CYCLES")
    reader = MaterialReader(material.name, warnings)
    shading = _read_output(output, reader) if output is not None else Shading()
    if _two_layouts(shading):
        reader.guess("lays its base colour and its emission out differently: both are laid out as the base colour")
    return replace(shading, guesses=tuple(reader.guesses))


def _read_output(output: Any, reader: MaterialReader) -> Shading:
    """The shading of what is linked to a material's output; a mere volume has no surface that stops light."""
    if reader.source(output.inputs["Displacement"]) is not None:
        reader.warn("its displacement is not baked: apply it to the mesh")
    shading = _input_shading(output.inputs["Surface"], reader)
    if reader.source(output.inputs["Volume"]) is None:
        return shading
    reader.warn("its volume is not baked: light goes through it as through air")
    return Shading(passing=1.0) if reader.source(output.inputs["Surface"]) is None else shading


def _two_layouts(shading: Shading) -> bool:
    first, second = shading.reflectance.image, shading.emission.image
    return first is not None and second is not None and (
        first.uv_map != second.uv_map or not np.array_equal(first.matrix, second.matrix))


def _read_shader(socket: Any, reader: MaterialReader) -> Shading:
    """The shading of the shader that leaves at an output socket."""
    read = SHADERS.get(socket.node.bl_idname)
    if read is None:
        reader.warn(f"its shader {socket.node.bl_label!r} is not known here and counts as black: "
                    "use Principled, Diffuse or Emission")
        return Shading(reasons=(f"{socket.node.bl_label} is not known",))
    return read(socket.node, reader)


def _principled(node: Any, reader: MaterialReader) -> Shading:
    _tell_bumps(node, reader)
    with reader.part("reflectance"):
        reflectance = reader.colour(node.inputs["Base Color"]).tinted(_coat(node, reader))
    with reader.part("emission"):
        strength = reader.number(node.inputs["Emission Strength"])
        emission = reader.colour(node.inputs["Emission Color"]).scaled(strength) if strength > 0 else BLACK
        if not emission.is_black:
            emission = emission.tinted(_coat(node, reader))
    with reader.part("lost"):
        metallic = _unit(reader.number(node.inputs["Metallic"]))
    alpha = reader.weight(node.inputs["Alpha"])
    transmission = reader.weight(node.inputs["Transmission Weight"]) * (1 - metallic)
    mirrored = mean_fresnel(specular_ior(_setting(node.inputs["IOR"]), _setting(node.inputs["Specular IOR Level"])))
    solid = alpha * (1 - transmission)
    lost = alpha * (metallic * luminance(reflectance) + (1 - metallic) * mirrored) + alpha * transmission
    reasons = []
    if metallic > 0:
        reader.warn(f"is metallic ({metallic:g}): it reflects as a matt surface of its base colour")
        reasons.append(f"metal reflects as a matt surface of its base colour (metallic {metallic:g})")
    if metallic < 1 and mirrored > 0:
        reasons.append("gloss on top of the base colour is left out")
    if transmission > 0:
        reasons.append("light goes straight through where it would be refracted")
    if _setting(node.inputs["Subsurface Weight"]) > 0:
        reasons.append("subsurface scattering counts as reflection where the light comes in")
    return Shading(reflectance.scaled(solid), emission.scaled(alpha), 1 - solid, min(lost, 1.0), alpha * transmission,
                   tuple(reasons))


def _coat(node: Any, reader: MaterialReader) -> Triple:
    """What a Principled's coat tints the light from below with."""
    weight = _unit(reader.number(node.inputs["Coat Weight"]))
    if weight == 0:
        return 1.0, 1.0, 1.0
    tint = reader.colour(node.inputs["Coat Tint"])
    if tint.image is not None:
        reader.guess("the tint of its coat is an image, which is not evaluated: white is used")
    return mean_coat(weight, tint.factor, _setting(node.inputs["Coat IOR"]))


def specular_ior(ior: float, level: float) -> float:
    """The index that Principled's gloss has after its Specular IOR Level, a factor of 2 level on F(0)."""
    normal = ((ior - 1) / (ior + 1)) ** 2 * 2 * max(level, 0.0)
    root = min(float(np.sqrt(normal)), 0.99)
    return (1 + root) / (1 - root)


def _diffuse(node: Any, reader: MaterialReader) -> Shading:
    _tell_bumps(node, reader)
    with reader.part("reflectance"):
        return Shading(reader.colour(node.inputs["Color"]))


def _tell_bumps(node: Any, reader: MaterialReader) -> None:
    if reader.source(node.inputs["Normal"]) is not None:
        reader.warn("its bumps or normal map are not baked: light falls on the mesh as it is")


def _emission(node: Any, reader: MaterialReader) -> Shading:
    with reader.part("emission"):
        return Shading(BLACK, reader.colour(node.inputs["Color"]).scaled(reader.number(node.inputs["Strength"])))


def _as_matt(node: Any, reader: MaterialReader, name: str = "Color") -> Shading:
    """A lobe that is not diffuse, with all its light sent back diffusely."""
    reader.warn(f"its shader {node.bl_label!r} reflects as a matt surface of its colour")
    with reader.part("reflectance"):
        colour = reader.colour(node.inputs[name])
    return Shading(colour, lost=min(luminance(colour), 1.0),
                   reasons=(f"{node.bl_label} reflects as a matt surface of its colour",))


def _scattering(node: Any, reader: MaterialReader) -> Shading:
    """Subsurface scattering: what comes out again comes out diffusely, though elsewhere."""
    return replace(_as_matt(node, reader), lost=0.0)


def _metal(node: Any, reader: MaterialReader) -> Shading:
    if getattr(node, "fresnel_type", "F82") == "F82":
        return _as_matt(node, reader, "Base Color")
    reader.warn(f"its shader {node.bl_label!r} reflects as a matt surface of its colour")
    index, absorbed = (np.array(node.inputs[name].default_value[:3]) for name in ("IOR", "Extinction"))
    if any(reader.source(node.inputs[name]) is not None for name in ("IOR", "Extinction")):
        reader.warn("the optical constants of its Metallic BSDF are linked: the node's own values are used")
    colour = Colour(tuple(((index - 1) ** 2 + absorbed**2) / ((index + 1) ** 2 + absorbed**2)))
    return Shading(colour, lost=min(luminance(colour), 1.0), reasons=("metal reflects as a matt surface",))


def _transparent(node: Any, reader: MaterialReader) -> Shading:
    colour = _through(node, reader)
    tinted = max(colour) - min(colour) > FAINT
    return Shading(passing=_unit(float(np.mean(colour))), refracted=_unit(float(np.mean(colour))) if tinted else 0.0,
                   reasons=("its tint of what goes through is left out",) if tinted else ())


def _glass(node: Any, reader: MaterialReader) -> Shading:
    part = _unit(float(np.mean(_through(node, reader))))
    return Shading(passing=part, lost=part, refracted=part,
                   reasons=(f"light goes straight through {node.bl_label} where it would be refracted or mirrored",))


def _through(node: Any, reader: MaterialReader) -> Triple:
    with reader.part("passing"):
        return reader.colour(node.inputs["Color"]).factor


def _mix(node: Any, reader: MaterialReader) -> Shading:
    factor = _unit(reader.number(node.inputs[0]))
    first, second = (_input_shading(node.inputs[index], reader) for index in (1, 2))
    if reader.source(node.inputs[0]) is not None and any(part == ALL for part, _ in reader.guesses):
        factor = min(max(factor, FAINT), 1 - FAINT)  # both may be there: neither counts as known to be zero
    return _sum(_scaled(first, 1 - factor), _scaled(second, factor), reader)


def _add(node: Any, reader: MaterialReader) -> Shading:
    return _sum(_input_shading(node.inputs[0], reader), _input_shading(node.inputs[1], reader), reader)


def _input_shading(socket: Any, reader: MaterialReader) -> Shading:
    with reader.at(socket) as source:
        return _read_shader(source, reader) if source is not None else Shading()


def _scaled(shading: Shading, factor: float) -> Shading:
    return Shading(shading.reflectance.scaled(factor), shading.emission.scaled(factor), shading.passing * factor,
                   shading.lost * factor, shading.refracted * factor, shading.reasons if factor > 0 else ())


def _sum(first: Shading, second: Shading, reader: MaterialReader) -> Shading:
    with reader.part("reflectance"):
        reflectance = reader.sum(first.reflectance, second.reflectance)
    with reader.part("emission"):
        emission = reader.sum(first.emission, second.emission)
    reasons = first.reasons + tuple(reason for reason in second.reasons if reason not in first.reasons)
    return Shading(reflectance, emission, min(first.passing + second.passing, 1.0),
                   min(first.lost + second.lost, 1.0), min(first.refracted + second.refracted, 1.0), reasons)


def _unit(value: float) -> float:
    return min(max(value, 0.0), 1.0)


def _setting(socket: Any) -> float:
    """A socket's own value, linked or not: for what only the report counts."""
    return float(socket.default_value)


SHADERS: dict[str, Callable[[Any, MaterialReader], Shading]] = {
    "ShaderNodeBsdfPrincipled": _principled,
    "ShaderNodeBsdfDiffuse": _diffuse,
    "ShaderNodeEmission": _emission,
    "ShaderNodeBsdfGlossy": _as_matt,
    "ShaderNodeBsdfAnisotropic": _as_matt,
    "ShaderNodeBsdfMetallic": _metal,
    "ShaderNodeBsdfSheen": _as_matt,
    "ShaderNodeBsdfToon": _as_matt,
    "ShaderNodeBsdfTranslucent": _as_matt,
    "ShaderNodeSubsurfaceScattering": _scattering,
    "ShaderNodeBsdfTransparent": _transparent,
    "ShaderNodeBsdfGlass": _glass,
    "ShaderNodeBsdfRefraction": _glass,
    "ShaderNodeMixShader": _mix,
    "ShaderNodeAddShader": _add,
}


def settled(shading: Shading, name: str, warnings: Warnings) -> Shading:
    """The shading with the reflectance of what is solid of the surface, within what can be solved; and what to tell."""
    for _, message in shading.guesses:
        warn(warnings, name, "material", message)
    tell_passing(shading, name, warnings)
    if shading.passes_light:
        return replace(shading, reflectance=BLACK)
    solid = shading.opacity
    reflectance = shading.reflectance.scaled(1 / solid) if solid > FAINT else Colour((HIGHEST,) * 3)
    return _clamped(replace(shading, reflectance=reflectance), name, warnings)


def tell_passing(shading: Shading, name: str, warnings: Warnings) -> None:
    """Tell what becomes of a surface that lets light through, where that is not what Cycles does."""
    part = f"lets {shading.passing:.0%} of the light through"
    if shading.passes_light:
        warn(warnings, name, "material", f"{part}: its faces are left out and block nothing")
    elif shading.passing > 0 and shading.opacity == 1:
        warn(warnings, name, "material", f"{part} and shines: it counts as opaque")
    elif shading.refracted > 0:
        warn(warnings, name, "material", f"{part}: it goes straight on, not refracted, scattered or tinted")


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


def _numbers(values: Triple) -> str:
    return ", ".join(f"{value:g}" for value in values)

"""False colours: a scale from dark blue over green to red with isolines, as a node group and as numbers.

Isolines are drawn where the value is a multiple of the step; their width is a part of the step, so they are wide
where the value changes slowly.
"""

from __future__ import annotations

import math
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ..solver.quantities import LUMINANCE, LUMINOUS_EFFICACY
from .baked_light import VIEW_MARK, add
from .images import srgb_to_linear
from .unlit import only_shader

Float = NDArray[np.floating[Any]]

# sRGB colours at equal distances along the scale, 0 ... 1.
PALETTE = np.array([
    (0.06, 0.04, 0.28), (0.10, 0.25, 0.72), (0.08, 0.55, 0.85), (0.12, 0.72, 0.58), (0.45, 0.82, 0.25),
    (0.93, 0.88, 0.20), (0.96, 0.60, 0.12), (0.86, 0.25, 0.10), (0.55, 0.05, 0.10)])
# An automatic scale goes no further than this times the mean over the whole area: a lamp's own spot would take it all.
SPAN = 3.0
# About so many isolines over the scale.
STEPS = 10
# Half the width of an isoline, as part of the step, and what it leaves of the colour.
LINE, LINE_SHADE = 0.035, 0.15
# Shading of maps without isolines: its strength, and the unit direction that is brightest.
SHADING, FROM = 0.25, (0.36, -0.48, 0.8)
GROUP, RANGE, STEP = "Radiosity False Colors", "range", "step"


def nice_step(span: float) -> float:
    """1, 2, 2.5 or 5 times a power of ten, so that about `STEPS` fit into the span."""
    rough = max(span, 1e-12) / STEPS
    power = 10.0 ** math.floor(math.log10(rough))
    return power * next((factor for factor in (1, 2, 2.5, 5) if factor * power >= rough * 0.999), 10)


def nice_top(value: float) -> float:
    """The end of a scale from 0 that holds a value: a whole number of nice steps."""
    step = nice_step(max(value, 1e-9))
    return step * math.ceil(max(value, 1e-9) / step - 1e-6)


def ticks(low: float, high: float, step: float) -> list[float]:
    """The values of the isolines inside a scale, and its ends."""
    first = math.ceil(low / step + 1e-6)
    inner = [number * step for number in range(first, math.floor(high / step) + 1)]
    return [low, *(value for value in inner if low + step / 4 < value < high - step / 4), high]


def number(value: float) -> str:
    """Four digits for people, without an exponent."""
    return f"{value:.0f}" if abs(value) >= 1000 else f"{value:.4g}" if abs(value) >= 1e-3 or value == 0 else "0"


def colour(part: Float) -> Float:
    """sRGB (n, 3) at parts (n,) of the scale, 0 ... 1."""
    stops = np.linspace(0, 1, len(PALETTE))
    return np.stack([np.interp(part, stops, PALETTE[:, axis]) for axis in range(3)], axis=-1)


def set_scale(low: float, high: float, step: float) -> None:
    """Change the scale of what is shown."""
    for tree in bpy.data.node_groups:
        if VIEW_MARK in tree and RANGE in tree.nodes:
            tree.nodes[RANGE].inputs["From Min"].default_value = low
            tree.nodes[RANGE].inputs["From Max"].default_value = high
            tree.nodes[STEP].inputs[1].default_value = step


def material_of_light(light: Any, scale: Any) -> Any:
    """A material that shows the illuminance of a baked light (its group) on a scale (the group of `scale_group`)."""
    # The light is the radiance of a white surface, E / pi.
    weights = LUMINANCE.astype(float) * LUMINOUS_EFFICACY * math.pi

    def value(tree: Any) -> Any:
        source = add(tree, "ShaderNodeGroup", -400, node_tree=light)
        dot = add(tree, "ShaderNodeVectorMath", -200, operation="DOT_PRODUCT")
        dot.inputs[1].default_value = tuple(weights)
        tree.links.new(source.outputs["Light"], dot.inputs[0])
        return dot.outputs["Value"]

    return _material(scale, value)


def material_of_attribute(name: str, scale: Any, shaded: bool = False) -> Any:
    """A material that shows a float attribute on a scale, with a hint of shading if asked, so that shapes stand out."""
    return _material(scale, lambda tree: add(tree, "ShaderNodeAttribute", -200, attribute_type="GEOMETRY",
                                             attribute_name=name).outputs["Fac"], shaded)


def _material(scale: Any, value: Any, shaded: bool = False) -> Any:
    made = bpy.data.materials.new("Radiosity False Colors")
    made[VIEW_MARK] = True
    made.cycles.emission_sampling = "NONE"

    def shader(tree: Any) -> Any:
        group, emission = add(tree, "ShaderNodeGroup", 0, node_tree=scale), add(tree, "ShaderNodeEmission", 150)
        tree.links.new(value(tree), group.inputs["Value"])
        tree.links.new(group.outputs["Color"], emission.inputs["Color"])
        if shaded:
            tree.links.new(_shading(tree), emission.inputs["Strength"])
        return emission.outputs["Emission"]

    only_shader(made, shader)
    return made


def _shading(tree: Any) -> Any:
    """A factor from `1 - 2 SHADING` to 1 by the way a surface faces."""
    facing = add(tree, "ShaderNodeVectorMath", operation="DOT_PRODUCT")
    facing.inputs[1].default_value = FROM
    factor = add(tree, "ShaderNodeMath", operation="MULTIPLY_ADD")
    factor.inputs[1].default_value, factor.inputs[2].default_value = SHADING, 1 - SHADING
    tree.links.new(add(tree, "ShaderNodeNewGeometry").outputs["Normal"], facing.inputs[0])
    tree.links.new(facing.outputs["Value"], factor.inputs[0])
    return factor.outputs[0]


def scale_group(low: float, high: float, step: float, isolines: bool = True) -> Any:
    """A node group from a value to its colour, with isolines unless values are steps themselves."""
    tree = bpy.data.node_groups.new(GROUP, "ShaderNodeTree")
    tree[VIEW_MARK] = True
    tree.interface.new_socket("Value", in_out="INPUT", socket_type="NodeSocketFloat")
    tree.interface.new_socket("Color", in_out="OUTPUT", socket_type="NodeSocketColor")
    value = add(tree, "NodeGroupInput", -600).outputs["Value"]
    part, ramp = add(tree, "ShaderNodeMapRange", -400, name=RANGE), add(tree, "ShaderNodeValToRGB", -200)
    _fill(ramp.color_ramp)
    tree.links.new(value, part.inputs["Value"])
    tree.links.new(part.outputs["Result"], ramp.inputs["Fac"])
    shade = add(tree, "ShaderNodeVectorMath", 400, operation="SCALE")
    shade.inputs["Scale"].default_value = 1.0
    tree.links.new(ramp.outputs["Color"], shade.inputs[0])
    lines = _isolines(tree, value)
    if isolines:
        tree.links.new(lines, shade.inputs["Scale"])
    out = add(tree, "NodeGroupOutput", 600)
    tree.links.new(shade.outputs["Vector"], out.inputs["Color"])
    set_scale(low, high, step)
    return tree


def _fill(ramp: Any) -> None:
    """Put the palette into a colour ramp."""
    colours = srgb_to_linear(PALETTE)
    stops = np.linspace(0, 1, len(colours))
    ramp.elements[0].position, ramp.elements[1].position = 0.0, 1.0
    for stop in stops[1:-1]:
        ramp.elements.new(float(stop))
    for element, rgb in zip(ramp.elements, colours, strict=True):
        element.color = (*rgb.tolist(), 1.0)


def _isolines(tree: Any, value: Any) -> Any:
    """A factor on the colour: `LINE_SHADE` on isolines, 1 elsewhere."""
    def node(operation: str, first: Any, second: float | None = None) -> Any:
        made = add(tree, "ShaderNodeMath", operation=operation)
        tree.links.new(first, made.inputs[0])
        if second is not None:
            made.inputs[1].default_value = second
        return made

    steps = node("DIVIDE", value, 1.0)
    steps.name = STEP
    # How far the nearest multiple of the step is, in steps; there is no line at 0.
    near = node("LESS_THAN", node("PINGPONG", steps.outputs[0], 0.5).outputs[0], LINE)
    above = node("GREATER_THAN", steps.outputs[0], 0.5)
    line = node("MULTIPLY", near.outputs[0])
    tree.links.new(above.outputs[0], line.inputs[1])
    part = node("MULTIPLY_ADD", line.outputs[0], LINE_SHADE - 1)
    part.inputs[2].default_value = 1.0
    return part.outputs[0]

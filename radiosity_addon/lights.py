"""Blender's lamps as the solver's, with the power, size and shape that Cycles gives them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..solver.area_lamp import Area
from ..solver.lamps import Point, Sun
from ..solver.lights import Light
from ..solver.spot import Spot
from .sockets import Colour, Reader
from .warn import Warnings, warn

Float = NDArray[np.floating[Any]]

CODE = "lamp"
# Cosine between the sides of an area lamp above which it counts as sheared.
SHEAR = 1e-3


def export_lights(depsgraph: Any, warnings: Warnings) -> tuple[Light, ...]:
    """The lamps that are rendered, instances included.

    Parameters
    ----------
    depsgraph : evaluated bpy dependency graph.
    warnings : gets a warning, with the lamp's name, for all that is not baked as Cycles renders it.

    Returns
    -------
    Lamps in world space, in the order of the dependency graph; those that send nothing are left out.
    """
    lights = []
    for instance in depsgraph.object_instances:
        lamp = instance.object
        if lamp.type != "LIGHT" or not instance.show_self or lamp.hide_render:
            continue
        light = _export(lamp, np.array(instance.matrix_world, np.float64), warnings)
        if light is not None:
            lights.append(light)
    return tuple(lights)


def _export(lamp: Any, matrix: Float, warnings: Warnings) -> Light | None:
    name, data = lamp.name, lamp.data
    if data.type == "AREA" and _cycles(data, "is_portal"):
        return None  # it guides Cycles' samples and sends nothing
    if not _lights_diffuse_surfaces(lamp, warnings):
        return None
    strength = _strength(name, data, warnings)
    if not strength.any():
        return None
    if (strength < 0).any() or not np.isfinite(strength).all():
        warn(warnings, name, CODE, f"its power ({', '.join(f'{value:g}' for value in strength)}) is negative or not "
             "finite: it is left out, give it a power from 0")
        return None
    if abs(np.linalg.det(matrix[:3, :3])) == 0 and data.type != "POINT":
        warn(warnings, name, CODE, "its scale is 0 along an axis: it is left out, give it a scale that is not 0")
        return None
    return MAKERS[data.type](name, data, matrix, strength, warnings)


def _sun(name: str, data: Any, matrix: Float, strength: Float, warnings: Warnings) -> Light:
    disc = np.pi * np.sin(data.angle / 2) ** 2 if data.angle > 0 else 1.0
    return Sun(name, -matrix[:3, 2], strength if _is_normalised(data) else strength * disc, float(data.angle))


def _point(name: str, data: Any, matrix: Float, strength: Float, warnings: Warnings) -> Light:
    return Point(name, matrix[:3, 3], _flux_of_ball(data, strength), float(data.shadow_soft_size), _is_sphere(data))


def _spot(name: str, data: Any, matrix: Float, strength: Float, warnings: Warnings) -> Light:
    frame = matrix[:3, :3]
    return Spot(name, matrix[:3, 3], _flux_of_ball(data, strength), float(data.shadow_soft_size), _is_sphere(data),
                direction=-frame[:, 2], spot_size=float(data.spot_size), blend=float(data.spot_blend), frame=frame)


def _area(name: str, data: Any, matrix: Float, strength: Float, warnings: Warnings) -> Light | None:
    round_ = data.shape in {"DISK", "ELLIPSE"}
    axis_u = matrix[:3, 0] * data.size
    axis_v = matrix[:3, 1] * (data.size_y if data.shape in {"RECTANGLE", "ELLIPSE"} else data.size)
    area = np.linalg.norm(axis_u) * np.linalg.norm(axis_v) * (np.pi / 4 if round_ else 1.0)
    if area == 0:
        warn(warnings, name, CODE, "its area is 0: it is left out, give it a size that is not 0")
        return None
    if not round_ and abs(axis_u @ axis_v) > SHEAR * area:
        # Cycles' own sampling takes the sides for perpendicular; its ellipses are right.
        warn(warnings, name, CODE, "its sides are not at right angles (a parent's scale shears it): it is baked as the "
             "parallelogram with all of its power, which Cycles does not render; apply the parent's scale")
    # It shines along -z; the solver's lamp along u x v. A mirrored matrix has them the other way round.
    if np.cross(axis_u, axis_v) @ matrix[:3, 2] > 0:
        axis_u, axis_v = axis_v, axis_u
    flux = strength if _is_normalised(data) else strength * area
    return Area(name, matrix[:3, 3], axis_u, axis_v, flux, round_, float(data.spread))


MAKERS: dict[str, Callable[[str, Any, Float, Float, Warnings], Light | None]] = {
    "SUN": _sun,
    "POINT": _point,
    "SPOT": _spot,
    "AREA": _area,
}


def _strength(name: str, data: Any, warnings: Warnings) -> Float:
    """(3,) float64: the lamp's colour times its power (W, or W/m2 of a sun), with all that multiplies it."""
    strength = np.array(data.color, np.float64) * data.energy
    # Exposure and temperature came with Blender 4.5.
    strength *= 2.0 ** getattr(data, "exposure", 0.0)
    if getattr(data, "use_temperature", False):
        strength *= np.array(data.temperature_color, np.float64)
    return np.asarray(strength * _node_factor(name, data, warnings))


def _node_factor(name: str, data: Any, warnings: Warnings) -> Float:
    """(3,) colour times strength of the lamp's Emission node; 1 without nodes."""
    if not data.use_nodes or data.node_tree is None:
        return np.ones(3)
    output = data.node_tree.get_output_node("CYCLES")
    reader = _LampReader(name, warnings)
    source = reader.source(output.inputs["Surface"]) if output is not None else None
    if source is None:
        return np.zeros(3)
    if source.node.bl_idname != "ShaderNodeEmission":
        reader.warn(f"its shader {source.node.bl_label!r} is not evaluated: it is left out, use Emission")
        return np.zeros(3)
    colour = reader.colour(source.node.inputs["Color"])
    return np.array(colour.factor) * reader.number(source.node.inputs["Strength"])


class _LampReader(Reader):
    """Reads a lamp's nodes; an image or a falloff has no place in them."""

    def warn(self, message: str) -> None:
        warn(self.warnings, self.material, CODE, message)

    def colour(self, socket: Any) -> Colour:
        colour = super().colour(socket)
        if colour.image is None:
            return colour
        flat = socket.default_value
        self.warn(f"its image {colour.image.image.name!r} is not projected: the socket's own colour is used")
        return Colour((flat[0], flat[1], flat[2]))

    def number(self, socket: Any) -> float:
        source = self.source(socket)
        if source is None or source.node.bl_idname != "ShaderNodeLightFalloff":
            return super().number(socket)
        if source.name != "Quadratic" or super().number(source.node.inputs["Smooth"]) > 0:
            self.warn(f"its falloff ({source.name}) is baked as quadratic without smoothing, as real light falls off")
        return super().number(source.node.inputs["Strength"])


def _lights_diffuse_surfaces(lamp: Any, warnings: Warnings) -> bool:
    """Whether the lamp counts for lightmaps; tells of what Cycles would do with it and a bake does not."""
    if not lamp.visible_diffuse:
        warn(warnings, lamp.name, CODE, "it is hidden from diffuse rays (Ray Visibility): it is left out")
        return False
    if not lamp.data.use_shadow:
        warn(warnings, lamp.name, CODE, "it is set to cast no shadow: its light is baked with shadows")
    linking = getattr(lamp, "light_linking", None)
    if linking is not None and (linking.receiver_collection or linking.blocker_collection):
        warn(warnings, lamp.name, CODE, "it is linked to some objects (Light Linking): it is baked on all")
    return True


def _flux_of_ball(data: Any, strength: Float) -> Float:
    """What the solver calls the flux of a point or spot lamp; not normalised, its power is meant per area."""
    if _is_normalised(data):
        return strength
    return strength * (4 * np.pi * data.shadow_soft_size**2 if data.shadow_soft_size > 0 else 4.0)


def _is_normalised(data: Any) -> bool:
    # Came with Blender 4.5; before that, power was always the whole lamp's.
    return bool(getattr(data, "normalize", True))


def _is_sphere(data: Any) -> bool:
    return not data.use_soft_falloff


def _cycles(data: Any, name: str) -> bool:
    """A setting of Cycles' own; False where that add-on is turned off."""
    return bool(getattr(getattr(data, "cycles", None), name, False))

"""Blender's lamps as the solver's, with the power, size and shape that Cycles gives them."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ..solver.area_lamp import Area
from ..solver.lamps import Point, Sun
from ..solver.lights import Light
from ..solver.linking import FREE, Linked
from ..solver.luminaire import NATURAL, Luminaire
from ..solver.spot import Spot
from .lamp_nodes import CODE, Emissions, LampEmission
from .lamp_places import is_rendered, lights_diffuse_surfaces, place_of
from .linking import Linking
from .warn import Warnings, warn

Float = NDArray[np.floating[Any]]

# Cosine between the sides of an area lamp, or sine between its face and its direction, above which it is sheared.
SHEAR = 1e-3
# Difference of a pattern's channels, relative to its peak, up to which it has one colour.
ONE_COLOUR = 1e-2
# Fewer bounces than this that a lamp's light may make are told of; diffuse light of more is faint.
FEW_BOUNCES = 8
# What leads from a scene to a light: nodes and particles instance objects and collections that are in no scene.
ON_THE_WAY = {"COLLECTION", "LIGHT", "NODETREE", "OBJECT", "PARTICLE"}


def export_lights(depsgraph: Any, linking: Linking, warnings: Warnings,
                  emissions: Emissions | None = None) -> tuple[Light, ...]:
    """The lamps that are rendered, instances included.

    Parameters
    ----------
    depsgraph : evaluated bpy dependency graph.
    linking : of the same.
    emissions : what the nodes of the lamps give, see `lamp_nodes`; None: as if they had none.
    warnings : gets a warning, with the lamp's name, for all that is not baked as Cycles renders it.

    Returns
    -------
    Lamps in world space, in the order of the dependency graph; those that send nothing are left out.
    """
    lights: list[Light] = []
    for instance in depsgraph.object_instances:
        if is_rendered(instance):
            made = _export(instance, emissions or {}, warnings)
            lights += _linked(instance.object, made, linking, warnings)
    return tuple(lights)


def lamp_data(scene: Any) -> list[Any]:
    """The lights that a render of a scene may show: all that its objects lead to, and those of its background set."""
    led_to = defaultdict(list)
    for block, users in bpy.data.user_map(key_types=ON_THE_WAY).items():
        for user in users:
            led_to[user].append(block)
    met: set[Any] = set()
    waiting = [scene]
    while waiting:
        block = waiting.pop()
        if block not in met:
            met.add(block)
            waiting += led_to[block]
            if isinstance(block, bpy.types.Scene) and block.background_set is not None:
                waiting.append(block.background_set)
    return sorted((block for block in met if isinstance(block, bpy.types.Light)), key=lambda data: str(data.name_full))


def _export(instance: Any, emissions: Emissions, warnings: Warnings) -> list[Light]:
    lamp, matrix = instance.object, np.array(instance.matrix_world, np.float64)
    # Lamps of several files may share a name.
    name, data = lamp.name_full, lamp.data
    if data.type == "AREA" and _cycles(data, "is_portal"):
        return []  # it guides Cycles' samples and sends nothing
    emission = _emission(instance, emissions)
    strength = _strength(data) * emission.factor
    if _strength(data).any() and not strength.any():
        warn(warnings, name, CODE, "its nodes give no light: it is left out, look at its Emission node's color and "
             "strength")
    if not strength.any() or not _counts(instance, warnings):
        return []
    if (strength < 0).any() or not np.isfinite(strength).all():
        warn(warnings, name, CODE, f"its power ({', '.join(f'{value:g}' for value in strength)}) is negative or not "
             "finite: it is left out, give it a power from 0")
        return []
    if abs(np.linalg.det(matrix[:3, :3])) == 0 and data.type != "POINT":
        warn(warnings, name, CODE, "its scale is 0 along an axis: it is left out, give it a scale that is not 0")
        return []
    made = [MAKERS[data.type](name, data, matrix, part, warnings) for part in _by_colour(strength, emission)]
    return [_shaped(light, emission, channel, matrix) for channel, light in enumerate(made) if light is not None]


def _emission(instance: Any, emissions: Emissions) -> LampEmission:
    """What the nodes of a lamp give where it stands; drafts, whose modifiers may be others, take what is next best."""
    found = emissions.get(instance.object.data.original.name_full, {})
    place = place_of(instance) if None not in found else None
    return found.get(place) or next(iter(found.values()), PLAIN)


def _linked(lamp: Any, lights: list[Light], linking: Linking, warnings: Warnings) -> list[Light]:
    """The lights of a lamp with what it reaches and what stops it."""
    links = linking.of(lamp) or FREE
    if lights and not np.any(links.receivers):
        collection = lamp.light_linking.receiver_collection.name
        warn(warnings, lamp.name_full, CODE, f"a render shows nothing of what it is linked to, {collection!r} (Light "
             "Linking): it is left out")
        return []
    if not lamp.data.use_shadow:
        links = replace(links, blockers=False)
    return lights if links is FREE else [Linked(light, links) for light in lights]


def _by_colour(strength: Float, emission: LampEmission) -> list[Float]:
    """The strength as one, or channel by channel where the pattern has several colours."""
    if emission.pattern is None or np.ptp(emission.pattern[..., strength > 0], axis=2).max() <= ONE_COLOUR:
        return [strength]
    return [strength * channel for channel in np.eye(3)]


def _shaped(light: Light, emission: LampEmission, channel: int, matrix: Float) -> Light:
    """The lamp with what its nodes make of its directions and falloff."""
    if isinstance(light, Sun) or (emission.pattern is None and emission.falloff == NATURAL):
        return light
    assert isinstance(light, Point | Area)
    if emission.pattern is None:
        return Luminaire(light, falloff=emission.falloff)
    lit = np.flatnonzero(light.colour)
    pattern = emission.pattern[..., lit].mean(axis=2) if len(lit) else emission.pattern[..., channel]
    frame = matrix[:3, :3]
    frames = {"normals": frame, "points": np.linalg.pinv(frame).T, "world": np.eye(3)}
    return Luminaire(light, pattern, frames[emission.axes], emission.falloff)


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
    facing = np.cross(axis_u, axis_v)
    ahead = facing @ matrix[:3, 2]
    if ahead**2 < (1 - SHEAR**2) * (facing @ facing) * (matrix[:3, 2] @ matrix[:3, 2]):
        warn(warnings, name, CODE, "it does not shine straight ahead of its face (a parent's scale shears it): it is "
             "baked as if it did, which Cycles does not render; apply the parent's scale")
    if ahead > 0:
        axis_u, axis_v = axis_v, axis_u
    flux = strength if _is_normalised(data) else strength * area
    return Area(name, matrix[:3, 3], axis_u, axis_v, flux, round_, float(data.spread))


PLAIN = LampEmission(np.ones(3))
MAKERS: dict[str, Callable[[str, Any, Float, Float, Warnings], Light | None]] = {
    "SUN": _sun,
    "POINT": _point,
    "SPOT": _spot,
    "AREA": _area,
}


def _strength(data: Any) -> Float:
    """(3,) float64: the lamp's colour times its power (W, or W/m2 of a sun), with all that multiplies it."""
    strength = np.array(data.color, np.float64) * data.energy
    # Exposure and temperature came with Blender 4.5.
    strength *= 2.0 ** getattr(data, "exposure", 0.0)
    if getattr(data, "use_temperature", False):
        strength *= np.array(data.temperature_color, np.float64)
    return np.asarray(strength)


def _counts(instance: Any, warnings: Warnings) -> bool:
    """Whether the lamp counts for lightmaps; tells of what Cycles would do with it and a bake does not."""
    lamp = instance.object
    if not lights_diffuse_surfaces(instance):
        whose = "" if not lamp.visible_diffuse else f" of {instance.parent.name!r}, which shows it"
        warn(warnings, lamp.name_full, CODE, f"it is hidden from diffuse rays (Ray Visibility{whose}): it is left out")
        return False
    bounces = getattr(getattr(lamp.data, "cycles", None), "max_bounces", None)
    if bounces is not None and bounces < FEW_BOUNCES:
        warn(warnings, lamp.name_full, CODE, f"its light is to end after {bounces} bounces (Max Bounces): it is baked "
             "with all of them")
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

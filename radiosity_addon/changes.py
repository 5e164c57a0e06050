"""What has changed in a scene since its light was kept, so that it must be baked again, said in the user's words."""

from __future__ import annotations

from collections.abc import Sequence

from ..solver.errors import RadiosityError
from .light_groups import Group
from .sockets import Triple
from .survey import Source, Survey

# More changes than this are counted.
TOLD = 3
# Strengths that differ by less, as a part of the strength, are the same: what is off by rounding gives no new light.
SAME = 1e-6


def changes(old: Survey, new: Survey, groups: Sequence[Group], *, follows: bool) -> list[str]:
    """One line for every change that kept light can't follow, the gravest first.

    follows : whether enough is kept to follow other reflectances.
    """
    return [*_objects(old, new, follows), *_materials(old, new, follows), *_lights(old, new, groups)]


def reflect_otherwise(old: Survey, new: Survey) -> list[str]:
    """Names of the materials whose reflectance may have changed, and of objects that have other ones, or other values
    that these read.
    """
    return list(dict.fromkeys([*_other_shapes(old, new), *_other_materials(old, new), *_other_values(old, new)]))


def refuse(found: Sequence[str]) -> None:
    """Tell of changes, if there are any.

    Raises
    ------
    RadiosityError
        With the first few.
    """
    if found:
        more = f", and {len(found) - TOLD} more changes" if len(found) > TOLD else ""
        raise RadiosityError(f"{'; '.join(found[:TOLD])}{more}: the kept light does not hold any more, bake again")


def _objects(old: Survey, new: Survey, follows: bool) -> list[str]:
    found = [f"object {name!r} was removed or hidden" for name in old.places if name not in new.places]
    found += [f"object {name!r} is new" for name in new.places if name not in old.places]
    for name in old.places:
        if name not in new.places:
            continue
        if old.places[name] != new.places[name]:
            found.append(f"object {name!r} was moved")
        if old.meshes[name] != new.meshes[name]:
            found.append(f"the mesh of object {name!r} changed")
        if old.links.get(name) != new.links.get(name):
            found.append(f"object {name!r} has other light linking")
        if old.missed.get(name) != new.missed.get(name):
            found.append(f"object {name!r} has other ray visibility")
    told = {name: f"object {name!r} has another {', '.join(values)}, which its materials read"
            for name, values in _other_values(old, new).items()}
    told |= {name: f"object {name!r} has other materials" for name in _other_materials(old, new)}
    for name, message in told.items():
        shown = [survey.surfaces[material] for survey in (old, new) for material in survey.materials[name] if material]
        if not follows or any(_shines(source) for source in shown):
            found.append(message)
    return found


def _other_materials(old: Survey, new: Survey) -> list[str]:
    """Objects in both whose materials are others."""
    return [name for name, materials in old.materials.items()
            if name in new.materials and new.materials[name] != materials]


def _other_values(old: Survey, new: Survey) -> dict[str, list[str]]:
    """Names of what materials read of an object, then as now, and found otherwise, by object in both."""
    found = {name: [word for word, value in values.items() if new.read.get(name, {}).get(word, value) != value]
             for name, values in old.read.items() if name in new.places}
    return {name: words for name, words in found.items() if words}


def _other_shapes(old: Survey, new: Survey) -> list[str]:
    """Materials in both that differ in more than the strength of their emission."""
    return [name for name, source in old.surfaces.items()
            if name in new.surfaces and new.surfaces[name].shape != source.shape]


def _materials(old: Survey, new: Survey, follows: bool) -> list[str]:
    found = []
    for name in _other_shapes(old, new):
        if not follows:
            found.append(f"material {name!r} reflects otherwise")
        elif _shines(old.surfaces[name]) or _shines(new.surfaces[name]):
            found.append(f"material {name!r} gives light, and changed in more than its color and strength")
    return found


def _lights(old: Survey, new: Survey, groups: Sequence[Group]) -> list[str]:
    found = [f"lamp {name!r} was moved, or its shape or linking changed" for name, source in new.lamps.items()
             if name in old.lamps and old.lamps[name].shape != source.shape]
    if old.world.shape != new.world.shape and (_shines(new.world) or _shines(old.world)):
        found.append("the world changed in more than its color and strength")
    kept = {(member.kind, member.name, member.part) for group in groups for member in group.members}
    for kind, sources in (("lamp", new.lamps), ("material", new.surfaces), ("world", {"World": new.world})):
        for name, source in sources.items():
            before = old.source(kind, name)
            for part, strength in source.strengths.items():
                was = before.strengths.get(part) if before is not None else None
                if any(strength) and (kind, name, part) not in kept and not _same(strength, was):
                    found.append(f"{kind} {name!r} gave no light at the bake")
    return found


def _shines(source: Source) -> bool:
    return any(any(strength) for strength in source.strengths.values())


def _same(first: Triple, second: Triple | None) -> bool:
    return second is not None and all(abs(a - b) <= SAME * max(abs(a), abs(b))
                                      for a, b in zip(first, second, strict=True))

"""Other materials in an object's slots for a while: put on the object, so that the mesh's own stay where they are.

Everything that is needed to go back is kept in custom properties, so it survives saving, loading and undo.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import bpy
import numpy as np

# Custom property of an object whose slots are covered: {"0": {"link": ..., "material": ..., OWN: ...}, ...} as they
# were; "material" is what the object itself held there.
COVERED = "radiosity_slots"
# Custom property of a material that covers another, which is in its OWN, without one if the slot was empty.
STANDS_FOR, OWN = "radiosity_stands_for", "own"
# Custom property of a mesh that had no slot and got one.
ADDED = "radiosity_added_slot"


def cover(item: Any, material_for: Callable[[Any], Any]) -> bool:
    """Cover every slot of an object with `material_for(its material)`; False where it can't be done.

    A material stands for one other only; a slot for which there is None stays as it is.
    """
    if item.library is not None or item.type != "MESH":
        return False
    if not item.material_slots and not _add_slot(item.data):
        return False
    kept: dict[str, dict[str, Any]] = {}
    for index, slot in enumerate(item.material_slots):
        shown = slot.material
        made = material_for(shown)
        if made is None:
            continue
        theirs = {OWN: shown} if shown is not None else {}
        made[STANDS_FOR] = theirs
        kept[str(index)] = {"link": slot.link, **theirs}
        # The object may hold a material of its own behind the mesh's.
        slot.link = "OBJECT"
        if slot.material is not None:
            kept[str(index)]["material"] = slot.material
        slot.material = made
    item[COVERED] = kept
    return True


def uncover(item: Any) -> bool:
    """Put back what `cover` covered, where it still does; whether it had. What the user has put there since stays."""
    kept = item.get(COVERED)
    if kept is None:
        return False
    for index, slot in enumerate(item.material_slots):
        link = slot.link
        slot.link = "OBJECT"
        if not stands_for_other(slot.material):
            slot.link = link
            continue
        before = _before(kept, index, own(slot.material))
        slot.material = before.get("material") if before is not None else own(slot.material)
        slot.link = before["link"] if before is not None and link == "OBJECT" else link
    del item[COVERED]
    return True


def _before(kept: Any, index: int, shown: Any) -> Any:
    """What was kept of a slot that showed a material, by its place or, if the user has moved it since, by that."""
    places = (str(index), *kept.keys())
    return next((kept[place] for place in places if place in kept and kept[place].get(OWN) == shown), None)


def uncover_all() -> int:
    """Uncover every object of the file, and take added slots away; how many objects."""
    count = sum(uncover(item) for item in bpy.data.objects if item.library is None)
    _replace_others()
    added = [mesh for mesh in bpy.data.meshes if ADDED in mesh]
    filled = {item.data for item in bpy.data.objects if any(slot.material is not None for slot in item.material_slots)
              } if added else set()
    for mesh in added:
        _take_slot(mesh, mesh in filled)
    return count


def _replace_others() -> None:
    """Put the user's materials wherever else ours have come since: joined meshes, for one, hold them themselves."""
    ours = [material for material in bpy.data.materials if material.library is None and stands_for_other(material)]
    for made in [material for material in ours if material.users]:
        if own(made) is not None:
            made.user_remap(own(made))
            continue
        for mesh in bpy.data.meshes:
            for index, material in enumerate(mesh.materials):
                if material == made:
                    mesh.materials[index] = None


def stands_for_other(material: Any) -> bool:
    """Whether a slot's material is one that covers the user's."""
    return material is not None and STANDS_FOR in material


def own(material: Any) -> Any:
    """The user's material that one stands for; itself if it does not. None is an empty slot."""
    return material[STANDS_FOR].get(OWN) if stands_for_other(material) else material


def own_materials(item: Any) -> list[Any]:
    """The materials of an object's slots, covered or not; None for an empty one."""
    found = [own(slot.material) for slot in item.material_slots]
    return [] if found == [None] and ADDED in item.data else found


@contextmanager
def uncovered() -> Iterator[None]:
    """Every slot as it was, for a while."""
    if not any(map(stands_for_other, bpy.data.materials)):
        yield
        return
    covers = [(item, [slot.material if stands_for_other(slot.material) else None for slot in item.material_slots])
              for item in bpy.data.objects if COVERED in item]
    uncover_all()
    try:
        yield
    finally:
        for item, materials in covers:
            cover(item, _one_after_another(materials))


def one_for_each(make: Callable[[], Any]) -> Callable[[Any], Any]:
    """What makes a material for each one that it covers, all alike."""
    made: dict[str, Any] = {}

    def material_for(material: Any) -> Any:
        name = material.name_full if material is not None else ""
        if name not in made:
            made[name] = make()
        return made[name]

    return material_for


def _one_after_another(materials: list[Any]) -> Callable[[Any], Any]:
    following = iter(materials)
    return lambda _material: next(following, None)


def _add_slot(mesh: Any) -> bool:
    if mesh.library is not None:
        return False
    mesh.materials.append(None)
    mesh[ADDED] = True
    return True


def _take_slot(mesh: Any, is_filled: bool) -> None:
    """Remove the slot that we added, unless the user has filled it on an object; faces keep their numbers."""
    del mesh[ADDED]
    if is_filled or len(mesh.materials) != 1 or mesh.materials[0] is not None:
        return
    numbers: np.ndarray[Any, np.dtype[np.int32]] | None = None
    if "material_index" in mesh.attributes:
        numbers = np.empty(len(mesh.polygons), np.int32)
        mesh.polygons.foreach_get("material_index", numbers)
    # Unlike pop(), this takes the slot off the objects too; it forgets the faces' numbers.
    mesh.materials.clear()
    if numbers is not None:
        mesh.polygons.foreach_set("material_index", numbers)

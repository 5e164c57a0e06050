"""Other materials in an object's slots for a while: put on the object, so that the mesh's own stay where they are.

Everything that is needed to go back is kept in custom properties, so it survives saving, loading and undo.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import bpy
import numpy as np

# Custom property of an object whose slots are covered: {"0": {"link": ..., "material": ...}, ...} as they were.
COVERED = "radiosity_slots"
# Custom property of a mesh that had no slot and got one.
ADDED = "radiosity_added_slot"


def cover(item: Any, material_for: Callable[[Any], Any]) -> bool:
    """Cover every slot of an object with `material_for(its material)`; False where it can't be done."""
    if item.library is not None or item.type != "MESH":
        return False
    if not item.material_slots and not _add_slot(item.data):
        return False
    kept: dict[str, dict[str, Any]] = {}
    for index, slot in enumerate(item.material_slots):
        shown = slot.material
        kept[str(index)] = {"link": slot.link}
        # The object may hold a material of its own behind the mesh's.
        slot.link = "OBJECT"
        if slot.material is not None:
            kept[str(index)]["material"] = slot.material
        slot.material = material_for(shown)
    item[COVERED] = kept
    return True


def uncover(item: Any) -> bool:
    """Put back what `cover` covered; whether it had."""
    kept = item.get(COVERED)
    if kept is None:
        return False
    for index, slot in enumerate(item.material_slots):
        before = kept.get(str(index))
        if before is None:
            continue  # added by the user since
        slot.link = "OBJECT"
        slot.material = before.get("material")
        slot.link = before["link"]
    del item[COVERED]
    return True


def uncover_all() -> int:
    """Uncover every object of the file, and take added slots away; how many objects."""
    count = sum(uncover(item) for item in bpy.data.objects if item.library is None)
    for mesh in bpy.data.meshes:
        if ADDED in mesh:
            _take_slot(mesh)
    return count


def own_materials(item: Any) -> list[Any]:
    """The materials of an object's slots, covered or not; None for an empty one."""
    kept = item.get(COVERED)
    if kept is None:
        return [slot.material for slot in item.material_slots]
    if ADDED in item.data:
        return []
    found = []
    for index, slot in enumerate(item.material_slots):
        before = kept.get(str(index))
        if before is None:
            found.append(slot.material)
        else:
            found.append(before.get("material") if before["link"] == "OBJECT" else item.data.materials[index])
    return found


@contextmanager
def uncovered() -> Iterator[None]:
    """Every slot as it was, for a while."""
    covers = [(item, [slot.material for slot in item.material_slots]) for item in bpy.data.objects if COVERED in item]
    if not covers:
        yield
        return
    uncover_all()
    try:
        yield
    finally:
        for item, materials in covers:
            cover(item, _one_after_another(materials))


def _one_after_another(materials: list[Any]) -> Callable[[Any], Any]:
    following = iter(materials)
    return lambda _material: next(following, None)


def _add_slot(mesh: Any) -> bool:
    if mesh.library is not None:
        return False
    mesh.materials.append(None)
    mesh[ADDED] = True
    return True


def _take_slot(mesh: Any) -> None:
    """Remove the slot that we added, unless the user has filled it; faces keep their numbers."""
    del mesh[ADDED]
    if len(mesh.materials) != 1 or mesh.materials[0] is not None:
        return
    numbers: np.ndarray[Any, np.dtype[np.int32]] | None = None
    if "material_index" in mesh.attributes:
        numbers = np.empty(len(mesh.polygons), np.int32)
        mesh.polygons.foreach_get("material_index", numbers)
    # Unlike pop(), this takes the slot off the objects too; it forgets the faces' numbers.
    mesh.materials.clear()
    if numbers is not None:
        mesh.polygons.foreach_set("material_index", numbers)

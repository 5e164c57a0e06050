"""Edits while a view is on: what the user has then is the user's own materials, whatever was done to the slots."""

from __future__ import annotations

from typing import Any

import bpy
import pytest
from radiosity.radiosity_addon import preview
from radiosity.radiosity_addon.baked_light import VIEW_MARK

VIEWS = ("preview", "lux_view", "density")


def slots_of(name: str) -> list[tuple[str, str | None]]:
    """Of each slot of an object, where its material is linked, and its name."""
    return [(slot.link, slot.material.name if slot.material else None)
            for slot in bpy.data.objects[name].material_slots]


def select(*names: str) -> None:
    """Select objects; the first one is active."""
    bpy.ops.object.select_all(action="DESELECT")
    for name in names:
        bpy.data.objects[name].select_set(True)
    bpy.context.view_layer.objects.active = bpy.data.objects[names[0]]


def hide() -> None:
    """Switch the view off; it leaves no material behind."""
    preview.hide()
    assert [material.name for material in bpy.data.materials if VIEW_MARK in material] == []


@pytest.fixture
def baked(sunny: Any) -> Any:
    """Three squares of a material each, one of two, one of an empty slot and one of none, baked."""
    for number, name in enumerate(("Left", "Right", "Bare", "Empty", "Two")):
        square = sunny.mesh(name, material=None if name in ("Bare", "Empty") else (0.5, 0.5, 0.1 * number))
        square.location.x = 2 * number
    bpy.data.objects["Empty"].data.materials.append(None)
    two = bpy.data.objects["Two"].data
    two.clear_geometry()
    two.from_pydata([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], [], [(0, 1, 2), (0, 2, 3)])
    two.materials.append(sunny.material("Second paint", (0.1, 0.2, 0.3)))
    two.polygons[1].material_index = 1
    bpy.ops.radiosity.bake()
    return sunny


@pytest.mark.parametrize("view", VIEWS)
def test_objects_joined_in_a_view_keep_their_materials(baked, view):
    # Squares with a material of their own, an empty slot and no slot, joined while a view is on. Exact answer: the
    # mesh's own materials, as if no view had been on; a bake reads them before it is off.
    getattr(bpy.ops.radiosity, view)()
    select("Left", "Right", "Empty", "Bare")
    bpy.ops.object.join()
    with preview.suspended():
        assert slots_of("Left")[:2] == [("DATA", "Left paint"), ("DATA", "Right paint")]
        assert {name for _, name in slots_of("Left")[2:]} == {None}
    assert all(VIEW_MARK in slot.material for slot in bpy.data.objects["Left"].material_slots[:2])
    hide()
    assert slots_of("Left")[:2] == [("DATA", "Left paint"), ("DATA", "Right paint")]
    assert {name for _, name in slots_of("Left")[2:]} == {None}


def test_an_object_joined_to_one_without_a_bake_keeps_its_material(baked):
    # The other one was not covered, and its mesh has the material afterwards. Exact answer: the user's, in a bake too.
    baked.mesh("New", material=(0.2, 0.2, 0.2))
    bpy.ops.radiosity.preview()
    select("New", "Left")
    bpy.ops.object.join()
    with preview.suspended():
        assert slots_of("New") == [("DATA", "New paint"), ("DATA", "Left paint")]
    hide()
    assert slots_of("New") == [("DATA", "New paint"), ("DATA", "Left paint")]


def test_materials_that_are_put_into_slots_in_a_view_stay(baked):
    # A new material over a covered one, one in the slot that a view has added, and a slot emptied. Exact answer: so
    # they stay, and meshes keep theirs.
    bpy.ops.radiosity.preview()
    for name in ("Right", "Bare"):
        bpy.data.objects[name].material_slots[0].material = baked.material(f"New for {name}", (1, 0, 0))
    bpy.data.objects["Two"].material_slots[1].material = None
    bpy.ops.radiosity.bake()
    assert bpy.context.scene.radiosity_view.mode == "BAKED"
    with preview.suspended():
        assert slots_of("Left") == [("DATA", "Left paint")]
    bpy.data.objects["Right"].material_slots[0].material = baked.material("Newest", (0, 1, 0))
    hide()
    assert slots_of("Right") == [("OBJECT", "Newest")]
    assert slots_of("Bare") == [("OBJECT", "New for Bare")]
    assert slots_of("Two") == [("DATA", "Two paint"), ("OBJECT", None)]
    assert [material.name for material in bpy.data.objects["Two"].data.materials] == ["Two paint", "Second paint"]


def test_duplicates_and_parts_of_an_object_in_a_view_keep_their_materials(baked):
    # A duplicate with a mesh of its own, one that shares it, and a square separated by its two materials. Exact answer:
    # what each has without a view, but that Blender links the separated part's material to the object.
    bpy.ops.radiosity.preview()
    for linked in (False, True):
        select("Left")
        bpy.ops.object.duplicate(linked=linked)
    select("Two")
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.mesh.separate(type="MATERIAL")
    bpy.ops.object.mode_set(mode="OBJECT")
    hide()
    assert [slots_of(name) for name in ("Left", "Left.001", "Left.002")] == [[("DATA", "Left paint")]] * 3
    assert (slots_of("Two"), slots_of("Two.001")) == ([("DATA", "Second paint")], [("OBJECT", "Two paint")])


def test_slots_that_are_moved_or_removed_in_a_view_go_back_by_their_materials(baked):
    # Of two slots the first is linked to the object. Exact answers: moved, both are in the other place with their
    # links; then the first removed, the other is left.
    slot = bpy.data.objects["Two"].material_slots[0]
    slot.link = "OBJECT"
    slot.material = baked.material("Own", (0.3, 0.2, 0.1))
    bpy.ops.radiosity.preview()
    select("Two")
    bpy.data.objects["Two"].active_material_index = 0
    bpy.ops.object.material_slot_move(direction="DOWN")
    hide()
    assert slots_of("Two") == [("DATA", "Second paint"), ("OBJECT", "Own")]
    bpy.ops.radiosity.preview()
    bpy.data.objects["Two"].active_material_index = 0
    bpy.ops.object.material_slot_remove()
    hide()
    assert slots_of("Two") == [("OBJECT", "Own")]


def test_a_linked_object_that_was_saved_in_a_view_is_read_with_its_own_materials(sunny, tmp_path):
    # A square under the sun saved while its baked look, which glows, is on; linked below a ceiling that nothing else
    # lights. Exact answer: the scene has no light.
    sunny.mesh("Square", material=(0.5, 0.5, 0.5))
    bpy.ops.radiosity.bake()
    bpy.ops.radiosity.preview()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "shown.blend"))
    bpy.ops.wm.read_factory_settings(use_empty=True)
    with bpy.data.libraries.load(str(tmp_path / "shown.blend"), link=True) as (_, linked):
        linked.objects = ["Square"]
    bpy.context.scene.collection.objects.link(linked.objects[0])
    assert VIEW_MARK in linked.objects[0].material_slots[0].material
    sunny.world((0.0, 0.0, 0.0))
    bpy.context.scene.radiosity.pack = True
    sunny.mesh("Ceiling", points=((0, 0, 1), (0, 1, 1), (1, 1, 1), (1, 0, 1)), material=(0.5, 0.5, 0.5))
    with pytest.raises(RuntimeError, match="the scene has no light"):
        bpy.ops.radiosity.bake()

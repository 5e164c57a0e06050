"""What becomes a mesh for a bake is shown, seen and lit as what it came from."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
import pytest
from radiosity.radiosity_addon import linking
from radiosity.radiosity_addon.blend_file import open_blend, save_copy
from radiosity.tests.blender.stage import geometry_nodes
from radiosity.tests.blender.test_geometry import bake, baked, told


@pytest.fixture
def stage(build: Any) -> Any:
    """A sun over a square of 1 m."""
    build.sun()
    build.mesh("Square").location = (3, 0, -1)
    return build


def text(stage: Any, name: str = "Text") -> Any:
    data = bpy.data.curves.new(name, "FONT")
    data.body, data.extrude = "I", 0.1
    return stage.object(name, data)


def shown() -> tuple[int, Any]:
    """How many faces are shown, and their area in square metres."""
    bpy.context.view_layer.update()
    faces, area = 0, 0.0
    for instance in bpy.context.evaluated_depsgraph_get().object_instances:
        if instance.object.type == "MESH" and instance.show_self:
            mesh = instance.object.to_mesh()
            mesh.transform(instance.matrix_world)
            faces, area = faces + len(mesh.polygons), area + sum(face.area for face in mesh.polygons)
            instance.object.to_mesh_clear()
    return faces, pytest.approx(area, rel=1e-4)


def instanced(stage: Any, item: Any, *, visible: bool) -> None:
    """Put an object into a collection that two empties, E1 and E2, show."""
    collection = bpy.data.collections.new("Shared")
    bpy.context.scene.collection.objects.unlink(item)
    collection.objects.link(item)
    if visible:
        bpy.context.scene.collection.children.link(collection)
    for number in (1, 2):
        empty = stage.object(f"E{number}", None)
        empty.instance_type, empty.instance_collection, empty.location.x = "COLLECTION", collection, 2 * number


def scattered(stage: Any) -> Any:
    """A square that nodes cut into four, with a grid on each of its nine corners."""
    ground = stage.mesh("Ground")

    def build(tree: Any, geometry: Any) -> Any:
        cut, grid, put, join = (tree.nodes.new(kind) for kind in (
            "GeometryNodeSubdivideMesh", "GeometryNodeMeshGrid", "GeometryNodeInstanceOnPoints",
            "GeometryNodeJoinGeometry"))
        put.inputs["Scale"].default_value = (0.1, 0.2, 0.3)
        for output, socket in ((geometry, cut.inputs[0]), (cut.outputs[0], put.inputs["Points"]),
                               (grid.outputs[0], put.inputs["Instance"]), (put.outputs[0], join.inputs[0]),
                               (cut.outputs[0], join.inputs[0])):
            tree.links.new(output, socket)
        return join.outputs[0]

    geometry_nodes(ground, build)
    return ground


@pytest.mark.parametrize("visible", [True, False])
@pytest.mark.parametrize("make", [text, scattered])
def test_what_instances_show_becomes_a_mesh_each(stage, tmp_path, make, visible):
    # In a collection that two empties show, and in the scene itself or not. Exact answer: as many faces as before, with
    # the same area, and a light for each.
    instanced(stage, make(stage), visible=visible)
    before = shown()
    report = bake(tmp_path, convert=True)
    assert shown() == before
    count = (2 + visible) * (10 if make is scattered else 1)
    assert len(baked(report)) == count + 1
    assert told(report, "not_stored") == []


def test_what_is_not_baked_of_a_source_stays_to_be_seen(stage, tmp_path):
    # Two instances of a text, one of them baked. Exact answer: both are shown, one with a light.
    instanced(stage, text(stage), visible=False)
    before = shown()
    assert baked(bake(tmp_path, convert=True, only=("E1",))) == ["E1:Text"]
    assert shown() == before


def test_a_mesh_takes_over_how_its_source_is_rendered(stage, tmp_path):
    # Every setting of a text and one of its instancer. Exact answer: the mesh has them all, and the instancer's too.
    source = text(stage)
    source.visible_diffuse = source.visible_camera = False
    source.color, source.pass_index, source["tint"], source.radiosity.density = (1, 0, 0, 1), 7, [0.5, 0.25, 1.0], 2
    source.cycles.is_caustics_caster = True
    instanced(stage, source, visible=True)
    bpy.data.objects["E1"].visible_glossy = False
    bake(tmp_path, convert=True)
    for name, glossy in (("Text mesh", True), ("E1:Text mesh", False)):
        mesh = bpy.data.objects[name]
        assert (mesh.visible_diffuse, mesh.visible_camera, mesh.visible_glossy) == (False, False, glossy)
        assert (*mesh.color, mesh.pass_index, list(mesh["tint"])) == (1, 0, 0, 1, 7, [0.5, 0.25, 1.0])
        assert (mesh.radiosity.density, mesh.cycles.is_caustics_caster) == (2, True)


@pytest.mark.parametrize("state", ["EXCLUDE", "INCLUDE"])
@pytest.mark.parametrize("by_collection", [False, True])
def test_a_mesh_is_linked_to_lights_as_its_source(stage, tmp_path, state, by_collection):
    # A lamp that is linked to a text, or to the collection that holds it. Exact answer: to its mesh in the same way.
    source, lamp = text(stage), stage.sun()
    links = bpy.data.collections.new("Links")
    lamp.light_linking.receiver_collection = links
    if by_collection:
        group = bpy.data.collections.new("Group")
        group.objects.link(source)
        links.children.link(group)
        links.collection_children[0].light_linking.link_state = state
    else:
        links.objects.link(source)
        links.collection_objects[0].light_linking.link_state = state
    bake(tmp_path, convert=True)
    mesh = bpy.data.objects["Text mesh"]
    assert linking.states(links) == {source: state, mesh: state}
    assert bpy.context.scene.collection in mesh.users_collection


def test_text_that_its_parent_shears_keeps_its_shape(stage, tmp_path):
    # Turned, under an empty that is three times as wide one way. Exact answer: the same faces, the same area.
    parent, source = stage.object("Parent", None), text(stage)
    parent.scale = (1, 3, 1)
    source.parent, source.rotation_euler = parent, (0.3, 0.4, 0.5)
    before = shown()
    bake(tmp_path, convert=True)
    assert shown() == before


def test_text_of_a_library_override_becomes_a_mesh_of_the_scene(stage, tmp_path):
    # A collection from a library, overridden. Exact answer: the mesh stands in the scene's own collection, as the
    # overridden one takes none, and the saved file shows the same as before.
    collection = bpy.data.collections.new("Library")
    bpy.context.scene.collection.children.link(collection)
    collection.objects.link(text(stage))
    library = tmp_path / "library.blend"
    save_copy(library)
    _override(stage, library)
    before = shown()
    report = bake(tmp_path, convert=True)
    assert told(report, "converted") == ["Text"]
    assert bpy.data.objects["Text mesh"].users_collection == (bpy.context.scene.collection,)
    save_copy(tmp_path / "baked.blend")
    open_blend(tmp_path / "baked.blend")
    assert shown() == before


def _override(stage: Any, library: Path) -> None:
    """A scene with nothing but a sun, a square and an override of the library's collection."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    stage.world((0.0, 0.0, 0.0))
    stage.sun()
    stage.mesh("Square").location.z = -1
    with bpy.data.libraries.load(str(library), link=True) as (_, wanted):
        wanted.collections = ["Library"]
    scene, linked = bpy.context.scene, wanted.collections[0]
    scene.collection.children.link(linked)
    linked.override_hierarchy_create(scene, bpy.context.view_layer)
    scene.collection.children.unlink(linked)

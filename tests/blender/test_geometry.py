"""What is shown in a scene bakes, or is told: instances, modifiers, nodes, curves, mirrored and hidden objects."""

from __future__ import annotations

import math
from collections import Counter
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from mathutils import Matrix
from radiosity.radiosity_addon.job import run
from radiosity.radiosity_addon.request import Request
from radiosity.radiosity_addon.results import result_of
from radiosity.solver.errors import SceneError
from radiosity.solver.settings import Settings
from radiosity.tests.blender.stage import geometry_nodes

SUN = 1 / math.pi


def bake(folder: Path, *, convert: bool = False, **settings: Any) -> dict[str, Any]:
    """The report of a quick bake."""
    request = Request(Settings(**{"error": 0.2, "resolution": 64, "threads": 2, **settings}), folder,
                      apply_modifiers=convert)
    return run(request, bpy.context.scene, bpy.context.view_layer).report


def baked(report: dict[str, Any]) -> list[str]:
    return sorted(output["object"] for output in report["outputs"])


def told(report: dict[str, Any], code: str) -> list[str]:
    return sorted(entry["object"] for entry in report["warnings"] if entry["code"] == code)


def shown() -> Counter[str]:
    """How often what is shown, by name."""
    bpy.context.view_layer.update()
    return Counter(instance.object.original.name for instance in bpy.context.evaluated_depsgraph_get().object_instances
                   if instance.object.type in {"MESH", "LIGHT"} and instance.show_self)


def light_at(item: Any, point: tuple[float, float, float]) -> float:
    """What the object's lightmap shows at a point in space that lies on it, red channel."""
    mesh, image = item.data, item["radiosity_lightmaps"]
    layer = mesh.uv_layers[mesh["radiosity_uv_map"]]
    width, height = image.size
    pixels = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(pixels)
    mesh.calc_loop_triangles()
    for triangle in mesh.loop_triangles:
        corners = np.array([item.matrix_world @ mesh.vertices[index].co for index in triangle.vertices])
        edges = np.stack([corners[1] - corners[0], corners[2] - corners[0]], axis=1)
        weight = np.linalg.lstsq(edges, np.array(point) - corners[0], rcond=None)[0]
        near = np.abs(edges @ weight + corners[0] - point).max() < 1e-4
        if near and weight.min() >= -1e-6 and weight.sum() <= 1 + 1e-6:
            uv = np.array([layer.uv[index].vector for index in triangle.loops])
            place = uv[0] + weight[0] * (uv[1] - uv[0]) + weight[1] * (uv[2] - uv[0])
            x, y = (np.minimum(place * (width, height), (width - 1, height - 1))).astype(int)
            return float(pixels.reshape(height, width, -1)[y, x, 0])
    raise AssertionError(f"{point} is not on {item.name}")


@pytest.fixture
def stage(build: Any) -> Any:
    """A sun that shines straight down with 1 W/m2: what lies open and level shows 1 / pi."""
    build.sun()
    return build


def test_linked_duplicates_keep_their_mesh_and_get_a_light_each(stage, tmp_path):
    # Two squares of one mesh, the second under a roof. Exact answer: 1/pi and 0, and still one mesh for both.
    first = stage.mesh("First")
    second = stage.object("Second", first.data)
    second.location.x = 5
    roof = stage.mesh("Roof")
    roof.location, roof.scale = (4, -1, 0.5), (3, 3, 1)
    report = bake(tmp_path, only=("First", "Second"))
    assert first.data is second.data
    assert first["radiosity_lightmaps"] != second["radiosity_lightmaps"]
    assert light_at(first, (0.4, 0.6, 0)) == pytest.approx(SUN, rel=0.01)
    assert light_at(second, (5.4, 0.6, 0)) < 0.02 * SUN
    assert baked(report) == ["First", "Second"]


def test_every_instance_of_a_collection_has_a_light_of_its_own(stage, tmp_path):
    # A collection with a square, shown twice, once under a roof. Exact answer: an image each, 1/pi and 0.
    collection = bpy.data.collections.new("Tile")
    square = stage.mesh("Square")
    bpy.context.scene.collection.objects.unlink(square)
    collection.objects.link(square)
    for name, x in (("Open", 0.0), ("Roofed", 5.0)):
        empty = stage.object(name, None)
        empty.instance_type, empty.instance_collection, empty.location.x = "COLLECTION", collection, x
    roof = stage.mesh("Roof")
    roof.location, roof.scale = (4, -1, 0.5), (3, 3, 1)
    report = bake(tmp_path, only=("Open", "Roofed"), margin=0)
    from radiosity.solver.image_file import read_exr

    images = {output["object"]: read_exr(tmp_path / output["image"]) for output in report["outputs"]}
    assert sorted(images) == ["Open:Square", "Roofed:Square"]
    assert images["Open:Square"].max() == pytest.approx(SUN, rel=0.01)
    assert images["Roofed:Square"].max() < 0.02 * SUN


@pytest.mark.parametrize("scale", [(-1, 1, 1), (-2, 0.5, 3), (-1, -1, -1)])
def test_a_mirrored_or_skewed_object_is_lit_on_the_side_that_blender_shows(stage, tmp_path, scale):
    # A cube scaled unevenly and mirrored. Exact answer: 1/pi on top, nothing below, as only fronts are baked.
    cube = stage.cube("Cube")
    cube.scale, cube.location.z = scale, 4
    bake(tmp_path)
    top = abs(scale[2]) / 2
    assert light_at(cube, (0.1, 0.1, 4 + top)) == pytest.approx(SUN, rel=0.01)
    assert light_at(cube, (0.1, 0.1, 4 - top)) < 0.02 * SUN


def test_objects_hidden_from_renders_neither_bake_nor_block(stage, tmp_path):
    # A square under a plate that renders do not show. Exact answer: 1/pi, and the square alone bakes.
    square, plate = stage.mesh("Square"), stage.mesh("Plate")
    plate.location.z, plate.hide_render = 0.5, True
    assert baked(bake(tmp_path)) == ["Square"]
    assert light_at(square, (0.4, 0.6, 0)) == pytest.approx(SUN, rel=0.01)


def test_modifiers_are_baked_and_applied_where_that_is_asked_for(stage, tmp_path):
    # A square with an array of two. Exact answer: applied, both squares are lit; else the mesh stays, and it is told.
    square = stage.mesh("Square")
    square.modifiers.new("Array", "ARRAY").count = 2
    assert told(bake(tmp_path), "not_stored") == ["Square"]
    assert len(square.modifiers) == 1
    report = bake(tmp_path, convert=True)
    assert told(report, "modifiers_applied") == ["Square"]
    assert light_at(square, (0.4, 0.6, 0)) == pytest.approx(SUN, rel=0.01)
    assert light_at(square, (1.4, 0.6, 0)) == pytest.approx(SUN, rel=0.01)


@pytest.mark.parametrize("target", ["lightmap", "vertex"])
def test_a_result_that_a_new_modifier_keeps_from_being_stored_is_none(stage, tmp_path, target):
    # A square, baked, then baked again with an array of two. Exact answer: it had a result and has none any more, not
    # the new image on the old map; what is not baked keeps its own.
    square, other = stage.mesh("Square"), stage.mesh("Other")
    other.location.x = 5
    bake(tmp_path, target=target)
    assert result_of(square) is not None
    square.modifiers.new("Array", "ARRAY").count = 2
    assert told(bake(tmp_path, target=target, only=("Square",)), "not_stored") == ["Square"]
    assert result_of(square) is None
    assert result_of(other) is not None


def test_modifiers_over_shape_keys_are_not_applied(stage, tmp_path):
    # A square with shape keys and an array of two. Exact answer: both stay, and it is told with the keys' names.
    square = stage.mesh("Square")
    for name in ("Basis", "Open"):
        square.shape_key_add(name=name)
    square.modifiers.new("Array", "ARRAY").count = 2
    report = bake(tmp_path, convert=True)
    assert told(report, "not_stored") == ["Square"]
    assert any("its shape keys (Basis, Open) would be lost" in entry["message"] for entry in report["warnings"])
    assert [key.name for key in square.data.shape_keys.key_blocks] == ["Basis", "Open"]
    assert len(square.modifiers) == 1


def _moved(tree: Any, geometry: Any, offset: tuple[float, float, float]) -> Any:
    node = tree.nodes.new("GeometryNodeTransform")
    node.inputs["Translation"].default_value = offset
    tree.links.new(geometry, node.inputs["Geometry"])
    return node.outputs[0]


def test_a_mesh_from_geometry_nodes_is_baked_and_applied(stage, tmp_path):
    # Nodes that put a new grid of 1 m beside the square, 3 m along x. Exact answer: both are lit.
    square = stage.mesh("Square")

    def tree(nodes, geometry):
        grid, join = nodes.nodes.new("GeometryNodeMeshGrid"), nodes.nodes.new("GeometryNodeJoinGeometry")
        nodes.links.new(_moved(nodes, grid.outputs[0], (3, 0.5, 0)), join.inputs[0])
        nodes.links.new(geometry, join.inputs[0])
        return join.outputs[0]

    geometry_nodes(square, tree)
    report = bake(tmp_path, convert=True)
    assert baked(report) == ["Square"]
    assert light_at(square, (0.4, 0.6, 0)) == pytest.approx(SUN, rel=0.01)
    assert light_at(square, (3.1, 0.6, 0)) == pytest.approx(SUN, rel=0.01)


def _instances(nodes: Any, geometry: Any) -> Any:
    """Grids of 1 m on the points of the geometry."""
    grid, put = nodes.nodes.new("GeometryNodeMeshGrid"), nodes.nodes.new("GeometryNodeInstanceOnPoints")
    nodes.links.new(geometry, put.inputs["Points"])
    nodes.links.new(grid.outputs[0], put.inputs["Instance"])
    return put.outputs[0]


def test_instances_from_geometry_nodes_become_objects_where_that_is_asked_for(stage, tmp_path):
    # Grids on the corners of a square of 4 m. Exact answer: asked for, four mesh objects that are lit, each with its
    # own light; else one warning, and nothing of the file changes.
    points = [(0, 0, 0), (4, 0, 0), (4, 4, 0), (0, 4, 0)]
    field = stage.mesh("Field", points)
    stage.mesh("Square").location.x = -5
    geometry_nodes(field, _instances)
    assert told(bake(tmp_path), "not_baked") == ["Field"]
    before = set(bpy.data.objects)
    report = bake(tmp_path, convert=True)
    made = [item for item in bpy.data.objects if item not in before]
    assert told(report, "converted") == ["Field"]
    assert len(made) == 4
    places = sorted((round(item.matrix_world.translation.x), round(item.matrix_world.translation.y)) for item in made)
    assert places == [(0, 0), (0, 4), (4, 0), (4, 4)]
    for item in made:
        x, y, z = item.matrix_world.translation
        assert light_at(item, (x + 0.1, y + 0.2, z)) == pytest.approx(SUN, rel=0.01)
    assert field.hide_render
    assert len(field.modifiers) == 1


def test_realised_instances_are_a_mesh(stage, tmp_path):
    # The same grids, realised by the nodes. Exact answer: one object, applied, lit in all four places.
    field = stage.mesh("Field", [(0, 0, 0), (4, 0, 0), (4, 4, 0), (0, 4, 0)])

    def tree(nodes, geometry):
        real = nodes.nodes.new("GeometryNodeRealizeInstances")
        nodes.links.new(_instances(nodes, geometry), real.inputs[0])
        return real.outputs[0]

    geometry_nodes(field, tree)
    assert baked(bake(tmp_path, convert=True)) == ["Field"]
    for x, y in ((0, 0), (4, 0), (4, 4), (0, 4)):
        assert light_at(field, (x + 0.1, y + 0.2, 0)) == pytest.approx(SUN, rel=0.01)


def _subdivided_with(put_on: Any) -> Any:
    """A tree that subdivides the mesh, and puts on its corners what `put_on(tree)` returns: it takes other corners."""

    def tree(nodes: Any, geometry: Any) -> Any:
        cut, put, join = (nodes.nodes.new(f"GeometryNode{kind}")
                          for kind in ("SubdivideMesh", "InstanceOnPoints", "JoinGeometry"))
        nodes.links.new(geometry, cut.inputs["Mesh"])
        nodes.links.new(cut.outputs[0], put.inputs["Points"])
        nodes.links.new(put_on(nodes), put.inputs["Instance"])
        for output in (cut.outputs[0], put.outputs[0]):
            nodes.links.new(output, join.inputs[0])
        return join.outputs[0]

    return tree


def _object_node(nodes: Any, item: Any) -> Any:
    """The output of a node that gives an object as an instance."""
    node = nodes.nodes.new("GeometryNodeObjectInfo")
    node.inputs["Object"].default_value, node.inputs["As Instance"].default_value = item, True
    return node.outputs["Geometry"]


def _small_grid(nodes: Any) -> Any:
    return nodes.nodes.new("GeometryNodeMeshGrid").outputs[0]


def _with_particles(field: Any, item: Any) -> None:
    """Subdivide a mesh, and put an object on ten particles of it."""
    field.modifiers.new("Subdivision", "SUBSURF").subdivision_type = "SIMPLE"
    field.modifiers.new("Particles", "PARTICLE_SYSTEM")
    settings = field.particle_systems[0].settings
    settings.type, settings.count, settings.render_type, settings.instance_object = "HAIR", 10, "OBJECT", item
    settings.particle_size = settings.hair_length = 1


SCATTERED = {
    "objects": lambda field, item: geometry_nodes(field, _subdivided_with(lambda nodes: _object_node(nodes, item))),
    "particles": _with_particles,
    "many meshes": lambda field, item: geometry_nodes(field, _subdivided_with(_small_grid)),
}


@pytest.mark.parametrize(("scatter", "what"), [
    ("objects", "mesh"), ("objects", "lamp"), ("particles", "mesh"), ("many meshes", "mesh")])
def test_scattered_objects_stay_though_modifiers_were_to_be_applied(stage, tmp_path, monkeypatch, scatter, what):
    # A ground with more corners than its own mesh and objects on it, or nine meshes where eight are converted. Exact
    # answer: all is shown as before, and one warning says why the ground can't hold its result.
    monkeypatch.setattr("radiosity.radiosity_addon.receiving.MOST_GENERATED", 8)
    item = stage.mesh("Stone") if what == "mesh" else stage.sun()
    ground = stage.mesh("Ground", [(0, 0, 0), (4, 0, 0), (4, 4, 0), (0, 4, 0)])
    SCATTERED[scatter](ground, item)
    before = shown()
    assert before.total() >= 12
    report = bake(tmp_path, convert=True)
    assert shown() == before
    assert told(report, "not_stored") == ["Ground"]
    assert any("would vanish" in entry["message"] for entry in report["warnings"])


def test_generated_meshes_beside_scattered_objects_are_not_converted(stage, tmp_path):
    # A curve that is filled, and with an object on its corners: hidden, it would take the object along. Exact answer:
    # it is told, and all is shown as before.
    geometry_nodes(_curve(stage), lambda nodes, geometry: _with_objects(nodes, geometry, stage.mesh("Stone")))
    before = shown()
    report = bake(tmp_path, convert=True)
    assert shown() == before
    assert told(report, "not_baked") == ["Plate"]
    assert "Stone" in {name.rpartition(":")[2].partition("#")[0] for name in baked(report)}


def _with_objects(nodes: Any, geometry: Any, item: Any) -> Any:
    """The geometry, and an object on its points."""
    put, join = nodes.nodes.new("GeometryNodeInstanceOnPoints"), nodes.nodes.new("GeometryNodeJoinGeometry")
    nodes.links.new(geometry, put.inputs["Points"])
    nodes.links.new(_object_node(nodes, item), put.inputs["Instance"])
    for output in (geometry, put.outputs[0]):
        nodes.links.new(output, join.inputs[0])
    return join.outputs[0]


def _curve(stage: Any) -> Any:
    data = bpy.data.curves.new("Plate", "CURVE")
    data.dimensions, data.fill_mode = "2D", "BOTH"
    spline = data.splines.new("POLY")
    spline.points.add(3)
    for point, (x, y) in zip(spline.points, ((0, 0), (1, 0), (1, 1), (0, 1)), strict=True):
        point.co = (x, y, 0, 1)
    spline.use_cyclic_u = True
    return stage.object("Plate", data)


def _text(stage: Any) -> Any:
    data = bpy.data.curves.new("Plate", "FONT")
    data.body = "I"
    data.size = 3
    return stage.object("Plate", data)


def _metaball(stage: Any) -> Any:
    data = bpy.data.metaballs.new("Plate")
    data.elements.new().radius = 1
    return stage.object("Plate", data)


@pytest.mark.parametrize("make", [_curve, _text, _metaball])
def test_what_is_no_mesh_becomes_one_where_that_is_asked_for(stage, tmp_path, make):
    # A filled curve, a letter, a metaball. Exact answer: asked for, a mesh beside it holds its light, up to 1/pi, and
    # the original stays, hidden; else it blocks only, it is told, and nothing changes.
    item = make(stage)
    stage.mesh("Square").location.x = -5
    report = bake(tmp_path)
    assert (baked(report), told(report, "not_baked")) == (["Square"], ["Plate"])
    assert not item.hide_render
    report = bake(tmp_path, convert=True)
    assert (baked(report), told(report, "converted")) == (["Plate", "Square"], ["Plate"])
    assert item.hide_render
    mesh = bpy.data.objects["Plate mesh"]
    assert mesh.type == "MESH"
    image = mesh["radiosity_lightmaps"]
    pixels = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(pixels)
    assert pixels.reshape(-1, image.channels)[:, :3].max() == pytest.approx(SUN, rel=0.02)
    # A second bake finds a mesh like any other.
    assert baked(bake(tmp_path, convert=True)) == ["Plate mesh", "Square"]


def test_a_sheared_instance_keeps_its_shape(stage, tmp_path):
    # Grids turned by 45 degrees on a square that is scaled to 4 x 1: sheared. Exact answer: the corners stay where
    # they are shown.
    field = stage.mesh("Field", [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)])
    field.scale.x = 4

    def tree(nodes, geometry):
        put = _instances(nodes, geometry)
        put.node.inputs["Rotation"].default_value = (0, 0, math.pi / 4)
        return put

    geometry_nodes(field, tree)
    shown = [np.array(instance.matrix_world @ Matrix.Translation((0.5, 0.5, 0)).translation)
             for instance in bpy.context.evaluated_depsgraph_get().object_instances if instance.is_instance]
    before = set(bpy.data.objects)
    bake(tmp_path, convert=True)
    bpy.context.view_layer.update()
    corners = np.array([item.matrix_world @ vertex.co for item in bpy.data.objects if item not in before
                        for vertex in item.data.vertices])
    for corner in shown:
        assert np.abs(corners - corner).max(axis=1).min() < 1e-4


def test_named_text_that_can_not_be_kept_is_an_error(stage, tmp_path):
    _text(stage)
    with pytest.raises(SceneError, match=r"'Plate' is made by a font and has no mesh .*--apply-modifiers"):
        bake(tmp_path, only=("Plate",))

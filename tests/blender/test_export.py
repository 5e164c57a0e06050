"""What leaves Blender as arrays, against Blender's own values."""

from __future__ import annotations

import math
from typing import Any

import bpy
import numpy as np
import pytest
from mathutils import Euler, Matrix
from radiosity.radiosity_addon.export import Exported, export_scene
from radiosity.solver.errors import NothingToBake, SceneError, SettingsError
from radiosity.solver.settings import Settings
from radiosity.tests.blender.stage import geometry_nodes

SKEW = Matrix.LocRotScale((3, -2, 5), Euler((0.4, 1.1, -0.7)), (2.0, 0.5, 1.5))


def export(warnings: list[dict[str, Any]] | None = None, **settings: Any) -> Exported:
    return export_scene(bpy.context.scene, bpy.context.view_layer, Settings(**settings),
                        [] if warnings is None else warnings)


def normals(exported: Exported) -> np.ndarray:
    """Unit normals by winding."""
    a, b, c = np.moveaxis(exported.scene.vertices[exported.scene.triangles], 1, 0)
    cross = np.cross(b - a, c - a)
    return np.asarray(cross / np.linalg.norm(cross, axis=1, keepdims=True))


def areas(exported: Exported) -> np.ndarray:
    a, b, c = np.moveaxis(exported.scene.vertices[exported.scene.triangles], 1, 0)
    return np.asarray(np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2)


def test_a_transformed_mesh_arrives_in_world_space(build):
    # A cube of side 1, moved, turned and scaled. Exact answer: its corners times Blender's own matrix.
    build.sun()
    cube = build.cube("Cube")
    cube.matrix_world = SKEW
    exported = export()
    expected = np.array([SKEW @ vertex.co for vertex in cube.data.vertices])
    assert np.allclose(exported.scene.vertices, expected, atol=1e-6)
    assert [surface.name for surface in exported.scene.surfaces] == ["Cube"]


@pytest.mark.parametrize("scale", [(1, 1, 1), (-1, 1, 1), (-2, -1, -3), (1, -1, 0.5)])
def test_a_mirrored_cube_still_faces_outwards(build, scale):
    # A closed cube about a point. Exact answer: every normal, by winding and by shading, points away from that point.
    build.sun()
    cube = build.cube("Cube")
    for polygon in cube.data.polygons:
        polygon.use_smooth = True
    cube.scale = scale
    exported = export()
    middle = exported.scene.vertices[exported.scene.triangles].mean(axis=1)
    assert ((normals(exported) * middle).sum(axis=1) > 0).all()
    corner_normals = exported.scene.corner_normals
    assert (np.einsum("tk,tck->tc", normals(exported), corner_normals) > 0).all()


def test_shading_normals_are_those_of_blender_under_a_skew_scale(build):
    # A smooth sphere, scaled to an ellipsoid x^2/4 + y^2 + z^2/9 = 1. Exact answer: normals along (x/4, y, z/9).
    build.sun()
    mesh = bpy.data.meshes.new("Ball")
    import bmesh

    shape = bmesh.new()
    bmesh.ops.create_icosphere(shape, subdivisions=3, radius=1.0)
    shape.to_mesh(mesh)
    shape.free()
    for polygon in mesh.polygons:
        polygon.use_smooth = True
    build.object("Ball", mesh).scale = (2, 1, 3)
    exported = export()
    corners = exported.scene.vertices[exported.scene.triangles]
    expected = corners / np.array([4, 1, 9])
    expected /= np.linalg.norm(expected, axis=2, keepdims=True)
    # Blender's vertex normals of the icosphere are within a degree of the sphere's.
    cosine = (exported.scene.corner_normals * expected).sum(axis=2)
    assert cosine.min() > math.cos(math.radians(2.5))


def test_flat_faces_carry_no_shading_normals(build):
    # A flat cube. Exact answer: nothing to interpolate.
    build.sun()
    build.cube("Cube")
    assert export().scene.corner_normals is None


def test_modifiers_are_baked_as_a_render_shows_them(build):
    # A square with an array of 2, and of 3 more rows in renders alone. Exact answer: area 6.
    build.sun()
    square = build.mesh("Square")
    square.modifiers.new("Array", "ARRAY").count = 2
    second = square.modifiers.new("Array 2", "ARRAY")
    second.count, second.show_viewport = 3, False
    second.relative_offset_displace = (0, 1, 0)
    exported = export()
    assert areas(exported).sum() == pytest.approx(6)
    assert not exported.bindings[0].same_topology


def test_hidden_from_render_is_left_out_and_hidden_in_the_viewport_is_not(build):
    # Squares shown, hidden from renders, hidden in the viewport by eye and by screen. Exact answer: three are there.
    build.sun()
    for name in ("Shown", "No render", "No eye", "No screen"):
        build.mesh(name)
    bpy.data.objects["No render"].hide_render = True
    bpy.data.objects["No screen"].hide_viewport = True
    bpy.data.objects["No eye"].hide_set(True)
    names = {surface.name for surface in export().scene.surfaces}
    assert names == {"Shown", "No eye", "No screen"}
    assert bpy.data.objects["No screen"].hide_viewport
    assert bpy.data.objects["No eye"].hide_get()


def test_every_instance_of_a_collection_is_a_surface_of_its_own(build):
    # A collection of two squares, shown by two empties. Exact answer: four surfaces at the empties' places.
    build.sun()
    collection = bpy.data.collections.new("Pair")
    for name, x in (("A", 0.0), ("B", 2.0)):
        square = build.mesh(name)
        square.location.x = x
        bpy.context.scene.collection.objects.unlink(square)
        collection.objects.link(square)
    for name, y in (("First", 0.0), ("Second", 5.0)):
        empty = build.object(name, None)
        empty.instance_type, empty.instance_collection, empty.location = "COLLECTION", collection, (0, y, 0)
    exported = export()
    lows = {surface.name: tuple(exported.scene.vertices[exported.scene.triangles[surface.triangles]].min(axis=(0, 1)))
            for surface in exported.scene.surfaces}
    assert lows == {"First:A": (0, 0, 0), "First:B": (2, 0, 0), "Second:A": (0, 5, 0), "Second:B": (2, 5, 0)}
    assert all(surface.receives for surface in exported.scene.surfaces)


def test_a_curve_blocks_light_but_is_not_baked(build):
    # A square and a tube made by a curve. Exact answer: both are there, the square alone receives, told in one line.
    build.sun()
    build.mesh("Square")
    data = bpy.data.curves.new("Tube", "CURVE")
    data.bevel_depth = 0.1
    data.dimensions = "3D"
    data.splines.new("POLY").points.add(1)
    data.splines[0].points[1].co = (0, 0, 1, 1)
    build.object("Tube", data)
    warnings: list[dict[str, Any]] = []
    exported = export(warnings)
    assert {surface.name: surface.receives for surface in exported.scene.surfaces} == {"Square": True, "Tube": False}
    assert [entry["object"] for entry in warnings] == ["Tube"]


def _hair_curves(build: Any, grid: Any) -> None:
    data = bpy.data.hair_curves.new("Grass")
    data.add_curves([2, 2])
    build.object("Grass", data)


def _particle_hair(build: Any, grid: Any) -> None:
    grid.modifiers.new("Particles", "PARTICLE_SYSTEM").particle_system.settings.type = "HAIR"


def _points(build: Any, grid: Any) -> None:
    def tree(nodes: Any, geometry: Any) -> Any:
        node = nodes.nodes.new("GeometryNodeMeshToPoints")
        nodes.links.new(geometry, node.inputs[0])
        return node.outputs[0]

    geometry_nodes(grid, tree)


def _volume(build: Any, grid: Any) -> None:
    geometry_nodes(grid, lambda nodes, geometry: nodes.nodes.new("GeometryNodeVolumeCube").outputs[0])


@pytest.mark.parametrize(("make", "name", "what"), [
    (_hair_curves, "Grass", "hair curves"), (_particle_hair, "Thing", "hair"), (_points, "Thing", "a point cloud"),
    (_volume, "Thing", "a volume")])
def test_what_has_no_faces_and_is_shown_is_told(build, make, name, what):
    # Hair, points or a volume above a square; nothing more is told where a render does not show it.
    build.sun()
    build.mesh("Square")
    make(build, build.mesh("Thing"))
    warnings: list[dict[str, Any]] = []
    export(warnings)
    (told,) = warnings
    assert (told["object"], told["code"]) == (name, "not_baked")
    assert f"shows {what}, " in told["message"]
    warnings.clear()
    bpy.data.objects[name].hide_render = True
    export(warnings)
    assert warnings == []


def test_corner_ids_lead_back_to_the_meshs_own_corners(build):
    # A cube of six quads. Exact answer: the vertex of each triangle corner is that of the mesh's corner it names.
    build.sun()
    cube = build.cube("Cube")
    cube.scale.x = -1
    surface = export().scene.surfaces[0]
    vertex = np.array([loop.vertex_index for loop in cube.data.loops])
    assert (vertex[surface.corner_ids] == export().scene.triangles).all()


def test_zero_area_faces_are_left_out_with_one_line(build):
    # A square and a face whose corners lie on a line. Exact answer: two triangles, and a warning that names the object.
    build.sun()
    points = ((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (2, 0, 0))
    build.mesh("Square", points, ((0, 1, 2, 3), (0, 1, 4)))
    warnings: list[dict[str, Any]] = []
    assert len(export(warnings).scene.triangles) == 2
    assert [(entry["object"], entry["code"]) for entry in warnings] == [("Square", "zero_area")]


def test_a_needle_keeps_its_area(build):
    # A triangle 1 long and 1e-4 high. Exact answer: it is no face without area.
    build.sun()
    build.mesh("Needle", ((0, 0, 0), (1, 0, 0), (0, 1e-4, 0)), ((0, 1, 2),))
    assert areas(export()).sum() == pytest.approx(0.5e-4, rel=1e-5)


def test_a_coordinate_that_is_not_finite_names_object_and_vertex(build):
    build.sun()
    square = build.mesh("Broken")
    square.data.vertices[2].co.x = math.nan
    with pytest.raises(SceneError, match=r"object 'Broken': vertex 2 is at \(nan, 1, 0\)"):
        export()


def test_no_mesh_and_no_light_are_nothing_to_bake(build):
    build.sun()
    with pytest.raises(NothingToBake, match="no mesh"):
        export()
    bpy.data.objects.remove(bpy.data.objects["Sun"])
    build.mesh("Square")
    with pytest.raises(NothingToBake, match="no light"):
        export()


def test_only_chooses_receivers_and_keeps_the_others_as_blockers(build):
    # Three squares, one named. Exact answer: three surfaces, one receives.
    build.sun()
    for name in ("A", "B", "C"):
        build.mesh(name)
    exported = export(only=("B",))
    assert [(surface.name, surface.receives) for surface in exported.scene.surfaces] == [
        ("A", False), ("B", True), ("C", False)]


def test_only_with_a_name_that_is_not_there_suggests_one_that_is(build):
    build.sun()
    build.mesh("Kitchen wall")
    with pytest.raises(SettingsError, match=r"'Kitchn wall', which the scene does not have: did you mean 'Kitchen"):
        export(only=("Kitchn wall",))


def test_a_uv_map_that_is_not_there_is_told_with_those_that_are(build):
    build.sun()
    build.mesh("Square").data.uv_layers.new(name="Paint")
    with pytest.raises(SettingsError, match=r"object 'Square' has no UV map 'Light' \(it has 'Paint'\)"):
        export(uv_layer="Light")


def test_the_users_uv_map_reaches_the_solver_corner_by_corner(build):
    # A square whose map is its own x and y, mirrored. Exact answer: each corner has the coordinates of its vertex.
    build.sun()
    square = build.mesh("Square")
    layer = square.data.uv_layers.new(name="Light")
    layer.uv.foreach_set("vector", np.array([vertex.co.xy for vertex in square.data.vertices], np.float32).ravel())
    square.scale = (-2, 1, 1)
    exported = export(uv_layer="Light")
    x = exported.scene.vertices[exported.scene.triangles][:, :, :2] / (-2, 1)
    assert np.allclose(exported.scene.surfaces[0].lightmap_uv, x)


def test_objects_that_share_a_mesh_share_a_layout(build):
    # Two objects of one mesh, and a third with an array modifier. Exact answer: the first two are of one layout.
    build.sun()
    first = build.mesh("First")
    second, third = build.object("Second", first.data), build.object("Third", first.data)
    second.scale.y = -1
    third.modifiers.new("Array", "ARRAY")
    layouts = [binding.layout for binding in export().bindings]
    assert layouts[0] == layouts[1] != layouts[2]


def test_the_file_is_left_as_it_was(build):
    # A scene with selection, active object and render settings. Exact answer: all the same afterwards, nothing new.
    build.sun()
    square = build.mesh("Square")
    square.select_set(True)
    bpy.context.view_layer.objects.active = square
    bpy.context.scene.render.engine = "CYCLES"

    def state() -> Any:
        counts = {name: len(getattr(bpy.data, name)) for name in (
            "objects", "meshes", "images", "scenes", "worlds", "cameras", "materials")}
        return (counts, bpy.context.scene.render.engine, bpy.context.scene.camera, bpy.context.active_object.name,
                [item.name for item in bpy.context.selected_objects])

    before = state()
    export()
    assert state() == before

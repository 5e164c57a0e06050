"""Twins and references of a scene made here: what is kept, what goes, and that Cycles' bake is E / pi."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("bpy", reason="Blender as a module (bpy) is not installed")

from radiosity.benchmarks import twins
from radiosity.benchmarks.cycles import reference, scenes, twin, worst
from radiosity.benchmarks.cycles.blender import open_blend

SKY = 0.75


@pytest.fixture
def case(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> scenes.Case:
    """A dark floor under a uniform sky, a pane of glass over it, and a cube without material and UV far below."""
    monkeypatch.setattr(scenes, "SCENES", tmp_path / "scenes")
    monkeypatch.setattr(scenes, "OUTPUT", tmp_path / "out")
    (tmp_path / "scenes" / "made").mkdir(parents=True)
    _make_scene(tmp_path / "scenes" / "made" / "made.blend")
    return scenes.Case("made", ("Floor", "Cube"), lumels=600, density={"Cube": 2.0})


def _make_scene(path: Path) -> None:
    import bpy

    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.world = bpy.data.worlds.new("World")
    with pytest.warns(DeprecationWarning, match="use_nodes"):
        scene.world.use_nodes = True
    scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = (SKY, SKY, SKY, 1)
    # Not black: Cycles drops a surface that reflects nothing, and its bake without colour is black too.
    _quad(bpy, "Floor", 2.0, 0.0, _material(bpy, "Dark", (0.1, 0.1, 0.1)))
    _quad(bpy, "Pane", 2.0, 1.0, _material(bpy, "Glass", (1, 1, 1), transmission=1.0))
    bpy.ops.mesh.primitive_cube_add(size=1, location=(0, 0, -50), calc_uvs=False)
    bpy.context.object.modifiers.new("Array", "ARRAY").count = 2
    bpy.ops.wm.save_as_mainfile(filepath=str(path))


def _material(bpy: Any, name: str, colour: tuple[float, ...], transmission: float = 0.0) -> Any:
    material = bpy.data.materials.new(name)
    with pytest.warns(DeprecationWarning, match="use_nodes"):
        material.use_nodes = True
    shader = material.node_tree.nodes["Principled BSDF"]
    shader.inputs["Base Color"].default_value = (*colour, 1)
    shader.inputs["Transmission Weight"].default_value = transmission
    return material


def _quad(bpy: Any, name: str, half: float, height: float, material: Any) -> None:
    mesh = bpy.data.meshes.new(name)
    corners = [(x * half, y * half, height) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    mesh.from_pydata(corners, [], [(0, 1, 2, 3)])
    mesh.uv_layers.new(name="Texture")
    mesh.materials.append(material)
    bpy.context.scene.collection.objects.link(bpy.data.objects.new(name, mesh))


def test_the_twin_drops_glass_realises_modifiers_and_keeps_the_layer_that_textures_read(case: scenes.Case) -> None:
    # The pane goes; the array's two cubes become one mesh of 24 triangles with Blender's default grey.
    known = twin.make_twin(case)
    assert known["removed"] == {"Pane": "1 of 1 faces: Glass"}
    bpy = open_blend(case.folder / "twin.blend")
    assert {made.name for made in bpy.data.objects} == {"Floor", "Cube"}
    floor, cube = bpy.data.objects["Floor"].data, bpy.data.objects["Cube"].data
    assert len(cube.polygons) == 24
    assert not bpy.data.objects["Cube"].modifiers
    assert next(layer.name for layer in floor.uv_layers if layer.active_render) == "Texture"
    assert floor.uv_layers.active.name == scenes.UV_LAYER
    shaders = {node.bl_idname for node in cube.materials[0].node_tree.nodes}
    assert shaders == {"ShaderNodeOutputMaterial", "ShaderNodeBsdfDiffuse"}


def test_lumels_are_as_many_as_asked_for_and_none_is_shared(case: scenes.Case) -> None:
    # 16 m2 of floor and 12 m2 of cubes at twice the density: sqrt(600 / (16 + 4 * 12)) = 3.06 texels a metre, so that
    # the floor's 4 m are 12 or 13 texels and each of the cubes' 12 faces of 1 m is 6 or 7.
    known = twin.make_twin(case)
    floor, cube = known["receivers"]
    assert 12**2 <= floor["lumels"] <= 13**2
    assert 12 * 6**2 <= cube["lumels"] <= 12 * 7**2
    assert floor["overlapping"] == cube["overlapping"] == 0
    assert floor["inner"] > 0.5 * floor["lumels"]


def test_the_same_scene_gives_the_same_twin_and_another_table_another(case: scenes.Case) -> None:
    # Content and recipe are hashes; made twice they agree, with more lumels they do not.
    first, again = twin.make_twin(case), twin.make_twin(case, again=True)
    assert first["content"] == again["content"]
    other = twin.make_twin(dataclasses.replace(case, lumels=900))
    assert other["made_from"] != first["made_from"]
    assert other["content"] != first["content"]


def test_a_lumel_s_place_in_the_world_is_where_its_texel_lies(case: scenes.Case) -> None:
    # The floor spans [-2, 2]^2 at z = 0 and faces up; its lumels' centres lie half a texel inside, on a regular grid.
    known = twin.make_twin(case)
    bpy = open_blend(case.folder / "twin.blend")
    position, normal = worst.world_places(bpy.data.objects["Floor"], scenes.UV_LAYER, known["resolution"])
    covered = np.isfinite(position[..., 0])
    assert covered.sum() == known["receivers"][0]["lumels"]
    np.testing.assert_allclose(position[covered][:, 2], 0, atol=1e-6)
    np.testing.assert_allclose(normal[covered], np.broadcast_to([0, 0, 1], (covered.sum(), 3)), atol=1e-6)
    rows, columns = np.nonzero(covered)
    along = np.linalg.norm(position[rows[0], columns[0] + 1] - position[rows[0], columns[0]])
    assert along == pytest.approx(1 / known["receivers"][0]["texels_per_metre"], rel=0.1)
    assert np.abs(position[covered]).max() < 2


def test_a_crop_keeps_all_of_the_surface_in_two_objects(case: scenes.Case) -> None:
    # The floor of 16 m2 is cut at x = 0: 8 m2 receive, 8 m2 are `Floor.outside`, flat as they were.
    half = dataclasses.replace(case, receivers=("Floor", "Floor.outside"), crop={"Floor": ((-9, -9, -1), (0, 9, 1))})
    known = twin.make_twin(half)
    assert [row["area"] for row in known["receivers"]] == pytest.approx([8.0, 8.0])


def test_cycles_bakes_the_sky_s_radiance_on_a_floor_under_it(case: scenes.Case) -> None:
    # Uniform sky L over an unoccluded floor: E = pi L, so the bake of E / pi is L everywhere.
    reference.refine(case, reference.LEAST_REFERENCE_SAMPLES, wanted=0.0, minutes=1e-6)
    content = twin.make_twin(case)["content"]
    assert reference.references(case, content) is None
    baker = reference.TwinInCycles(case)
    for seed in (1, 2):
        reference.save(case, baker.bake(64, seed), content)
    pair = reference.references(case, content)
    assert pair is not None
    inner = reference.selection(case, pair).counted["Floor"].inner
    assert inner.sum() == twin.make_twin(case)["receivers"][0]["inner"]
    np.testing.assert_allclose(pair.first["Floor"][inner], SKY, rtol=1e-3)
    assert (pair.first["Cube"] != pair.second["Cube"]).any()
    assert reference.noise(case, content) < 0.05


def test_copies_of_a_triangle_are_taken_out_and_normals_stay(case: scenes.Case) -> None:
    # Three triangles, the second on the first but turned over: one goes, and the others face up as they did. The
    # array's cubes are made of squares, which are no copies.
    assert twin.make_twin(case)["copies"] == {}
    bpy = open_blend(case.blend)
    _quad(bpy, "Twice", 1.0, 5.0, _material(bpy, "Grey", (0.5, 0.5, 0.5)))
    twice = bpy.data.objects["Twice"].data
    twice.clear_geometry()
    corners = [(0, 0, 5), (1, 0, 5), (0, 1, 5), (0, 0, 5), (0, 1, 5), (1, 0, 5), (1, 1, 5)]
    twice.from_pydata(corners, [], [(0, 1, 2), (3, 4, 5), (1, 6, 2)])
    bpy.ops.wm.save_as_mainfile(filepath=str(case.blend))
    assert twin.make_twin(case)["copies"] == {"Twice": "1 of 3 faces lie on another"}
    bpy = open_blend(case.folder / "twin.blend")
    normals = [corner.vector[:] for corner in bpy.data.objects["Twice"].data.corner_normals]
    np.testing.assert_allclose(normals, [(0, 0, 1)] * 6, atol=1e-4)


def test_references_of_another_twin_are_passed_over(case: scenes.Case) -> None:
    # A bake kept under one content hash is not found under another.
    reference.save(case, reference.TwinInCycles(case).bake(1, 1), "another")
    assert reference.load(case, "this one") == []
    assert [bake.samples for bake in reference.load(case, "another")] == [1]


@pytest.mark.slow
def test_a_twin_s_row_counts_every_lumel_once(case: scenes.Case) -> None:
    # A floor and two cubes that touch, under a sky: the floor's inner lumels are lit, the cubes' two faces that touch
    # are black. Those that count, edges, black and farthest ones are the whole; the row holds.
    known = twin.make_twin(case)
    baker = reference.TwinInCycles(case)
    for seed in (1, 2):
        reference.save(case, baker.bake(reference.LEAST_REFERENCE_SAMPLES, seed), known["content"])
    row = twins.measure(case, 0.02)
    assert row.lumels + row.edges + row.black + row.farthest == known["lumels"]
    floor, cube = known["receivers"]
    assert row.black == pytest.approx(cube["lumels"] / 6, rel=0.1)
    assert floor["inner"] + cube["inner"] * 5 / 6 == pytest.approx(row.lumels + row.farthest, rel=0.1)
    assert (row.first_samples, row.second_samples) == (64, 64)
    assert row.rms < 0.01
    assert row.rms_low <= row.rms <= row.rms_high
    assert row.estimated_low <= row.estimated <= row.estimated_high
    assert row.holds()

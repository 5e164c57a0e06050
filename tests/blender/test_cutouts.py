"""Shadows of surfaces with holes, against Cycles: the same lumels under the same plate.

The receiver is a square of 1 m at z = 0 with 8 x 8 lumels; a plate of the same size hovers .3 m above it, whose alpha
is the case's. A square lamp shines from z = 2 m. Cycles bakes the direct diffuse light without colour, 4,096 samples;
ours is the mean over as many shadow rays to points of the lamp, from the part of each lumel that Cycles samples.
"""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np
import pytest
from radiosity.solver import irradiance
from radiosity.solver.geometry import Geometry
from radiosity.solver.sampling import kronecker
from radiosity.solver.scene import Scene
from radiosity.solver.settings import Settings
from radiosity.tests.blender.stage import export

SIDE = 8
SAMPLES = 4096
TOLERANCE = 0.01
# Part of a lumel, each way, that Cycles' samples are spread over.
FOOTPRINT = 0.5 if bpy.app.version < (5, 2) else 1.0
# Mean irradiance of the receiver without a plate, W/m2.
OPEN = 6.8


def unwrapped(item: Any) -> Any:
    layer = item.data.uv_layers.new(name="Paint")
    layer.uv.foreach_set("vector", np.array([vertex.co.xy for vertex in item.data.vertices], np.float32).ravel())
    return item


@pytest.fixture
def stage(build):
    """The receiver and the lamp; the plate is the test's."""
    white = build.material("White", (1, 1, 1))
    tree = white.node_tree
    tree.links.new(tree.nodes.new("ShaderNodeBsdfDiffuse").outputs[0], tree.get_output_node("CYCLES").inputs[0])
    unwrapped(build.mesh("Receiver", material=white))
    data = bpy.data.lights.new("Lamp", "AREA")
    data.energy, data.size = 100, 0.6
    lamp = build.object("Lamp", data)
    lamp.location = (0.5, 0.5, 2)
    return build


def plate(build: Any, material: Any) -> Any:
    item = unwrapped(build.mesh("Plate", material=material))
    item.location = (0, 0, 0.3)
    return item


def cycles() -> np.ndarray:
    """(64,): irradiance of the receiver's lumels by Cycles, W/m2."""
    scene, receiver = bpy.context.scene, bpy.data.objects["Receiver"]
    scene.render.engine = "CYCLES"
    scene.cycles.device, scene.cycles.samples = "CPU", SAMPLES
    scene.cycles.use_adaptive_sampling = scene.cycles.use_denoising = False
    scene.cycles.sample_clamp_direct = scene.cycles.sample_clamp_indirect = 0
    image = bpy.data.images.new("Baked", SIDE, SIDE, float_buffer=True)
    image.colorspace_settings.name = "Non-Color"
    tree = receiver.data.materials[0].node_tree
    tree.nodes.active = tree.nodes.new("ShaderNodeTexImage")
    tree.nodes.active.image = image
    bpy.context.view_layer.objects.active = receiver
    receiver.select_set(True)
    bpy.ops.object.bake(type="DIFFUSE", pass_filter={"DIRECT"}, margin=0)
    return np.asarray(np.array(image.pixels[:]).reshape(SIDE * SIDE, 4)[:, 0] * np.pi)


def ours(scene: Scene) -> np.ndarray:
    """(64,): irradiance of the lumels by shadow rays to the scene's lamp."""
    lamp = scene.lights[0].translated(-scene.origin)
    index = np.repeat(np.arange(SIDE * SIDE), SAMPLES)
    numbers = (np.tile(kronecker(SAMPLES, 4), (SIDE * SIDE, 1)) + 0.37 * index[:, None]) % 1
    middle = np.stack([index % SIDE, index // SIDE], axis=1) + 0.5
    points = np.zeros((len(index), 3), np.float32)
    points[:, :2] = (middle + (numbers[:, 2:] - 0.5) * FOOTPRINT) / SIDE
    points = (points - scene.origin).astype(np.float32)
    normals = np.broadcast_to(np.array([0, 0, 1], np.float32), points.shape)
    towards = lamp.sample(points, normals, numbers[:, :2].astype(np.float32))
    hidden = Geometry(scene).visibility.occluded(points + normals * 1e-4, towards.direction, towards.distance * 0.999)
    light = towards.weight * ~hidden * lamp.colour[0]
    return np.asarray(light.reshape(SIDE * SIDE, SAMPLES).mean(axis=1))


def assert_agree(found: np.ndarray, expected: np.ndarray) -> None:
    """Lumel by lumel to 1 % of the light in the open, and their mean to 1 % of itself."""
    # The diagonal is left out: two triangles share its lumels, and Cycles samples one of the two.
    apart = np.arange(SIDE * SIDE) // SIDE != np.arange(SIDE * SIDE) % SIDE
    found, expected = found[apart], expected[apart]
    assert 0.1 * OPEN < expected.mean() < 0.8 * OPEN
    assert np.sqrt(((found - expected) ** 2).mean()) < TOLERANCE * OPEN
    assert abs(found.mean() / expected.mean() - 1) < TOLERANCE


def alpha_image(build: Any, alpha: np.ndarray) -> Any:
    rgba = np.full((*alpha.shape, 4), 0.9)
    rgba[..., 3] = alpha
    return build.image("Leaf", rgba)


def holes() -> np.ndarray:
    """64 x 64: opaque, but for a round hole and a slit."""
    y, x = (np.mgrid[0:64, 0:64] + 0.5) / 64
    return np.asarray(1.0 - (((x - 0.4) ** 2 + (y - 0.6) ** 2 < 0.05) | (abs(x - 0.85) < 0.04)))


def by_image(build: Any, alpha: np.ndarray) -> Any:
    """A Principled material, its alpha an image's."""
    material = build.textured("Leaf", alpha_image(build, alpha))
    tree = material.node_tree
    image = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeTexImage")
    tree.links.new(image.outputs["Alpha"], build.shader(material).inputs["Alpha"])
    return material


def by_mix(build: Any, factor: Any) -> Any:
    """Transparent and Diffuse, mixed by a number or by a node's output that `factor(tree)` gives."""
    material = build.material("Mix", (1, 1, 1))
    tree = material.node_tree
    clear, matt, mix = (tree.nodes.new(f"ShaderNode{kind}") for kind in ("BsdfTransparent", "BsdfDiffuse", "MixShader"))
    if callable(factor):
        tree.links.new(factor(tree), mix.inputs[0])
    else:
        mix.inputs[0].default_value = factor
    tree.links.new(clear.outputs[0], mix.inputs[1])
    tree.links.new(matt.outputs[0], mix.inputs[2])
    tree.links.new(mix.outputs[0], tree.get_output_node("CYCLES").inputs["Surface"])
    return material


def voronoi_mask(tree: Any) -> Any:
    """1 within .09 of a cell's middle, else 0."""
    cells, less = tree.nodes.new("ShaderNodeTexVoronoi"), tree.nodes.new("ShaderNodeMath")
    cells.inputs["Scale"].default_value = 3
    less.operation = "GREATER_THAN"
    less.inputs[1].default_value = 0.4
    tree.links.new(cells.outputs["Distance"], less.inputs[0])
    return less.outputs[0]


CASES = {
    "an image's alpha": lambda build: by_image(build, holes()),
    "a soft alpha": lambda build: by_image(build, np.linspace(0, 1, 64)[None].repeat(64, axis=0)),
    "a mask made by nodes": lambda build: by_mix(build, voronoi_mask),
    "the same opacity everywhere": lambda build: by_mix(build, 0.3),
    "a plain alpha": lambda build: build.material("Film", (0.5, 0.5, 0.5), Alpha=0.6),
}


@pytest.mark.parametrize("case", CASES)
def test_a_surface_with_holes_casts_the_shadow_that_cycles_casts(stage, case):
    plate(stage, CASES[case](stage))
    warnings: list[dict[str, Any]] = []
    scene = export(warnings)
    assert_agree(ours(scene), cycles())
    assert warnings == []


def test_what_is_solid_of_a_surface_reflects_its_whole_colour(stage):
    # Base colour .5 everywhere, alpha of an image. Exact answer: reflectance .5 where alpha is not 0.
    material = by_image(stage, np.linspace(0.2, 1, 64)[None].repeat(64, axis=0))
    tree = material.node_tree
    for link in list(stage.shader(material).inputs["Base Color"].links):
        tree.links.remove(link)
    stage.shader(material).inputs["Base Color"].default_value = (0.5, 0.5, 0.5, 1)
    plate(stage, material)
    scene = export([])
    rows = np.flatnonzero(np.asarray(scene.opacity_texture) >= 0).repeat(64)
    u, v = (np.tile(kronecker(64, 2)[:, axis] / 2, len(rows) // 64).astype(np.float32) for axis in (0, 1))
    assert np.allclose(Geometry(scene).reflectance(rows, u, v), 0.5, atol=2e-3)


def test_light_through_a_film_adds_up_in_the_whole_solver(stage):
    # A black film of opacity .4 over the whole receiver. Exact answer: .6 of the light without it.
    points = np.column_stack([0.2 + 0.6 * kronecker(200, 2), np.full(200, 0.01)])
    up = np.tile([0.0, 0.0, 1.0], (200, 1))
    bare = irradiance(export([]), Settings(error=0.03), points, up)
    film = stage.material("Film", (0, 0, 0), Alpha=0.4)
    plate(stage, film).scale = (20, 20, 1)
    bpy.data.objects["Plate"].location = (-10, -10, 0.3)
    covered = irradiance(export([]), Settings(error=0.03), points, up)
    assert covered.mean() / bare.mean() == pytest.approx(0.6, rel=0.01)

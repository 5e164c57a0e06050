"""What ray visibility does, against Cycles (see `stage`)."""

import bpy
import numpy as np
import pytest
from radiosity import radiosity_addon, solver
from radiosity.radiosity_addon.export import export_scene
from radiosity.tests.blender.stage import (
    TOLERANCE,
    cycles_irradiance,
    exported,
    footprint_points,
    lamp,
    material,
    mesh,
    solver_irradiance,
    warned,
)


@pytest.mark.parametrize(("kind", "settings"), [
    ("POINT", {}), ("SPOT", {"spot_size": 1.6, "spot_blend": 0.5}), ("SUN", {})])
def test_a_lamp_without_shadows_shines_through_the_plate(stage, kind, settings):
    # The shaded lumels get what they would get without the plate.
    bulb = lamp(kind, energy=10, **settings)
    bulb.data.use_shadow = False
    lights = exported()
    cycles = cycles_irradiance()
    ours = solver_irradiance(lights, 0.001 * cycles.mean())
    assert ours.mean(axis=1) == pytest.approx(cycles.mean(axis=1), rel=TOLERANCE)
    bulb.data.use_shadow = True
    assert cycles_irradiance()[1].mean() < 0.9 * cycles[1].mean()


def test_a_lamp_of_few_bounces_is_told_of(stage):
    lamp("POINT", energy=5).data.cycles.max_bounces = 2
    assert "after 2 bounces" in warned()[1]


def test_a_lamp_hidden_from_cameras_shines_all_the_same(stage):
    lamp("POINT", energy=5).visible_camera = False
    assert len(exported()) == 1


def _exported_scene():
    """The whole scene, and the warnings' (object, code)."""
    warnings = []
    scene = bpy.context.scene
    exported = export_scene(scene, bpy.context.view_layer, solver.Settings(), warnings)
    return exported.scene, [(warning["object"], warning["code"]) for warning in warnings]


def _means(scene):
    """(2, 3) mean irradiance of the open and of the shaded lumels, all bounces."""
    points = np.concatenate([footprint_points(left)[:, :16].reshape(-1, 3) for left in (-1.5, 0.5)])
    up = np.tile(np.float32([0, 0, 1]), (len(points), 1))
    value = solver.irradiance(scene, solver.Settings(error=0.02), points, up)
    return value.reshape(2, -1, 3).mean(axis=1)


@pytest.fixture
def registered(stage):
    """The addon registered."""
    radiosity_addon.register()
    yield
    radiosity_addon.unregister()


@pytest.fixture
def walls(registered):
    """A lamp without radius, and a red wall beside the receivers, which throws its light at them."""
    lamp("POINT", energy=100, shadow_soft_size=0)
    return mesh("Wall", [(-2, 0.7, 0), (2, 0.7, 0), (2, 0.7, 2), (-2, 0.7, 2)], [(0, 1, 2, 3)],
                material("Red", "ShaderNodeBsdfDiffuse", Color=(0.9, 0.2, 0.1, 1)))


def test_an_object_that_casts_no_shadow_reflects_all_the_same(walls):
    # The plate is white: it bounces light down, and lets the lamp's through.
    plate = bpy.data.objects["Plate"]
    plate.data.materials[0] = material("White plate", "ShaderNodeBsdfDiffuse", Color=(0.8, 0.8, 0.8, 1))
    plate.visible_shadow = False
    scene, told = _exported_scene()
    assert told == [("Plate", "visibility")]
    assert _means(scene) == pytest.approx(cycles_irradiance(("DIRECT", "INDIRECT")).mean(axis=1), rel=0.01)


def test_an_object_that_diffuse_rays_do_not_see_casts_its_shadow_and_reflects_nothing(walls):
    # Without its bounce the wall leaves what a black wall would: it hides nothing of what is there.
    walls.visible_diffuse = False
    scene, told = _exported_scene()
    assert told == []
    ours = _means(scene)
    assert ours == pytest.approx(cycles_irradiance(("DIRECT", "INDIRECT")).mean(axis=1), rel=0.01)
    walls.visible_diffuse = True
    assert _means(_exported_scene()[0])[0, 0] > 1.05 * ours[0, 0]


def _instanced(*items):
    """An empty that shows objects as instances, in their places."""
    collection = bpy.data.collections.new("Shown")
    for item in items:
        bpy.context.collection.objects.unlink(item)
        collection.objects.link(item)
    instancer = bpy.data.objects.new("Instancer", None)
    instancer.instance_type, instancer.instance_collection = "COLLECTION", collection
    bpy.context.collection.objects.link(instancer)
    return instancer


@pytest.mark.parametrize(("word", "expected"), [
    ("visible_shadow", [("Instancer", "visibility")]), ("visible_diffuse", [])])
def test_what_rays_do_not_see_of_an_instancer_they_do_not_see_of_its_instances(walls, word, expected):
    # Plate and wall are visible to all rays, the empty that shows them is not.
    instancer = _instanced(bpy.data.objects["Plate"], walls)
    before = _means(_exported_scene()[0])
    setattr(instancer, word, False)
    scene, told = _exported_scene()
    assert told == expected
    ours = _means(scene)
    assert ours == pytest.approx(cycles_irradiance(("DIRECT", "INDIRECT")).mean(axis=1), rel=0.01)
    assert np.abs(ours / before - 1).max() > 0.05


def test_a_lamp_of_an_instancer_that_diffuse_rays_do_not_see_gives_what_cycles_gives(stage):
    # Cycles looks at the instancer of a lamp or not, by its version.
    _instanced(lamp("POINT", energy=100, shadow_soft_size=0)).visible_diffuse = False
    light = cycles_irradiance(samples=16)
    if light.any():
        assert solver_irradiance(exported(), 0.001 * light.mean()).mean() == pytest.approx(light.mean(), rel=TOLERANCE)
    else:
        lights, message = warned()
        assert lights == ()
        assert "'Instancer'" in message


def test_a_glowing_object_that_diffuse_rays_do_not_see_gives_no_light(registered):
    mesh("Glow", [(-1, -1, 2), (1, -1, 2), (1, 1, 2), (-1, 1, 2)], [(0, 1, 2, 3)],
         material("Glow", "ShaderNodeEmission", Strength=5)).visible_diffuse = False
    lamp("POINT", energy=10, shadow_soft_size=0, location=(0, 0.3, 1.5))
    scene, _ = _exported_scene()
    assert not np.asarray(scene.emission).any()
    assert _means(scene) == pytest.approx(cycles_irradiance(("DIRECT", "INDIRECT")).mean(axis=1), rel=0.01)

"""Each kind of light against Cycles: the same lumels, once in the open and once half in the shade (see `stage`)."""

import math

import bpy
import numpy as np
import pytest
from radiosity.solver.mesh_emitter import group_emitters
from radiosity.tests.blender.stage import (
    TOLERANCE,
    assert_agree,
    cycles_irradiance,
    emission_nodes,
    exported,
    lamp,
    material,
    mesh,
    our_irradiance,
    warned,
)

LAMPS = {
    "area square": ("AREA", {"energy": 50, "size": 0.8, "color": (1, 0.5, 0.25)}),
    "area rectangle": ("AREA", {"energy": 50, "shape": "RECTANGLE", "size": 0.4, "size_y": 1.2,
                                "rotation": (0.2, 0.3, 0.5)}),
    "area disc": ("AREA", {"energy": 50, "shape": "DISK", "size": 0.8}),
    "area ellipse, scaled": ("AREA", {"energy": 50, "shape": "ELLIPSE", "size": 0.4, "size_y": 0.6,
                                      "scale": (1.5, 2, 1)}),
    "area mirrored": ("AREA", {"energy": 50, "size": 0.6, "scale": (-1, 2, 1), "rotation": (0, 0, 0.4)}),
    "area with spread": ("AREA", {"energy": 50, "size": 1.0, "spread": 2.0, "location": (0.3, 0, 2)}),
    "area disc with a narrow spread": ("AREA", {"energy": 50, "shape": "DISK", "size": 4.0, "spread": 0.35}),
    "point without radius": ("POINT", {"energy": 100, "shadow_soft_size": 0}),
    "point": ("POINT", {"energy": 100, "shadow_soft_size": 0.4}),
    "point as a sphere": ("POINT", {"energy": 100, "shadow_soft_size": 0.6, "use_soft_falloff": False}),
    "point scaled": ("POINT", {"energy": 100, "shadow_soft_size": 0.2, "scale": (2, 3, 0.5)}),
    "spot without radius": ("SPOT", {"energy": 100, "shadow_soft_size": 0, "spot_size": 1.6, "spot_blend": 0.5}),
    "spot": ("SPOT", {"energy": 100, "shadow_soft_size": 0.3, "spot_size": 1.4, "spot_blend": 0.3}),
    "spot as a sphere": ("SPOT", {"energy": 100, "shadow_soft_size": 0.5, "spot_size": 1.4, "spot_blend": 0.6,
                                  "use_soft_falloff": False}),
    "spot scaled": ("SPOT", {"energy": 100, "shadow_soft_size": 0.1, "spot_size": 1.0, "spot_blend": 0.4,
                             "scale": (2, 1, 0.8), "rotation": (0.1, 0.2, 0.3)}),
    "sun without angle": ("SUN", {"energy": 3, "angle": 0, "rotation": (0.5, 0.2, 0)}),
    "sun": ("SUN", {"energy": 3, "angle": 0.6, "rotation": (0.5, 0.2, 0)}),
    "sun scaled and mirrored": ("SUN", {"energy": 3, "angle": 0.3, "rotation": (0.5, 0.2, 0), "scale": (-1, 1, 2)}),
}
# Exposure, temperature and "normalize" came with Blender 4.5.
NEWER_LAMPS = {
    "exposure": ("POINT", {"energy": 100, "shadow_soft_size": 0, "exposure": 1.5}),
    "temperature": ("POINT", {"energy": 100, "shadow_soft_size": 0, "use_temperature": True, "temperature": 3000,
                              "color": (0.5, 1, 1)}),
    "area per square metre": ("AREA", {"energy": 5, "shape": "ELLIPSE", "size": 0.8, "size_y": 0.5,
                                       "normalize": False}),
    "sphere per square metre": ("POINT", {"energy": 5, "shadow_soft_size": 0.3, "normalize": False}),
    "point per nothing": ("POINT", {"energy": 5, "shadow_soft_size": 0, "normalize": False}),
    "sun per steradian": ("SUN", {"energy": 50, "angle": 0.3, "rotation": (0.5, 0.2, 0), "normalize": False}),
}


@pytest.mark.parametrize("kind", LAMPS)
def test_a_lamp_gives_what_cycles_bakes(stage, kind):
    lamp_type, settings = LAMPS[kind]
    lamp(lamp_type, **settings)
    lights = exported()
    assert len(lights) == 1
    assert_agree(lights)


@pytest.mark.skipif("normalize" not in bpy.types.Light.bl_rna.properties, reason="came with Blender 4.5")
@pytest.mark.parametrize("kind", NEWER_LAMPS)
def test_what_multiplies_a_lamps_power_counts_as_in_cycles(stage, kind):
    lamp_type, settings = NEWER_LAMPS[kind]
    lamp(lamp_type, **settings)
    assert_agree(exported())


def test_a_setting_sun_lights_what_stands_above_the_horizon(stage):
    # 46 degrees wide and 10 degrees high: its lower part is cut off. The plate's shade falls beside the receivers.
    lamp("SUN", energy=3, angle=0.8, rotation=(0, -1.4, 0))
    _, closed = our_irradiance(exported())
    assert closed.mean(axis=0) == pytest.approx(cycles_irradiance()[0].mean(axis=0), rel=TOLERANCE)


def test_a_lamps_emission_node_multiplies_its_power(stage):
    bulb = lamp("POINT", energy=100, shadow_soft_size=0, color=(1, 0.5, 1))
    emission_nodes(bulb, (0.5, 1, 0.25), 3)
    lights = exported()
    assert lights[0].power() == pytest.approx(100 * 3 * np.array([0.5, 0.5, 0.25]))
    assert_agree(lights)


def test_a_quadratic_falloff_is_what_light_does_anyway(stage):
    emission = emission_nodes(lamp("POINT", energy=100, shadow_soft_size=0), (1, 1, 1), 1)
    tree = emission.id_data
    falloff = tree.nodes.new("ShaderNodeLightFalloff")
    falloff.inputs["Strength"].default_value = 2
    tree.links.new(falloff.outputs["Quadratic"], emission.inputs["Strength"])
    lights = exported()
    assert lights[0].power() == pytest.approx(200)
    assert_agree(lights)


def test_nodes_that_are_switched_off_count_for_nothing(stage):
    bulb = lamp("POINT", energy=100, shadow_soft_size=0)
    if getattr(bulb.data.bl_rna.properties["use_nodes"], "is_deprecated", False):
        pytest.skip("this Blender has no such switch")
    emission_nodes(bulb, (0.5, 1, 0.25), 3)
    bulb.data.use_nodes = False
    assert_agree(exported())


def test_instances_of_a_lamp_shine_where_they_stand(stage):
    # Two instances of a collection with one area lamp, turned and scaled, and none where the collection itself is.
    bulb = lamp("AREA", location=(0, 0, 0.2), energy=30, size=0.5)
    bpy.context.collection.objects.unlink(bulb)
    collection = bpy.data.collections.new("Lamps")
    collection.objects.link(bulb)
    for x, turn, scale in ((-0.5, 0.3, 1), (1.0, -0.4, 2)):
        instancer = bpy.data.objects.new("Instancer", None)
        instancer.instance_type, instancer.instance_collection = "COLLECTION", collection
        instancer.location, instancer.rotation_euler, instancer.scale = (x, 0.2, 1.8), (0, turn, 0), [scale] * 3
        bpy.context.collection.objects.link(instancer)
    lights = exported()
    assert len(lights) == 2
    assert_agree(lights)


def test_a_lamp_hidden_from_diffuse_rays_gives_no_light(stage):
    lamp("POINT", energy=100).visible_diffuse = False
    lights, message = warned()
    assert lights == ()
    assert "Ray Visibility" in message
    assert cycles_irradiance().max() == 0


def test_lamps_that_send_nothing_are_left_out(stage):
    lamp("POINT", energy=0)
    lamp("SUN", color=(0, 0, 0))
    lamp("AREA").data.cycles.is_portal = True
    lamp("POINT", energy=10).hide_render = True
    assert exported() == ()


@pytest.mark.parametrize(("settings", "word"), [
    ({"kind": "POINT", "energy": -5}, "negative"),
    ({"kind": "AREA", "energy": 5, "size": 0}, "area is 0"),
    ({"kind": "SPOT", "energy": 5, "scale": (1, 0, 1)}, "scale is 0"),
])
def test_lamps_that_cannot_shine_are_told_of_and_left_out(stage, settings, word):
    lamp(**settings)
    lights, message = warned()
    assert lights == ()
    assert word in message


def _shear(bulb):
    """Stretch a lamp along x from outside."""
    bulb.parent = bpy.data.objects.new("Parent", None)
    bulb.parent.scale = (2, 1, 1)
    bpy.context.collection.objects.link(bulb.parent)


def test_a_sheared_disc_is_an_ellipse_as_in_cycles(stage):
    _shear(lamp("AREA", energy=50, shape="DISK", size=0.8, rotation=(0, 0, math.pi / 4)))
    assert_agree(exported())


def test_a_sheared_square_is_told_of(stage):
    # Turned by 45 degrees it becomes a rhombus, which Cycles renders up to 30 % too bright or too dark.
    _shear(lamp("AREA", energy=5, rotation=(0, 0, math.pi / 4)))
    lights, message = warned()
    assert "right angles" in message
    assert lights[0].power() == pytest.approx(5)


@pytest.mark.parametrize("shape", ["SQUARE", "DISK"])
def test_a_lamp_sheared_askew_of_its_face_is_told_of(stage, shape):
    # Tilted about x by .6 rad, then stretched along y: its sides stay at right angles, and -z leans to its face.
    bulb = lamp("AREA", energy=5, shape=shape, rotation=(0.6, 0, 0))
    _shear(bulb)
    assert len(exported()) == 1
    bulb.parent.scale = (1, 3, 1)
    assert "straight ahead" in warned()[1]


def test_an_emissive_mesh_shines_from_its_back_too(stage):
    # A quad of 3 W/(m2 sr), 1.5 m above the receivers, whose front looks up, away from them.
    corners = np.array([(-0.5, -0.4, 1.5), (0.7, -0.4, 1.5), (0.7, 0.6, 1.7), (-0.5, 0.6, 1.7)])
    mesh("Emitter", corners.tolist(), [(0, 1, 2, 3)], material("Glow", "ShaderNodeEmission", Color=(1, 0.5, 0.2, 1),
                                                                 Strength=3))
    triangles = corners[[[0, 1, 2], [0, 2, 3]]]
    exitance = np.pi * 3 * np.tile([1, 0.5, 0.2], (2, 1))
    assert_agree(group_emitters(triangles, exitance))

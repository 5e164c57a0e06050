"""What ray visibility and linking of lamps do, against Cycles (see `stage`)."""

import bpy
import pytest
from radiosity.tests.blender.stage import TOLERANCE, cycles_irradiance, exported, lamp, solver_irradiance, warned


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


def test_a_lamp_that_is_linked_is_told_of(stage):
    bulb = lamp("POINT", energy=5)
    bulb.light_linking.receiver_collection = bpy.data.collections.new("Some")
    assert "Light Linking" in warned()[1]


def test_a_lamp_hidden_from_cameras_shines_all_the_same(stage):
    lamp("POINT", energy=5).visible_camera = False
    assert len(exported()) == 1

"""Units: a scene in centimetres bakes as Cycles lights it, and every image file says what its numbers are."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from radiosity import operators
from radiosity.radiosity_addon.export import export_scene
from radiosity.radiosity_addon.units import metres_per_unit
from radiosity.solver import image_file
from radiosity.solver.quantities import LUMINOUS_EFFICACY, photometric
from radiosity.solver.settings import Settings
from radiosity.tests.blender.stage import assert_agree, cycles_irradiance, emission_nodes, exported, lamp

CENTIMETRES = 0.01
# Lumens that Cycles takes for a watt of an IES file's light: daylight's, D65.
CYCLES_IES = 177.83
# An even 1,000 cd into all directions, every 10 degrees; Cycles 4.2 adds some between angles that are far apart.
IES = "\n".join([
    "IESNA:LM-63-2002", "TILT=NONE", "1 -1 1 19 37 1 2 0 0 0 1 1 100", " ".join(map(str, range(0, 181, 10))),
    " ".join(map(str, range(0, 361, 10))), *[" ".join(["1000"] * 19)] * 37, ""])


def set_scale(scale: float, system: str = "METRIC") -> Any:
    """The open scene with a unit scale."""
    scene = bpy.context.scene
    scene.unit_settings.system, scene.unit_settings.scale_length = system, scale
    return scene


@pytest.mark.parametrize(("kind", "settings"), [
    ("POINT", {"energy": 50}), ("AREA", {"energy": 50, "size": 0.8}), ("SUN", {"energy": 3})])
def test_the_unit_scale_changes_no_light_in_cycles_nor_here(stage, kind, settings):
    # A lamp over receivers of 1 unit, in a scene whose units are shown as centimetres. Exact answer: Cycles bakes the
    # same with both scales (a unit is a metre for light), and so does the solver.
    lamp(kind, **settings)
    set_scale(1.0)
    in_metres = cycles_irradiance()
    set_scale(CENTIMETRES)
    assert cycles_irradiance() == pytest.approx(in_metres, rel=1e-5)
    assert_agree(exported())


def test_geometry_is_in_blender_units_at_any_scale(build):
    # A cube of 2 units and a sun, shown in centimetres. Exact answer: vertices at +-1, as where the scale is 1.
    build.cube("Cube", 2.0)
    build.sun()
    scene = set_scale(CENTIMETRES)
    made = export_scene(scene, bpy.context.view_layer, Settings(), []).scene
    assert np.abs(made.vertices).min() == np.abs(made.vertices).max() == 1


@pytest.mark.parametrize(("scale", "system", "density"), [
    (1.0, "METRIC", 20), (CENTIMETRES, "METRIC", 0.2), (0.3048, "IMPERIAL", 6.096), (CENTIMETRES, "NONE", 20)])
def test_texel_density_is_per_metre_as_blender_shows_it(build, scale, system, density):
    # 20 pixels per metre. Exact answer: times the metres of a unit; bare numbers are metres.
    build.mesh("Square")
    build.sun()
    scene = set_scale(scale, system)
    warnings: list[dict[str, Any]] = []
    found = export_scene(scene, bpy.context.view_layer, Settings(texel_density=20), warnings)
    assert metres_per_unit(scene) == pytest.approx(density / 20)
    assert found.settings.texel_density == pytest.approx(density)
    assert warnings == []


@pytest.mark.parametrize(("quantity", "warned"), [
    ("radiance", False), ("irradiance", True), ("illuminance", True), ("radiosity", True)])
def test_watts_per_square_unit_are_told(build, quantity, warned):
    # Centimetres: radiance matches Cycles; the others are named per square metre, so one warning says what they are.
    build.mesh("Square")
    build.sun()
    warnings: list[dict[str, Any]] = []
    export_scene(set_scale(CENTIMETRES), bpy.context.view_layer, Settings(quantity=quantity), warnings)
    assert [warning["code"] for warning in warnings] == ["unit_scale"] * warned
    assert all(quantity in warning["message"] and "0.01" in warning["message"] for warning in warnings)


@pytest.mark.skipif(not hasattr(bpy.data, "colorspace"), reason="Blender before 5.0 has no other working space")
def test_another_working_space_is_told(build):
    # A square under a sun. Exact answer: one warning in a file of Rec. 2020, none in one of Rec. 709.
    build.sun()
    build.mesh("Square")
    for space, count in (("Linear Rec.2020", 1), ("Linear Rec.709", 0)):
        bpy.ops.wm.set_working_color_space(working_space=space)
        warnings: list[dict[str, Any]] = []
        export_scene(bpy.context.scene, bpy.context.view_layer, Settings(), warnings)
        assert [warning["code"] for warning in warnings] == ["working_space"] * count
        assert all(repr(space) in warning["message"] for warning in warnings)


@pytest.mark.parametrize("pack", [False, True])
def test_the_image_says_its_quantity_unit_seed_and_error(build, tmp_path, pack):
    # A square of 400 units, shown as 4 m, under a sun of 1 W/m2, 20 px/m, as illuminance. Exact answer: 683 lux in
    # about 80 x 80 lumels; the file, or the one packed in the .blend, has quantity, unit, seed and the report's error.
    operators.register()
    try:
        build.sun()
        square = build.mesh("Square", [(0, 0, 0), (400, 0, 0), (400, 400, 0), (0, 400, 0)])
        scene = set_scale(CENTIMETRES)
        scene.radiosity.error, scene.radiosity.pack = 0.2, pack
        told = tmp_path / "report.json"
        options = f"--texel-density 20 --quantity illuminance --seed 7 --report '{told}'"
        assert bpy.ops.radiosity.bake(options=options if pack else f"{options} --output '{tmp_path}'") == {"FINISHED"}
    finally:
        operators.unregister()
    image = square["radiosity_lightmaps"]
    path = Path(bpy.path.abspath(image.filepath))
    if pack:
        path = tmp_path / "unpacked.exr"
        path.write_bytes(image.packed_file.data)
    layers, header = image_file.read_layers(path)
    lit = layers[""][layers[""] > 0]
    assert lit == pytest.approx(683, rel=0.02)
    report = json.loads(told.read_text())
    assert report["lumels"] == pytest.approx(6400, rel=0.1)
    assert (header["radiosity:quantity"], header["radiosity:unit"]) == ("illuminance", "lux")
    assert (header["radiosity:seed"], header["radiosity:objects"]) == ("7", "Square")
    assert header["radiosity:wantedError"] == pytest.approx(0.2)
    assert math.isclose(header["radiosity:error"], report["error"]["estimated"]["rms"], rel_tol=1e-6)
    assert header["radiosity:luminousEfficacy"] == 683
    assert report["settings"]["texel_density"] == 20


def test_cycles_makes_watts_of_an_ies_file_s_candela_by_177_83(stage):
    # A point lamp of 1 W whose IES file says 1,000 cd everywhere, 2 m above: 1000 / r2 cos lux, so over Cycles' W/m2
    # stands the efficacy that docs/units.md names for such files.
    bulb = lamp("POINT", location=(-1, 0, 2), energy=1, shadow_soft_size=0)
    emission = emission_nodes(bulb, (1, 1, 1), 1.0)
    tree = bulb.data.node_tree
    profile = tree.nodes.new("ShaderNodeTexIES")
    text = bpy.data.texts.new("bulb.ies")
    text.write(IES)
    profile.ies = text
    tree.links.new(profile.outputs["Fac"], emission.inputs["Strength"])
    watts = cycles_irradiance()[0]
    place = (np.arange(8) + 0.5) / 8 - 0.5
    r2 = 4 + place[:, None] ** 2 + place[None] ** 2
    lux = (1000 * 2 / r2**1.5)[~np.eye(8, dtype=bool)]
    assert lux.mean() / photometric(watts, 1.0).mean() == pytest.approx(CYCLES_IES, rel=0.002)


def test_lux_are_made_with_the_efficacy_of_blender_s_own_gltf():
    # 683 lm/W there as here: a lamp that is exported to another program has there the lumens that a bake gives it.
    conversion = pytest.importorskip("io_scene_gltf2.blender.com.conversion", reason="Blender's glTF module moved")
    assert conversion.PBR_WATTS_TO_LUMENS == LUMINOUS_EFFICACY

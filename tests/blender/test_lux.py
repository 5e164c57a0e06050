"""Lux of a bake: the table, working planes, the legend of the scale."""

from __future__ import annotations

import csv
import math
from contextlib import closing

import bpy
import pytest
from radiosity.radiosity_addon import false_colour, legend
from radiosity.radiosity_addon.baked_light import VIEW_MARK
from radiosity.radiosity_addon.working_plane import PlaneJob
from radiosity.solver.errors import Cancelled

# Of a white irradiance of 1 W/m2, lx.
WHITE = 683.0


@pytest.mark.parametrize(("target", "quantity"), [("lightmap", "radiance"), ("lightmap", "illuminance"),
                                                  ("vertex", "irradiance")])
def test_the_table_of_lux_gives_exact_means_and_areas(sunny, target, quantity):
    # A black floor of 2 m2 under a sun of 1 W/m2, and one turned by 60 degrees, far away.
    # Exact answers: 683 lx and half of it, the same everywhere, uniformity 1.
    bpy.context.scene.radiosity.target, bpy.context.scene.radiosity.quantity = target, quantity
    floor = sunny.mesh("Floor", material=(0.0, 0.0, 0.0))
    floor.scale = (2, 1, 1)
    sunny.mesh("Slope", material=(0.0, 0.0, 0.0)).location = (50, 0, 0)
    bpy.data.objects["Slope"].rotation_euler = (math.radians(60), 0, 0)
    bpy.ops.radiosity.bake()
    assert bpy.ops.radiosity.lux_view() == {"FINISHED"}
    rows = {row.name: row for row in bpy.context.scene.radiosity_view.rows}
    assert (rows["Floor"].minimum, rows["Floor"].mean, rows["Floor"].maximum) == pytest.approx((WHITE,) * 3, rel=0.01)
    assert rows["Slope"].mean == pytest.approx(WHITE / 2, rel=0.01)
    assert (rows["Floor"].area, rows["Slope"].area) == pytest.approx((2, 1), rel=1e-5)
    assert rows["Floor"].uniformity == pytest.approx(1, rel=0.01)


def test_lux_of_a_gradient_is_weighted_by_area(sunny):
    # Vertex colours set by hand on a unit square, 0 and 2 W/m2 on two sides. Exact answer: 0, 683, 1366 lx.
    bpy.context.scene.radiosity.target, bpy.context.scene.radiosity.quantity = "vertex", "irradiance"
    square = sunny.mesh("Square", material=(0.5, 0.5, 0.5))
    bpy.ops.radiosity.bake()
    for corner, loop in zip(square.data.color_attributes["Radiosity"].data, square.data.loops, strict=True):
        value = 2 * square.data.vertices[loop.vertex_index].co.x
        corner.color = (value, value, value, 1)
    bpy.ops.radiosity.lux_view()
    row = bpy.context.scene.radiosity_view.rows["Square"]
    assert (row.minimum, row.mean, row.maximum) == pytest.approx((0, WHITE, 2 * WHITE), rel=1e-5)


def test_lux_of_radiosity_is_refused(sunny):
    sunny.mesh("Square", material=(0.5, 0.5, 0.5))
    bpy.context.scene.radiosity.quantity = "radiosity"
    bpy.ops.radiosity.bake()
    with pytest.raises(RuntimeError, match="bake radiance, irradiance or illuminance"):
        bpy.ops.radiosity.lux_view()
    assert bpy.context.scene.radiosity_view.mode == "OFF"


def test_a_working_plane_leaves_out_what_lies_inside_furniture(sunny, tmp_path):
    # A black floor of 4 m x 4 m under a sun of 1 W/m2, a closed black cube of 1 m standing on it; plane at .8 m.
    # Exact answers: 683 lx on 15 m2; nothing of it blocks light or is in a later bake; the CSV holds the same.
    floor = sunny.mesh("Floor", points=[(-2, -2, 0), (2, -2, 0), (2, 2, 0), (-2, 2, 0)], material=(0.0, 0.0, 0.0))
    sunny.cube("Cube", material=(0.0, 0.0, 0.0)).location.z = 0.5
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "plane.blend"))
    floor = bpy.data.objects["Floor"]
    view = bpy.context.scene.radiosity_view
    view.floor = floor
    assert bpy.ops.radiosity.working_plane() == {"FINISHED"}
    row = view.rows[-1]
    assert row.name == "Plane 0.8 m"
    assert (row.minimum, row.mean, row.maximum) == pytest.approx((WHITE,) * 3, rel=0.01)
    assert row.area == pytest.approx(15)
    plane = next(item for item in bpy.data.objects if VIEW_MARK in item)
    assert plane.hide_render
    assert len(plane.data.polygons) == 240
    assert bpy.ops.radiosity.lux_csv() == {"FINISHED"}
    table = list(csv.reader((tmp_path / "lightmaps" / "lux.csv").read_text(encoding="utf-8").splitlines()))
    assert table[0] == ["name", "minimum lx", "mean lx", "maximum lx", "uniformity", "area m2"]
    assert float(table[1][2]) == pytest.approx(row.mean, rel=1e-5)
    assert bpy.ops.radiosity.lux_view() == {"FINISHED"}
    assert not [item for item in bpy.data.objects if VIEW_MARK in item]


def test_a_working_plane_is_measured_in_parts(sunny):
    # A black floor of 1 m2 under a sun of 1 W/m2, read in parts of no time. Exact answers: 683 lx, after several parts;
    # nothing of it once it was cancelled.
    sunny.mesh("Floor", material=(0.0, 0.0, 0.0))
    scene, layer = bpy.context.scene, bpy.context.view_layer
    for cancel in (True, False):
        with closing(PlaneJob(scene, layer)) as job:
            assert len(list(job.exporting(0.0))) > 2
            job.start()
            job.wait(60)
            assert job.is_baked
            if cancel:
                job.cancel()
                with pytest.raises(Cancelled):
                    job.finish()
                assert not scene.radiosity_view.rows
            else:
                assert job.finish().mean == pytest.approx(WHITE, rel=0.01)


@pytest.mark.parametrize(("change", "told"), [({"spacing": 0.001}, "raise its spacing"),
                                              ({"border": 3.0}, "leaves nothing of a floor"),
                                              ({"height": -1.0}, "no light reaches the working plane")])
def test_a_working_plane_that_cannot_be_is_told(sunny, change, told):
    sunny.mesh("Floor", material=(0.5, 0.5, 0.5))
    for name, value in change.items():
        setattr(bpy.context.scene.radiosity_view, name, value)
    with pytest.raises(RuntimeError, match=told):
        bpy.ops.radiosity.working_plane()
    assert bpy.ops.radiosity.working_plane.poll()


def test_scales_have_round_numbers():
    assert false_colour.nice_step(1000) == pytest.approx(100)
    assert false_colour.nice_step(0.73) == pytest.approx(0.1)
    assert false_colour.nice_step(2400) == pytest.approx(250)
    assert false_colour.nice_top(683) == pytest.approx(700)
    assert false_colour.ticks(0, 500, 100) == pytest.approx([0, 100, 200, 300, 400, 500])
    assert false_colour.ticks(50, 480, 100) == pytest.approx([50, 100, 200, 300, 400, 480])


def test_the_legend_names_the_values_of_the_isolines(sunny):
    sunny.mesh("Square", material=(0.0, 0.0, 0.0))
    bpy.ops.radiosity.bake()
    bpy.ops.radiosity.lux_view()
    assert [text for _, text in legend.lines(bpy.context.scene.radiosity_view)] == [
        "0", "100", "200", "300", "400", "500", "600", "700"]
    bpy.context.scene.radiosity_view.automatic = False
    bpy.context.scene.radiosity_view.high = 2000
    assert legend.lines(bpy.context.scene.radiosity_view)[-1] == (1.0, "2000")

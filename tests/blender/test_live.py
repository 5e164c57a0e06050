"""A bake that is watched: its looks, what is kept of it, and that its result is that of a bake in background."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from radiosity import operators
from radiosity.radiosity_addon import first_look
from radiosity.radiosity_addon.job import Job, Outcome, run
from radiosity.radiosity_addon.live import LiveJob, steps
from radiosity.radiosity_addon.look import Look
from radiosity.radiosity_addon.request import Request
from radiosity.solver.errors import Cancelled
from radiosity.solver.layout import make_layout
from radiosity.solver.scene import Scene, Surface
from radiosity.solver.settings import Settings
from radiosity.tests.blender.conftest import UNIT_SQUARE

# Seconds that a bake of these tests may take.
LONGEST = 120.0


@pytest.fixture
def square(build: Any, tmp_path: Path) -> Iterator[Request]:
    """A grey square of 1 m under a sun of 1 W/m2, which stands straight above."""
    build.sun()
    build.mesh("Square", material=(0.5, 0.5, 0.5))
    yield Request(Settings(error=0.08, resolution=32), tmp_path / "out")
    if Job.current is not None:
        Job.current.close()


def work(job: LiveJob) -> list[Look]:
    """Let the worker run to its end; the looks on its way."""
    job.export()
    job.start()
    seen: list[Look] = []
    end = time.monotonic() + LONGEST
    while not job.is_done:
        assert time.monotonic() < end
        if job.look is not None and (not seen or seen[-1] is not job.look):
            seen.append(job.look)
        job.wait(0.001)
    if job.look is not None and (not seen or seen[-1] is not job.look):
        seen.append(job.look)
    return seen


def ended(job: LiveJob) -> Outcome:
    """What came of a job whose worker has ended."""
    try:
        outcome: Outcome = job.finish()
        return outcome
    finally:
        job.close()


def live(request: Request) -> LiveJob:
    """A job in the open file."""
    return LiveJob(request, bpy.context.scene, bpy.context.view_layer)


def light() -> Any:
    """(h, w) red of the square's image."""
    image = bpy.data.objects["Square"]["radiosity_lightmaps"]
    pixels = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(pixels)
    return pixels.reshape(image.size[1], image.size[0], -1)[:, :, 0]


def test_the_first_look_is_the_light_of_the_whole_scene(square):
    # Exact answer: E / pi times the reflectance of .5 on the whole square.
    job = live(square)
    look = work(job)[0]
    assert look.title == "first look"
    sides = np.cross(look.corners[:, 1] - look.corners[:, 0], look.corners[:, 2] - look.corners[:, 0])
    assert np.linalg.norm(sides, axis=1).sum() / 2 == pytest.approx(1.0, rel=1e-5)
    assert look.colour == pytest.approx(0.5 / math.pi, rel=0.02)
    job.close()


def test_a_watched_bake_ends_as_one_in_background_does(square, tmp_path):
    # Exact answer: the same bits; looks and drafts are in the report's stages of the watched one alone.
    outcome = run(square, bpy.context.scene, bpy.context.view_layer)
    expected = light()
    job = live(replace(square, output=tmp_path / "watched"))
    looks = work(job)
    seen = ended(job)
    assert np.array_equal(light(), expected)
    assert looks[-1].pages[0].shape[:2] == expected.shape
    assert "good_enough" not in seen.report
    names = [{stage["name"] for stage in report["stages"]} for report in (outcome.report, seen.report)]
    assert names[1] - names[0] == {"first look", "draft"}
    assert seen.exit_code == outcome.exit_code


def test_good_enough_keeps_the_draft_and_its_own_estimate(square):
    # Half of 32 pixels a side. Exact answer: 1 / pi in 16 pixels; the wish is the user's, the estimate the draft's own.
    job = live(square)
    job.good_enough()
    work(job)
    report = ended(job).report
    assert report["good_enough"] is True
    assert report["outputs"][0]["resolution"] == [16, 16]
    assert report["error"]["wanted"] == pytest.approx(0.08)
    assert report["error"]["estimated"]["lumels_audited"] > 0
    lit = light()
    assert lit.shape == (16, 16)
    assert lit[lit > 0] == pytest.approx(1 / math.pi, rel=0.02)


def test_a_draft_of_vertex_colours_can_be_kept(square):
    job = live(replace(square, settings=Settings(target="vertex", error=0.08)))
    job.good_enough()
    looks = work(job)
    assert ended(job).report["good_enough"] is True
    colours = np.empty(4 * 4, np.float32)
    bpy.data.objects["Square"].data.color_attributes["Radiosity"].data.foreach_get("color", colours)
    assert colours.reshape(-1, 4)[:, 0] == pytest.approx(1 / math.pi, rel=0.02)
    assert looks


def test_a_kept_draft_has_no_light_groups_and_says_so(square):
    job = live(replace(square, groups="lamp"))
    job.good_enough()
    work(job)
    report = ended(job).report
    assert [warning["code"] for warning in report["warnings"]] == ["no_groups"]


@pytest.mark.parametrize("keep", [False, True])
def test_esc_leaves_the_file_as_it_was_or_keeps_the_draft_as_the_user_chose(square, keep):
    # Esc in the middle of the result's own work, which takes long. Exact answer: an error and no folder; or the draft.
    job = live(replace(square, settings=Settings(error=0.003, resolution=128)))
    job.export()
    job.start()
    end = time.monotonic() + LONGEST
    while not job.can_keep:
        assert not job.is_done
        assert time.monotonic() < end
        job.wait(0.001)
    job.give_up(keep=keep)
    if keep:
        assert ended(job).report["good_enough"] is True
        assert "radiosity_lightmaps" in bpy.data.objects["Square"]
        return
    with pytest.raises(Cancelled):
        ended(job)
    assert "radiosity_lightmaps" not in bpy.data.objects["Square"]
    assert not square.output.exists()


def test_esc_before_the_first_draft_leaves_nothing_whatever_the_user_chose(square):
    job = live(square)
    job.give_up(keep=True)
    work(job)
    with pytest.raises(Cancelled):
        ended(job)


def test_the_operator_good_enough_is_for_a_watched_bake_alone(square):
    operators.register()
    try:
        assert not bpy.ops.radiosity.good_enough.poll()
        job = live(square)
        assert bpy.ops.radiosity.good_enough() == {"FINISHED"}
        work(job)
        assert ended(job).report["good_enough"] is True
    finally:
        operators.unregister()


def test_drafts_come_only_before_a_much_better_result():
    # Exact answer: by the wanted error, the errors of all bakes on the way.
    def errors(wanted):
        return [step.settings.error for step in steps(Settings(error=wanted), None)]

    assert errors(0.2) == [0.2]
    assert errors(0.03) == [0.3, 0.03]
    assert errors(0.01) == [0.3, 0.06, 0.01]


def test_drafts_share_the_layout_of_the_result():
    # One square unwrapped at 64 pixels. Exact answer: the same coordinates in images of 32, 64 and 64.
    scene = Scene(vertices=np.array(UNIT_SQUARE, float), triangles=[[0, 1, 2], [0, 2, 3]],
                  surfaces=(Surface("square", 0, 2),))
    settings = Settings(error=0.01, resolution=64)
    made = steps(settings, make_layout(scene, settings, []))
    assert [step.layout.pages[0].width for step in made] == [32, 64, 64]
    assert all(step.layout.uv is made[-1].layout.uv for step in made)


def test_the_first_look_has_few_places_however_many_triangles():
    # 20,000 triangles of a wavy ground of 10 m, and one that is 10 m long. Exact answer: the same area as before, every
    # corner at a place no further than the cube that they share.
    side = np.linspace(0, 10, 101)
    x, y = np.meshgrid(side, side, indexing="ij")
    grid = np.stack([x, y, np.sin(x)], axis=2)
    a, b, c, d = grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]
    ground = np.concatenate([np.stack([a, b, c], 2), np.stack([a, c, d], 2)]).reshape(-1, 3, 3)
    corners = np.concatenate([ground, [[[0, 0, 5], [10, 0, 5], [0, 10, 5]]]])
    pieces, parent, first, place = first_look.places(corners)
    assert len(first) <= first_look.PLACES
    assert place.shape == pieces.shape[:2]

    def area(triangles):
        edges = triangles[:, 1:] - triangles[:, :1]
        return np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1) / 2

    assert np.bincount(parent, area(pieces)) == pytest.approx(area(corners))
    met = pieces.reshape(-1, 3)[first][place]
    assert np.abs(met - pieces).max() < 0.5

"""The measure of steps across seams: on a layout whose steps are known, and on a scene from its file."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from radiosity.benchmarks import seams as benchmark
from radiosity.solver.seam_samples import seam_samples
from radiosity.solver.seams import seam_taps
from radiosity.tests.solver import test_seams as squares

ROOT = Path(__file__).resolve().parents[2]
BALL = """
import sys, bpy
bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.mesh.primitive_uv_sphere_add(segments=24, ring_count=12)
bpy.ops.object.shade_smooth()
bpy.ops.object.light_add(type="SUN", rotation=(1, 0, 0))
bpy.ops.wm.save_as_mainfile(filepath=sys.argv[1])
"""


def found(light, as_far=2.0):
    """The steps over two squares side by side (see there) under a light."""
    scene = squares.two_squares()
    layout, images = squares.baked(scene, light)
    return benchmark.steps(layout, images, seam_taps(seam_samples(layout, scene), layout, scene), as_far), layout


def test_a_jump_at_the_seam_is_told_as_it_is():
    # 1 on the left square and 3 on the right one, even on each: every step inside is 0, every one across is 2. Margins
    # grow from their own chart, so that filtering shows the same.
    told, _ = found(lambda point: np.where(point[:, :1] < 1, 1.0, 3.0) * np.ones(3))
    assert (told.usual, told.inside) == (0, 0)
    assert told.seam == pytest.approx(2)
    assert told.all == pytest.approx(2)
    assert told.shown == pytest.approx(2, rel=1e-5)
    assert 0 < told.alike <= told.pairs


def test_light_that_goes_on_evenly_steps_as_inside():
    # Light that is x: neighbours in a row differ by their distance, those in a column not at all, so that the usual
    # step lies between 0 and the texel of the coarser chart. No step at the seam is larger than two texels.
    told, layout = found(lambda point: point[:, :1] * np.ones(3), 4.0)
    texel = 1 / (.35 * squares.SIDE)
    assert 0 < told.usual < texel
    assert 0 < told.seam < 2 * texel
    assert told.ratio == pytest.approx(told.seam / told.inside)
    assert told.shown_ratio == pytest.approx(told.shown / told.usual)
    assert len(layout) > 0


def test_a_scene_is_measured_from_its_file(tmp_path):
    # A smooth ball under a sun: its charts meet in seams of one smooth surface.
    scene = tmp_path / "ball.blend"
    subprocess.run([sys.executable, "-c", BALL, str(scene)], check=True, capture_output=True)
    done = subprocess.run([sys.executable, "-m", "benchmarks.seams", str(scene), "--error", ".3", "--resolution", "64"],
                          cwd=ROOT, check=False, capture_output=True, text=True)
    assert done.returncode in {0, 1}, done.stderr
    rows = {line.split()[0]: line.split() for line in done.stdout.splitlines() if line.startswith("  ")}
    shown = {name: float(row[row.index("shown") + 1]) for name, row in rows.items()}
    assert 0 < shown["stitched"] < shown["before"]

"""Where a coarse, smooth-shaded hill turns away from the sun: whole triangles are dark, here and in Cycles' bakes."""

from __future__ import annotations

import math
import subprocess
import sys
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from radiosity.solver import image_file

# What counts as lit, over the brightest lumel: far more than noise, far less than what the next triangle has.
LIT = 0.05


def test_triangles_turn_dark_where_they_do_in_cycles(build: Any, tmp_path: Path) -> None:
    # An icosphere of 80 smooth triangles under a sun of half a degree. A triangle that faces away is dark though its
    # shading normals still face the sun. Exact answer: Cycles' bake of the same lumels; none is lit in one and dark in
    # the other, and where both are lit they agree to 2 % of the brightest.
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=2)
    bpy.ops.object.shade_smooth()
    sun = build.sun(3.0)
    sun.data.angle, sun.rotation_euler = math.radians(0.5), (math.radians(50), 0.0, math.radians(20))
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "sphere.blend"))
    done = subprocess.run([sys.executable, "-m", "radiosity", "compare", str(tmp_path / "sphere.blend"),
                           "--error", ".1", "--resolution", "64", "--passes", "direct", "--margin", "0",
                           "--samples", "64", "--no-camera", "--output", str(tmp_path)],
                          capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr
    ours, cycles = (image_file.read_exr(tmp_path / f"Lightmap_1_{name}.exr")[:, :, 0] for name in ("ours", "cycles"))
    level = cycles.max()
    assert 0.1 < (cycles > LIT * level).mean() < 0.5
    assert np.array_equal(ours > LIT * level, cycles > LIT * level)
    assert np.abs(ours - cycles).max() < 0.02 * level

"""The picture of a baked scene shows lightmap x base colour, and nothing else."""

from __future__ import annotations

import json
import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from radiosity.solver.image_file import write_exr

ROOT = Path(__file__).resolve().parents[2]

# A square of base colour (.5, .25, 1) that fills the camera, lit by a lamp that the picture must not count again.
SCENE = """
import sys
import bpy
bpy.ops.wm.read_factory_settings(use_empty=True)
scene = bpy.context.scene
mesh = bpy.data.meshes.new("Square")
mesh.from_pydata([(-5, -5, 0), (5, -5, 0), (5, 5, 0), (-5, 5, 0)], [], [(0, 1, 2, 3)])
mesh.uv_layers.new(name="UVMap_Lightmap")
material = bpy.data.materials.new("Paint")
if material.node_tree is None:
    material.use_nodes = True
material.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = (0.5, 0.25, 1, 1)
mesh.materials.append(material)
lamp = bpy.data.lights.new("Sun", "SUN")
camera = bpy.data.cameras.new("Camera")
camera.type, camera.ortho_scale = "ORTHO", 2
for name, data, height in (("Square", mesh, 0), ("Sun", lamp, 5), ("Camera", camera, 5)):
    thing = bpy.data.objects.new(name, data)
    thing.location.z = height
    scene.collection.objects.link(thing)
scene.camera = bpy.data.objects["Camera"]
bpy.ops.wm.save_as_mainfile(filepath=sys.argv[-1])
"""


def srgb(light: float) -> int:
    """IEC 61966-2-1: linear light to a code value of 8 bits."""
    return round(255 * (light * 12.92 if light <= 0.0031308 else 1.055 * light ** (1 / 2.4) - 0.055))


@pytest.mark.parametrize(
    ("quantity", "baked", "radiance"),
    [("radiance", 0.4, (0.2, 0.1, 0.4)), ("irradiance", 0.4 * math.pi, (0.2, 0.1, 0.4)),
     ("radiosity", 0.4 * math.pi, (0.4, 0.4, 0.4))],
)
def test_a_pixel_is_the_baked_light_times_the_base_colour(
    tmp_path: Path, quantity: str, baked: float, radiance: tuple[float, float, float]
) -> None:
    # A lightmap of one value; exact answer: radiance = rho E / pi, as sRGB at exposure 0 (a step of 8 bits either way).
    def run(*arguments: str | Path) -> None:
        done = subprocess.run([sys.executable, *map(str, arguments)], capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr

    (tmp_path / "scene.py").write_text(SCENE, encoding="utf-8")
    run(tmp_path / "scene.py", tmp_path / "baked.blend")
    write_exr(tmp_path / "flat.exr", np.full((8, 8, 3), baked, np.float32))
    output = {"object": "Square", "target": "lightmap", "uv_layer": "UVMap_Lightmap", "image": "flat.exr"}
    report = {"settings": {"quantity": quantity}, "outputs": [output]}
    (tmp_path / "report.json").write_text(json.dumps(report), encoding="utf-8")
    run(ROOT / "tools" / "picture.py", tmp_path / "baked.blend", tmp_path / "picture.png", "--exposure", "0")
    pixels = np.asarray(Image.open(tmp_path / "picture.png"), int).reshape(-1, 3)
    assert len(pixels) > 100_000
    assert np.abs(pixels - [srgb(value) for value in radiance]).max() <= 1

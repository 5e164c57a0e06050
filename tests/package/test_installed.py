"""The zip, installed as a user does, bakes: in a fresh process with the bpy wheel, and in the real Blender."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from radiosity.solver.image_file import read_exr
from radiosity.tools import real_blender

HERE = Path(__file__).parent
# B = E / (1 - rho) in the closed furnace (furnace.py): E / pi = 1 / (1 - 1/2) at every lumel.
EXACT = 2.0
WANTED = 0.01
# A bake of flat walls unwraps without xatlas, so the three are imported by hand as well.
LOADED_FROM = """
import embreex.rtcore_scene, xatlas, OpenEXR
for module in (embreex, xatlas, OpenEXR):
    print('FROM', module.__file__)
"""


# Leaves the open file as one saves it in the middle of modelling.
SAVE_EDITED = """
import bpy
bpy.context.view_layer.objects.active = bpy.data.objects['Furnace']
bpy.ops.object.mode_set(mode='EDIT')
bpy.ops.wm.save_mainfile()
"""


def assert_furnace(report_path: Path) -> None:
    """Every lit lumel of every image of the report is EXACT within the wanted error, and the report says so."""
    report = json.loads(report_path.read_text(encoding="utf-8"))
    assert [output["object"] for output in report["outputs"]] == ["Furnace"]
    pixels = read_exr(report_path.parent / report["outputs"][0]["image"])
    lit = pixels[(pixels > 0).any(axis=2)]
    assert len(lit) > 0.3 * pixels.shape[0] * pixels.shape[1]
    assert np.sqrt(np.mean((lit / EXACT - 1) ** 2)) < WANTED
    assert report["error"]["estimated"]["rms"] < WANTED
    assert report["lumels"] > 0
    assert abs(report["energy"]["imbalance"]) < WANTED


def only_blender(folder: Path) -> Path:
    """A folder of links to the bpy wheel and NumPy alone, to start Python with."""
    packages = folder / "packages"
    packages.mkdir()
    installed = Path(np.__file__).parents[1]
    for name in ("bpy", "numpy", "numpy.libs"):
        assert (installed / name).is_dir(), f"{name} is not in {installed}: run `make setup`"
        (packages / name).symlink_to(installed / name)
    return packages


def test_the_zip_bakes_in_the_bpy_wheel(linux_zip: Path, tmp_path: Path) -> None:
    # The closed furnace; exact answer 2 at every lumel. As in Blender, there is NumPy and nothing else: all packages
    # have to come out of the zip.
    resources, folder = tmp_path / "resources", tmp_path / "bake"
    resources.mkdir()
    folder.mkdir()
    python = Path(sys.base_prefix) / "bin" / f"python{sys.version_info.major}.{sys.version_info.minor}"
    done = subprocess.run(
        [str(python), "-s", str(HERE / "bake_installed.py"), str(linux_zip), str(folder)],
        env={**os.environ, "BLENDER_USER_RESOURCES": str(resources), "PYTHONPATH": str(only_blender(tmp_path))},
        capture_output=True, text=True, timeout=300, check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "BAKE {'FINISHED'}" in done.stdout
    where = json.loads((folder / "where.json").read_text(encoding="utf-8"))
    assert all(Path(path).is_relative_to(resources) for path in where.values()), where
    assert (folder / "baked.blend").stat().st_size > 0
    assert_furnace(folder / "lightmaps" / "report.json")


@pytest.mark.usefixtures("real_blender")
def test_the_zip_bakes_in_the_real_blender_from_the_command_line(linux_zip: Path, tmp_path: Path) -> None:
    # The same furnace, made and baked by Blender 4.3.2 with Python 3.13 and NumPy 2, from a file that was saved while
    # its mesh was edited; exact answer 2 at every lumel.
    resources, folder = tmp_path / "resources", tmp_path / "bake"
    resources.mkdir()
    scene = tmp_path / "scene.blend"

    def blender(*arguments: str | Path) -> str:
        done = real_blender.run([str(argument) for argument in arguments], resources, timeout=300)
        assert done.returncode == 0, done.stdout
        return done.stdout

    blender("--command", "extension", "install-file", "-r", "user_default", "-e", linux_zip)
    blender("-b", "--factory-startup", "--python-exit-code", "3", "--python", HERE / "furnace.py", "--", scene)
    blender("-b", scene, "--python-exit-code", "3", "--python-expr", SAVE_EDITED)
    told = blender("-b", scene, "-c", "radiosity", "bake", "--output", folder, "--error", str(WANTED),
                   "--resolution", "64", "--save", folder / "baked.blend", "--report", folder / "report.json")
    assert "Traceback" not in told
    loaded = blender("-b", "--python-exit-code", "3", "--python-expr", LOADED_FROM)
    assert loaded.count(f"FROM {resources}") == 3, loaded
    assert (folder / "baked.blend").stat().st_size > 0
    assert_furnace(folder / "report.json")


@pytest.mark.usefixtures("real_blender")
def test_the_command_line_tells_wrong_arguments_by_exit_code_2(linux_zip: Path, tmp_path: Path) -> None:
    done = real_blender.run(
        ["--command", "extension", "install-file", "-r", "user_default", "-e", str(linux_zip)], tmp_path, timeout=120
    )
    assert done.returncode == 0, done.stdout
    done = real_blender.run(["-b", "-c", "radiosity", "bake", "--error", "much"], tmp_path, timeout=120)
    assert done.returncode == 2, done.stdout
    assert "Traceback" not in done.stdout

"""The zip without its wheels, in the real Blender: a message in the preferences, no traceback."""

from __future__ import annotations

import zipfile
from pathlib import Path

import pytest
from radiosity.tools import real_blender

LOOK = """
import bpy
name = "bl_ext.user_default.radiosity_lightmaps"
notice = bpy.context.preferences.addons[name].preferences
print("NOTICE", type(notice).__name__, hasattr(bpy.types.Scene, "radiosity"))
bpy.ops.preferences.addon_disable(module=name)
print("GONE", hasattr(bpy.types, "RADIOSITY_AP_missing_wheels"))
"""


def strip_wheels(source: Path, target: Path) -> None:
    """The zip without its wheels; its manifest still lists them, which Blender passes over without a word."""
    with zipfile.ZipFile(source) as old, zipfile.ZipFile(target, "w") as new:
        for item in old.infolist():
            if not item.filename.endswith(".whl"):
                new.writestr(item, old.read(item))


@pytest.mark.usefixtures("real_blender")
def test_missing_wheels_leave_a_message_and_no_traceback(linux_zip: Path, tmp_path: Path) -> None:
    # Exact answer: the three names, the next step, and nothing registered but the notice.
    stripped = tmp_path / linux_zip.name
    strip_wheels(linux_zip, stripped)
    install = real_blender.run(
        ["--command", "extension", "install-file", "-r", "user_default", "-e", str(stripped)], tmp_path, timeout=120
    )
    assert install.returncode == 0, install.stdout
    script = tmp_path / "look.py"
    script.write_text(LOOK, encoding="utf-8")
    look = real_blender.run(["-b", "--python-exit-code", "3", "--python", str(script)], tmp_path, timeout=120)
    assert look.returncode == 0, look.stdout
    assert "can't start: embreex, xatlas, OpenEXR not found." in look.stdout
    assert "Install the zip made for your platform" in look.stdout
    assert "Traceback" not in look.stdout
    assert "NOTICE RADIOSITY_AP_missing_wheels False" in look.stdout
    assert "GONE False" in look.stdout

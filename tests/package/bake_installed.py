"""Run by a fresh Python with the bpy wheel: `python bake_installed.py ZIP FOLDER` installs the zip, bakes the furnace.

Writes FOLDER/where.json: the files that the three bundled packages and the extension were loaded from.
"""

from __future__ import annotations

import importlib
import json
import sys
from pathlib import Path

import bpy
import furnace

ID = "bl_ext.user_default.radiosity_lightmaps"


def main() -> None:
    """Install, enable, bake by the operator, save."""
    # Blender's own module: found only once bpy is imported.
    import addon_utils

    archive, folder = sys.argv[1], Path(sys.argv[2])
    # First, since factory settings switch extensions off.
    furnace.build()
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "scene.blend"))
    bpy.ops.extensions.package_install_files(filepath=archive, repo="user_default", enable_on_install=True)
    if not all(addon_utils.check(ID)):
        raise SystemExit(f"{ID} is not enabled: {addon_utils.check(ID)}")
    print("BAKE", bpy.ops.radiosity.bake(options="--error 0.01 --resolution 64"))
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "baked.blend"))
    where = {name: importlib.import_module(name).__file__ for name in ("embreex", "xatlas", "OpenEXR", ID)}
    (folder / "where.json").write_text(json.dumps(where), encoding="utf-8")


if __name__ == "__main__":
    main()

"""Radiosity Lightmaps: the entry of the Blender extension, and the root of the library `radiosity`.

Nothing is imported here before `register()`: pytest and `import radiosity.solver` read this file too, and have no
Blender.
"""

from __future__ import annotations

import importlib
import importlib.util
from types import ModuleType
from typing import Any

# In the order of registration; unregister() is its mirror.
LAYERS = ("radiosity_addon", "operators")
# What the extension's wheels bring; everything else comes with Blender.
WHEELS = ("embreex", "xatlas", "OpenEXR")

_registered: list[ModuleType] = []
_notice: list[Any] = []


def missing_wheels() -> tuple[str, ...]:
    """Names of the bundled packages that Python can't find."""
    return tuple(name for name in WHEELS if importlib.util.find_spec(name) is None)


def register() -> None:
    """Register every layer; with a wheel missing, only a notice in the preferences."""
    missing = missing_wheels()
    if missing:
        _register_notice(missing)
        return
    for name in LAYERS:
        layer = importlib.import_module(f".{name}", __package__)
        layer.register()
        _registered.append(layer)


def unregister() -> None:
    """Undo register(), last layer first."""
    while _registered:
        _registered.pop().unregister()
    if _notice:
        import bpy

        bpy.utils.unregister_class(_notice.pop())


def notice_lines(missing: tuple[str, ...]) -> tuple[str, ...]:
    """What the user reads when packages are missing."""
    return (
        f"Radiosity Lightmaps can't start: {', '.join(missing)} not found.",
        "The installed zip has no wheel for this platform and Python.",
        "Install the zip made for your platform (Edit > Preferences > Get Extensions > Install from Disk).",
    )


def _register_notice(missing: tuple[str, ...]) -> None:
    """Say in the preferences, and once on the console, which packages are missing."""
    import bpy

    lines = notice_lines(missing)

    class RADIOSITY_AP_missing_wheels(bpy.types.AddonPreferences):
        """Stands in for the extension's preferences while a wheel is missing."""

        bl_idname = __package__

        def draw(self, _context: object) -> None:
            column = self.layout.column()
            column.alert = True
            for number, line in enumerate(lines):
                column.label(text=line, icon="BLANK1" if number else "ERROR")

    bpy.utils.register_class(RADIOSITY_AP_missing_wheels)
    _notice.append(RADIOSITY_AP_missing_wheels)
    print("\n".join(lines))

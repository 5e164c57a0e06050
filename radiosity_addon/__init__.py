"""All that knows Blender and is no verb: settings, panel, export, materials, job, write-back, command line.

Nothing is imported before `register()`: the command line has to prepare the environment before the first import of bpy.
"""

from __future__ import annotations

from typing import Any

_commands: list[Any] = []


def _classes() -> tuple[type, ...]:
    """The layer's Blender classes, in the order of registration."""
    from .panel import CLASSES as PANELS
    from .settings import CLASSES as SETTINGS

    return (*SETTINGS, *PANELS)


def register() -> None:
    """Register the classes, the settings of each scene, and `blender -c radiosity`."""
    import bpy

    from . import settings
    from .command import execute

    for cls in _classes():
        bpy.utils.register_class(cls)
    settings.attach()
    _commands.append(bpy.utils.register_cli_command("radiosity", execute))


def unregister() -> None:
    """Undo register(), last first."""
    import bpy

    from . import settings

    while _commands:
        bpy.utils.unregister_cli_command(_commands.pop())
    settings.detach()
    for cls in reversed(_classes()):
        bpy.utils.unregister_class(cls)

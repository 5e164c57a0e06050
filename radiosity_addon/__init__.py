"""All that knows Blender and is no verb: settings, panel, export, materials, job, write-back, command line.

Nothing is imported before `register()`: the command line has to prepare the environment before the first import of bpy.
"""

from __future__ import annotations

from typing import Any

_commands: list[Any] = []


def _classes() -> tuple[type, ...]:
    """The layer's Blender classes, in the order of registration."""
    from .compare_panel import CLASSES as COMPARE
    from .object_panel import CLASSES as OBJECT_PANELS
    from .object_settings import CLASSES as OBJECT_SETTINGS
    from .panel import CLASSES as PANELS
    from .relight_panel import CLASSES as RELIGHT_PANELS
    from .settings import CLASSES as SETTINGS
    from .view_panel import CLASSES as VIEW_PANELS
    from .view_settings import CLASSES as VIEW_SETTINGS

    return (*SETTINGS, *OBJECT_SETTINGS, *VIEW_SETTINGS, *PANELS, *VIEW_PANELS, *RELIGHT_PANELS, *COMPARE,
            *OBJECT_PANELS)


def register() -> None:
    """Register the classes, the settings of each scene, and `blender -c radiosity`."""
    import bpy

    from . import compare_panel, legend, live_relight, look_overlay, object_settings, settings, undone, view_settings
    from .command import execute

    for cls in _classes():
        bpy.utils.register_class(cls)
    settings.attach()
    object_settings.attach()
    view_settings.attach()
    legend.attach()
    look_overlay.attach()
    live_relight.attach()
    undone.attach()
    compare_panel.attach()
    _commands.append(bpy.utils.register_cli_command("radiosity", execute))


def unregister() -> None:
    """Undo register(), last first."""
    import bpy

    from . import compare_panel, legend, live_relight, look_overlay, object_settings, settings, undone, view_settings

    while _commands:
        bpy.utils.unregister_cli_command(_commands.pop())
    compare_panel.detach()
    undone.detach()
    live_relight.detach()
    look_overlay.detach()
    legend.detach()
    view_settings.detach()
    object_settings.detach()
    settings.detach()
    for cls in reversed(_classes()):
        bpy.utils.unregister_class(cls)

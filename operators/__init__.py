"""The user's verbs, one a file. Nothing is imported before `register()`."""

from __future__ import annotations


def _classes() -> tuple[type, ...]:
    """The layer's operators, in the order of registration."""
    from .bake import RADIOSITY_OT_bake
    from .check import RADIOSITY_OT_check
    from .clear import RADIOSITY_OT_clear
    from .compare import CLASSES as COMPARE
    from .density import CLASSES as DENSITY
    from .findings import CLASSES as FINDINGS
    from .good_enough import CLASSES as GOOD_ENOUGH
    from .leaks import CLASSES as LEAKS
    from .lux import CLASSES as LUX
    from .preview import CLASSES as PREVIEW
    from .relight import CLASSES as RELIGHT

    return (RADIOSITY_OT_bake, *GOOD_ENOUGH, RADIOSITY_OT_check, RADIOSITY_OT_clear, *COMPARE, *DENSITY, *FINDINGS,
            *PREVIEW, *LUX, *LEAKS, *RELIGHT)


def register() -> None:
    """Register the operators."""
    import bpy

    for cls in _classes():
        bpy.utils.register_class(cls)


def unregister() -> None:
    """Undo register(), last first; work on its way ends."""
    import bpy

    from .working import end_all

    end_all(bpy.context)
    for cls in reversed(_classes()):
        bpy.utils.unregister_class(cls)

"""Objects that take the place of others: what a render makes of an object beside its shape goes with it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from .baked_images import MARK
from .linking import WORDS
from .results import RESULT
from .warn import Warnings, warn

# Who sees an object. An instance is seen by those who see it and its instancer.
SEEN = ("visible_camera", "visible_diffuse", "visible_glossy", "visible_transmission", "visible_volume_scatter",
        "visible_shadow")
# What else a render and a viewport make of it: Blender's own properties, as far as it has them, and groups of addons.
LOOKS = ("color", "pass_index", "is_holdout", "is_shadow_catcher", "lightgroup", "shadow_terminator_normal_offset",
         "shadow_terminator_geometry_offset", "shadow_terminator_shading_offset", "hide_probe_volume",
         "hide_probe_sphere", "hide_probe_plane", "display_type", "show_in_front", "show_wire")
GROUPS = ("cycles", "radiosity")


def stand_in(item: Any, source: Any, instancer: Any, told: Mapping[Any, Mapping[Any, str]],
             warnings: Warnings) -> None:
    """Give an object the settings and the light linking of its source.

    Parameters
    ----------
    instancer : the object that shows the source as an instance, or None.
    told : the states of linking collections, as `linking.told` gives them.
    warnings : gets what could not be taken over.
    """
    _look_alike(item, source, instancer)
    _link_alike(item, source, instancer, told, warnings)


def is_free(collection: Any) -> bool:
    """Whether objects can be put into a collection: not if it comes from a library, as an override too."""
    return collection.library is None and collection.override_library is None


def _look_alike(item: Any, source: Any, instancer: Any) -> None:
    for name in SEEN:
        setattr(item, name, getattr(source, name) and (instancer is None or getattr(instancer, name)))
    for name in (name for name in LOOKS if hasattr(source, name)):
        setattr(item, name, getattr(source, name))
    for name in WORDS:
        setattr(item.light_linking, name, getattr(source.light_linking, name))
    for name in (name for name in GROUPS if hasattr(source, name)):
        for prop in getattr(source, name).bl_rna.properties:
            if not prop.is_readonly:
                setattr(getattr(item, name), prop.identifier, getattr(getattr(source, name), prop.identifier))
    # Materials may ask for the user's own.
    for key in set(source.keys()) - {*source.bl_rna.properties.keys(), RESULT, MARK}:
        item[key] = source[key]


def _link_alike(item: Any, source: Any, instancer: Any, told: Mapping[Any, Mapping[Any, str]],
                warnings: Warnings) -> None:
    owner = instancer if any(instancer in states for states in told.values()) else source
    for collection, states in told.items():
        if owner not in states:
            continue
        if not is_free(collection):
            warn(warnings, item.name, "linking", f"can't be put into the collection {collection.name!r}, which links "
                 f"lights and comes from a library, so they light it otherwise than {owner.name!r}: make the "
                 "collection local (Object > Relations > Make Local)")
            continue
        if item not in collection.objects.values():
            collection.objects.link(item)
        entry = collection.collection_objects[collection.objects.find(item.name)]
        entry.light_linking.link_state = states[owner]

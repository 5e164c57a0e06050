"""Sub-panels "Groups", where lights are changed after a bake, and "Cache", which tells what is kept for that."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy

from ..solver.errors import RadiosityError
from . import cache, compat, live_relight
from .digest import LIGHT_INPUTS
from .knobs import giving
from .light_groups import Group
from .relight_request import kept_in
from .sockets import feeding
from .world import rendered_world

# Lights that the panel shows; more are counted.
MOST_LIGHTS = 24
# Letters of a line in a panel of usual width.
LINE = 40

# What is kept in the folder that was looked at last, so that drawing reads no file twice.
_read: dict[Path, tuple[float, tuple[Group, ...]]] = {}


class _Tab:
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Radiosity"
    bl_parent_id = "RADIOSITY_PT_bake"
    bl_options = {"DEFAULT_CLOSED"}


class RADIOSITY_PT_groups(_Tab, bpy.types.Panel):
    """Which lights are kept apart, their sliders, and the button that updates the images."""

    bl_label = "Groups"
    bl_idname = "RADIOSITY_PT_groups"

    def draw(self, context: Any) -> None:
        layout, scene = self.layout, context.scene
        layout.use_property_split = True
        layout.use_property_decorate = False
        layout.prop(scene.radiosity, "groups")
        row = layout.row()
        row.active = scene.radiosity.groups != "none"
        row.prop(scene.radiosity, "reflectances")
        layout.prop(scene.radiosity, "group_layers")
        groups = kept_groups(kept_in(scene))
        if not groups:
            layout.label(text="Bake with groups to change lights later", icon="INFO")
            return
        members = list(dict.fromkeys((member.kind, member.name) for group in groups for member in group.members))
        for kind, name in members[:MOST_LIGHTS]:
            _draw_light(layout, scene, kind, name)
        if len(members) > MOST_LIGHTS:
            layout.label(text=f"and {len(members) - MOST_LIGHTS} more")
        layout.operator("radiosity.relight", icon="LIGHT_SUN")
        layout.prop(scene.radiosity, "live_relight")
        _draw_problem(layout, live_relight.problem(scene))


class RADIOSITY_PT_cache(_Tab, bpy.types.Panel):
    """What is kept on disk."""

    bl_label = "Cache"
    bl_idname = "RADIOSITY_PT_cache"

    def draw(self, context: Any) -> None:
        layout = self.layout
        folder = kept_in(context.scene)
        if folder is None:
            layout.label(text="No light groups are kept")
            return
        count = len(kept_groups(folder))
        layout.label(text=f"{count} light group{'s' if count != 1 else ''}, {cache.size(folder) / 1e6:.1f} MB")
        if cache.follows_colours(folder):
            layout.label(text="Base colors can be changed too")
        layout.label(text=str(folder), icon="FILE_FOLDER")
        layout.operator("radiosity.clear_groups", icon="TRASH")


def kept_groups(folder: Path | None) -> tuple[Group, ...]:
    """The groups in a folder, read once; none if they can't be read."""
    if folder is None:
        return ()
    try:
        changed = (folder / cache.ABOUT).stat().st_mtime
        if folder not in _read or _read[folder][0] != changed:
            _read.clear()
            _read[folder] = (changed, cache.read(folder).groups)
    except (OSError, RadiosityError):
        return ()
    return _read[folder][1]


def _draw_light(layout: Any, scene: Any, kind: str, name: str) -> None:
    """Blender's own properties of a light: its power and colour."""
    if kind == "lamp":
        # Lamps of libraries, which can't be changed here, are called otherwise.
        item = bpy.data.objects.get((name, None))
        if item is None or item.type != "LIGHT":
            return
        box = _box(layout, name, "OUTLINER_OB_LIGHT")
        box.prop(item.data, "energy", text="Strength" if item.data.type == "SUN" else "Power")
        box.prop(item.data, "color")
        box.prop(item, "hide_render", text="Off")
    else:
        block = rendered_world(scene, scene.view_layers[0]) if kind == "world" else bpy.data.materials.get(name)
        if block is None:
            return
        box = _box(layout, block.name, "WORLD" if kind == "world" else "MATERIAL")
        if not compat.uses_nodes(block):
            if kind == "world":
                box.prop(block, "color")
            return
        for node in giving(block.node_tree).values():
            for socket in (node.inputs[word] for word in LIGHT_INPUTS[node.bl_idname]):
                if feeding(socket) is None:
                    box.prop(socket, "default_value", text=socket.name)


def _box(layout: Any, name: str, icon: str) -> Any:
    column = layout.box().column(align=True)
    column.label(text=name, translate=False, icon=icon)
    return column


def _draw_problem(layout: Any, text: str) -> None:
    """A message over as many lines as it needs."""
    line, icon = "", "ERROR"
    for word in [*text.split(), ""]:
        if line and (not word or len(line) + len(word) > LINE):
            layout.label(text=line, icon=icon)
            line, icon = "", "BLANK1"
        line = f"{line} {word}".strip()


CLASSES = (RADIOSITY_PT_groups, RADIOSITY_PT_cache)

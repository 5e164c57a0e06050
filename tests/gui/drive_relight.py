"""Run by Blender in its window: bakes with light groups, switches Live on, goes to a frame with another light, and
shows the table of lux in German.

Started as `drive.py` is, with a job of tab, shots, settings and result. Its results: the mean light of the lightmap in
both frames; what the table's panel shows.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy

sys.path.insert(0, str(Path(__file__).parent))
import drive  # type: ignore[import-not-found]
import drive_modes  # type: ignore[import-not-found]

# Frames of the two keys, and what the strength is multiplied by in the second.
FIRST, SECOND, FACTOR = 1, 20, 0.25


def emission() -> Any:
    """The strength of the panel's light."""
    nodes = bpy.data.objects["Panel"].active_material.node_tree.nodes
    return nodes["Principled BSDF"].inputs["Emission Strength"]


def mean() -> float:
    """The mean of the floor's lightmap."""
    image = bpy.data.objects["Floor"]["radiosity_lightmaps"]
    return float(sum(image.pixels[:][::4]) / (image.size[0] * image.size[1]))


def german_table() -> Iterator[float]:
    """Write down the panel of the table of lux in German."""
    view = bpy.context.preferences.view
    view.language, view.use_translate_interface = "de_DE", True
    bpy.types.RADIOSITY_PT_lux.append(
        lambda self, _context: drive.SEEN.update(table=str(self.layout.introspect())))
    drive_modes.run("radiosity.lux_view")
    yield from drive_modes.until(lambda: "table" in drive.SEEN)
    yield 1.0
    drive.photograph("relight-2-german")


def steps() -> Iterator[float]:
    """The whole visit."""
    scene = bpy.context.scene
    for name, value in drive.JOB["settings"].items():
        setattr(scene.radiosity, name, value)
    yield from drive.open_tab(drive.JOB["tab"])
    strength = emission()
    strength.keyframe_insert("default_value", frame=FIRST)
    strength.default_value *= FACTOR
    strength.keyframe_insert("default_value", frame=SECOND)
    scene.frame_set(FIRST)
    yield 1.0
    drive_modes.run("radiosity.bake")
    yield from drive_modes.end()
    scene.radiosity.live_relight = True
    drive.SEEN["before"] = mean()
    scene.frame_set(SECOND)
    yield from drive_modes.until(lambda: mean() < drive.SEEN["before"] * (1 + FACTOR) / 2)
    yield from drive_modes.end()
    drive.SEEN["after"] = mean()
    drive.photograph("relight-1-frame")
    yield from german_table()


if __name__ == "__main__":
    drive.begin(steps(), "relight-error")

"""Run by Blender: `blender -b BAKED.blend --python read_lightmaps.py -- OUT.json` tells what the baked images hold.

Writes {"images": {name: {"finite", "lit", "highest"}}, "samples": [{"object", "position", "light"}]}: the light at
three points of every triangle, each near a corner, looked up through the lightmap's own UV map.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from mathutils import Vector

LIGHTMAP_UV = "UVMap_Lightmap"
# Custom property by which an object knows its lightmap.
MARK = "radiosity_lightmaps"
# Weights of a point's own corner and of the two others.
NEAR, FAR = 0.8, 0.1


def pixels_of(image: Any) -> np.ndarray[Any, np.dtype[np.float32]]:
    """(height, width, channels) float32, row 0 at the bottom."""
    values = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(values)
    return values.reshape(image.size[1], image.size[0], image.channels)


def samples_of(thing: Any) -> list[dict[str, Any]]:
    """The light near the corners of each triangle of an object."""
    pixels = pixels_of(thing[MARK])
    mesh = thing.data
    mesh.calc_loop_triangles()
    coordinates = mesh.uv_layers[LIGHTMAP_UV].uv
    samples = []
    for triangle in mesh.loop_triangles:
        for corner in range(3):
            weights = [NEAR if index == corner else FAR for index in range(3)]
            position = sum((w * mesh.vertices[v].co for w, v in zip(weights, triangle.vertices, strict=True)), Vector())
            uv = sum((w * coordinates[loop].vector for w, loop in zip(weights, triangle.loops, strict=True)),
                     Vector((0, 0)))
            row, column = int(uv.y * pixels.shape[0]), int(uv.x * pixels.shape[1])
            samples.append({"object": thing.name, "position": list(thing.matrix_world @ position),
                            "light": pixels[row, column, :3].tolist()})
    return samples


def main() -> None:
    """Write the JSON file."""
    images, samples = {}, []
    for image in bpy.data.images:
        if MARK in image:
            rgb = pixels_of(image)[:, :, :3]
            images[image.name] = {"finite": bool(np.isfinite(rgb).all()), "lit": float((rgb > 0).any(axis=2).mean()),
                                  "highest": float(rgb.max())}
    for thing in bpy.data.objects:
        if thing.type == "MESH" and LIGHTMAP_UV in thing.data.uv_layers and MARK in thing:
            samples += samples_of(thing)
    Path(sys.argv[-1]).write_text(json.dumps({"images": images, "samples": samples}), encoding="utf-8")


if __name__ == "__main__":
    main()

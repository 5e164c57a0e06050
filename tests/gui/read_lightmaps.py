"""Run by Blender: `blender -b BAKED.blend --python read_lightmaps.py -- OUT.json` tells what the baked images hold."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import bpy
import numpy as np

LIGHTMAP_UV = "UVMap_Lightmap"


def main() -> None:
    """Write {"images": {name: {size, lit, mean, highest}}, "receivers": [names of objects with the UV map]}."""
    images = {}
    for image in bpy.data.images:
        if not image.is_float or not image.size[0]:
            continue
        pixels = np.empty(len(image.pixels), np.float32)
        image.pixels.foreach_get(pixels)
        rgb = pixels.reshape(-1, image.channels)[:, :3]
        lit = rgb[(rgb > 0).any(axis=1)]
        images[image.name] = {
            "size": list(image.size),
            "lit": len(lit) / len(rgb),
            "mean": lit.mean(axis=0).tolist() if len(lit) else [0, 0, 0],
            "highest": float(rgb.max()),
            "finite": bool(np.isfinite(rgb).all()),
        }
    receivers = [thing.name for thing in bpy.data.objects
                 if thing.type == "MESH" and LIGHTMAP_UV in thing.data.uv_layers]
    Path(sys.argv[-1]).write_text(json.dumps({"images": images, "receivers": receivers}), encoding="utf-8")


if __name__ == "__main__":
    main()

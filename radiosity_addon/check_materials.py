"""Findings on materials: light that the diffuse model does not carry, too much reflectance, images that are missing."""

from __future__ import annotations

import os
from collections.abc import Iterable
from typing import Any

import bpy

from .warn import Warnings, warn

# Part of the light that may be sent on otherwise than diffusely before it is told.
NOT_CARRIED = 0.1
# Paint that reflects more than this does not exist, and light in a room of it hardly ends.
BRIGHT = 0.95


def check_materials(rows: Iterable[dict[str, Any]], warnings: Warnings) -> None:
    """Tell of the report's rows of materials."""
    for row in rows:
        if row["not_carried"] > NOT_CARRIED:
            why = f" ({row['reason']})" if row["reason"] else ""
            warn(warnings, row["name"], "non_diffuse", f"sends {row['not_carried']:.0%} of the light on otherwise than "
                 f"diffusely{why}, and a lightmap holds that as matt light or not at all: raise its roughness, lower "
                 "metallic or transmission, or accept it")
        if max(row["diffuse_reflectance"]) > BRIGHT:
            warn(warnings, row["name"], "bright", f"reflects {max(row['diffuse_reflectance']):.0%} of the light, more "
                 "than any paint: lower the base colour below .9, else rooms of it are too bright and bake slowly")


def check_images(materials: Iterable[Any], warnings: Warnings) -> bool:
    """Tell of images in the materials' nodes that are not there; whether any is missing."""
    missing = False
    for material in materials:
        for image in _images(material.node_tree) if material.node_tree is not None else ():
            if image.packed_file is not None or image.source not in {"FILE", "SEQUENCE", "MOVIE", "TILED"}:
                continue
            path = os.path.normpath(bpy.path.abspath(image.filepath, library=image.library))
            there = os.path.exists(path) if image.source == "FILE" else os.path.isdir(os.path.dirname(path))
            if not (image.filepath and there) and not image.has_data:
                missing = True
                warn(warnings, material.name, "missing_image", f"image {image.name!r} is missing at {path}: restore "
                     "the file (File > External Data > Find Missing Files) or choose another image")
    return missing


def _images(tree: Any, seen: frozenset[str] = frozenset()) -> Iterable[Any]:
    """The images of a node tree and of the groups in it."""
    for node in tree.nodes:
        if node.bl_idname in {"ShaderNodeTexImage", "ShaderNodeTexEnvironment"} and node.image is not None:
            yield node.image
        elif node.bl_idname == "ShaderNodeGroup" and node.node_tree is not None and node.node_tree.name not in seen:
            yield from _images(node.node_tree, seen | {node.node_tree.name})

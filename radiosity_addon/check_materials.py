"""Findings on materials: light that the diffuse model does not carry, too much reflectance, images that are missing."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from .shown_images import RESTORE, images, missing_at
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
        for image in images(material.node_tree) if material.node_tree is not None else ():
            if (path := missing_at(image)) is not None:
                missing = True
                warn(warnings, material.name, "missing_image",
                     f"image {image.name!r} is missing at {path}: {RESTORE}")
    return missing

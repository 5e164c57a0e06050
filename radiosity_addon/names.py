"""Names that fit where they go: one that is too long is cut, and a sum of the whole keeps it apart from others."""

from __future__ import annotations

import re

import bpy

from .digest import digest

# What file systems don't take in names.
FORBIDDEN = re.compile(r'[<>:"/\\|?*\x00-\x1f]')
# File systems take names of 255 bytes; what stands behind ours (_2, _groups.exr) has room in the rest.
FILE_BYTES = 200
# Blender's limit for names of custom properties; colour attributes may have a few more.
KEY_BYTES = 63
# Characters of the sum.
SUM = 8


def file_stem(name: str) -> str:
    """A name for a file, without its ending."""
    return fitted(FORBIDDEN.sub("_", name).strip(" ."), FILE_BYTES)


def block_name(name: str) -> str:
    """A name for an image or another data-block: Blender takes 63 bytes, from version 5 on 255, and an end."""
    return fitted(name, bpy.types.ID.bl_rna.properties["name"].length_max - 1)


def fitted(name: str, most: int) -> str:
    """A name of so many bytes at most."""
    if len(name.encode()) <= most:
        return name
    end = f"_{digest(name)[:SUM]}"
    return name.encode()[:most - len(end)].decode(errors="ignore") + end

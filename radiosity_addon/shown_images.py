"""The images that node trees show, and whether their files are there: Cycles shows magenta for those that are not."""

from __future__ import annotations

import os
from collections.abc import Iterator
from typing import Any

import bpy

from ..solver.errors import SceneError
from .shown_nodes import shown_nodes
from .warn import Warnings, warn

IMAGE_NODES = frozenset({"ShaderNodeTexImage", "ShaderNodeTexEnvironment"})
# Sources that come from a file; others are made in Blender.
FROM_FILES = frozenset({"FILE", "SEQUENCE", "MOVIE", "TILED"})
ANIMATED = frozenset({"SEQUENCE", "MOVIE"})
RESTORE = "restore the file (File > External Data > Find Missing Files) or choose another image"
# What of an animated image is baked, where Cycles is told the scene's frame and where it is not.
PRESENT, FIRST = "its present frame", "what it shows in the scene's frame 1"


def images(tree: Any) -> list[Any]:
    """The images that a tree's output shows, those in its groups too."""
    return [node.image for node in _image_nodes(tree)]


def tell_animated(tree: Any, owner: str, code: str, frame: str, warnings: Warnings) -> None:
    """Tell which frame of sequences and movies is baked."""
    for image in images(tree):
        if image.source in ANIMATED:
            warn(warnings, owner, code, f"image {image.name!r} is a {image.source.lower()}: {frame} is baked")


def require(tree: Any, owner: str, *, read: bool = False) -> None:
    """See that the files of a tree's images are there; `read` them too, which takes time and memory.

    Raises
    ------
    SceneError
        Naming the owner, an image and where its file should be.
    """
    for node in _image_nodes(tree):
        # Which frame of a sequence is due, evaluated trees alone know.
        path = missing_at(node.image, node.image_user if tree.is_evaluated else None)
        if path is None and read and node.image.source == "FILE" and not node.image.size[0]:
            path = file_of(node.image)
        if path is not None:
            raise missing_error(node.image, path, owner)


def missing_error(image: Any, path: str, owner: str) -> SceneError:
    """What to say of an image without a file, or with a broken one."""
    state = "can't be read from" if os.path.isfile(path) else "is missing at"
    return SceneError(f"{owner}: image {image.name!r} {state} {path}: {RESTORE}")


def missing_at(image: Any, user: Any = None) -> str | None:
    """Where an image's file should be, if it is not there; `user` tells the frame of a sequence."""
    if image.source not in FROM_FILES or image.packed_file is not None or image.has_data:
        return None
    path = file_of(image, user)
    many = image.source == "TILED" or (image.source == "SEQUENCE" and user is None)
    there = os.path.isdir(os.path.dirname(path)) if many else os.path.isfile(path)
    return None if there else path


def file_of(image: Any, user: Any = None) -> str:
    """Path of an image's file."""
    path = image.filepath_from_user(image_user=user) if user is not None else image.filepath
    path = bpy.path.abspath(path, library=image.library)
    return os.path.normpath(path) if path else "an unknown place"


def _image_nodes(tree: Any) -> Iterator[Any]:
    return (node for node in shown_nodes(tree) if node.bl_idname in IMAGE_NODES and node.image is not None)

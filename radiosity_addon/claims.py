"""What a bake may replace of earlier ones: images that its own objects alone show, and files of no other .blend."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Collection, Iterable
from pathlib import Path
from typing import Any

import bpy

from .baked_images import BETWEEN, BLEND, MARK, OBJECTS, SAVED, is_our_file, place_of
from .exr_writer import text_attribute
from .names import block_name


class Claims:
    """Who shows the images that are there.

    Parameters
    ----------
    baked : names of the objects whose images the bake replaces.
    save : the .blend that is saved with the bake; None for none.

    Attributes
    ----------
    holders : an object that is not baked and shows an image, by the image's name.
    taken : places of files, as `baked_images.place_of` gives them, that other objects of this .blend show.
    others : the .blend that baked a file which is there and stays, by the file's name.
    lost : an object that is not baked and had its light in a file that is replaced, by the file's name.
    """

    def __init__(self, baked: Collection[str], save: Path | None) -> None:
        held = [(item.name, item[MARK]) for item in bpy.data.objects
                if MARK in item and item[MARK] is not None and item.name not in baked and item.users_scene]
        self.holders = {image.name: item for item, image in held if image.library is None}
        self.taken = set(_places(image for _, image in held))
        self._own = set(_places(image for image in bpy.data.images if image.library is None and MARK in image))
        self.others: dict[str, str] = {}
        self.lost: dict[str, str] = {}
        self._baked, self._save = baked, save

    def free_names(self, wanted: Iterable[str]) -> list[str]:
        """Names for images: those that are wanted, with _2 and so on where other objects show an image of that name."""
        used = set(self.holders)
        found = []
        for name in wanted:
            free, number = name, 1
            while block_name(free) in used:
                number += 1
                free = f"{name}_{number}"
            used.add(block_name(free))
            found.append(free)
        return found

    def may_replace(self, path: Path) -> bool:
        """Whether a file is ours, and of this .blend: one that it shows, or that no other one baked."""
        if not is_our_file(path):
            return False
        # What the .blend showed that this bake's takes the place of, nobody shows any more.
        if place_of(path) in self._own or _is_same(_told(path, SAVED), self._save):
            return True
        theirs = _baked_by(path)
        if theirs is not None:
            self.others[path.name] = theirs.name
            return False
        for name in text_attribute(path, OBJECTS).split(BETWEEN):
            if name in bpy.data.objects and name not in self._baked:
                self.lost[path.name] = name
        return True


def _places(images: Iterable[Any]) -> Iterable[str]:
    return (place_of(Path(bpy.path.abspath(image.filepath, library=image.library))) for image in images)


def _baked_by(path: Path) -> Path | None:
    """The .blend that a file was baked from, if that is there and not the open one."""
    theirs = _told(path, BLEND)
    return None if _is_same(theirs, bpy.data.filepath) else theirs


def _told(path: Path, name: str) -> Path | None:
    """The .blend that a file names in an attribute, if that is there."""
    told = text_attribute(path, name)
    theirs = Path(os.path.normpath(path.parent / told))
    return theirs if told and _is_there(theirs) else None


def _is_there(path: Path) -> bool:
    """Whether there is such a file. One whose folder may not be looked into, as another user's, may be there."""
    try:
        return path.is_file()
    except OSError:
        return True


def _is_same(theirs: Path | None, other: Path | str | None) -> bool:
    if theirs is None or not other:
        return False
    with contextlib.suppress(OSError):  # one of them is not there, or may not be looked at
        return theirs.samefile(str(other))
    return False

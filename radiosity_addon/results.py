"""What an object knows of its own bake: where its light lies and what the numbers mean. Saved with the .blend."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import bpy

from .baked_images import MARK

# Custom property of an object, a group {target, quantity, layer}; its image is in MARK.
RESULT = "radiosity_result"


@dataclass(frozen=True, eq=False)
class Result:
    """The baked light of one object.

    Attributes
    ----------
    item : the bpy object.
    target, quantity : as in `solver.Settings`.
    layer : the UV map that lays the image out, or the colour attribute.
    image : the bpy image; None for vertex colours.
    """

    item: Any
    target: str
    quantity: str
    layer: str
    image: Any


def remember(item: Any, target: str, quantity: str, layer: str, image: Any = None) -> None:
    """Let an object know its result."""
    item[RESULT] = {"target": target, "quantity": quantity, "layer": layer}
    if image is not None:
        item[MARK] = image
    elif MARK in item:
        del item[MARK]


def forget(item: Any) -> bool:
    """Take the result off an object; whether there was any."""
    found = False
    for mark in (RESULT, MARK):
        if mark in item:
            del item[mark]
            found = True
    return found


def result_of(item: Any) -> Result | None:
    """The object's result; None where it has none, or where its image or layer is gone."""
    kept = item.get(RESULT)
    if kept is None or item.type != "MESH":
        return None
    result = Result(item, str(kept["target"]), str(kept["quantity"]), str(kept["layer"]), item.get(MARK))
    if result.target == "vertex":
        return result if result.layer in item.data.color_attributes else None
    return result if result.image is not None and result.layer in item.data.uv_layers else None


def results(scene: Any) -> Iterator[Result]:
    """The results of a scene's objects, in their order."""
    for item in scene.objects:
        result = result_of(item)
        if result is not None:
            yield result


def any_result() -> bool:
    """Whether the file holds a baked object."""
    return any(RESULT in item for item in bpy.data.objects)

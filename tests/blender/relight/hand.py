"""What tests of relighting do and look at in the open file."""

from __future__ import annotations

import math
from typing import Any

import bpy
import numpy as np
import pytest


def lamp() -> Any:
    return bpy.data.objects["Sun"].data


def pixels() -> np.ndarray:
    """The square's light, (n, 3), as Blender has it in its image, times pi: W/m2."""
    image = bpy.data.objects["Square"]["radiosity_lightmaps"]
    values = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(values)
    values = values.reshape(-1, 4)[:, :3] * np.float32(math.pi)
    return np.asarray(values[values.any(axis=1)])


def relight() -> None:
    assert bpy.ops.radiosity.relight() == {"FINISHED"}


def refused(message: str, options: str = "") -> None:
    """A relight ends with one line, and the image stays."""
    before = pixels()
    with pytest.raises(RuntimeError, match=message) as failure:
        bpy.ops.radiosity.relight(options=options)
    assert len(str(failure.value).strip().splitlines()) == 1
    assert np.array_equal(pixels(), before)

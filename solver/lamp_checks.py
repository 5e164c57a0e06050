"""What every lamp checks of its numbers when it is made; messages name the lamp, the value and the next step."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .errors import SceneError

Float = NDArray[np.floating[Any]]


def put(lamp: Any, **values: Any) -> None:
    """Set fields of a frozen dataclass while it is being made; arrays become read-only."""
    for name, value in values.items():
        if isinstance(value, np.ndarray):
            value.flags.writeable = False
        object.__setattr__(lamp, name, value)


def vector(name: str, word: str, value: ArrayLike) -> Float:
    """A lamp's (3,) float64 vector, checked."""
    array = _numbers(name, word, value, np.float64)
    if array.shape != (3,) or not np.isfinite(array).all():
        raise SceneError(f"lamp {name!r}: {word} {array.tolist()} must be three finite numbers")
    return array


def unit_vector(name: str, word: str, value: ArrayLike) -> Float:
    """A lamp's (3,) float64 direction, made unit."""
    array = vector(name, word, value)
    length = float(np.linalg.norm(array))
    if length == 0:
        raise SceneError(f"lamp {name!r}: {word} has no length: give it a scale that is not 0")
    return array / length


def spectrum(name: str, word: str, value: ArrayLike) -> Float:
    """A lamp's (3,) float32 power or radiance, checked."""
    array = _numbers(name, word, value, np.float32)
    if array.shape not in {(), (1,), (3,)}:
        raise SceneError(f"lamp {name!r}: {word} {array.tolist()} must be one number or three")
    array = np.array(np.broadcast_to(array, (3,)))
    if not np.isfinite(array).all() or array.min() < 0:
        raise SceneError(f"lamp {name!r}: {word} {array.tolist()} is negative or not finite: give finite values from 0")
    return array


def within(name: str, word: str, value: float, low: float, high: float) -> float:
    """A lamp's number, checked."""
    number = _numbers(name, word, value, np.float64)
    if number.shape != () or not (np.isfinite(number) and low <= number <= high + 1e-6):
        raise SceneError(f"lamp {name!r}: {word} {value!r} is not within {low:g} and {high:g}")
    return min(float(number), high)


def _numbers(name: str, word: str, value: ArrayLike, dtype: Any) -> NDArray[Any]:
    try:
        return np.array(value, dtype)
    except (ValueError, TypeError):
        raise SceneError(f"lamp {name!r}: {word} {value!r} is no number or row of numbers") from None

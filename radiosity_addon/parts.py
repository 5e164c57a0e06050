"""Long work in Blender's thread, cut into parts: a generator that yields where a window may draw and answer."""

from __future__ import annotations

import math
import time
from collections.abc import Generator
from typing import TypeVar

Result = TypeVar("Result")
Parts = Generator[None, None, Result]

# Seconds that a part aims at in a window, and where nobody waits for one.
WINDOW_PART, ENDLESS = 0.03, math.inf


def whole(parts: Parts[Result]) -> Result:
    """All parts at once; what they return."""
    while True:
        try:
            next(parts)
        except StopIteration as end:
            result: Result = end.value
            return result


def some(parts: Parts[Result], seconds: float = WINDOW_PART) -> None:
    """As many parts as begin within so many seconds, one at least.

    Raises
    ------
    StopIteration
        At the end, with what the parts return.
    """
    until = time.perf_counter() + seconds
    next(parts)
    while time.perf_counter() < until:
        next(parts)

"""Long work in Blender's thread, cut into parts: a generator that yields where a window may draw and answer.

It yields a thread where it can't go on before that one has ended, PAUSE before a step that can't be cut and may be
long, else None.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Generator
from typing import Any, TypeVar

Result = TypeVar("Result")
Other = TypeVar("Other")
# What is yielded is None or a thread; mypy takes a bare `yield` for no value where it is told so.
Parts = Generator[Any, None, Result]

# Seconds that a part aims at in a window, and where nobody waits for one.
WINDOW_PART, ENDLESS = 0.02, math.inf


class _Pause:
    """Nothing to wait for, but a window may want its turn."""

    def join(self) -> None:
        """See above."""


PAUSE = _Pause()


def whole(parts: Parts[Result]) -> Result:
    """All parts at once; what they return."""
    while True:
        try:
            waited_for = next(parts)
        except StopIteration as end:
            result: Result = end.value
            return result
        if waited_for is not None:
            waited_for.join()


def some(parts: Parts[Result], seconds: float = WINDOW_PART) -> None:
    """As many parts as begin within so many seconds and before a pause, one at least.

    Raises
    ------
    StopIteration
        At the end, with what the parts return.
    """
    until = time.perf_counter() + seconds
    while True:
        waited_for = next(parts)
        if waited_for is PAUSE:
            return
        if waited_for is not None:
            waited_for.join(max(until - time.perf_counter(), 0.0))
        if time.perf_counter() >= until:
            return


def aside(work: Callable[[], Result]) -> Parts[Result]:
    """Work that touches no bpy, in a thread of its own; raises what it raises."""
    thread, result = _begun(work)
    yield from ended(thread)
    return result()


def beside(work: Callable[[], Result], parts: Parts[Other]) -> Parts[tuple[Result, Other]]:
    """`aside` while parts go on in Blender's thread; what both give."""
    thread, result = _begun(work)
    try:
        other = yield from parts
        yield from ended(thread)
    finally:
        thread.join()
    return result(), other


def _begun(work: Callable[[], Result]) -> tuple[threading.Thread, Callable[[], Result]]:
    """A thread that works, and what it gives or raises once it has ended."""
    results: list[Result] = []
    failures: list[BaseException] = []

    def run() -> None:
        try:
            results.append(work())
        except BaseException as error:  # noqa: BLE001 - it is raised again in Blender's thread
            failures.append(error)

    def result() -> Result:
        if failures:
            raise failures[0]
        return results[0]

    thread = threading.Thread(target=run, name="radiosity aside", daemon=True)
    thread.start()
    return thread, result


def ended(thread: threading.Thread) -> Parts[None]:
    """Until a thread has ended, and not without it."""
    try:
        while thread.is_alive():
            yield thread
    finally:
        thread.join()

"""Ctrl C on the command line.

Blender does not survive an exception that Python raises in the middle of its code, while it is imported least of all.
So Ctrl C is remembered, and asked about where work can end; pressed again meanwhile, it ends the process at once.
Imports Python's own modules alone: it is there before all that takes long to load.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

_pressed = threading.Event()


def watch() -> None:
    """Remember Ctrl C from now on."""
    signal.signal(signal.SIGINT, _remember)


def refuse() -> None:
    """Raise Cancelled if it was pressed."""
    if _pressed.is_set():
        from ..solver.errors import Cancelled

        raise Cancelled("cancelled: nothing was changed")


@contextmanager
def cancelling(cancel: Callable[[], None]) -> Iterator[None]:
    """Let Ctrl C cancel what goes on inside; Blender's own handler knows nothing of it. Raises Cancelled if it was
    pressed before."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, lambda _number, _frame: cancel())
    try:
        refuse()
        yield
    finally:
        # None: a handler that was not set from Python, and can't be set again from here.
        signal.signal(signal.SIGINT, before if before is not None else signal.SIG_DFL)


def _remember(_number: int, _frame: Any) -> None:
    _pressed.set()
    signal.signal(signal.SIGINT, signal.SIG_DFL)

"""`compare` on the command line."""

from __future__ import annotations

from typing import Any

from .compare import Compared, Comparison
from .compare_request import CompareRequest
from .compare_write import lines_of
from .job import wait_for


def compare(request: CompareRequest, scene: Any, view_layer: Any) -> int:
    """Compare and wait for it, with progress and warnings on the terminal; the exit code.

    Raises
    ------
    RadiosityError
        With its exit code.
    """
    done: Compared = wait_for(Comparison(request, scene, view_layer))
    for line in lines_of(done.report):
        print(line)
    for label in ("page", "board", "numbers"):
        print(f"{label:<12}{done.files[label]}", flush=True)
    return done.exit_code

"""Files appear whole or not at all: they are written beside their name and then moved there."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path

from .errors import OutputError


@contextlib.contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """The path to write to, from where the file then takes the place of `path`; if anything fails, nothing is left.

    Raises
    ------
    OutputError
        In place of an OSError.
    """
    beside = part_of(path)
    try:
        yield beside
        os.replace(beside, path)
    except OSError as cause:
        raise OutputError(f"{path} can't be written ({reason(cause)}): check the folder's rights and space") from cause
    finally:
        with contextlib.suppress(OSError):
            beside.unlink(missing_ok=True)


def part_of(path: Path) -> Path:
    """Where a file is written before it takes its place."""
    return path.with_name(f".{path.name}.{os.getpid()}.part")


def reason(cause: Exception) -> str:
    """Why something failed, in a few words: the system's own, else the first line that the failure says."""
    said = str(cause).strip().splitlines()
    text = getattr(cause, "strerror", None) or (said[0] if said else type(cause).__name__)
    return str(text).lower()

"""EXR files by the OpenEXR package, in a process of its own where Blender's copy of that library stands in the way.

Blender for Linux loads its own libOpenEXRCore into the global scope of the process. The package carries another
version, and the dynamic linker then binds the package's calls to Blender's functions: writing fails or crashes
(measured with 4.3.2 of Debian and OpenEXR 3.5.3). As a Python module (the bpy wheel), on Windows and on macOS each
keeps its own. Loading the package with RTLD_DEEPBIND is no cure: it then frees with libc what Blender's allocator gave.
"""

from __future__ import annotations

import ctypes
import json
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..solver import errors, image_file

Float = NDArray[np.floating[Any]]

MAGIC = b"\x76\x2f\x31\x01"
# An EXR header of ours is shorter by far.
HEADER_BYTES = 1 << 16
# A function of libOpenEXRCore.
SYMBOL = "exr_start_write"
# What the other process runs: the solver as a package of its own, out of the same folder.
CHILD = """
import json, sys
job = json.loads(sys.stdin.read())
sys.path[:0] = job["sys_path"]
import numpy
from solver import errors, image_file
layers = {name: numpy.load(path, mmap_mode="r") for name, path in job["layers"].items()}
try:
    image_file.write_exr(job["path"], numpy.load(job["pixels"], mmap_mode="r"), job["header"], layers=layers)
except errors.RadiosityError as error:
    print(error, file=sys.stderr)
    sys.exit(3)
"""
# The child's exit code for an error that its one line explains.
EXPLAINED = 3


def write_exr(path: Path, pixels: Float, header: dict[str, str | float],
              layers: Mapping[str, Float] | None = None) -> None:
    """`solver.image_file.write_exr`, wherever it can run.

    Raises
    ------
    OutputError
        If the file can't be written.
    """
    if not needs_process():
        image_file.write_exr(path, pixels, header, layers=layers)
        return
    with tempfile.TemporaryDirectory(prefix="radiosity-exr-") as folder:
        stored = _stored(Path(folder) / "pixels.npy", pixels)
        files = {name: _stored(Path(folder) / f"layer_{number}.npy", layer)
                 for number, (name, layer) in enumerate((layers or {}).items())}
        _in_process({"path": str(path), "pixels": stored, "layers": files, "header": header}, path)


def _stored(path: Path, pixels: Float) -> str:
    np.save(path, np.asarray(pixels, np.float32))
    return str(path)


@cache
def needs_process() -> bool:
    """Whether the global scope holds a libOpenEXRCore that is not the package's own."""
    return sys.platform.startswith("linux") and hasattr(ctypes.CDLL(None), SYMBOL)


def has_attribute(path: Path, name: str) -> bool:
    """Whether a file is an EXR whose header has a number of that name; read as bytes, as OpenEXR may be barred."""
    return name.encode() + b"\0float\0" in _head(path)


def text_attribute(path: Path, name: str) -> str:
    """The text of that name in an EXR file's header; "" if there is none."""
    _, found, rest = _head(path).partition(name.encode() + b"\0string\0")
    return rest[4:4 + int.from_bytes(rest[:4], "little")].decode(errors="replace") if found else ""


def _head(path: Path) -> bytes:
    """The first bytes of an EXR file; none of any other, and of none."""
    try:
        with path.open("rb") as file:
            head = file.read(HEADER_BYTES)
    except OSError:
        return b""
    return head if head.startswith(MAGIC) else b""


def _in_process(job: dict[str, Any], path: Path) -> None:
    folder = Path(image_file.__file__).parents[1]
    text = json.dumps({**job, "sys_path": [str(folder), *sys.path]})
    done = subprocess.run([sys.executable, "-I", "-c", CHILD], input=text, capture_output=True, text=True, check=False)
    if done.returncode == EXPLAINED:
        raise errors.OutputError(done.stderr.strip())
    if done.returncode:
        reason = (done.stderr.strip().splitlines() or [f"exit code {done.returncode}"])[-1]
        raise errors.OutputError(f"{path} can't be written (Blender's Python {sys.executable} failed: {reason}): "
                                 "install the extension again")

"""Cycles in another Blender, for a window that must not wait for it: asked in parts, as long as nothing else is known.

What can't be taken there is done here: nodes that look at other objects, whose places a file does not hold, images
that were painted and not saved, and what is linked from a library.
"""

from __future__ import annotations

import json
import os
import pickle
import subprocess
import tempfile
import time
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import bpy

from ..solver.errors import RadiosityError
from . import child_blender, shown_images
from .parts import Parts

# Files in the folder, by the number of a request.
REQUEST, ANSWER = "request_{}.pickle", "answer_{}.pickle"
BLOCKS = "blocks_{}.blend"
# Seconds between two looks for an answer.
TICK = 0.002


class Elsewhere:
    """The other Blender; it starts when it is first brought something. Close it in any case."""

    def __init__(self) -> None:
        self._folder = tempfile.TemporaryDirectory(prefix="radiosity-cycles-")
        self._log = Path(self._folder.name) / "log"
        self._process: subprocess.Popen[bytes] | None = None
        self._known: set[tuple[str, str]] = set()
        self._asked = 0

    def bring(self, blocks: Iterable[Any]) -> None:
        """Have it know worlds and materials, those that can go there; the open file stays as it is."""
        new = {block for block in blocks if can_go(block) and not self.knows(block)}
        if not new:
            return
        if self._process is None:
            self._process = self._started()
        path = str(Path(self._folder.name) / BLOCKS.format(self._asked))
        bpy.data.libraries.write(path, new, path_remap="ABSOLUTE", fake_user=True)
        self._known.update(map(_name, new))
        self._send(self._process, {"do": "bring", "blocks": path})

    def knows(self, block: Any) -> bool:
        """Whether it can be asked for a world or material."""
        return _name(block) in self._known

    def ask(self, **request: Any) -> Parts[Any]:
        """The answer to a request of `cycles_child.py`.

        Raises
        ------
        RadiosityError
            If Cycles can't do it, or the other Blender fails, with its own last word.
        """
        assert self._process is not None
        answer = _Answer(self._process, self._send(self._process, request))
        while not answer.is_there():
            yield answer
        if not answer.path.is_file():
            raise RadiosityError(f"another Blender, which evaluates materials and the world, failed "
                                 f"({child_blender.reason(self._log, self._process)})")
        found = pickle.loads(answer.path.read_bytes())
        answer.path.unlink()
        if isinstance(found, str):
            raise RadiosityError(found)
        return found

    def close(self) -> None:
        """End it; nothing of it stays."""
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            if self._process.stdin is not None:
                self._process.stdin.close()
        self._folder.cleanup()

    def _started(self) -> subprocess.Popen[bytes]:
        folder = Path(self._folder.name)
        job, resources = folder / "job.json", folder / "resources"
        job.write_text(json.dumps(child_blender.known("cycles_child", folder)), encoding="utf-8")
        resources.mkdir()
        with self._log.open("wb") as log:
            return subprocess.Popen(
                child_blender.command(job), bufsize=0, stdin=subprocess.PIPE, stdout=log, stderr=subprocess.STDOUT,
                env={**os.environ, "BLENDER_USER_RESOURCES": str(resources), **child_blender.temporary(folder)})

    def _send(self, process: subprocess.Popen[bytes], request: dict[str, Any]) -> Path:
        """Hand a request over; the file that its answer will be."""
        folder, number = Path(self._folder.name), self._asked
        self._asked += 1
        (folder / REQUEST.format(number)).write_bytes(pickle.dumps(request))
        assert process.stdin is not None
        try:
            process.stdin.write(f"{number}\n".encode())
        except OSError:
            process.wait()
        return folder / ANSWER.format(number)


class _Answer:
    """An answer that is waited for, with the words of a thread."""

    def __init__(self, process: subprocess.Popen[bytes], path: Path) -> None:
        self.path, self._process = path, process

    def is_there(self) -> bool:
        """Whether there is nothing to wait for any more."""
        return self._process.poll() is not None or self.path.is_file()

    def join(self, timeout: float | None = None) -> None:
        """Wait for it, or so many seconds."""
        until = None if timeout is None else time.monotonic() + timeout
        while not self.is_there() and (until is None or time.monotonic() < until):
            time.sleep(TICK)


def _name(block: Any) -> tuple[str, str]:
    return block.rna_type.identifier, block.name_full


def can_go(block: Any) -> bool:
    """Whether a world or material looks the same in another Blender."""
    tree = block.node_tree
    return block.library is None and (tree is None or not (
        _objects(tree) or any(image.is_dirty for image in shown_images.images(tree))))


def _objects(tree: Any) -> bool:
    """Whether a node of a tree or of its groups looks at an object."""
    return any(getattr(node, "object", None) is not None
               or (node.bl_idname == "ShaderNodeGroup" and node.node_tree is not None and _objects(node.node_tree))
               for node in tree.nodes)

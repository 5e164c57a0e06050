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
from . import child_blender, node_hash
from .parts import Parts

# Files in the folder that both know, by number.
REQUEST, ANSWER = "request_{}.pickle", "answer_{}.pickle"
BLOCKS = "blocks.blend"
# Seconds between two looks for an answer.
TICK = 0.002


class Elsewhere:
    """The other Blender. Close it in any case."""

    def __init__(self, blocks: Iterable[Any]) -> None:
        """Write worlds and materials to a file of their own and start; the open file stays as it is."""
        self._folder = tempfile.TemporaryDirectory(prefix="radiosity-cycles-")
        folder = Path(self._folder.name)
        bpy.data.libraries.write(str(folder / BLOCKS), set(blocks), path_remap="ABSOLUTE", fake_user=True)
        job = folder / "job.json"
        job.write_text(json.dumps({**child_blender.known("cycles_child", folder), "blocks": str(folder / BLOCKS)}),
                       encoding="utf-8")
        resources = folder / "resources"
        resources.mkdir()
        self._log = folder / "log"
        with self._log.open("wb") as log:
            self._process = subprocess.Popen(
                child_blender.command(job), bufsize=0, stdin=subprocess.PIPE, stdout=log, stderr=subprocess.STDOUT,
                env={**os.environ, "BLENDER_USER_RESOURCES": str(resources), **child_blender.temporary(folder)})
        self._asked = 0

    def ask(self, **request: Any) -> Parts[Any]:
        """The answer to a request of `cycles_child.py`.

        Raises
        ------
        RadiosityError
            If Cycles can't do it, or the other Blender fails, with its own last word.
        """
        folder, number = Path(self._folder.name), self._asked
        self._asked += 1
        (folder / REQUEST.format(number)).write_bytes(pickle.dumps(request))
        answer = _Answer(self._process, folder / ANSWER.format(number))
        assert self._process.stdin is not None
        try:
            self._process.stdin.write(f"{number}\n".encode())
        except OSError:
            self._process.wait()
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
        self._process.kill()
        self._process.wait()
        if self._process.stdin is not None:
            self._process.stdin.close()
        self._folder.cleanup()


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


def can_go(block: Any) -> bool:
    """Whether a world or material looks the same in another Blender."""
    tree = block.node_tree
    return block.library is None and (tree is None or not (
        _objects(tree) or any(image.is_dirty for image in node_hash.images(tree))))


def _objects(tree: Any) -> bool:
    """Whether a node of a tree or of its groups looks at an object."""
    return any(getattr(node, "object", None) is not None
               or (node.bl_idname == "ShaderNodeGroup" and node.node_tree is not None and _objects(node.node_tree))
               for node in tree.nodes)

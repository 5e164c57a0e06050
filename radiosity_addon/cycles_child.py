"""Runs in a Blender of its own: what Cycles makes of worlds and materials, one request after another.

Started by `cycles_elsewhere.py` with a job in JSON, which names the folder. A line on standard input is the number of a
request, whose file is there by then; answers are files too, put in their places when they are whole.
"""

from __future__ import annotations

import json
import os
import pickle
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from ..solver.errors import RadiosityError
from . import evaluate, world_render
from .cycles_elsewhere import ANSWER, REQUEST
from .mesh_part import MeshPart
from .parts import whole
from .triangle_cells import Cells


def main(path: str) -> None:
    """Answer until nobody asks any more."""
    job = json.loads(Path(path).read_text(encoding="utf-8"))
    folder = Path(job["folder"])
    blocks = _Blocks({}, {})
    for line in sys.stdin:
        number = int(line)
        asked = pickle.loads((folder / REQUEST.format(number)).read_bytes())
        try:
            answer: Any = _answer(asked, blocks)
        except RadiosityError as error:
            answer = str(error)
        beside = folder / f"part_{number}"
        beside.write_bytes(pickle.dumps(answer))
        os.replace(beside, folder / ANSWER.format(number))


@dataclass(frozen=True)
class _Blocks:
    """What was brought, by the names that it has in the other Blender's file: here it may have got others."""

    worlds: dict[str, Any]
    materials: dict[str, Any]

    def load(self, path: str) -> None:
        with bpy.data.libraries.load(path) as (there, here):
            here.worlds, here.materials = list(there.worlds), list(there.materials)
        self.worlds.update(zip(there.worlds, here.worlds, strict=True))
        self.materials.update(zip(there.materials, here.materials, strict=True))


def _answer(asked: dict[str, Any], blocks: _Blocks) -> Any:
    if asked["do"] == "bring":
        return blocks.load(asked["blocks"])
    if asked["do"] == "map":
        return whole(world_render.map_parts(blocks.worlds[asked["world"]], world_render.Map(*asked["size"])))
    if asked["do"] == "window":
        return world_render.window(blocks.worlds[asked["world"]], *asked["view"])
    subject = evaluate.Subject(blocks.materials[asked["material"]], MeshPart(*asked["part"]), *asked["subject"])
    return np.asarray(evaluate.bake(subject, asked["name"], Cells(*asked["cells"]), asked["frame"]))

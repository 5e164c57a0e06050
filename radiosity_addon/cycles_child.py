"""Runs in a Blender of its own: what Cycles makes of worlds and materials, one request after another.

Started by `cycles_elsewhere.py` with a job in JSON: folder, and the .blend with the blocks. A line on standard input is
the number of a request, whose file is there by then; answers are files too, put in their places when they are whole.
"""

from __future__ import annotations

import json
import os
import pickle
import sys
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
    with bpy.data.libraries.load(job["blocks"]) as (there, here):
        here.worlds, here.materials = list(there.worlds), list(there.materials)
    # By the names that they have in the file: here they may have got others.
    worlds = dict(zip(there.worlds, here.worlds, strict=True))
    materials = dict(zip(there.materials, here.materials, strict=True))
    for line in sys.stdin:
        number = int(line)
        asked = pickle.loads((folder / REQUEST.format(number)).read_bytes())
        try:
            answer: Any = _answer(asked, worlds, materials)
        except RadiosityError as error:
            answer = str(error)
        beside = folder / f"part_{number}"
        beside.write_bytes(pickle.dumps(answer))
        os.replace(beside, folder / ANSWER.format(number))


def _answer(asked: dict[str, Any], worlds: dict[str, Any], materials: dict[str, Any]) -> Any:
    if asked["do"] == "map":
        return whole(world_render.map_parts(worlds[asked["world"]], world_render.Map(*asked["size"])))
    if asked["do"] == "window":
        return world_render.window(worlds[asked["world"]], *asked["view"])
    subject = evaluate.Subject(materials[asked["material"]], MeshPart(*asked["part"]), *asked["subject"])
    return np.asarray(evaluate.bake(subject, asked["name"], Cells(*asked["cells"]), asked["frame"]))

"""What is measured in each scene: which objects receive, and how many lumels they get.

The scenes lie in `../shared/scenes` beside the checkout, or where RADIOSITY_SCENES points to. They were made by others
(each folder's SOURCE.md says who, and under which licence) and are no part of this project.
"""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SCENES = Path(os.environ.get("RADIOSITY_SCENES", ROOT.parent / "shared" / "scenes"))
OUTPUT = ROOT / "out" / "benchmarks"

# Name of the UV layer that the twin's receivers get.
UV_LAYER = "Benchmark"

Box = tuple[tuple[float, float, float], tuple[float, float, float]]


@dataclass(frozen=True)
class Case:
    """One scene and its receivers.

    Parameters
    ----------
    name : its folder and file under `SCENES`.
    receivers : names of the objects that get lumels; all others block, reflect and emit.
    lumels : about how many lumels in all; the texel density, the same on all receivers, is chosen to meet it.
    density : factor on that density, for furniture whose faces would hold no inner lumel.
    crop : boxes (minimum, maximum; metres) that cut an object in two: the part inside keeps the object's name, the part
        outside is named `<name>.outside`; either may be a receiver.
    why : what the scene is good for, and what was chosen.
    """

    name: str
    receivers: tuple[str, ...]
    lumels: int = 20_000
    density: dict[str, float] = field(default_factory=dict)
    crop: dict[str, Box] = field(default_factory=dict)
    why: str = ""

    @property
    def blend(self) -> Path:
        """The scene as it was found."""
        return SCENES / self.name / f"{self.name}.blend"

    @property
    def folder(self) -> Path:
        """Where the twin and all its bakes go."""
        return OUTPUT / self.name


_BOXES = tuple(f"{box}_box_{side}" for box in ("short", "tall") for side in ("top", "front", "back", "left", "right"))

CASES = {
    case.name: case
    for case in (
        Case(
            "cornell",
            ("floor", "ceiling.outside", "back_wall", "left_wall", "right_wall", *_BOXES),
            # The lamp hangs 1 mm under the ceiling and shines into that gap too. The 160 hidden lumels there are a
            # hundred times as bright as all others and would carry nearly all of the mean square: they get none.
            crop={"ceiling": ((-3.43, 2.27, 5), (-2.13, 3.32, 6))},
            why="colour bleeding and one soft shadow; every surface but the lamp and the ceiling right above it",
        ),
        Case(
            "classroom",
            ("obj_35", "obj_69", "obj_43", "obj_34", "obj_49"),
            # The floor plate is 222 m a side, the walls have an outside: only the room is of interest. The board obj_17
            # turns its front to the wall behind it, so that it would bake black.
            density={"obj_34": 2.5, "obj_49": 2.0, "obj_43": 1.5},
            crop={
                "obj_35": ((-4.2, -5.93, -0.1), (3.94, 5.93, 0.1)),
                "obj_69": ((-4.25, -5.955, -1), (4, 5.955, 2.955)),
            },
            why="a room lit by sun and sky through its windows; floor, walls, ceiling, boards, desks, lectern",
        ),
        Case(
            "truck_town",
            ("GrassMesh", "RoadMesh", "RacetrackMesh", "HugeTireMesh", "House01Mesh", "House02Mesh", "House06Mesh"),
            density={"HugeTireMesh": 2.0, "House01Mesh": 3.0, "House02Mesh": 3.0, "House06Mesh": 3.0},
            why="out of doors, textured, smooth normals; the 2 km ground plate only reflects",
        ),
        Case(
            "living-room",
            # The cupboard obj_37 gets no lumels: it is all but closed and white (reflectance 1) inside: light goes
            # on for far more than the 64 bounces at which Cycles stops.
            ("obj_33", "obj_32", "obj_31", "obj_36", "obj_34", "obj_62", "obj_25"),
            density={"obj_62": 3.0, "obj_25": 2.0},
            why="a room lit by an HDR environment through windows; walls, floor, ceiling, sofa, mouldings, table",
        ),
        Case("pandora", ("pandora",), lumels=40_000, why="a game level in one mesh, many small lamps"),
        Case("zdm2", ("zdm2",), lumels=40_000, why="a game level in one mesh, sun, sky, points, spot"),
        Case("godot_livingroom", ("Cube", "Cylinder"), why="most triangles have no area at all"),
        Case("pc_house", ("House",), why="open, white; its alpha leaves are left out"),
        Case(
            "pc_terrain",
            ("Terreno", "Icosphere.001", "Icosphere.002", "Arbol 2", "Arbol"),
            density={"Arbol 2": 3.0, "Arbol": 3.0},
            why="open terrain under sun and sky, smooth normals",
        ),
    )
}


def case_named(name: str) -> Case:
    """The case of that name.

    Raises
    ------
    KeyError
        If there is none; the message lists what there is.
    """
    if name not in CASES:
        raise KeyError(f"no scene {name!r}: choose from {', '.join(CASES)}")
    return CASES[name]

"""The peers' rows of the table: pyviewfactor and raystrack on the same cases, in their own environment."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ..peers import environment
from .cases import Case

Row = tuple[str, str, int, float, float, float]

SCRIPT = Path(environment.__file__).with_name("view_factors.py")
# The sample counts that each program is asked for. Where nothing stands between the polygons pyviewfactor is at its
# limit with few pairs.
LADDERS = {
    "pyviewfactor": (1, 16, 256, 4096, 65536),
    "raystrack rays": (16, 256, 4096, 65536),
    "raystrack pairs": (16, 256, 4096, 65536),
}
ENOUGH_UNOCCLUDED = {"pyviewfactor": 256}
PACKAGES = {"pyviewfactor": "pyviewfactor", "raystrack rays": "raystrack", "raystrack pairs": "raystrack"}


def ladder(name: str, case: Case, most: int) -> list[int]:
    """The sample counts at which a program is measured on a case."""
    limit = most if case.occluders else min(most, ENOUGH_UNOCCLUDED.get(name, most))
    return [samples for samples in LADDERS[name] if samples <= limit]


def rows(cases: tuple[Case, ...], most: int, seeds: int, calls: int,
         folder: Path) -> tuple[list[Row], dict[str, str]]:
    """The rows of the programs that are installed and run; and why the others are missing, by name.

    Parameters
    ----------
    seeds : of the random ones;  calls : of those that know no seed.
    """
    problems = {name: f"{package} is not installed" for name, package in PACKAGES.items()
                if not environment.has(package)}
    asked = [
        {"method": name, "case": _plain(case), "samples": samples}
        for name in LADDERS
        if name not in problems
        for case in cases
        for samples in ladder(name, case, most)
    ]
    if not asked:
        return [], problems
    answer = environment.run(SCRIPT, {"asked": asked, "seeds": seeds, "calls": calls}, folder)
    found: list[Row] = [(row[0], row[1], int(row[2]), row[3], row[4], row[5]) for row in answer["rows"]]
    return found, problems | answer["problems"]


def _plain(case: Case) -> dict[str, Any]:
    return {
        "name": case.name,
        "a": case.a.tolist(),
        "b": case.b.tolist(),
        "occluders": [occluder.tolist() for occluder in case.occluders],
        "exact": case.exact,
    }

"""Where our bake of a twin is farthest from Cycles': which charts carry the error, and which lumels, in the world.

    python -m benchmarks.cycles.worst classroom --error .03

Reads what `compare.py` baked last at that error. A lumel's share is its part of the scene's mean square error, nothing
left out; the references' noise is taken out on average, so that a share may be below zero.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from radiosity.solver import image_file

from . import charts, reference, unwrap
from .blender import open_blend
from .scenes import CASES, Case, case_named
from .twin import make_twin

Float = NDArray[np.floating[Any]]


@dataclass(frozen=True)
class Deviation:
    """The inner lumels of one receiver: product of the deviations from the two references, and what it is made of."""

    name: str
    inner: NDArray[np.bool_]
    chart: NDArray[np.int32]
    square: Float
    ours: Float
    first: Float
    second: Float


def deviations(case: Case, error: float) -> list[Deviation]:
    """One for each receiver.

    Raises
    ------
    RuntimeError
        If `compare.py` has not baked this scene at this error, or there are no references.
    """
    known = make_twin(case)
    pair = reference.references(case, known["content"])
    report_path = case.folder / f"ours_{error:g}" / "report.json"
    if pair is None or not report_path.is_file():
        raise RuntimeError(f"nothing to look at: run python -m benchmarks.cycles.compare {case.name} --error {error:g}")
    report = json.loads(report_path.read_text())
    paths = {output["object"]: report_path.parent / output["image"] for output in report["outputs"]}
    counted = reference.selection(case, pair).counted
    found = []
    with np.load(case.folder / "lumels.npz") as archive:
        for name, masks in counted.items():
            ours, first, second = image_file.read_exr(paths[name]), pair.first[name], pair.second[name]
            square = np.where(masks.inner, ((ours - first) * (ours - second)).mean(axis=2), 0)
            found.append(Deviation(name, masks.inner, archive[name], np.asarray(square), ours, first, second))
    return found


def world_places(made: Any, layer: str, resolution: int) -> tuple[Float, Float]:
    """(rows, columns, 3) positions in metres and geometric normals of an object's lumels, nan where there is none."""
    uv = unwrap.triangle_uv(made.data, layer).astype(np.float64) * resolution
    corner = np.empty(len(made.data.loops), np.int32)
    made.data.loops.foreach_get("vertex_index", corner)
    place = np.array(made.matrix_world.translation)
    world = (unwrap.world_positions(made) + place)[corner].reshape(-1, 3, 3)
    image = charts.triangle_image(uv / resolution, resolution)[0]
    row, column = np.nonzero(image >= 0)
    triangle = image[row, column]
    sides, flat = world[triangle, 1:] - world[triangle, :1], uv[triangle, 1:] - uv[triangle, :1]
    offset = np.stack([column + 0.5, row + 0.5], axis=1) - uv[triangle, 0]
    weights = np.linalg.solve(np.swapaxes(flat, 1, 2), offset[..., None])[..., 0]
    position, normal = (np.full((*image.shape, 3), np.nan) for _ in range(2))
    position[row, column] = world[triangle, 0] + (weights[..., None] * sides).sum(axis=1)
    cross = np.cross(sides[:, 0], sides[:, 1])
    normal[row, column] = cross / np.linalg.norm(cross, axis=1, keepdims=True)
    return position, normal


def print_worst(case: Case, error: float, top: int) -> None:
    """The charts and the lumels that carry most of the mean square error."""
    found = deviations(case, error)
    total = sum(float(one.square.sum()) for one in found)
    known = make_twin(case)
    bpy = open_blend(case.folder / "twin.blend")
    places = {
        one.name: world_places(bpy.data.objects[one.name], known["uv_layer"], known["resolution"]) for one in found
    }
    print(f"{case.name}: charts that carry most of the mean square error of our bake at {error:g}")
    by_chart = []
    for one in found:
        squares = np.bincount(one.chart[one.inner], one.square[one.inner])
        by_chart += [(float(squares[chart]), one, chart) for chart in np.argsort(squares)[-top:]]
    for square, one, chart in sorted(by_chart, key=lambda entry: -entry[0])[:top]:
        mask = one.inner & (one.chart == chart)
        low, high = places[one.name][0][mask].min(axis=0), places[one.name][0][mask].max(axis=0)
        reference_mean = (one.first[mask] + one.second[mask]).mean() / 2
        print(
            f"  {square / total:7.2%}  {one.name} chart {chart}: {mask.sum()} inner lumels from {low.round(3)} to "
            f"{high.round(3)}, mean ours {one.ours[mask].mean():.4f}, reference {reference_mean:.4f}"
        )
    print("lumels")
    entries = [(one.square[y, x], one, y, x) for one in found for y, x in _largest(one.square, top)]
    for square, one, y, x in sorted(entries, key=lambda entry: -entry[0])[:top]:
        position, normal = (values[y, x].round(4) for values in places[one.name])
        print(
            f"  {square / total:7.2%}  {one.name} row {y} column {x} at {position} facing {normal.round(2)}: ours "
            f"{one.ours[y, x].round(4)}, references {one.first[y, x].round(4)} {one.second[y, x].round(4)}"
        )


def _largest(square: Float, top: int) -> list[tuple[int, int]]:
    return [divmod(int(index), square.shape[1]) for index in np.argsort(square.ravel())[-top:]]


def main(arguments: list[str] | None = None) -> None:
    """Command line: print the worst charts and lumels of the scenes named."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.cycles.worst", description=(__doc__ or "").splitlines()[0]
    )
    parser.add_argument("scene", nargs="+", help=f"one or more of {', '.join(CASES)}")
    parser.add_argument("--error", type=float, default=0.03, help="error that was asked of our bake (.03)")
    parser.add_argument("--top", type=int, default=12, help="how many to show (12)")
    chosen = parser.parse_args(arguments)
    for name in chosen.scene:
        print_worst(case_named(name), chosen.error, chosen.top)


if __name__ == "__main__":
    main()

"""pyviewfactor and raystrack on our cases with known form factors; runs in the peers' environment.

    view_factors.py REQUEST.json ANSWER.json

The request lists what to measure (method, case, samples), seeds and calls; the answer has rows like those of
benchmarks/form_factors. Every program is called once before its clock starts, for both compile at first use.

pyviewfactor    `samples` pairs of quadrilaterals: both polygons cut alike; one pair is exact but for its rounding where
                nothing stands between. Shadows are all or nothing for each pair of centroids, and only `obstacles=`
                makes it look for any. Its matrix is F[i, j] = from j to i. Bogdan and Walther 2022.
raystrack       `samples` rays: shifted Halton points, cosine rays ("raystrack rays") or pairs of points on both
                polygons ("raystrack pairs"). The best clock is that of a whole call, scene and solver made anew.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.floating[Any]]
Method = Callable[[Float, Float, int, "list[Float]", int], float]

# Rays that belong to one randomised shift of raystrack's points: it estimates errors from the spread of the shifts.
SHIFTS = 4


def _quads(polygon: Float, side: int) -> tuple[Float, NDArray[np.int64]]:
    """A quadrilateral as side x side ones: vertices and their corners, wound alike."""
    u = np.linspace(0, 1, side + 1)
    s, t = (grid.ravel()[:, None] for grid in np.meshgrid(u, u))
    p0, p1, p2, p3 = polygon
    vertices = (1 - s) * (1 - t) * p0 + s * (1 - t) * p1 + s * t * p2 + (1 - s) * t * p3
    first = (np.arange(side)[:, None] * (side + 1) + np.arange(side)).ravel()
    return vertices, first[:, None] + np.array([0, 1, side + 2, side + 1])


def _polydata(polygons: list[tuple[Float, NDArray[np.int64]]]) -> Any:
    """One mesh of PyVista."""
    import pyvista

    starts = np.cumsum([0, *(len(vertices) for vertices, _ in polygons)])
    faces = np.concatenate([corners + start for (_, corners), start in zip(polygons, starts, strict=False)])
    counted = np.concatenate([np.full((len(faces), 1), faces.shape[1]), faces], axis=1)
    return pyvista.PolyData(np.concatenate([vertices for vertices, _ in polygons]), counted.ravel())


def pyviewfactor(a: Float, b: Float, samples: int, occluders: list[Float], seed: int) -> float:
    """F_ab by its SA-30 kernel over about `samples` pairs."""
    import pyviewfactor as program

    side = max(1, round(samples**0.25))
    mesh = _polydata([_quads(a, side), _quads(b, side)])
    obstacles = [_polydata([(occluder, np.arange(len(occluder))[None])]).triangulate() for occluder in occluders]
    matrix = program.compute_viewfactor_matrix(mesh, obstacles=obstacles or None, skip_obstruction=not obstacles)
    area = np.asarray(mesh.compute_cell_sizes(length=False, volume=False)["Area"])
    on_a = slice(0, side * side)
    return float((matrix[side * side :, on_a].sum(axis=0) * area[on_a]).sum() / area[on_a].sum())


def _raystrack(a: Float, b: Float, occluders: list[Float], sampling: Any, rays: int) -> float:
    import raystrack

    fan = [[0, k, k + 1] for k in range(1, 3)]
    meshes = {name: raystrack.Mesh(polygon.astype(np.float32), np.array(fan, np.int32))
              for name, polygon in (("a", a), ("b", b), *((f"occluder{i}", o) for i, o in enumerate(occluders)))}
    accuracy = raystrack.Accuracy(max_replicates=SHIFTS, min_replicates=SHIFTS, tolerance=0.0)
    options = raystrack.SolveOptions(sampling=sampling, accuracy=accuracy)
    with raystrack.Solver(raystrack.Scene.from_meshes(meshes), device="cpu") as solver:
        query = raystrack.Query.pair("a", "b", receiver_sides=("front",))
        result = solver.solve(query, options, raystrack.Budget(rays=rays))
    value = result.value("a", raystrack.Channel("surface", "b", "front"))
    return float("nan") if value is None else float(value)


def raystrack_rays(a: Float, b: Float, samples: int, occluders: list[Float], seed: int) -> float:
    """F_ab by `samples` cosine rays."""
    import raystrack

    sampling = raystrack.Sampling(density=1, rays_per_cell=max(1, samples // SHIFTS), seed=seed)
    return _raystrack(a, b, occluders, sampling, samples)


def raystrack_pairs(a: Float, b: Float, samples: int, occluders: list[Float], seed: int) -> float:
    """F_ab by `samples` pairs of points."""
    import raystrack

    sampling = raystrack.Sampling(strategy="area_pair", pair_samples=max(1, samples // SHIFTS), seed=seed,
                                  sequence="shifted_halton")
    return _raystrack(a, b, occluders, sampling, samples)


METHODS: dict[str, Method] = {
    "pyviewfactor": pyviewfactor,
    "raystrack rays": raystrack_rays,
    "raystrack pairs": raystrack_pairs,
}
DETERMINISTIC = {"pyviewfactor"}


def measure(asked: dict[str, Any], seeds: int, calls: int) -> list[Any]:
    """One row: case, method, samples, mean value, RMS relative error over the seeds, seconds of the best call."""
    case, name = asked["case"], asked["method"]
    a, b = np.array(case["a"]), np.array(case["b"])
    occluders = [np.array(occluder) for occluder in case["occluders"]]
    values, seconds = [], []
    for seed in [0] * calls if name in DETERMINISTIC else range(seeds):
        begin = time.perf_counter()
        values.append(METHODS[name](a, b, asked["samples"], occluders, seed))
        seconds.append(time.perf_counter() - begin)
    error = float(np.sqrt(np.square(np.array(values) / case["exact"] - 1).mean()))
    return [case["name"], name, asked["samples"], float(np.mean(values)), error, min(seconds)]


def main() -> None:
    """Read the request, measure, write the answer."""
    request = json.loads(Path(sys.argv[1]).read_text())
    rows: list[list[Any]] = []
    problems: dict[str, str] = {}
    for name in dict.fromkeys(asked["method"] for asked in request["asked"]):
        mine = [asked for asked in request["asked"] if asked["method"] == name]
        try:
            # Compiles, without occluders and with: not timed.
            for first in {bool(asked["case"]["occluders"]): asked for asked in reversed(mine)}.values():
                measure(first, 1, 1)
            rows += [measure(asked, request["seeds"], request["calls"]) for asked in mine]
        except Exception as problem:  # noqa: BLE001 (a peer that fails is reported, the others go on)
            problems[name] = f"{type(problem).__name__}: {problem}"
    Path(sys.argv[2]).write_text(json.dumps({"rows": rows, "problems": problems}))


if __name__ == "__main__":
    main()

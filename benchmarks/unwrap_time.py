"""Seconds and use of the page of the unwrap, by the number of triangles.

    python -m benchmarks.unwrap_time 62500 250000 1000000

The mesh is a wavy sheet with bumps, as terrain: one connected piece, nowhere planar, which is the hard case for charts.
"""

from __future__ import annotations

import argparse
import sys
import time

import numpy as np
from radiosity.solver.layout import make_layout, world_areas
from radiosity.solver.scene import Scene
from radiosity.solver.settings import Settings


def terrain(triangles: int, seed: int = 0) -> Scene:
    """A sheet of 100 m with about so many triangles: waves of 20, 5 and 1 m."""
    side = round(np.sqrt(triangles / 2))
    x, y = (each.ravel() for each in np.meshgrid(np.linspace(0, 100, side + 1), np.linspace(0, 100, side + 1)))
    random = np.random.default_rng(seed)
    z = np.zeros_like(x)
    for length, height in ((20.0, 3.0), (5.0, 0.6), (1.0, 0.08)):
        for _ in range(3):
            way, phase = random.normal(size=2), random.uniform(0, 2 * np.pi)
            way *= 2 * np.pi / length / np.linalg.norm(way)
            z += height * np.sin(x * way[0] + y * way[1] + phase) / 3
    number = np.arange((side + 1) ** 2).reshape(side + 1, side + 1)
    a, b, c, d = (part.ravel() for part in (number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]))
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    return Scene(np.stack([x, y, z], axis=1), faces)


def main(arguments: list[str] | None = None) -> int:
    """Unwrap and print a row each."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("triangles", type=int, nargs="+")
    parser.add_argument("--resolution", type=int, default=4096)
    given = parser.parse_args(arguments)
    for count in given.triangles:
        scene = terrain(count)
        wall, cpu = time.perf_counter(), time.process_time()
        layout = make_layout(scene, Settings(resolution=given.resolution), [])
        wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
        uv = layout.uv[0]
        assert uv is not None
        sides = np.cross(uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0])
        used = float(np.abs(sides).sum() / 2)
        density = given.resolution * np.sqrt(used / world_areas(scene).sum())
        print(f"{len(scene.triangles)} triangles: {wall:.1f} s ({cpu:.1f} s CPU), {used:.0%} of the page used, "
              f"{density:.1f} px/m", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())

"""How fast the gather's rays are: the whole stage of a bake against Embree alone, over the very same rays.

    python -m benchmarks.gather_rate SCENE.blend ... [--error .03] [--resolution 512] [--threads 2] [--csv TABLE.csv]

Each scene is baked twice, with equal bits. The first bake is timed: wall clock and CPU seconds of the stage "gather",
and the rays that Embree is asked for in it. The second keeps those rays, chunk by chunk. Then a bare loop hands the
kept chunks to embreex, on as many threads, and does nothing with what it says. `share` is the gather's rate over the
bare loop's: the part of its time that the gather spends in Embree. The audit, which a bake does beside the gather,
waits here until the gather is done.
"""

from __future__ import annotations

import argparse
import csv
import os
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, dataclass, fields
from importlib import import_module
from pathlib import Path
from threading import Lock
from typing import Any
from unittest.mock import patch

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from numpy.typing import NDArray
from radiosity.solver.parallel import Run
from radiosity.solver.result import Stages
from radiosity.solver.scene import Scene
from radiosity.solver.settings import Settings
from radiosity.solver.visibility import Hits, Visibility

Float = NDArray[np.floating[Any]]
STAGE = "gather"
# Rays that are kept at most, of chunks spread evenly over the stage: 24 bytes each.
MOST_KEPT = 2**25
# The bare loop is run this often; its best time counts.
REPEATS = 3


@dataclass(frozen=True)
class Clock:
    """Wall clock and CPU seconds, of all threads."""

    wall: float
    cpu: float

    @classmethod
    def now(cls) -> Clock:
        """Both clocks as they stand."""
        return cls(time.perf_counter(), time.process_time())

    def since(self, start: Clock) -> Clock:
        """What has passed."""
        return Clock(self.wall - start.wall, self.cpu - start.cpu)


@dataclass(frozen=True, eq=False)
class Chunk:
    """One call of Embree: rays (n, 3) each, and how far they go (n,); None asks for the nearest hit."""

    visibility: Visibility
    origins: Float
    directions: Float
    distances: Float | None


@dataclass(frozen=True)
class Row:
    """One scene; rates in rays a second, of wall clock (`_wall`) and of CPU time (`_cpu`)."""

    scene: str
    error: float
    threads: int
    lumels: int
    rays: int
    seconds: float
    cpu_seconds: float
    gather_wall: float
    bare_wall: float
    share_wall: float
    gather_cpu: float
    bare_cpu: float
    share_cpu: float


class Watch:
    """Looks on while a scene is baked.

    Parameters
    ----------
    every : which of the calls of Embree in the stage to keep: each `every`-th; 0 keeps none and copies nothing.

    Attributes
    ----------
    rays, clock : of the stage.
    chunks : what was kept of it.
    """

    def __init__(self, every: int) -> None:
        self.rays, self.clock = 0, Clock(0.0, 0.0)
        self.chunks: list[Chunk] = []
        self._every, self._calls, self._within = every, 0, False
        self._lock = Lock()

    def bake(self, scene: Scene, settings: Settings) -> dict[str, Any]:
        """Bake, and return the report."""
        module: Any = import_module("radiosity.solver.bake")  # the package's own `bake` is the function in it
        watch = self

        class WatchedStages(Stages):
            @contextmanager
            def __call__(self, name: str) -> Iterator[None]:
                with super().__call__(name), watch._stage(name):
                    yield

        with ExitStack() as stack:
            stack.enter_context(patch.object(module, "Stages", WatchedStages))
            stack.enter_context(patch.object(Run, "beside", _put_off(Run.beside)))
            stack.enter_context(patch.object(Visibility, "hits", self._hits(Visibility.hits)))
            stack.enter_context(patch.object(Visibility, "occluded", self._occluded(Visibility.occluded)))
            report: dict[str, Any] = module.bake(scene, settings).report
        return report

    @contextmanager
    def _stage(self, name: str) -> Iterator[None]:
        self._within = name == STAGE
        start = Clock.now()
        yield
        if self._within:
            self.clock = Clock.now().since(start)
        self._within = False

    def _hits(self, original: Callable[..., Hits]) -> Callable[..., Hits]:
        def hits(visibility: Visibility, origins: Float, directions: Float) -> Hits:
            self._note(visibility, origins, directions, None)
            return original(visibility, origins, directions)

        return hits

    def _occluded(self, original: Callable[..., Any]) -> Callable[..., Any]:
        def occluded(visibility: Visibility, origins: Float, directions: Float, distances: Float) -> Any:
            self._note(visibility, origins, directions, distances)
            return original(visibility, origins, directions, distances)

        return occluded

    def _note(self, visibility: Visibility, origins: Float, directions: Float, distances: Float | None) -> None:
        if not self._within:
            return
        with self._lock:
            self.rays += len(origins)
            self._calls += 1
            chosen = self._every and self._calls % self._every == 0
        if chosen:
            far = None if distances is None else np.array(distances, np.float32)
            self.chunks.append(Chunk(visibility, np.array(origins, np.float32), np.array(directions, np.float32), far))


def _put_off(original: Callable[..., Any]) -> Callable[..., Any]:
    """`Run.beside` without a thread of its own: its work is done when it is asked for."""
    @contextmanager
    def beside(run: Run, stage: str, work: Callable[[Run], Any]) -> Iterator[Callable[[], Any]]:
        threads, run.threads = run.threads, 1
        with original(run, stage, work) as result:
            run.threads = threads
            yield result

    return beside


def bare(chunks: list[Chunk], threads: int) -> Clock:
    """The best of some runs of the chunks through Embree alone."""
    trees: dict[int, tuple[Any, Any]] = {}
    for chunk in chunks:
        if id(chunk.visibility) not in trees:
            tree = EmbreeScene()
            # The mesh must live as long as its tree, which the first ray builds.
            trees[id(chunk.visibility)] = tree, TriangleMesh(tree, chunk.visibility._corners)
            tree.run(chunk.origins[:1], chunk.directions[:1])

    def cast(chunk: Chunk) -> None:
        tree = trees[id(chunk.visibility)][0]
        if chunk.distances is None:
            tree.run(chunk.origins, chunk.directions, output=True)
        else:
            tree.run(chunk.origins, chunk.directions, dists=chunk.distances, query="OCCLUDED")

    found = []
    with ThreadPoolExecutor(threads) as pool:
        for _ in range(REPEATS):
            start = Clock.now()
            for _ in pool.map(cast, chunks):
                pass
            found.append(Clock.now().since(start))
    return Clock(min(clock.wall for clock in found), min(clock.cpu for clock in found))


def measure(name: str, scene: Scene, settings: Settings) -> Row:
    """One scene's row."""
    timed = Watch(0)
    report = timed.bake(scene, settings)
    kept = Watch(1 + timed.rays // MOST_KEPT)
    kept.bake(scene, settings)
    if kept.rays != timed.rays:
        raise RuntimeError(f"{name}: {timed.rays} rays in the first bake and {kept.rays} in the second: not the same")
    replayed = sum(len(chunk.origins) for chunk in kept.chunks)
    alone = bare(kept.chunks, settings.thread_count)
    gather = Clock(timed.rays / timed.clock.wall, timed.rays / timed.clock.cpu)
    embree = Clock(replayed / alone.wall, replayed / alone.cpu)
    return Row(name, settings.error, settings.thread_count, report["lumels"], timed.rays, timed.clock.wall,
               timed.clock.cpu, gather.wall, embree.wall, gather.wall / embree.wall, gather.cpu, embree.cpu,
               gather.cpu / embree.cpu)


def line(row: Row) -> str:
    """A row to read."""
    def rates(gather: float, embree: float, share: float) -> str:
        return f"gather {gather / 1e6:.2f} M rays/s, Embree alone {embree / 1e6:.2f} M rays/s: {share:.0%}"

    return (f"{row.scene}: {row.lumels} lumels, {row.rays / 1e6:.2f} M rays in {row.seconds:.2f} s "
            f"({row.cpu_seconds:.2f} s CPU, {row.threads} threads)\n"
            f"  wall clock  {rates(row.gather_wall, row.bare_wall, row.share_wall)}\n"
            f"  CPU time    {rates(row.gather_cpu, row.bare_cpu, row.share_cpu)}")


def write_csv(path: Path, rows: list[Row]) -> None:
    """All rows."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", newline="", encoding="utf-8") as file:
        table = csv.DictWriter(file, [field.name for field in fields(Row)])
        table.writeheader()
        for row in rows:
            table.writerow({key: f"{value:.6g}" if isinstance(value, float) else value
                            for key, value in asdict(row).items()})


def exported(path: Path, settings: Settings) -> tuple[Scene, Settings]:
    """The scene of a .blend as it is baked; the extension must be registered."""
    import bpy
    from radiosity.radiosity_addon.blend_file import open_blend
    from radiosity.radiosity_addon.export import export_scene
    from radiosity.radiosity_addon.layouts import with_shared_layouts

    open_blend(path)
    found = export_scene(bpy.context.scene, bpy.context.view_layer, settings, [])
    return with_shared_layouts(found.scene, found.bindings, found.settings, [])


def main(arguments: list[str] | None = None) -> int:
    """Measure and print scene by scene."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", type=Path, nargs="+", metavar="SCENE.blend")
    parser.add_argument("--error", type=float, default=Settings().error)
    parser.add_argument("--resolution", type=int, default=512)
    parser.add_argument("--threads", type=int, default=0, help="0 (the default) is all")
    parser.add_argument("--csv", type=Path, default=Path("out/gather_rate.csv"))
    given = parser.parse_args(arguments)
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        os.environ.setdefault("BLENDER_USER_RESOURCES", folder)
        from radiosity import radiosity_addon

        wanted = Settings(error=given.error, resolution=given.resolution, threads=given.threads)
        radiosity_addon.register()
        try:
            for path in given.scenes:
                rows.append(measure(path.stem, *exported(path, wanted)))
                print(line(rows[-1]), flush=True)
        finally:
            radiosity_addon.unregister()
    write_csv(given.csv, rows)
    return 0


if __name__ == "__main__":
    sys.exit(main())

"""A comparison from start to end: our bake, Cycles' bakes of the same lumels, the error between them, and its pictures.

    export      the scene as for a bake; lamps, world and camera into a file of their own      compare_twin.py
    bake        ours, in a thread                                                             solver/bake.py
    Cycles      twice, with different seeds, in another Blender                               compare_process.py
    score       error, its noise taken out; time                                              compare_score.py
    write       images, numbers, one page to look at                                          compare_write.py

Nothing of the open file changes: the diffuse twin that Cycles bakes is built elsewhere.
"""

from __future__ import annotations

import json
import tempfile
import threading
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from ..solver.errors import NothingToBake
from ..solver.result import Bake
from . import compare_score, compare_write, compat, cycles
from .compare_child import BAKED_VIEW, CYCLES_VIEW, LIGHTMAPS, REFERENCES
from .compare_process import run_job
from .compare_request import CompareRequest
from .compare_twin import Stage, write_geometry, write_stage
from .job import ERROR_NOT_REACHED, Job
from .parts import PAUSE, WINDOW_PART, Parts
from .progress import STAGE_WEIGHTS
from .report import reached
from .warn import warn

# Cycles' references have seeds that no bake of ours has.
SEED = 0x5EED
# Samples of each of Cycles' bakes below which they lean to the texels' centres.
SHORT_BAKE = 64
# Leaving the largest deviations out makes an error smaller. Where all of them together are smaller than this part of
# the rest, they were the few lumels with the bright samples that Cycles' mean consists of.
FIREFLIES = 0.8


@dataclass(frozen=True)
class Compared:
    """What came of it: the report, the files by what they show, and the exit code."""

    report: dict[str, Any]
    files: dict[str, Path]
    exit_code: int


class Comparison(Job):
    """A job (see there) that compares instead of writing back."""

    # The last one that was done, for the panel.
    last: Compared | None = None

    def __init__(self, request: CompareRequest, scene: Any, view_layer: Any) -> None:
        super().__init__(request.bake, scene, view_layer)
        self.asked = request
        self.progress.weights = {**STAGE_WEIGHTS, "Cycles": 100.0, "camera view": 20.0 * request.camera}
        self._folder = tempfile.TemporaryDirectory(prefix="radiosity-compare-")
        self._stage: Stage | None = None
        self._compared: Compared | None = None

    def exporting(self, part_seconds: float = WINDOW_PART) -> Parts[None]:
        """Read the scene for both programs, in parts. Raises RadiosityError."""
        yield from super().exporting(part_seconds)
        yield PAUSE
        scene, layer = self._place()
        self._stage = cycles.with_render_depsgraph(
            scene, layer, lambda depsgraph: write_stage(scene, depsgraph, Path(self._folder.name)))
        self._blend, self._blender = bpy.data.filepath or scene.name, compat.version()

    def finishing(self) -> Parts[Compared]:  # type: ignore[override]
        """What came of it. Raises what the worker raised, or RadiosityError."""
        self.wait(threading.TIMEOUT_MAX)
        if self._failure is not None:
            raise self._failure
        assert self._compared is not None
        Comparison.last = self._compared
        yield
        return self._compared

    def close(self) -> None:
        """End all that runs and take the twin's files away."""
        super().close()
        self._folder.cleanup()

    def _use(self, done: Bake) -> None:
        """Compare it."""
        self._compared = self._compare(done)

    def _compare(self, bake: Bake) -> Compared:
        assert self._exported is not None
        folder = Path(self._folder.name)
        scene, seconds = self._exported.scene, time.perf_counter() - self._started
        self._add_solver_warnings()
        self.progress("Cycles", 0.0)
        pages, copies = write_geometry(scene, bake, folder)
        if copies.any():
            warn(self.warnings, "", "overlapping", f"{copies.sum()} of {len(scene.triangles)} triangles lie exactly on "
                 "others: Cycles is not given them, since it would shade both by chance, and their lumels are not "
                 "compared: merge vertices by distance (Mesh > Merge) or delete them")
        job = self._job(pages)
        run_job(job, folder, self._cycles_told, self._cancel.is_set)
        with np.load(folder / REFERENCES) as archive:
            about = json.loads(str(archive["about"]))
            halves = [[archive[f"{half}/{page}"] for page in range(len(bake.lightmaps))] for half in range(2)]
        maps = compare_score.make_maps(scene, bake, halves, copies)
        try:
            numbers = compare_score.numbers(maps, [surface.name for surface in scene.surfaces], seconds, about)
        except ValueError as cause:
            raise NothingToBake(f"nothing can be compared ({cause}): see that light falls on what is baked") from cause
        self._tell_limits(numbers)
        views = self._views(job, folder) if self.asked.camera else {}
        report = self._report(numbers)
        files = compare_write.write(maps, report, views, self.asked)
        self.progress("write", 1.0)
        measured = report["comparison"]["ours"]
        wanted_missed = min(measured["rms_low"], measured["rms_untrimmed"]) > self.request.settings.error
        return Compared(report, files, ERROR_NOT_REACHED if wanted_missed else 0)

    def _job(self, pages: list[list[int]]) -> dict[str, Any]:
        assert self._stage is not None
        settings = self.request.settings
        if self.asked.camera and self._stage.camera is None:
            warn(self.warnings, "", "no_camera", "the scene has no camera, so there is no view of it: add one")
        return {"do": "bake", "stage": self._stage.as_dict(), "pages": pages, "passes": settings.passes,
                "samples": self.asked.samples, "seconds": self.asked.seconds, "seed": SEED, "threads": settings.threads,
                "camera": self.asked.camera and self._stage.camera is not None}

    def _cycles_told(self, stage: str, fraction: float) -> None:
        if stage == "camera view":
            self.progress("camera view", fraction)
        elif stage.startswith("bake"):
            half = int(stage.split()[1]) - 1
            self.progress("Cycles", 0.05 + 0.95 * (half + fraction) / 2)

    def _views(self, job: dict[str, Any], folder: Path) -> dict[str, Any]:
        """The camera's view in both programs, (h, w, 3) each; empty without a camera."""
        if not job["camera"]:
            return {}
        assert self._bake is not None
        np.savez(folder / LIGHTMAPS, **{str(page): item.pixels for page, item in enumerate(self._bake.lightmaps)})
        run_job({**job, "do": "camera"}, folder, self._cycles_told, self._cancel.is_set)
        return {name: np.load(folder / file)
                for name, file in (("ours", BAKED_VIEW), ("Cycles", CYCLES_VIEW))}

    def _tell_limits(self, numbers: dict[str, Any]) -> None:
        samples, lumels, ours = numbers["cycles"]["samples"] // 2, numbers["lumels"], numbers["ours"]
        if lumels["doubled"]:
            whole = lumels["doubled"] + lumels["counted"]
            warn(self.warnings, "", "doubled_lumels", f"on {lumels['doubled'] / whole:.2%} of the lumels lies a part "
                 "of another face: Cycles shades these by chance, and they are not compared: move the faces apart")
        if ours["rms_untrimmed"] < FIREFLIES * ours["rms"]:
            warn(self.warnings, "", "fireflies", "most light of some lumels comes by rare paths that Cycles' bakes "
                 f"have hardly found, so that our error may as well be {ours['rms_untrimmed']:.2%} as "
                 f"{ours['rms']:.2%}: give Cycles more time (--seconds, --samples)")
        if samples < SHORT_BAKE:
            warn(self.warnings, "", "short_bakes", f"Cycles' two bakes have {samples} samples each, of which the first "
                 "is always a texel's centre: give it more time (--seconds, --samples)")
        if not numbers["clean"]:
            warn(self.warnings, "", "noisy_references", f"Cycles' two bakes have {numbers['cycles']['half_rms']:.2%} "
                 f"noise each, more than three times our error of {numbers['ours']['rms']:.2%}, which is less sure for "
                 "it: give it more time (--seconds, --samples)")
        if self.request.settings.footprint != 0.5:
            warn(self.warnings, "", "footprint", f"footprint is {self.request.settings.footprint:g}, and Cycles' is "
                 "0.5: the difference counts as error")

    def _report(self, numbers: dict[str, Any]) -> dict[str, Any]:
        assert self._bake is not None
        ours = self._bake.report
        return {
            "version": ours["version"], "scene": self._blend, "blender": self._blender,
            "settings": self.request.settings.as_dict(),
            "budget": {"seconds": self.asked.seconds, "samples": self.asked.samples},
            "comparison": numbers,
            "audit": {**ours["error"], "reached": reached(ours)},
            "lumels": ours["lumels"], "triangles": ours["triangles"], "stages": ours["stages"],
            "warnings": self.warnings,
        }

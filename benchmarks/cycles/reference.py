"""Cycles' own bake of a twin, on the same lumels: references that can be refined, and points of Cycles' own curve.

    python -m benchmarks.cycles.reference classroom --samples 256 --noise .05 --minutes 20

Every single bake is kept, in out/benchmarks/NAME/ref_SEED_SAMPLES.npz: pixels, coverage, seconds. Bakes of odd seeds
together are the first reference, those of even seeds the second; each is the mean of its bakes, weighted by samples.
Bakes that are timed to draw Cycles' curve have seeds of their own (`TIMED_SEED`) and are in no reference.

What is baked: DIFFUSE, direct + indirect without colour, which is E / pi; 64 bounces, no clamping, no adaptive
sampling, no light threshold, light tree on, no denoising, plain Sobol points (blue noise ties neighbours together).
"""

from __future__ import annotations

import argparse
import json
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from radiosity.solver import estimator

from .blender import open_blend, select_only
from .scenes import CASES, Case, case_named
from .twin import make_twin

Float = NDArray[np.floating[Any]]

BOUNCES = 64
# Seeds from here on are for timing only.
TIMED_SEED = 9000
# Sample 0 of a Cycles lumel is its centre, in every bake: a reference made of short bakes would lean to it.
LEAST_REFERENCE_SAMPLES = 64


@dataclass(frozen=True)
class CyclesBake:
    """One bake by Cycles.

    radiance : (rows, columns, 3) float32 for each receiver, E / pi, row 0 at v = 0;  covered : its mask.
    seconds : wall clock of the bake operator, scene synchronisation included;  cpu_seconds : of all threads.
    """

    seed: int
    samples: int
    seconds: float
    cpu_seconds: float
    radiance: dict[str, Float]
    covered: dict[str, NDArray[np.bool_]]


class TwinInCycles:
    """A twin opened in Blender and made ready to bake: every receiver with an image of its own."""

    def __init__(self, case: Case) -> None:
        known = make_twin(case)
        self.case, self.resolution = case, int(known["resolution"])
        self.content = known["content"]
        self.squares = {row["object"]: int(row["square"]) for row in known["receivers"]}
        self.bpy = open_blend(case.folder / "twin.blend")
        self.images = {name: self._prepare(name, known["uv_layer"]) for name in self.squares}
        from radiosity.radiosity_addon import cycles

        # What `compare` of the product sets, too.
        cycles.set_up_bake(self.bpy.context.scene)

    def _prepare(self, name: str, layer: str) -> Any:
        """Image of a receiver's square alone: the same lumels at the same size, without the empty rest."""
        made, side = self.bpy.data.objects[name], self.squares[name]
        values = np.empty(len(made.data.loops) * 2, np.float32)
        made.data.uv_layers[layer].uv.foreach_get("vector", values)
        made.data.uv_layers[layer].uv.foreach_set("vector", values * np.float32(self.resolution / side))
        made.data.uv_layers.active = made.data.uv_layers[layer]
        image = self.bpy.data.images.new(f"bake {name}", side, side, alpha=True, float_buffer=True, is_data=True)
        for index, material in enumerate(made.data.materials):
            own = material.copy()
            made.data.materials[index] = own
            node = own.node_tree.nodes.new("ShaderNodeTexImage")
            node.image = image
            own.node_tree.nodes.active = node
        return image

    def bake(self, samples: int, seed: int) -> CyclesBake:
        """Bake all receivers once and time it."""
        cycles = self.bpy.context.scene.cycles
        cycles.samples, cycles.seed = samples, seed
        select_only(self.bpy, [self.bpy.data.objects[name] for name in self.squares])
        wall, cpu = time.perf_counter(), time.process_time()
        self.bpy.ops.object.bake(
            type="DIFFUSE",
            pass_filter={"DIRECT", "INDIRECT"},
            target="IMAGE_TEXTURES",
            save_mode="INTERNAL",
            margin=0,
            use_clear=True,
        )
        wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
        pixels = {name: self._pixels(name) for name in self.squares}
        radiance = {name: values[..., :3] for name, values in pixels.items()}
        covered = {name: np.asarray(values[..., 3] > 0) for name, values in pixels.items()}
        return CyclesBake(seed, samples, wall, cpu, radiance, covered)

    def _pixels(self, name: str) -> Float:
        side = self.squares[name]
        square = np.empty(side * side * 4, np.float32)
        self.images[name].pixels.foreach_get(square)
        whole = np.zeros((self.resolution, self.resolution, 4), np.float32)
        whole[:side, :side] = square.reshape(side, side, 4)
        return whole


def save(case: Case, bake: CyclesBake, content: str) -> Path:
    """Keep one bake."""
    path = case.folder / f"ref_{bake.seed}_{bake.samples}.npz"
    about = {"seed": bake.seed, "samples": bake.samples, "seconds": bake.seconds, "cpu_seconds": bake.cpu_seconds}
    arrays: dict[str, NDArray[Any]] = {f"radiance/{name}": values for name, values in bake.radiance.items()}
    arrays |= {f"covered/{name}": mask for name, mask in bake.covered.items()}
    np.savez_compressed(path, about=json.dumps({**about, "twin": content, "bounces": BOUNCES}), **arrays)
    return path


def load(case: Case, content: str) -> list[CyclesBake]:
    """All bakes of this twin that were kept, by seed; those of an older twin are passed over."""
    bakes = []
    for path in sorted(case.folder.glob("ref_*.npz")):
        with np.load(path) as archive:
            about = json.loads(str(archive["about"]))
            if about["twin"] != content:
                continue
            radiance = {key.split("/", 1)[1]: archive[key] for key in archive.files if key.startswith("radiance/")}
            covered = {key.split("/", 1)[1]: archive[key] for key in archive.files if key.startswith("covered/")}
        bakes.append(
            CyclesBake(about["seed"], about["samples"], about["seconds"], about["cpu_seconds"], radiance, covered)
        )
    return sorted(bakes, key=lambda bake: (bake.seed, bake.samples))


@dataclass(frozen=True)
class References:
    """The two references of a twin, receiver by receiver, and what they are made of."""

    first: dict[str, Float]
    second: dict[str, Float]
    covered: dict[str, NDArray[np.bool_]]
    samples: tuple[int, int]
    seconds: float


def references(case: Case, content: str) -> References | None:
    """The mean of the bakes of odd seeds and that of even seeds; None as long as either is missing."""
    bakes = [bake for bake in load(case, content) if bake.seed < TIMED_SEED]
    sides = [[bake for bake in bakes if bake.seed % 2 == odd] for odd in (1, 0)]
    if not all(sides):
        return None
    means = [
        {
            name: np.asarray(np.average([b.radiance[name] for b in side], axis=0, weights=[b.samples for b in side]))
            for name in side[0].radiance
        }
        for side in sides
    ]
    samples = (sum(bake.samples for bake in sides[0]), sum(bake.samples for bake in sides[1]))
    return References(means[0], means[1], sides[0][0].covered, samples, sum(bake.seconds for bake in bakes))


@dataclass(frozen=True)
class Selection:
    """Which lumels of each receiver count; turns images into lists of lumels."""

    counted: dict[str, estimator.Counted]

    def take(self, images: dict[str, Float], which: str = "inner") -> Float:
        """(n, 3) values of the `inner` or the `edge` lumels of all receivers."""
        return np.concatenate([images[name][getattr(masks, which)] for name, masks in self.counted.items()])


def selection(case: Case, pair: References) -> Selection:
    """The lumels that count: covered by a chart and by Cycles, lit in both references, sorted into inner and edge."""
    with np.load(case.folder / "lumels.npz") as archive:
        charts = {name: archive[name] for name in archive.files}
    return Selection(
        {
            name: estimator.counted_lumels(np.where(pair.covered[name], chart, -1), pair.first[name], pair.second[name])
            for name, chart in charts.items()
        }
    )


def noise(case: Case, content: str) -> float:
    """Relative RMS noise of one reference over the inner lumels, as `estimator.score` trims them; inf without two."""
    pair = references(case, content)
    if pair is None:
        return float("inf")
    chosen = selection(case, pair)
    first, second = chosen.take(pair.first), chosen.take(pair.second)
    left_out = estimator.largest_deviations(first, second, second)
    return estimator.noise_of(first[~left_out], second[~left_out])


def refine(case: Case, samples: int, wanted: float, minutes: float) -> None:
    """Add bakes, a pair at a time, until the references' noise is below `wanted` or the time is over."""
    if samples < LEAST_REFERENCE_SAMPLES:
        raise ValueError(f"{samples} samples lean to the texel's centre: give {LEAST_REFERENCE_SAMPLES} or more")
    twin = TwinInCycles(case)
    deadline = time.monotonic() + 60 * minutes
    reached = noise(case, twin.content)
    while reached > wanted and time.monotonic() < deadline:
        done = {bake.seed for bake in load(case, twin.content)}
        seed = next(seed for seed in range(1, TIMED_SEED, 2) if not {seed, seed + 1} <= done)
        for one in (seed, seed + 1):
            if one not in done:
                bake = twin.bake(samples, one)
                save(case, bake, twin.content)
                print(f"{case.name}: seed {one}, {samples} samples, {bake.seconds:.1f} s ({bake.cpu_seconds:.1f} CPU)")
        reached = noise(case, twin.content)
        print(f"{case.name}: each reference has {reached:.2%} noise", flush=True)


def main(arguments: list[str] | None = None) -> None:
    """Command line: make or refine the references of the scenes named."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.cycles.reference", description=(__doc__ or "").splitlines()[0]
    )
    parser.add_argument("scene", nargs="+", help=f"one or more of {', '.join(CASES)}, or all")
    parser.add_argument("--samples", type=int, default=256, help="of each single bake (256)")
    parser.add_argument(
        "--noise", type=float, default=0.05, help="relative RMS noise of each reference to stop at (.05)"
    )
    parser.add_argument("--minutes", type=float, default=30, help="to stop after, for each scene (30)")
    chosen = parser.parse_args(arguments)
    for name in CASES if chosen.scene == ["all"] else chosen.scene:
        refine(case_named(name), chosen.samples, chosen.noise, chosen.minutes)


if __name__ == "__main__":
    main()

"""Steps of the light across the seams of the layout, against steps between lumels inside charts.

    python -m benchmarks.seams SCENE.blend ... [--error .1] [--resolution 512] [--as-far 2]

Printed for each scene, before and after stitching, over the seams of smooth surfaces (across a crease, or from one
object to another that is not flush with it, light really has a step):

    seam    mean difference between two lumels next to a seam, one of each chart, at the same place of it
    inside  mean difference of the same lumels from those beside them in their own charts
    shown   mean difference of the filtered light that the two charts show on the seam, over all samples of seams
    usual   mean difference of neighbours in a chart, over all lumels of the scene
    all     the first, over all pairs

`seam / inside` and `shown / usual` may be 1.2 at most. `shown / usual` leaves nothing out and is what is seen.
`seam / inside` compares like with like: those pairs count whose lumels face the same way (in a narrow strip of a smooth
surface the shading normal turns by tens of degrees from one chart to the next, and the light with it), and are about as
far apart as the lumels of their charts are, to a factor of `--as-far`.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from radiosity.solver import seams
from radiosity.solver.finish import to_images
from radiosity.solver.neighbours import LumelNeighbours
from radiosity.solver.receivers import Lumels
from radiosity.solver.scene import Scene
from radiosity.solver.seam_samples import SMOOTH_COSINE, seam_samples
from radiosity.solver.settings import Settings

Float = NDArray[np.floating[Any]]
Int = NDArray[np.integer[Any]]
WANTED = 1.2
# The neighbours to the left, right, below and above, of the eight.
SIDEWAYS = [1, 3, 4, 6]
# Two lumels on a seam count if their distance is within this factor of that of lumels in their charts. Texels of two
# charts meet in any way: most pairs are nearer than a texel.
AS_FAR = 2.0


@dataclass(frozen=True)
class Steps:
    """Mean differences, in the lightmap's unit; how many pairs across seams are alike, and how many there are."""

    seam: float
    inside: float
    shown: float
    usual: float
    all: float
    alike: int
    pairs: int

    @property
    def ratio(self) -> float:
        """Step across seams over step inside charts, of lumels that are alike."""
        return self.seam / self.inside

    @property
    def shown_ratio(self) -> float:
        """Step that seams show over the usual step inside charts."""
        return self.shown / self.usual


def baked(path: Path, settings: Settings) -> tuple[Lumels, Scene, list[Float], seams.Seams]:
    """Layout, scene, dilated images of a .blend before its seams are stitched, and what stitches them."""
    import bpy
    from radiosity.radiosity_addon.blend_file import open_blend
    from radiosity.radiosity_addon.export import export_scene
    from radiosity.radiosity_addon.layouts import with_shared_layouts

    module: Any = import_module("radiosity.solver.bake")  # the package's own `bake` is the function in it
    open_blend(path)
    exported = export_scene(bpy.context.scene, bpy.context.view_layer, settings, [])
    scene, settings = with_shared_layouts(exported.scene, exported.bindings, exported.settings, [])
    kept: list[tuple[Lumels, list[Float], seams.Seams]] = []
    stitched = module.finished

    def keep(lumels: Lumels, between: seams.Seams, values: Float, settings: Settings, _check: Any) -> list[Float]:
        images = to_images(lumels, values, settings)
        kept.append((lumels, images, between))
        return images

    module.finished = keep
    try:
        module.bake(scene, settings)
    finally:
        module.finished = stitched
    lumels, images, between = kept[0]
    return lumels, scene, images, between


def pairs_across(lumels: Lumels, taps: seams.Taps) -> Int:
    """(n, 2) lumels on the two sides of a seam: at each of its samples the nearest of each chart; every pair once."""
    row = np.full(len(taps.owner), -1, np.int64)
    row[seams.texel_of(lumels)] = np.arange(len(lumels))
    own = taps.owner[taps.texel] == taps.chart[:, :, None]
    nearest = np.argmax(np.where(own, taps.weight, -1), axis=2)[:, :, None]
    both = np.take_along_axis(own, nearest, axis=2).all(axis=(1, 2))
    pair = row[np.take_along_axis(taps.texel, nearest, axis=2)[both, :, 0]]
    return np.asarray(np.unique(np.sort(pair, axis=1), axis=0))


def steps(lumels: Lumels, images: list[Float], taps: seams.Taps, as_far: float) -> Steps:
    """Mean steps over seams and beside them, see the module."""
    flat = np.concatenate([image.reshape(-1, 3) for image in images]).astype(np.float64)
    shown = (flat[taps.texel] * taps.weight[:, :, :, None]).sum(axis=2)
    value, position, normal = flat[seams.texel_of(lumels)], lumels.receivers.position, lumels.receivers.normal
    near = LumelNeighbours(lumels)
    beside, own_chart = near.at(1)[:, SIDEWAYS], near.in_chart(1)[:, SIDEWAYS]
    lumel, side = np.nonzero(own_chart >= 0)
    usual = np.abs(value[lumel] - value[own_chart[lumel, side]]).mean()
    pair = pairs_across(lumels, taps)

    def apart(one: Int, other: Int) -> tuple[Float, Float, NDArray[np.bool_]]:
        return (np.abs(value[one] - value[other]).mean(axis=-1),
                np.linalg.norm(position[one] - position[other], axis=-1),
                (normal[one] * normal[other]).sum(axis=-1) > SMOOTH_COSINE)

    step, distance, alike = apart(*pair.T)
    around = beside[pair].reshape(len(pair), -1)
    own_step, own_distance, own_alike = apart(np.repeat(pair, len(SIDEWAYS), axis=1), around)
    counts = own_alike & (around >= 0)
    number = np.maximum(counts.sum(axis=1), 1)
    inside, apart_inside = ((each * counts).sum(axis=1) / number for each in (own_step, own_distance))
    some = alike & counts.any(axis=1) & (distance > apart_inside / as_far) & (distance < apart_inside * as_far)
    return Steps(float(step[some].mean()), float(inside[some].mean()), float(np.abs(shown[:, 0] - shown[:, 1]).mean()),
                 float(usual), float(step.mean()), int(some.sum()), len(pair))


def measure(path: Path, settings: Settings, as_far: float) -> bool:
    """Print a scene's row; whether its stitched seams hold."""
    lumels, scene, images, between = baked(path, settings)
    taps = seams.seam_taps(seam_samples(lumels, scene), lumels, scene)
    start = time.perf_counter()
    stitched = between.stitch(images)
    seconds = time.perf_counter() - start
    moved = sum(int((new != old).any(axis=2).sum()) for new, old in zip(stitched, images, strict=True))
    print(f"{path.stem}: {len(lumels)} lumels, {len(taps.texel)} samples of seams, {moved} texels moved in "
          f"{seconds:.2f} s")
    for name, shown in (("before", images), ("stitched", stitched)):
        found = steps(lumels, shown, taps, as_far)
        print(f"  {name:<10}seam {found.seam:.3g}  inside {found.inside:.3g}  seam / inside {found.ratio:.2f}  "
              f"({found.alike} pairs)  shown {found.shown:.3g}  usual {found.usual:.3g}  shown / usual "
              f"{found.shown_ratio:.2f}  all {found.all:.3g}  ({found.pairs} pairs)", flush=True)
    return max(found.ratio, found.shown_ratio) <= WANTED


def main(arguments: list[str] | None = None) -> int:
    """Measure the scenes; 1 if a seam shows."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", type=Path, nargs="+", metavar="SCENE.blend")
    parser.add_argument("--error", type=float, default=0.1)
    parser.add_argument("--resolution", type=int, default=512)
    parser.add_argument("--as-far", type=float, default=AS_FAR)
    given = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory() as folder:
        os.environ.setdefault("BLENDER_USER_RESOURCES", folder)
        from radiosity import radiosity_addon

        settings = Settings(error=given.error, resolution=given.resolution)
        radiosity_addon.register()
        try:
            held = [measure(path, settings, given.as_far) for path in given.scenes]
        finally:
            radiosity_addon.unregister()
    return 0 if all(held) else 1


if __name__ == "__main__":
    sys.exit(main())

"""Steps of the light across the seams of the layout, against steps between lumels inside charts.

    python -m benchmarks.seams SCENE.blend ... [--error .1] [--resolution 512]

Printed for each scene, before and after stitching, over the seams of smooth surfaces (across a crease, or from one
object to another that is not flush with it, light really has a step):

    seam    mean difference between the lumels next to the seam, one of each chart, at the same place of it
    shown   mean difference of the filtered light that the two charts show on the seam
    inside  mean difference of neighbouring lumels of one chart, one of them beside a seam
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
from radiosity.solver.neighbours import Neighbours
from radiosity.solver.receivers import Lumels
from radiosity.solver.scene import Scene
from radiosity.solver.seam_samples import seam_samples
from radiosity.solver.settings import Settings

Float = NDArray[np.floating[Any]]
WANTED = 1.2


@dataclass(frozen=True)
class Steps:
    """Mean differences, in the lightmap's unit, and the number of pairs of lumels across seams."""

    seam: float
    shown: float
    inside: float
    pairs: int

    @property
    def ratio(self) -> float:
        """Step across seams over step inside charts."""
        return self.seam / self.inside


def baked(path: Path, settings: Settings) -> tuple[Lumels, Scene, list[Float]]:
    """Layout, scene and dilated images of a .blend, before its seams are stitched."""
    import bpy
    from radiosity.radiosity_addon.blend_file import open_blend
    from radiosity.radiosity_addon.export import export_scene
    from radiosity.radiosity_addon.layouts import with_shared_layouts

    module: Any = import_module("radiosity.solver.bake")  # the package's own `bake` is the function in it
    open_blend(path)
    exported = export_scene(bpy.context.scene, bpy.context.view_layer, settings, [])
    scene, settings = with_shared_layouts(exported.scene, exported.bindings, exported.settings, [])
    kept: list[tuple[Lumels, list[Float]]] = []
    stitched = module.finished

    def keep(lumels: Lumels, _seams: Any, values: Float, settings: Settings) -> list[Float]:
        images = to_images(lumels, values, settings)
        kept.append((lumels, images))
        return images

    module.finished = keep
    try:
        module.bake(scene, settings)
    finally:
        module.finished = stitched
    return kept[0][0], scene, kept[0][1]


def steps(lumels: Lumels, scene: Scene, images: list[Float], taps: seams.Taps) -> Steps:
    """Mean steps over seams and beside them, see the module."""
    flat = np.concatenate([image.reshape(-1, 3) for image in images]).astype(np.float64)
    shown = (flat[taps.texel] * taps.weight[:, :, :, None]).sum(axis=2)
    # The lumel nearest to the seam on each side: the one that weighs most there.
    own = taps.owner[taps.texel] == taps.chart[:, :, None]
    nearest = np.argmax(np.where(own, taps.weight, -1), axis=2)[:, :, None]
    both = np.take_along_axis(own, nearest, axis=2).all(axis=(1, 2))
    pair = np.unique(np.take_along_axis(taps.texel, nearest, axis=2)[both, :, 0], axis=0)
    return Steps(float(np.abs(flat[pair[:, 0]] - flat[pair[:, 1]]).mean()),
                 float(np.abs(shown[:, 0] - shown[:, 1]).mean()), inside(lumels, flat, taps), len(pair))


def inside(lumels: Lumels, flat: Float, taps: seams.Taps) -> float:
    """Mean step between neighbouring lumels of one chart, one of them beside a seam."""
    sizes = np.array([page.width * page.height for page in lumels.pages], np.int64)
    place = np.concatenate([[0], np.cumsum(sizes)])[lumels.page] + lumels.pixel
    beside = np.zeros(len(flat), bool)
    beside[taps.texel] = True
    around = Neighbours(lumels).at(1)[:, [1, 3, 4, 6]]
    row, column = np.nonzero((around >= 0) & beside[place][:, None])
    return float(np.abs(flat[place[row]] - flat[place[around[row, column]]]).mean())


def measure(path: Path, settings: Settings) -> bool:
    """Print a scene's row; whether its stitched seams hold."""
    lumels, scene, images = baked(path, settings)
    taps = seams.seam_taps(seam_samples(lumels, scene), lumels, scene)
    start = time.perf_counter()
    stitched = seams.Seams(lumels, scene).stitch(images)
    seconds = time.perf_counter() - start
    moved = sum(int((new != old).any(axis=2).sum()) for new, old in zip(stitched, images, strict=True))
    print(f"{path.stem}: {len(lumels)} lumels, {len(taps.texel)} samples of seams, {moved} texels moved in "
          f"{seconds:.2f} s")
    for name, shown in (("before", images), ("stitched", stitched)):
        found = steps(lumels, scene, shown, taps)
        print(f"  {name:<10}seam {found.seam:.5g}  shown {found.shown:.5g}  inside {found.inside:.5g}  "
              f"seam / inside {found.ratio:.3f}  ({found.pairs} pairs)", flush=True)
    return found.ratio <= WANTED


def main(arguments: list[str] | None = None) -> int:
    """Measure the scenes; 1 if a seam shows."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", type=Path, nargs="+", metavar="SCENE.blend")
    parser.add_argument("--error", type=float, default=0.1)
    parser.add_argument("--resolution", type=int, default=512)
    given = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory() as folder:
        os.environ.setdefault("BLENDER_USER_RESOURCES", folder)
        from radiosity import radiosity_addon

        settings = Settings(error=given.error, resolution=given.resolution)
        radiosity_addon.register()
        try:
            held = [measure(path, settings) for path in given.scenes]
        finally:
            radiosity_addon.unregister()
    return 0 if all(held) else 1


if __name__ == "__main__":
    sys.exit(main())

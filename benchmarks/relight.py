"""A relight against fresh bakes of the changed scene: how long it takes, and how far it is from them.

    python -m benchmarks.relight classroom [--resolution 512] [--error .03]

The scene is baked once, with a group for each lamp and with what other reflectances need. Then every lamp and the world
get another strength, and in another copy every plain base colour another colour; each copy is relit, and baked anew
with three seeds. Compared are inner lumels, whose neighbours are all of their chart, and all; the one in a thousand
that is farthest off is left out, as against a renderer.

    same     relit against the fresh bake that has the same seed, and most of the noise in common
    relit    error of the relit image, as two independent fresh bakes say: mean((relit - one) (relit - other)), so
             that their own noise falls out
    fresh    error of the first fresh bake, by the same two
    kept     the kept light in its old strength against the image that was baked: what half floats lose

Mixing is timed too: eight layers of 1,024 x 1,024, in one thread.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from radiosity.solver import image_file
from radiosity.solver.mixing import Layer, mix

from .cycles.blender import open_blend
from .cycles.scenes import CASES, OUTPUT, case_named

Float = NDArray[np.floating[Any]]
Mask = NDArray[np.bool_]

SEEDS = (0, 1, 2)
# Strengths of lamps and world are multiplied by these, in turn; colours turn their channels round and get darker.
STRENGTHS = (0.4, 2.5, 1.6, 0.7)
DARKER = 0.8
# Part of the lumels that is left out, those that are farthest off.
LEFT_OUT = 1e-3
# Exit codes with results.
WRITTEN = {0, 4}


@dataclass(frozen=True)
class Done:
    """One run of the command: seconds as its report says, those of all threads of the whole process, and its images'
    pixels (n, 3).
    """

    seconds: float
    cpu_seconds: float
    pixels: Float


def run(command: str, blend: Path, folder: Path, *words: str) -> Done:
    """Bake or relight into a folder.

    Raises
    ------
    RuntimeError
        If the command fails, with what it said.
    """
    before = os.times()
    done = subprocess.run([sys.executable, "-m", "radiosity", command, str(blend), "--output", str(folder), *words],
                          capture_output=True, text=True, check=False)
    after = os.times()
    if done.returncode not in WRITTEN:
        raise RuntimeError(f"{command} of {blend} ended with code {done.returncode}: {done.stderr.strip()[-300:]}")
    cpu = after.children_user + after.children_system - before.children_user - before.children_system
    report = json.loads((folder / "report.json").read_text())
    images = sorted({output["image"] for output in report["outputs"]})
    pixels = np.concatenate([image_file.read_exr(folder / image).reshape(-1, 3) for image in images])
    return Done(float(report["seconds"]), cpu, pixels)


def other_strengths(bpy: Any) -> int:
    """Give every lamp and the world another strength; how many there were."""
    lamps = sorted({item.data.name for item in bpy.data.objects if item.type == "LIGHT"})
    for number, name in enumerate(lamps):
        bpy.data.lights[name].energy *= STRENGTHS[number % len(STRENGTHS)]
    world = bpy.context.scene.world
    nodes = world.node_tree.nodes if world is not None and world.node_tree is not None else ()
    for node in nodes:
        if node.bl_idname == "ShaderNodeBackground":
            node.inputs["Strength"].default_value *= STRENGTHS[len(lamps) % len(STRENGTHS)]
    return len(lamps) + 1


def other_colours(bpy: Any) -> int:
    """Give every plain base colour another; how many there were."""
    found = 0
    for material in bpy.data.materials:
        for node in material.node_tree.nodes if material.node_tree is not None else ():
            socket = node.inputs["Base Color"] if node.bl_idname == "ShaderNodeBsdfPrincipled" else None
            if socket is not None and not socket.is_linked:
                red, green, blue, alpha = socket.default_value
                socket.default_value = (green * DARKER, blue * DARKER, red * DARKER, alpha)
                found += 1
    return found


def changed(blend: Path, to: Path, change: Callable[[Any], int]) -> int:
    """A copy of the scene with something changed, saved at `to`; what `change` returns."""
    bpy = open_blend(blend)
    count = change(bpy)
    bpy.ops.wm.save_as_mainfile(filepath=str(to), copy=True)
    return count


def inner_pixels(blend: Path, folder: Path) -> tuple[Mask, Mask]:
    """Which pixels of all images are lumels, and which of these have all eight neighbours, (n,) each."""
    bpy = open_blend(blend)
    from radiosity import radiosity_addon
    from radiosity.radiosity_addon import cache
    from radiosity.radiosity_addon.export import export_surfaces
    from radiosity.solver.layout import Layout
    from radiosity.solver.lumels import lumels
    from radiosity.solver.neighbours import LumelNeighbours
    from radiosity.solver.receivers import Page

    radiosity_addon.register()
    try:
        kept = cache.read(cache.find(folder, bpy.context.scene.name))
        scene = export_surfaces(bpy.context.scene, bpy.context.view_layer, kept.settings)
    finally:
        radiosity_addon.unregister()
    shapes = [layer.bits.shape for layer in next(iter(kept.bake.groups.layers.values()))]
    pages = tuple(Page(page.name, shape[1], shape[0])
                  for page, shape in zip(kept.bake.lightmaps, shapes, strict=True))
    found = lumels(scene, kept.settings, [], layout=Layout(pages, kept.bake.page_of_surface, kept.bake.uv))
    order = np.argsort([page.name for page in pages])
    sizes = np.array([page.width * page.height for page in pages])
    first = np.zeros(len(pages), np.int64)
    first[order] = np.cumsum(sizes[order]) - sizes[order]
    place = first[found.page] + found.pixel
    covered, inner = np.zeros(sizes.sum(), bool), np.zeros(sizes.sum(), bool)
    covered[place] = True
    inner[place] = (LumelNeighbours(found).at(1) >= 0).all(axis=1)
    return covered, inner


def rms(square: Float, level: float) -> float:
    """Root of the mean of (n,) squares or products of deviations, the farthest left out, over the mean light."""
    kept = square[np.argsort(np.abs(square))[:int(np.ceil(len(square) * (1 - LEFT_OUT)))]]
    mean = float(kept.mean())
    return float(np.sign(mean) * np.sqrt(abs(mean))) / level


def print_row(name: str, relit: Float, fresh: list[Float], mask: Mask) -> None:
    """How far a relit image is from fresh ones, over some of the lumels."""
    relit, first, second, third = (image[mask].astype(np.float64) for image in (relit, *fresh))
    level = first.mean()
    same = rms(np.square(relit - first).mean(axis=1), level)
    ours = rms(((relit - second) * (relit - third)).mean(axis=1), level)
    theirs = rms(((first - second) * (first - third)).mean(axis=1), level)
    print(f"  {name:<7}{mask.sum():7d} lumels   mean {relit.mean() / level - 1:+.3%}   same {same:.3%}   "
          f"relit {ours:.3%}   fresh {theirs:.3%}", flush=True)


def print_mixing() -> None:
    """The time of eight layers of 1,024 x 1,024."""
    random = np.random.default_rng(0)
    layers = [Layer.of(random.random((1024, 1024, 3), np.float32)) for _ in range(8)]
    factors = random.random((8, 3))
    wall, own = [], []
    for _ in range(9):
        start, begun = time.perf_counter(), time.thread_time()
        mix(layers, factors)
        wall.append(time.perf_counter() - start)
        own.append(time.thread_time() - begun)
    print(f"mixing 8 layers of 1,024 x 1,024: {min(own) * 1e3:.0f} ms of one thread, {np.median(wall) * 1e3:.0f} ms by "
          "the clock")


def main(arguments: list[str] | None = None) -> int:
    """Bake, change, relight, bake anew, compare."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene", choices=sorted(CASES))
    parser.add_argument("--resolution", type=int, default=512)
    parser.add_argument("--error", type=float, default=0.03)
    given = parser.parse_args(arguments)
    case = case_named(given.scene)
    folder = OUTPUT / "relight" / given.scene
    folder.mkdir(parents=True, exist_ok=True)
    words = ("--resolution", str(given.resolution), "--error", f"{given.error:g}")
    print_mixing()
    baked = run("bake", case.blend, folder / "kept", *words, "--groups", "lamp", "--reflectances")
    kept = run("relight", case.blend, folder / "kept")
    covered, inner = inner_pixels(case.blend, folder / "kept")
    lost = rms(np.square(kept.pixels - baked.pixels)[covered].mean(axis=1), float(baked.pixels[covered].mean()))
    print(f"{given.scene}: baked in {baked.seconds:.1f} s ({baked.cpu_seconds:.1f} s of all threads), kept {lost:.3%}")
    for name, change in (("lamps", other_strengths), ("colours", other_colours)):
        blend = folder / f"{name}.blend"
        count = changed(case.blend, blend, change)
        relit = run("relight", blend, folder / "kept")
        print(f"{count} {name} changed: relit in {relit.seconds:.2f} s, {relit.seconds / baked.seconds:.1%} of the "
              f"bake ({relit.cpu_seconds:.1f} s of all threads, Blender's start included)", flush=True)
        fresh = [run("bake", blend, folder / f"fresh_{seed}", *words, "--seed", str(seed)).pixels for seed in SEEDS]
        print_row("inner", relit.pixels, fresh, inner)
        print_row("all", relit.pixels, fresh, covered)
    return 0


if __name__ == "__main__":
    sys.exit(main())

"""LuxCore's BAKECPU engine on the layouts of a twin; runs in the peers' environment.

    luxcore_bake.py REQUEST.json ANSWER.json

Each receiver is a map of type LIGHTMAP (which is E / pi) with its own UV layout; first row on top. The engine spreads
its samples over a map's surface and splats them by the pixel filter; with none, a texel is the mean over all of it, not
over the central half as in Cycles: where light changes within a texel the two differ for that reason alone. Emissive
faces get a second face a hair behind them, as for Mitsuba.
"""

from __future__ import annotations

import json
import os
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.floating[Any]]

# How far the two faces of an emitter are moved apart, metres.
APART = 1e-4
# Seconds between two looks at a bake that runs.
LOOK = 0.05


def define_mesh(scene: Any, name: str, corners: Float, uv: Float | None) -> None:
    """Triangles (t, 3, 3) as a mesh of their own corners; uv (t, 3, 2) or None."""
    points = [tuple(map(float, point)) for point in corners.reshape(-1, 3)]
    faces = [(3 * index, 3 * index + 1, 3 * index + 2) for index in range(len(corners))]
    layout = None if uv is None else [tuple(map(float, point)) for point in uv.reshape(-1, 2)]
    scene.DefineMesh(name, points, faces, None, layout, None, None)


def load_scene(program: Any, arrays: Any) -> Any:
    """The twin as a scene of LuxCore; receivers are the objects `receiver_PAGE`."""
    scene = program.Scene()
    words = program.Properties()
    words.SetFromString("scene.camera.lookat.orig = 0 0 0\nscene.camera.lookat.target = 0 1 0\n")
    scene.Parse(words)
    uv, pages = arrays["layout"], arrays["page_of_surface"]
    colours, colour = np.unique(np.concatenate([arrays["reflectance"], arrays["radiance"]], axis=1), axis=0,
                                return_inverse=True)
    keys, part = np.unique(np.stack([arrays["surface"], colour.ravel()], axis=1), axis=0, return_inverse=True)
    lines: list[str] = []
    for index, (surface, kind) in enumerate(keys):
        mine = part.ravel() == index
        corners, page = arrays["corners"][mine], int(pages[surface])
        name = f"receiver_{page}_{index}" if page >= 0 else f"part_{index}"
        sides = [(name, corners)]
        if colours[kind, 3:].any():
            normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
            shift = APART / 2 * (normal / np.linalg.norm(normal, axis=1, keepdims=True))[:, None]
            sides = [(name, corners + shift), (f"{name}_back", (corners - shift)[:, ::-1])]
        lines += material(f"colour_{kind}", colours[kind, :3], colours[kind, 3:])
        for title, points in sides:
            define_mesh(scene, f"mesh_{title}", points, uv[mine] if page >= 0 else None)
            lines += [f"scene.objects.{title}.ply = mesh_{title}", f"scene.objects.{title}.material = colour_{kind}"]
    for index, radiance in enumerate(np.unique(arrays["lamp_radiance"], axis=0)):
        mine = (arrays["lamp_radiance"] == radiance).all(axis=1)
        define_mesh(scene, f"mesh_lamp_{index}", arrays["lamp_corners"][mine], None)
        lines += material(f"lamp_{index}", np.zeros(3), radiance)
        lines += [f"scene.objects.lamp_{index}.ply = mesh_lamp_{index}",
                  f"scene.objects.lamp_{index}.material = lamp_{index}"]
    if arrays["sky"].any():
        lines += ["scene.lights.sky.type = constantinfinite", f"scene.lights.sky.color = {triple(arrays['sky'])}"]
    described = program.Properties()
    described.SetFromString("\n".join(lines) + "\n")
    scene.Parse(described)
    return scene


def material(name: str, reflectance: Float, radiance: Float) -> list[str]:
    """A matte material, with emission if it has any: `radiance` of the side that its corners turn left on."""
    lines = [f"scene.materials.{name}.type = matte", f"scene.materials.{name}.kd = {triple(reflectance)}"]
    if radiance.any():
        lines += [f"scene.materials.{name}.emission = {triple(radiance)}"]
    return lines


def triple(value: Float) -> str:
    """Three numbers as the program reads them."""
    return " ".join(f"{float(x):.9g}" for x in value)


def configuration(arrays: Any, samples: int, request: dict[str, Any], objects: dict[int, list[str]]) -> str:
    """The engine's settings: path tracing as deep as Cycles', no clamping, no filter, no tone mapping."""
    lines = [
        "renderengine.type = BAKECPU",
        "sampler.type = SOBOL",
        f"renderengine.seed = {request['seed'] % 1000 + 1}",
        f"path.pathdepth.total = {request['bounces']}",
        f"path.pathdepth.diffuse = {request['bounces']}",
        "path.clamping.variance.maxvalue = 0",
        "film.filter.type = NONE",
        "film.imagepipelines.0.0.type = NOP",
        "batch.haltthreshold = 0",
        f"batch.haltspp = {samples} 0",
        "bake.skipexistingmapfiles = 0",
        "bake.margin = 0",
    ]
    for page, names in objects.items():
        side = request["squares"][str(arrays["page_names"][page])]
        lines += [
            f"bake.maps.{page}.type = LIGHTMAP",
            f"bake.maps.{page}.filename = luxcore_{samples}_{page}.exr",
            f"bake.maps.{page}.imagepipelineindex = 0",
            f"bake.maps.{page}.width = {side}",
            f"bake.maps.{page}.height = {side}",
            f"bake.maps.{page}.uvindex = 0",
            f"bake.maps.{page}.objectnames = {' '.join(names)}",
        ]
    return "\n".join(lines) + "\n"


def bake(program: Any, scene: Any, words: str) -> None:
    """Run the engine until it is done; the maps are in the current folder."""
    properties = program.Properties()
    properties.SetFromString(words)
    session = program.RenderSession(program.RenderConfig(properties, scene))
    session.Start()
    while not session.HasDone():
        time.sleep(LOOK)
        session.UpdateStats()
    session.Stop()


def clocks() -> Float:
    """Wall clock and CPU seconds, of all threads."""
    return np.array([time.perf_counter(), time.process_time()])


def main() -> None:
    """Read the request, bake once for each number of samples, write the answer."""
    request = json.loads(Path(sys.argv[1]).read_text())
    answer = Path(sys.argv[2]).absolute()
    import pyluxcore as program

    program.Init()
    with np.load(request["arrays"]) as archive:
        arrays = {name: archive[name] for name in archive.files}
    os.chdir(answer.parent)
    sides = [request["squares"][str(name)] for name in arrays["page_names"]]
    # The squares alone are baked: the same lumels at the same size.
    page_of_triangle = arrays["page_of_surface"][arrays["surface"]]
    scale = np.array([request["resolution"] / side for side in sides] + [1.0])
    arrays["layout"] = arrays["layout"] * scale[page_of_triangle][:, None, None].astype(np.float32)
    begin = clocks()
    scene = load_scene(program, arrays)
    loaded = clocks() - begin
    objects: dict[int, list[str]] = {}
    for index, (surface, _) in enumerate(object_keys(arrays)):
        page = int(arrays["page_of_surface"][surface])
        if page >= 0:
            objects.setdefault(page, []).append(f"receiver_{page}_{index}")
    rows = []
    for samples in request["samples"]:
        begin = clocks()
        bake(program, scene, configuration(arrays, samples, request, objects))
        wall, cpu = loaded + clocks() - begin
        rows.append({"samples": samples, "seconds": wall, "cpu_seconds": cpu,
                     "images": [str(answer.parent / f"luxcore_{samples}_{page}.exr") for page in sorted(objects)]})
    answer.write_text(json.dumps({"rows": rows}))


def object_keys(arrays: Any) -> NDArray[np.int64]:
    """(parts, 2): object and colour of the parts that the scene is cut into, in their order."""
    colours = np.concatenate([arrays["reflectance"], arrays["radiance"]], axis=1)
    colour = np.unique(colours, axis=0, return_inverse=True)[1].ravel()
    return np.asarray(np.unique(np.stack([arrays["surface"], colour], axis=1), axis=0))


if __name__ == "__main__":
    main()

"""Mitsuba 3 on the lumels of a twin; runs in the peers' environment.

    mitsuba_bake.py REQUEST.json ANSWER.json

A wavefront of our own: at every lumel a cosine-distributed ray is handed to Mitsuba's `path` integrator, and one light
sample is taken; multiple importance sampling weighs the two where both may find a lamp (Veach and Guibas 1995). So a
lumel gets what the integrator would give a white surface there: E / pi. The integrator keeps its own Russian roulette
(from the fifth bounce) and goes as deep as Cycles' bake. Sample positions are those of Cycles: the central half of the
texel, inside the centre's triangle.

Mitsuba's lamps shine from one side, Blender's emissive faces from both: each gets a second face a hair behind it.
"""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.floating[Any]]

# Rays in flight at once.
WAVEFRONT = 1 << 19
# How far the two faces of an emitter are moved apart, metres.
APART = 1e-4
# Tries for a place inside the centre's triangle, as in Cycles.
TRIES = 10


class Places:
    """Random places in the lumels' footprints."""

    def __init__(self, arrays: Any, footprint: float, seed: int) -> None:
        self.corner = arrays["corners"][arrays["lumel_triangle"]]
        self.weight, self.step = arrays["lumel_weight"], arrays["lumel_step"]
        self.footprint, self.random = footprint, np.random.default_rng(seed)

    def __call__(self, lumel: NDArray[np.int64]) -> Float:
        """(m, 3) float32: one place in each of the lumels listed."""
        weight = self.weight[lumel].copy()
        outside = np.arange(len(lumel))
        for _ in range(TRIES):
            offset = (self.random.random((len(outside), 2), np.float32) - np.float32(0.5)) * np.float32(self.footprint)
            tried = self.weight[lumel[outside]] + np.einsum("ni,nij->nj", offset, self.step[lumel[outside]])
            inside = (tried >= 0).all(axis=1) & (tried.sum(axis=1) <= 1)
            weight[outside[inside]] = tried[inside]
            outside = outside[~inside]
        corner = self.corner[lumel]
        u, v = weight[:, :1], weight[:, 1:]
        return np.asarray(corner[:, 0] * (1 - u - v) + corner[:, 1] * u + corner[:, 2] * v, np.float32)


def write_ply(path: Path, corners: Float) -> None:
    """Triangles (t, 3, 3) as a binary PLY."""
    header = (f"ply\nformat binary_little_endian 1.0\nelement vertex {3 * len(corners)}\n"
              "property float x\nproperty float y\nproperty float z\n"
              f"element face {len(corners)}\nproperty list uchar int vertex_indices\nend_header\n")
    faces = np.empty(len(corners), np.dtype([("count", "u1"), ("corner", "<i4", 3)]))
    faces["count"], faces["corner"] = 3, np.arange(3 * len(corners)).reshape(-1, 3)
    path.write_bytes(header.encode() + corners.astype("<f4").tobytes() + faces.tobytes())


def parts(arrays: Any) -> list[tuple[Float, Float, Float]]:
    """(corners, reflectance, radiance): the scene cut by colour; emitters' two faces and the lamps are parts, too."""
    colours, part = np.unique(np.concatenate([arrays["reflectance"], arrays["radiance"]], axis=1), axis=0,
                              return_inverse=True)
    found = []
    for index, colour in enumerate(colours):
        corners = arrays["corners"][part.ravel() == index]
        if not colour[3:].any():
            found.append((corners, colour[:3], colour[3:]))
            continue
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        shift = APART / 2 * (normal / np.linalg.norm(normal, axis=1, keepdims=True))[:, None]
        found += [(corners + shift, colour[:3], colour[3:]), ((corners - shift)[:, ::-1], colour[:3], colour[3:])]
    for colour in np.unique(arrays["lamp_radiance"], axis=0):
        found.append((arrays["lamp_corners"][(arrays["lamp_radiance"] == colour).all(axis=1)], np.zeros(3), colour))
    return found


def load_scene(mi: Any, arrays: Any, folder: Path) -> Any:
    """The twin as a scene of Mitsuba."""
    described: dict[str, Any] = {"type": "scene"}
    rgb = lambda value: {"type": "rgb", "value": [float(x) for x in value]}  # noqa: E731
    for index, (corners, reflectance, radiance) in enumerate(parts(arrays)):
        path = folder / f"part_{index}.ply"
        write_ply(path, corners)
        bsdf = {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": rgb(reflectance)}}
        shape: dict[str, Any] = {"type": "ply", "filename": str(path), "face_normals": True, "bsdf": bsdf}
        if radiance.any():
            shape["emitter"] = {"type": "area", "radiance": rgb(radiance)}
        described[f"part_{index}"] = shape
    if arrays["sky"].any():
        described["sky"] = {"type": "constant", "radiance": rgb(arrays["sky"])}
    return mi.load_dict(described)


def _share(dr: Any, chance: Any, other: Any) -> Any:
    """The balance heuristic: one way's density over that of both; 0 where it has none."""
    return dr.select(chance > 0, chance / (chance + other), 0)


def wave(mi: Any, dr: Any, scene: Any, integrator: Any, places: Float, normals: Float, seed: int) -> Float:
    """(m, 3) one estimate of E / pi at each place."""
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(seed, len(places))
    at = dr.zeros(mi.SurfaceInteraction3f, len(places))
    at.p, at.n = mi.Point3f(np.ascontiguousarray(places.T)), mi.Normal3f(np.ascontiguousarray(normals.T))
    at.sh_frame = mi.Frame3f(at.n)
    lamp, weight = scene.sample_emitter_direction(at, sampler.next_2d(), True)
    cosine = dr.maximum(dr.dot(at.n, lamp.d), 0)
    other = dr.select(lamp.delta, 0, cosine / dr.pi)
    direct = weight * cosine / dr.pi * _share(dr, lamp.pdf, other)
    local = mi.warp.square_to_cosine_hemisphere(sampler.next_2d())
    ray = at.spawn_ray(at.to_world(local))
    hit = scene.ray_intersect(ray)
    emitter = hit.emitter(scene)
    seen = emitter.eval(hit)
    there = mi.DirectionSample3f(scene, hit, at)
    chance = scene.pdf_emitter_direction(at, there, seen.x + seen.y + seen.z > 0)
    own = local.z / dr.pi
    # The integrator counts a lamp that the ray meets in full: take out what the light sample stands for.
    indirect = integrator.sample(scene, sampler, mi.RayDifferential3f(ray))[0]
    indirect -= seen * _share(dr, chance, own)
    return np.array(direct + indirect).T.reshape(-1, 3)


def bake(mi: Any, dr: Any, scene: Any, arrays: Any, samples: int, request: dict[str, Any]) -> Float:
    """(n, 3) E / pi of the lumels, the mean of `samples` estimates each."""
    count = len(arrays["lumel_triangle"])
    places = Places(arrays, request["footprint"], request["seed"])
    integrator = mi.load_dict({"type": "path", "max_depth": request["bounces"]})
    total = np.zeros((count, 3))
    at_once = max(1, WAVEFRONT // count)
    for first in range(0, samples, at_once):
        lumel = np.tile(np.arange(count), min(at_once, samples - first))
        seed = request["seed"] + 1000 + first
        values = wave(mi, dr, scene, integrator, places(lumel), arrays["lumel_normal"][lumel], seed)
        total += values.reshape(-1, count, 3).sum(axis=0)
    return np.asarray(total / samples, np.float32)


def clocks() -> Float:
    """Wall clock and CPU seconds, of all threads."""
    return np.array([time.perf_counter(), time.process_time()])


def main() -> None:
    """Read the request, bake once for each number of samples, write the answer."""
    request = json.loads(Path(sys.argv[1]).read_text())
    import drjit as dr
    import mitsuba as mi

    mi.set_variant("llvm_ad_rgb")
    folder = Path(sys.argv[2]).parent
    with np.load(request["arrays"]) as archive:
        arrays = {name: archive[name] for name in archive.files}
    begin = clocks()
    scene = load_scene(mi, arrays, folder)
    loaded = clocks() - begin
    # The kernel compiles at first use: not timed.
    bake(mi, dr, scene, arrays, 1, request)
    rows = []
    for samples in request["samples"]:
        begin = clocks()
        values = bake(mi, dr, scene, arrays, samples, request)
        wall, cpu = loaded + clocks() - begin
        path = folder / f"mitsuba_{samples}.npy"
        np.save(path, values)
        rows.append({"samples": samples, "seconds": wall, "cpu_seconds": cpu, "values": str(path)})
    Path(sys.argv[2]).write_text(json.dumps({"rows": rows}))


if __name__ == "__main__":
    main()

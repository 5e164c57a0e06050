"""Runs in a Blender of its own: builds the diffuse twin from files, and has Cycles bake and render it.

Started by `compare_process.py` with a job in JSON: folder (of the files of `compare_twin.py`; results go there too),
stage, pages ([width, height] each), passes, samples or seconds, seed, threads, and what to do: "bake" or "camera".
"""

from __future__ import annotations

import contextlib
import json
import os
import threading
import time
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from . import cycles
from .compare_linking import TwinLinks
from .compare_materials import LUMELS, REFLECTANCE, TEXTURE, TwinMaterials
from .compare_twin import GEOMETRY, LAMPS

Float = NDArray[np.floating[Any]]

REFERENCES, STATUS = "references.npz", "status.json"
CYCLES_VIEW, BAKED_VIEW = "cycles.npy", "baked.npy"
LIGHTMAPS = "ours.npz"
# A first bake warms up; the second, of so many samples, tells how long a sample takes.
PILOT_SAMPLES = 8
# Sample 0 of a lumel is its centre in every bake: fewer samples than this lean to it.
LEAST_SAMPLES, MOST_SAMPLES = 4, 1 << 20
# The camera's picture: its longer side in pixels, and samples of a pixel.
VIEW_SIDE, VIEW_SAMPLES, EEVEE_SAMPLES = 480, 64, 16


def main(path: str) -> None:
    """Do the job of a file, and end as soon as the program that asked for it has ended."""
    threading.Thread(target=_end_with_parent, daemon=True).start()
    job = json.loads(Path(path).read_text(encoding="utf-8"))
    folder = Path(job["folder"])
    twin = Twin(job, folder)
    if job["do"] == "bake":
        _bake(twin, job, folder)
        if job["camera"]:
            _tell(folder, "camera view", 0.0)
            twin.aim(job)
            np.save(folder / CYCLES_VIEW, cycles.render_still(twin.scene, folder / "cycles.exr", VIEW_SAMPLES))
    else:
        _tell(folder, "camera view", 0.0)
        twin.show_baked(folder / LIGHTMAPS)
        twin.aim(job)
        np.save(folder / BAKED_VIEW, cycles.render_eevee(twin.scene, folder / "baked.exr", EEVEE_SAMPLES))


def _end_with_parent() -> None:
    # Not by sys.stdin, whose lock a thread may not hold when Python ends.
    while os.read(0, 1):
        pass
    os._exit(1)


def _bake(twin: Twin, job: dict[str, Any], folder: Path) -> None:
    """Two bakes with different seeds, each half the budget; and the pilots that tell how much that is."""
    started = time.perf_counter()
    _tell(folder, "pilot", 0.0)
    twin.bake(1, job["seed"] + 2, job["passes"])
    overhead = twin.bake(1, job["seed"] + 2, job["passes"])
    pilot = twin.bake(PILOT_SAMPLES, job["seed"] + 3, job["passes"])
    per_sample = max((pilot - overhead) / (PILOT_SAMPLES - 1), pilot / PILOT_SAMPLES / 10)
    if job["samples"] is not None:
        samples = job["samples"] // 2
    else:
        left = job["seconds"] - (time.perf_counter() - started)
        samples = int((left / 2 - max(overhead - per_sample, 0)) / per_sample)
    samples = min(max(samples, LEAST_SAMPLES), MOST_SAMPLES)
    results: dict[str, NDArray[Any]] = {}
    seconds = []
    for half in range(2):
        _tell(folder, f"bake {half + 1} of 2", overhead + per_sample * samples)
        seconds.append(twin.bake(samples, job["seed"] + half, job["passes"]))
        results |= {f"{half}/{page}": pixels for page, pixels in enumerate(twin.pixels())}
    about = {"samples": samples, "seconds": seconds, "pilot_samples": [1, PILOT_SAMPLES],
             "pilot_seconds": [overhead, pilot], "bounces": cycles.BOUNCES}
    np.savez(folder / REFERENCES, about=json.dumps(about), **results)


def _tell(folder: Path, stage: str, expected: float) -> None:
    """Let the program that waits know what is done now, and for how many seconds."""
    beside = folder / f"{STATUS}.part"
    beside.write_text(json.dumps({"stage": stage, "expected": expected}), encoding="utf-8")
    with contextlib.suppress(PermissionError):  # Windows, while the other program reads it
        os.replace(beside, folder / STATUS)


class Twin:
    """The scene in this Blender: one mesh that is baked and one that is not for each group, lamps, world."""

    def __init__(self, job: dict[str, Any], folder: Path) -> None:
        self.scene = bpy.context.scene
        _empty(self.scene)
        lamps = _place_stage(self.scene, job["stage"], folder / LAMPS)
        with np.load(folder / GEOMETRY) as archive:
            arrays = {name: archive[name] for name in archive.files}
        baked, groups = arrays["page"] >= 0, arrays["group"].astype(int)
        self.pages = len(job["pages"])
        self.images = {(group, page): bpy.data.images.new(f"page {page} of group {group}", *job["pages"][page],
                                                          alpha=True, float_buffer=True, is_data=True)
                       for group, page in np.unique(np.stack([groups, arrays["page"]], 1)[baked], axis=0).tolist()}
        self._materials = TwinMaterials(arrays, self.images)
        self.receivers = []
        meshes = []
        for group in np.unique(groups).tolist():
            for receives in (True, False):
                rows = np.flatnonzero((groups == group) & (baked == receives))
                if len(rows):
                    made = self._mesh(f"{'receivers' if receives else 'others'} {group}", arrays, rows)
                    made.visible_shadow, made.visible_diffuse = bool(group & 1), bool(group & 2)
                    self.receivers += [made] * receives
                    meshes.append((made, group >> 2))
        links = TwinLinks([(made, int(arrays["kind_surface"][kind])) for made, kind in meshes])
        for made, kind in meshes:
            links.link(made, arrays["kind_links"][kind])
        for lamp, placed in zip(lamps, job["stage"]["lights"], strict=True):
            if placed["links"]:
                links.link(lamp, np.array(placed["links"]))
        # What was taken out and put in shows in the view layer only from here on.
        bpy.context.view_layer.update()
        cycles.set_up_bake(self.scene)
        if job["threads"]:
            self.scene.render.threads_mode, self.scene.render.threads = "FIXED", job["threads"]

    def bake(self, samples: int, seed: int, passes: str) -> float:
        """Bake all pages; the seconds that it took."""
        self.scene.cycles.samples, self.scene.cycles.seed = samples, seed
        started = time.perf_counter()
        for item in self.receivers:
            cycles.bake_diffuse(item, passes)
        return time.perf_counter() - started

    def pixels(self) -> list[Float]:
        """What was baked last: (height, width, 4) float32 a page, row 0 at the bottom, alpha 1 where Cycles baked."""
        found: list[Any] = [0.0] * self.pages
        for (_, page), image in self.images.items():
            values = np.empty(len(image.pixels), np.float32)
            image.pixels.foreach_get(values)
            # Of several groups on a page each has lumels of its own, and nothing elsewhere.
            found[page] = found[page] + values.reshape(image.size[1], image.size[0], 4)
        return found

    def aim(self, job: dict[str, Any]) -> None:
        """Put the user's camera into the scene, and let it look through holes."""
        self._materials.show_holes()
        placed = job["stage"]["camera"]
        camera = bpy.data.objects.new("camera", bpy.data.cameras[placed["data"]])
        camera.data.dof.use_dof = False
        self.scene.collection.objects.link(camera)
        camera.matrix_world = _matrix(placed["matrix"])
        self.scene.camera = camera
        width, height = job["stage"]["size"]
        scale = VIEW_SIDE / max(width, height)
        render = self.scene.render
        render.resolution_x, render.resolution_y = max(round(width * scale), 1), max(round(height * scale), 1)
        render.resolution_percentage = 100

    def show_baked(self, path: Path) -> None:
        """Let every surface shine by itself with the light that was baked on it, and by nothing else."""
        with np.load(path) as archive:
            for (_, page), image in self.images.items():
                pixels = archive[str(page)]
                rgba = np.ones((*pixels.shape[:2], 4), np.float32)
                rgba[..., :3] = pixels
                image.pixels.foreach_set(rgba.ravel())
                image.update()
        self._materials.show_baked()
        for item in list(self.scene.objects):
            if item.type == "LIGHT":
                bpy.data.objects.remove(item)

    def _mesh(self, name: str, arrays: dict[str, NDArray[Any]], rows: NDArray[np.int64]) -> Any:
        """An object of some of the triangles."""
        normals = arrays["normals"][rows] if len(arrays["normals"]) else np.zeros((len(rows), 3, 3), np.float32)
        vertices, corners = _split(arrays["vertices"], arrays["triangles"][rows], normals)
        mesh = bpy.data.meshes.new(name)
        mesh.vertices.add(len(vertices))
        mesh.vertices.foreach_set("co", vertices.ravel())
        mesh.loops.add(3 * len(rows))
        mesh.loops.foreach_set("vertex_index", corners.ravel())
        mesh.polygons.add(len(rows))
        mesh.polygons.foreach_set("loop_start", np.arange(0, 3 * len(rows), 3, dtype=np.int32))
        slots, slot = np.unique(arrays["material"][rows], return_inverse=True)
        for index in slots:
            mesh.materials.append(self._materials[int(index)])
        mesh.polygons.foreach_set("material_index", slot.astype(np.int32))
        bent = normals.any(axis=(1, 2))
        mesh.polygons.foreach_set("use_smooth", bent)
        mesh.update(calc_edges=True)
        for layer, key in ((LUMELS, "layout"), (TEXTURE, "uv")):
            made = mesh.uv_layers.new(name=layer, do_init=False)
            made.uv.foreach_set("vector", arrays[key][rows].ravel())
        mesh.uv_layers.active = mesh.uv_layers[LUMELS]
        colours = np.ones((len(rows), 3, 4), np.float32)
        colours[..., :3] = arrays["reflectance"][rows][:, None]
        attribute = mesh.color_attributes.new(REFLECTANCE, "FLOAT_COLOR", "CORNER")
        attribute.data.foreach_set("color", colours.ravel())
        if bent.any():
            mesh.normals_split_custom_set(normals.reshape(-1, 3).tolist())
        mesh.update()
        made = bpy.data.objects.new(name, mesh)
        made.location = arrays["origin"]
        # Both of Cycles' cures for shadows on coarse smooth meshes move rays off the surface: no transport, so off.
        # Before Blender 5 they were Cycles' own settings.
        holder = made if hasattr(made, "shadow_terminator_geometry_offset") else made.cycles
        holder.shadow_terminator_geometry_offset = 0.0
        if hasattr(holder, "shadow_terminator_normal_offset"):
            holder.shadow_terminator_normal_offset = 0.0
        self.scene.collection.objects.link(made)
        return made


def _split(vertices: Float, triangles: NDArray[np.int32], normals: Float) -> tuple[Float, NDArray[np.int32]]:
    """Vertices that only corners with the same shading normal share, and the corners' indices, (t, 3)."""
    grid = np.rint(normals.reshape(-1, 3).astype(np.float64) / 1e-4).astype(np.int64)
    key = np.column_stack([triangles.reshape(-1), grid])
    first, corner = np.unique(key, axis=0, return_index=True, return_inverse=True)[1:]
    used = triangles.reshape(-1)[first]
    return np.ascontiguousarray(vertices[used]), corner.reshape(-1, 3).astype(np.int32)


def _empty(scene: Any) -> None:
    """Take everything out of Blender's start-up scene."""
    for item in list(bpy.data.objects):
        bpy.data.objects.remove(item)
    scene.world = None


def _place_stage(scene: Any, stage: dict[str, Any], path: Path) -> list[Any]:
    """The user's lamps and world, still: as they are in the frame that is baked. Returns the lamps."""
    wanted = {placed["data"] for placed in stage["lights"]}
    with bpy.data.libraries.load(str(path), link=False) as (_, into):
        into.lights = sorted(wanted)
        into.worlds = [stage["world"]] if stage["world"] else []
        into.cameras = [stage["camera"]["data"]] if stage["camera"] else []
    lights = dict(zip(sorted(wanted), into.lights, strict=True))
    for data in (*into.lights, *into.worlds, *into.cameras):
        data.animation_data_clear()
        if getattr(data, "node_tree", None) is not None:
            data.node_tree.animation_data_clear()
    lamps = []
    for placed in stage["lights"]:
        lamp = bpy.data.objects.new(placed["data"], lights[placed["data"]])
        scene.collection.objects.link(lamp)
        lamp.matrix_world = _matrix(placed["matrix"])
        lamps.append(lamp)
    if into.worlds:
        scene.world = into.worlds[0]
        _without_volume(scene.world)
    return lamps


def _without_volume(world: Any) -> None:
    """No fog: radiosity knows light between surfaces alone."""
    for node in world.node_tree.nodes if world.node_tree is not None else ():
        if node.bl_idname == "ShaderNodeOutputWorld":
            for link in list(node.inputs["Volume"].links):
                world.node_tree.links.remove(link)


def _matrix(rows: list[list[float]]) -> Any:
    from mathutils import Matrix

    return Matrix(rows)

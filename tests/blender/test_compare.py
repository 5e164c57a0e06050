"""Comparing with Cycles: what it says is true, it says all of it, and the user's file stays as it is."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from numpy.typing import NDArray
from radiosity.solver import estimator, image_file
from radiosity.tests.blender.conftest import UNIT_SQUARE

Float = NDArray[np.floating[Any]]

# A closed room, metres, with a panel that hangs in it and shines both ways, and a block on its floor that stands on
# whole lumels.
SIDE = 2.0
PANEL = ((0.5, 0.5, 1.4), (1.5, 1.5, 1.4))
BLOCK = ((5 / 12, 1.0, 0.0), (10 / 12, 1.5, 1.0))
RADIANCE = 5.0
WHITE, RED, GREEN = (0.7, 0.7, 0.7), (0.6, 0.1, 0.1), (0.1, 0.5, 0.1)
# Each wall: the corner at (u, v) = (0, 0), its two sides, and its colour; the normal, u x v, points into the room.
WALLS = {
    "Floor": ((0, 0, 0), (SIDE, 0, 0), (0, SIDE, 0), WHITE),
    "Ceiling": ((0, SIDE, SIDE), (SIDE, 0, 0), (0, -SIDE, 0), WHITE),
    "Front": ((0, 0, SIDE), (SIDE, 0, 0), (0, 0, -SIDE), WHITE),
    "Back": ((0, SIDE, 0), (SIDE, 0, 0), (0, 0, SIDE), WHITE),
    "Left": ((0, 0, 0), (0, SIDE, 0), (0, 0, SIDE), RED),
    "Right": ((SIDE, SIDE, 0), (0, -SIDE, 0), (0, 0, SIDE), GREEN),
}
BAKED = ("Floor", "Back", "Left", "Right")
RESOLUTION = 24
# Paths of each lumel in each of the two references made here, and of so many at once.
PATHS, AT_ONCE = 512, 1 << 17
SAMPLES = 384
# Steps of an even sequence in four dimensions: powers of the root of x^5 = x + 1.
EVEN = 1.1673039782614187 ** -np.arange(1.0, 5.0)


def command(*arguments: Any, **options: Any) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, "-m", "radiosity", *map(str, arguments)], capture_output=True, text=True,
                          timeout=300, check=False, **options)


@dataclass(frozen=True)
class Compared:
    """A comparison by the command line of the room: its folder, its numbers, its file before, what it said."""

    folder: Path
    told: dict[str, Any]
    untouched: bool
    done: subprocess.CompletedProcess[str]


@pytest.fixture(scope="module")
def compared(tmp_path_factory: pytest.TempPathFactory) -> Compared:
    """The room, baked roughly by us and well by Cycles."""
    folder = tmp_path_factory.mktemp("compare")
    path = save_room(folder / "room.blend")
    before = path.read_bytes()
    only = [word for name in BAKED for word in ("--only", name)]
    done = command("compare", path, "--output", folder / "out", "--error", "1", "--uv-layer", "Mine", "--resolution",
                   RESOLUTION, "--samples", SAMPLES, "--quantity", "irradiance", *only)
    assert done.returncode in {0, 4}, done.stderr
    told = json.loads((folder / "out" / "compare.json").read_text())
    return Compared(folder / "out", told, path.read_bytes() == before, done)


def save_room(path: Path) -> Path:
    """The room as a .blend, every wall with a UV map that is the whole of its image."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    for name, (corner, along, up, colour) in WALLS.items():
        c, u, v = (np.array(value, float) for value in (corner, along, up))
        add(name, [c, c + u, c + u + v, c + v], [(0, 1, 2, 3)], colour)
    low, high = np.array(BLOCK)
    points = [np.where([x, y, z], high, low) for z in (0, 1) for y in (0, 1) for x in (0, 1)]
    add("Block", points, [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)], WHITE)
    (x0, y0, z), (x1, y1, _) = PANEL
    panel = add("Panel", [(x0, y0, z), (x0, y1, z), (x1, y1, z), (x1, y0, z)], [(0, 1, 2, 3)], (0, 0, 0))
    shader = principled(panel.data.materials[0])
    shader.inputs["Emission Color"].default_value = (1, 1, 1, 1)
    shader.inputs["Emission Strength"].default_value = RADIANCE
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    return path


def add(name: str, points: Any, faces: Any, colour: tuple[float, ...]) -> Any:
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata([tuple(map(float, point)) for point in points], [], faces)
    material = bpy.data.materials.new(name)
    if material.node_tree is None:
        material.use_nodes = True
    principled(material).inputs["Base Color"].default_value = (*colour, 1.0)
    mesh.materials.append(material)
    if len(faces) == 1:
        mesh.uv_layers.new(name="Mine").uv.foreach_set("vector", np.array([0, 0, 1, 0, 1, 1, 0, 1], np.float32))
    made = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(made)
    return made


def principled(material: Any) -> Any:
    return next(node for node in material.node_tree.nodes if node.bl_idname == "ShaderNodeBsdfPrincipled")


def hit(origin: Float, direction: Float) -> tuple[Float, Float, NDArray[np.bool_], Float]:
    """Nearest surface of the room along rays (n, 3): point, normal, whether it is the panel, reflectance."""
    with np.errstate(divide="ignore", invalid="ignore"):
        to_walls = np.where(direction > 0, (SIDE - origin) / direction, -origin / direction)
        to_walls[direction == 0] = np.inf
        axis = to_walls.argmin(axis=1)
        distance = to_walls.min(axis=1)
        side = np.take_along_axis(direction, axis[:, None], 1)[:, 0] > 0
        normal = np.zeros_like(origin)
        normal[np.arange(len(axis)), axis] = np.where(side, -1, 1)
        colour = np.full_like(origin, WHITE[0])
        colour[(axis == 0) & ~side], colour[(axis == 0) & side] = RED, GREEN
        # The block, by slabs (Kay & Kajiya 1986).
        low, high = np.array(BLOCK, origin.dtype)
        near, far = (low - origin) / direction, (high - origin) / direction
        near, far = np.minimum(near, far), np.maximum(near, far)
        enter, leave = near.max(axis=1), far.min(axis=1)
        met = (enter < leave) & (enter > 1e-5) & (enter < distance)
        rows, face = np.flatnonzero(met), near.argmax(axis=1)[met]
        normal[rows] = 0
        normal[rows, face] = -np.sign(direction[rows, face])
        colour[rows] = WHITE
        distance = np.where(met, enter, distance)
        # The panel, a rectangle at one height.
        (x0, y0, z), (x1, y1, _) = PANEL
        height = (z - origin[:, 2]) / direction[:, 2]
        x, y = (origin[:, i] + height * direction[:, i] for i in (0, 1))
        panel = (height > 1e-5) & (height < distance) & (x > x0) & (x < x1) & (y > y0) & (y < y1)
    return origin + distance[:, None] * direction, normal, panel, colour


def cosine(normal: Float, numbers: Float) -> Float:
    """Directions about unit normals, with a density in proportion to the cosine: normal plus a point on a sphere."""
    height, angle = 1 - 2 * numbers[:, 0], 2 * np.pi * numbers[:, 1]
    ring = np.sqrt(np.maximum(1 - height**2, 0))
    ball = np.stack([ring * np.cos(angle), ring * np.sin(angle), height], axis=1)
    direction = normal + ball * np.float32(0.99999)
    return np.asarray(direction / np.linalg.norm(direction, axis=1, keepdims=True))


def from_panel(origin: Float, normal: Float, numbers: Float) -> Float:
    """The panel's own light E / pi at points (n, 3), (n, 1): one shadow ray each, to the point that (n, 2) say."""
    low, high = np.array(PANEL, np.float32)
    towards = low + np.pad(numbers, ((0, 0), (0, 1))) * (high - low) - origin
    square = np.maximum((towards**2).sum(axis=1), 1e-8)
    with np.errstate(divide="ignore", invalid="ignore"):
        near, far = (np.array(BLOCK, np.float32)[:, None] - origin) / towards
    enter, leave = np.minimum(near, far).max(axis=1), np.maximum(near, far).min(axis=1)
    free = ~((enter < leave) & (enter < 1) & (leave > 1e-4))
    cosines = np.maximum((towards * normal).sum(axis=1), 0) * np.abs(towards[:, 2]) / square
    area = np.prod((high - low)[:2])
    return np.asarray(RADIANCE * area / np.pi * free * cosines / square)[:, None]


def path_traced(origin: Float, normal: Float, numbers: Float, random: np.random.Generator) -> Float:
    """Radiance E / pi at points (n, 3), one path each, with a shadow ray to the panel from every vertex.

    `numbers` (n, 4) say where the first shadow ray and the first direction go; chance says the rest.
    """
    radiance = from_panel(origin, normal, numbers[:, :2]) * np.ones(3, np.float32)
    numbers = numbers[:, 2:]
    carried = np.ones_like(origin)
    alive = np.arange(len(origin))
    for bounce in range(1000):
        place, facing, panel, colour = hit(origin, cosine(normal, numbers))
        carried = carried * colour
        # The panel reflects nothing; other paths end by chance, and those that go on carry more for it.
        chance = np.where(panel, 0, carried.max(axis=1) if bounce > 1 else 1)
        keep = random.random(len(chance)) < chance
        alive, origin, normal = alive[keep], place[keep] + facing[keep] * np.float32(1e-4), facing[keep]
        carried = carried[keep] / chance[keep, None].astype(np.float32)
        if not len(alive):
            break
        numbers = random.random((len(alive), 2), np.float32)
        radiance[alive] += carried * from_panel(origin, normal, random.random((len(alive), 2), np.float32))
    return radiance


def independent_reference(seed: int) -> dict[str, Float]:
    """E / pi of the baked walls' lumels, (n, n, 3) each: the mean over the middle half of a texel each way."""
    random = np.random.default_rng(seed)
    found = {}
    for name in BAKED:
        corner, u, v, _ = (np.array(value, np.float32) for value in WALLS[name])
        normal = np.cross(u, v) / SIDE**2
        row, column = np.divmod(np.repeat(np.arange(RESOLUTION**2), PATHS), RESOLUTION)
        # For each lumel the same even sequence (Kronecker's, Roberts 2018), shifted by chance.
        even = np.outer(np.tile(np.arange(PATHS), RESOLUTION**2), EVEN)
        even = ((even + np.repeat(random.random((RESOLUTION**2, 4)), PATHS, axis=0)) % 1).astype(np.float32)
        total = np.zeros((RESOLUTION**2, 3))
        for start in range(0, len(row), AT_ONCE):
            part = slice(start, start + AT_ONCE)
            x, y = (random.random((2, len(row[part]))) - 0.5) * 0.5 + 0.5 + np.stack([column[part], row[part]])
            points = corner + (x[:, None] * u + y[:, None] * v) / RESOLUTION + normal * 1e-4
            light = path_traced(points.astype(np.float32), np.broadcast_to(normal, points.shape).astype(np.float32),
                                even[part], random)
            np.add.at(total, row[part] * RESOLUTION + column[part], light)
        found[name] = (total / PATHS).reshape(RESOLUTION, RESOLUTION, 3)
    return found


@pytest.mark.slow
def test_the_error_agrees_with_one_computed_without_cycles_and_without_the_solver(compared):
    # A closed room under a shining panel, baked roughly. The error of that bake against path tracing written here, in
    # which no line of the product takes part; compare, which knows Cycles' two bakes alone, says the same within 10 %.
    first, second = independent_reference(1), independent_reference(2)
    inner = slice(1, RESOLUTION - 1)
    free = {name: np.ones((RESOLUTION, RESOLUTION), bool) for name in BAKED}
    (x0, y0), (x1, y1) = (np.rint(np.array(corner[:2]) / SIDE * RESOLUTION).astype(int) for corner in BLOCK)
    # No light arrives under the block.
    free["Floor"][y0:y1, x0:x1] = False

    def lumels(images: dict[str, Float]) -> Float:
        return np.concatenate([images[name][inner, inner][free[name][inner, inner]] for name in BAKED])

    ours = {name: image_file.read_exr(compared.folder / f"Lightmap_{name}_ours.exr") for name in BAKED}
    cycles = {name: image_file.read_exr(compared.folder / f"Lightmap_{name}_cycles.exr") for name in BAKED}
    exact = estimator.score(lumels(ours), lumels(first), lumels(second))
    told = compared.told["comparison"]["ours"]
    assert compared.told["comparison"]["lumels"]["counted"] == exact.lumels
    assert exact.rms > 0.01
    assert told["rms"] == pytest.approx(exact.rms, rel=0.1)
    assert told["bias"] == pytest.approx(exact.bias, abs=0.003)
    # And Cycles' own mean is right: the twin is the room.
    twin = estimator.score(lumels(cycles), lumels(first), lumels(second))
    assert abs(twin.bias) < 0.003


def test_all_is_written_and_the_scenes_file_is_not(compared):
    # Four walls of their own images. Exact answer: three EXR files each, the numbers, a picture and a page.
    assert compared.untouched
    told, folder = compared.told, compared.folder
    assert {row["image"] for row in told["outputs"]} == {f"Lightmap_{name}" for name in BAKED}
    for row in told["outputs"]:
        shown = {kind: image_file.read_exr(folder / row[kind]) for kind in ("ours", "cycles", "error")}
        assert {image.shape for image in shown.values()} == {(RESOLUTION, RESOLUTION, 3)}
    assert sorted(path.name for path in folder.iterdir() if path.suffix != ".exr") == [
        "compare.html", "compare.json", "compare.png"]
    numbers = told["comparison"]
    assert {row["object"] for row in numbers["objects"]} == set(BAKED)
    assert numbers["cycles"]["samples"] == SAMPLES
    assert numbers["cycles"]["bounces"] == 64
    assert told["settings"]["quantity"] == "radiance"
    # Two bakes of half the samples: the noise of their mean is that of one of them over the root of two.
    assert numbers["cycles"]["rms"] == pytest.approx(numbers["cycles"]["half_rms"] / 2**0.5)
    assert numbers["equal_error"]["factor"] == pytest.approx(
        numbers["equal_error"]["cycles_seconds"] / numbers["ours"]["seconds"])


def test_the_error_in_an_image_is_that_of_the_numbers(compared):
    # The signed error of all inner lumels, written as EXR, in parts of the scene's mean. Its mean is the bias.
    inner = slice(1, RESOLUTION - 1)
    error = np.concatenate([image_file.read_exr(compared.folder / row["error"])[inner, inner, 0].ravel()
                            for row in compared.told["outputs"]])
    lit = error[error != 0]
    # Two lumels of these, the 0.1 % that deviate most, are not in the bias.
    assert lit.mean() == pytest.approx(compared.told["comparison"]["ours"]["bias"], abs=2e-3)


def test_the_page_needs_no_other_file(compared):
    page = (compared.folder / "compare.html").read_text()
    assert not re.search(r'(src|href)="(?!data:image/png;base64,)', page)
    # The scale, and three maps a wall.
    assert page.count("data:image/png;base64,") == 1 + 3 * len(BAKED)
    assert "<svg" in page
    numbers = compared.told["comparison"]
    assert f"{numbers['ours']['rms']:.2%}" in page
    assert f"{numbers['cycles']['rms']:.2%}" in page
    assert (compared.folder / "compare.png").read_bytes().startswith(b"\x89PNG")


def test_an_error_above_the_wanted_one_ends_with_code_4(compared):
    told = compared.told
    missed = told["comparison"]["ours"]["rms_low"] > told["settings"]["error"]
    assert compared.done.returncode == (4 if missed else 0)
    assert "Traceback" not in compared.done.stderr


def test_the_operator_compares_any_scene_and_leaves_it_as_it_was(build, tmp_path):
    # A textured floor and a smooth dome under a lamp that only an instance of a collection shows, a parent's scale on
    # it, and between them a sheet that lets half of the light through and one that casts no shadow; a lamp for the dome
    # alone, which that sheet does not stop, and a panel that glows for the floor alone. Exact answer: Cycles' twin has
    # the same of each, so both bakes agree; the file is unchanged.
    from radiosity import operators

    floor = build.mesh("Floor", ((-2, -2, 0), (2, -2, 0), (2, 2, 0), (-2, 2, 0)))
    squares = np.ones((8, 8, 4), np.float32)
    squares[::2, ::2, :3], squares[1::2, 1::2, :3] = 0.2, 0.2
    floor.data.materials.append(build.textured("Tiles", build.image("Tiles", squares)))
    floor.data.uv_layers.new(name="UVMap")
    bpy.ops.mesh.primitive_uv_sphere_add(segments=16, ring_count=8, radius=0.7, location=(0, 0, 0.9))
    bpy.ops.object.shade_smooth()
    sheet = ((-2, -2, 2), (0, -2, 2), (0, 2, 2), (-2, 2, 2))
    build.mesh("Veil", sheet, material=build.material("Veil", (0.5, 0.5, 0.5), Alpha=0.5))
    build.mesh("Ghost", np.add(sheet, (2, 0, 0.2)), material=(0.5, 0.5, 0.5)).visible_shadow = False
    hidden = bpy.data.collections.new("Lamps")
    lamp = bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "AREA"))
    lamp.data.energy, lamp.data.size = 100.0, 0.5
    hidden.objects.link(lamp)
    shown = build.object("Instance", None)
    shown.instance_type, shown.instance_collection = "COLLECTION", hidden
    shown.location, shown.scale = (1.0, 0.5, 3.0), (2.0, 2.0, 2.0)
    rim = build.object("Rim", bpy.data.lights.new("Rim", "POINT"))
    rim.data.energy, rim.location = 150.0, (-1.0, 0.0, 3.0)
    rim.light_linking.receiver_collection = linked_to("Sphere")
    rim.light_linking.blocker_collection = linked_to("Floor", "Sphere")
    panel = build.mesh("Panel", np.add(UNIT_SQUARE, (-1.5, -1.5, 1.2)), material=(0.0, 0.0, 0.0))
    build.shader(panel.data.materials[0]).inputs["Emission Color"].default_value = (1, 1, 1, 1)
    build.shader(panel.data.materials[0]).inputs["Emission Strength"].default_value = 3.0
    panel.light_linking.receiver_collection = linked_to("Floor")
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    operators.register()
    before = state()
    options = f"--output '{tmp_path / 'out'}' --error .2 --resolution 48 --samples 256 --report '{tmp_path / 'n.json'}'"
    assert bpy.ops.radiosity.compare(options=options) == {"FINISHED"}
    assert state() == before
    operators.unregister()
    told = json.loads((tmp_path / "n.json").read_text())
    assert told["page"] == "out/compare.html"
    assert {row["object"] for row in told["comparison"]["objects"]} == {
        "Floor", "Sphere", "Veil", "Ghost", "Panel"}
    assert told["comparison"]["ours"]["rms"] < 0.1
    assert abs(told["comparison"]["ours"]["bias"]) < 0.03
    # The lamp for the dome is a small part of all; with the veil's shade in one of the bakes this is .19.
    assert next(row["rms"] for row in told["comparison"]["objects"] if row["object"] == "Sphere") < 0.05


def linked_to(*names: str) -> Any:
    """A linking collection that includes some objects."""
    made = bpy.data.collections.new("Linked")
    for name in names:
        made.objects.link(bpy.data.objects[name])
    return made


def state() -> Any:
    """Everything of the file that a comparison must leave alone."""
    scene = bpy.context.scene
    kinds = ("objects", "meshes", "images", "materials", "scenes", "worlds", "cameras", "lights", "collections")
    return ({kind: sorted((item.name, item.users) for item in getattr(bpy.data, kind)) for kind in kinds},
            [[layer.name for layer in mesh.uv_layers] for mesh in bpy.data.meshes],
            scene.render.engine, scene.cycles.samples, scene.cycles.max_bounces, bpy.data.filepath,
            bpy.context.active_object, list(bpy.context.selected_objects))


@pytest.mark.parametrize(("words", "line"), [
    (("--target", "vertex"), "target is 'vertex': lightmaps alone are compared with Cycles, use lightmap"),
    (("--samples", "4"), "samples is 4: use a number from 8"),
    (("--seconds", "-1"), "seconds is -1: give Cycles a time above 0"),
    (("--seconds", "9", "--samples", "64"), "not allowed with argument"),
])
def test_wrong_words_are_told_in_one_line(build, words, line):
    from radiosity import operators

    operators.register()
    with pytest.raises(RuntimeError, match=re.escape(line)):
        bpy.ops.radiosity.compare(options=" ".join(("--output /nowhere", *words)))
    operators.unregister()


@pytest.mark.skipif(sys.platform == "win32", reason="there is no SIGINT to send")
def test_an_interrupt_ends_both_programs_with_code_130(tmp_path):
    # A comparison for which Cycles gets ten minutes, interrupted as soon as Cycles bakes. Exact answer: 130 within
    # seconds, one line, no file, and no other Blender left.
    scene, temporary = tmp_path / "scene", tmp_path / "temporary"
    scene.mkdir()
    temporary.mkdir()
    path = save_room(scene / "room.blend")
    process = subprocess.Popen([sys.executable, "-u", "-m", "radiosity", "compare", str(path), "--error", "1",
                                "--resolution", "16", "--seconds", "600"], stdout=subprocess.PIPE,
                               stderr=subprocess.PIPE, text=True, env={**os.environ, "TMPDIR": str(temporary)})
    assert process.stdout is not None
    for line in process.stdout:
        if line.startswith("Cycles"):
            break
    time.sleep(2)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 130, errors
    assert len([line for line in errors.splitlines() if line.startswith("radiosity: error: ")]) == 1
    assert [item.name for item in scene.iterdir()] == ["room.blend"]
    assert not list(temporary.glob("radiosity-*"))
    assert not any(str(temporary).encode() in words_of(entry) for entry in Path("/proc").glob("[0-9]*/cmdline"))


def words_of(process: Path) -> bytes:
    """What a process was started with; nothing if it has just ended."""
    try:
        return process.read_bytes()
    except OSError:
        return b""

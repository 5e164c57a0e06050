"""Reading and writing in parts: the same as at once, and no part keeps Blender's thread for long."""

from __future__ import annotations

import contextlib
import dataclasses
import threading
import time
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from radiosity.radiosity_addon import evaluate, world_render
from radiosity.radiosity_addon.blend_file import open_blend
from radiosity.radiosity_addon.cycles_elsewhere import Elsewhere, can_go
from radiosity.radiosity_addon.export import export_parts, export_scene
from radiosity.radiosity_addon.images import texture_parts
from radiosity.radiosity_addon.job import Job
from radiosity.radiosity_addon.parts import PAUSE, aside, some, whole
from radiosity.radiosity_addon.request import Request
from radiosity.radiosity_addon.world_render import COARSE, Map, fine_map
from radiosity.solver.errors import RadiosityError, SceneError
from radiosity.solver.settings import Settings

SCENES = Path(__file__).resolve().parents[3] / "shared" / "scenes"
SHORT = 1e-6
# Seconds of its own that a part may keep Blender's thread, whatever else the machine does.
LONGEST = 0.1
# The quicker of so many runs counts: a thread waits for memory that other work on the machine uses.
RUNS = 3


def add(tree: Any, kind: str, **values: Any) -> Any:
    node = tree.nodes.new(kind)
    for name, value in values.items():
        node.inputs[name].default_value = value
    return node


@pytest.fixture
def scene(build: Any) -> Any:
    """Three squares, one with an image of 300 x 300 and one of noise, under a sun and a sky that is half red."""
    build.sun()
    pixels = np.random.default_rng(0).random((300, 300, 4), np.float32)
    build.mesh("Image", material=build.textured("Image paint", build.image("Photo", pixels)))
    noisy = build.material("Noise paint", (1, 1, 1))
    noise = add(noisy.node_tree, "ShaderNodeTexNoise", Scale=5.0)
    noisy.node_tree.links.new(noise.outputs["Color"], build.shader(noisy).inputs["Base Color"])
    build.mesh("Noise", material=noisy).location.x = 2
    build.mesh("Plain", material=(0.2, 0.4, 0.6)).location.x = 4
    tree = bpy.context.scene.world.node_tree
    background = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeBackground")
    gradient, place = add(tree, "ShaderNodeTexGradient"), add(tree, "ShaderNodeTexCoord")
    tree.links.new(place.outputs["Generated"], gradient.inputs["Vector"])
    tree.links.new(gradient.outputs["Color"], background.inputs["Color"])
    return bpy.context.scene


def arrays(value: Any) -> Any:
    """All that a dataclass of arrays holds, as plain lists."""
    if dataclasses.is_dataclass(value):
        return [arrays(getattr(value, field.name)) for field in dataclasses.fields(value)]
    if isinstance(value, tuple | list):
        return [arrays(item) for item in value]
    return value.tolist() if isinstance(value, np.ndarray) else value


def parts_of(scene: Any, **more: Any) -> Any:
    return export_parts(scene, bpy.context.view_layer, Settings(resolution=32), [], **more)


def test_a_scene_read_in_short_parts_is_the_scene_read_at_once(scene):
    # Parts as short as can be. Exact answer: all arrays are the same, to the bit, and there were many parts.
    at_once = export_scene(scene, bpy.context.view_layer, Settings(resolution=32), [])
    count = 0

    def counted() -> Any:
        nonlocal count
        parts = parts_of(scene, part_seconds=SHORT)
        while True:
            try:
                next(parts)
                count += 1
            except StopIteration as end:
                return end.value

    assert arrays(counted().scene) == arrays(at_once.scene)
    assert count > 10


def test_a_glance_has_all_surfaces_and_a_coarse_sky_before_the_rest_is_read(scene):
    # Exact answer: the triangles and the plain colour of the whole; for the image its mean, to a part of its pixels; a
    # map of 256 x 128; given once, and nothing more is read before its parts have ended.
    seen: list[Any] = []
    order: list[str] = []

    def glance_at(dark: Any, light: Any, settings: Settings) -> Any:
        sky, _ = yield from light
        seen.append((dark(), sky))
        yield
        order.append("looked")

    parts = parts_of(scene, part_seconds=SHORT, glance=glance_at)
    while not seen:
        next(parts)
    assert order == []
    exported = whole(parts)
    assert order == ["looked"]
    ((glance, sky),) = seen
    assert np.array_equal(glance.vertices, exported.scene.vertices)
    assert sky.radiance.shape == (COARSE.height, COARSE.width, 3)
    wanted = fine_map(bpy.context.scene.world)
    assert exported.scene.sky.radiance.shape == (wanted.height, wanted.width, 3)
    assert wanted.width > COARSE.width
    assert sky.radiance.mean(axis=(0, 1)) == pytest.approx(exported.scene.sky.radiance.mean(axis=(0, 1)), rel=0.02)
    assert glance.reflectance[-1] == pytest.approx(exported.scene.reflectance[-1])
    assert not glance.textures
    assert glance.reflectance[0] == pytest.approx(exported.scene.textures[0].mean, rel=0.03)
    assert len(exported.scene.textures) == 2


def test_a_glance_has_the_lamps_of_a_render_though_the_viewport_hides_them(scene):
    # The sun is switched off in viewports alone. Exact answer: the lamp of the whole, and no other.
    sun = next(item for item in scene.objects if item.type == "LIGHT")
    sun.hide_viewport = True
    seen: list[Any] = []

    def glance_at(dark: Any, light: Any, settings: Settings) -> Any:
        yield from light
        seen.append(dark())

    whole(parts_of(scene, part_seconds=SHORT, glance=glance_at))
    assert [lamp.name for lamp in seen[0].lights] == [sun.name]


def test_what_cycles_evaluates_in_another_blender_is_what_it_evaluates_here(scene):
    # The noise and the gradient, asked of another Blender in a window's parts. Exact answer: all arrays of the scene
    # that is read at once, to the bit, and the same messages.
    evaluate.forget()
    expected: list[Any] = []
    at_once = export_scene(scene, bpy.context.view_layer, Settings(resolution=32), expected)
    evaluate.forget()
    messages: list[Any] = []
    asked = whole(export_parts(scene, bpy.context.view_layer, Settings(resolution=32), messages, part_seconds=SHORT))
    assert arrays(asked.scene) == arrays(at_once.scene)
    assert messages == expected


def test_another_blender_that_fails_is_told_of_and_leaves_nothing(scene):
    # It is ended from outside before it can answer. Exact answer: an error with its exit code, and no folder.
    elsewhere = Elsewhere()
    folder = Path(elsewhere._folder.name)
    try:
        elsewhere.bring([scene.world])
        elsewhere._process.kill()
        with pytest.raises(RadiosityError, match=r"another Blender, .* failed \(exit code"):
            whole(elsewhere.ask(do="map", world=scene.world.name, size=(8, 4, 1)))
    finally:
        elsewhere.close()
    assert not folder.exists()


def test_what_looks_at_an_object_stays_in_this_blender(scene):
    # Texture coordinates of an object, whose place no file holds. Exact answer: may go without it, and not with it.
    assert can_go(scene.world)
    node = next(node for node in scene.world.node_tree.nodes if node.bl_idname == "ShaderNodeTexCoord")
    node.object = bpy.data.objects["Plain"]
    assert not can_go(scene.world)


def test_strips_of_a_world_are_the_whole_map(scene):
    # A map in strips of a few rows each. Exact answer: the map rendered at once, to the bit.
    size = Map(64, 40, 2)
    strips = whole(world_render.map_parts(scene.world, size, SHORT))
    assert np.array_equal(strips, whole(world_render.map_parts(scene.world, size)))


def test_an_image_decoded_in_rows_is_the_whole_image(build):
    # An image of 1,024 x 300 in its parts. Exact answer: row by row what sRGB says of its bytes.
    stored = np.random.default_rng(1).integers(0, 256, (300, 1024, 4)).astype(np.float32) / 255
    stored[..., 3] = 1
    texture = whole(texture_parts(build.image("Wide", stored), "", []))
    linear = np.where(stored <= 0.04045, stored / 12.92, ((stored + 0.055) / 1.055) ** 2.4)[..., :3]
    assert texture.pixels == pytest.approx(linear, abs=1e-6)


def test_a_scene_that_changes_between_two_parts_is_refused(scene, monkeypatch):
    # A mesh is renamed after the first, parts of one mesh each. Exact answer: an error that says so.
    monkeypatch.setattr("radiosity.radiosity_addon.render_walk.WORTH", 0.0)
    parts = parts_of(scene, part_seconds=SHORT)
    for _ in range(2):
        next(parts)
    bpy.data.objects["Plain"].name = "Other"
    with pytest.raises(SceneError, match="changed while it was read"):
        whole(parts)


def test_what_is_worked_aside_is_waited_for_and_its_error_is_raised_here():
    # Exact answer: the result, of another thread; a window gets its turn meanwhile; and the error itself.
    def slow() -> int:
        time.sleep(0.2)
        return threading.get_ident()

    def broken() -> None:
        raise SceneError("broken")

    assert whole(aside(slow)) != threading.get_ident()
    parts, ticks = aside(slow), 0
    with contextlib.suppress(StopIteration):
        while True:
            some(parts, 0.01)
            ticks += 1
    assert ticks > 3
    with pytest.raises(SceneError, match="broken"):
        whole(aside(broken))


def test_some_goes_on_for_as_long_as_is_asked():
    # Five parts of ten milliseconds. Exact answer: one, where no time is given; all, with their result, in a second.
    def five() -> Any:
        for _ in range(5):
            time.sleep(0.01)
            done.append(1)
            yield
        return "result"

    done: list[int] = []
    some(five(), 0.0)
    assert len(done) == 1
    with pytest.raises(StopIteration) as end:
        some(five(), 1.0)
    assert end.value.value == "result"


def test_a_pause_gives_the_window_its_turn():
    # A pause between two steps, with a second to go. Exact answer: one step before it; both where nobody waits.
    def two() -> Any:
        done.append(1)
        yield PAUSE
        done.append(2)
        yield

    done: list[int] = []
    some(two(), 1.0)
    assert done == [1]
    whole(two())
    assert done == [1, 1, 2]


def test_files_are_put_in_their_places_at_the_end_alone(scene, tmp_path):
    # The worker has ended, and nothing is written back. Exact answer: no file of a result under its name; if the job is
    # closed then, none at all.
    output = tmp_path / "out"
    job = Job(Request(Settings(error=0.3, resolution=32), output, groups="lamp"), scene, bpy.context.view_layer)
    try:
        job.export()
        job.start()
        job.wait(60)
        assert job.is_baked
        assert not [path for path in output.iterdir() if not path.name.startswith(".")]
        assert list(output.rglob("*.exr"))
    finally:
        job.close()
    assert not output.exists()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["classroom", "living-room", "truck_town", "pandora"])
def test_no_part_of_a_large_scene_keeps_the_window_for_long(build, name, tmp_path):
    # Reading and writing, in seconds of Blender's own thread: what Cycles does in others is not in them. Allowed: a
    # tenth of a second a part. Printed: the longest by the clock too, Cycles included.
    path = SCENES / name / f"{name}.blend"
    if not path.is_file():
        pytest.skip(f"no scene at {path}")
    open_blend(path)
    request = Request(Settings(error=0.3, resolution=512), tmp_path, groups="lamp")
    longest: dict[str, list[float]] = {"reading": [], "writing": []}
    for _ in range(RUNS):
        job = Job(request, bpy.context.scene, bpy.context.view_layer)
        try:
            reading = timed(job.exporting())
            job.start()
            job.wait(600)
            writing = timed(job.finishing())
        finally:
            job.close()
        for stage, (own, clock) in (("reading", reading), ("writing", writing)):
            longest[stage].append(max(own))
            print(f"{name}: {stage} in {len(own)} ticks, {sum(own):.2f} s, longest {max(own):.3f} s of the thread, "
                  f"{max(clock):.3f} s by the clock")
    assert max(min(seconds) for seconds in longest.values()) < LONGEST


def timed(parts: Any) -> tuple[list[float], list[float]]:
    """Seconds of every tick of a window that works in parts: of this thread, and by the clock."""
    own: list[float] = []
    clock: list[float] = []
    while True:
        begun, start = time.thread_time(), time.perf_counter()
        try:
            some(parts)
        except StopIteration:
            return own, clock
        finally:
            own.append(time.thread_time() - begun)
            clock.append(time.perf_counter() - start)

"""What Blender offers only as a render: Cycles renders a scene of ours or bakes a material, and a render's own view of
the scene.

The only file that calls `bpy.ops.render` and `bpy.ops.object.bake`.
"""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

import bpy
import numpy as np
from numpy.typing import NDArray

from ..solver.errors import SceneError

Float = NDArray[np.floating[Any]]
Result = TypeVar("Result")

RENDER_RESULT = "Render Result"
# The slot that our own renders go to where the user has a render to look at.
SLOT = "Radiosity"


def rendered(scene: Any, name: str) -> Float:
    """What the camera of a scene of our own sees, (h, w, 3) float32, row 0 at the bottom.

    Raises
    ------
    SceneError
        Naming the world or lamp `name`, if Cycles can't render it.
    """
    with tempfile.TemporaryDirectory(prefix="radiosity-world-") as folder:
        path = Path(folder) / "world.exr"
        scene.render.filepath = str(path)
        with _render_result_kept(), _quiet():
            bpy.ops.render.render(write_still=True, scene=scene.name)
        if not path.is_file():
            raise SceneError(f"{name!r} could not be rendered by Cycles: simplify its node tree")
        return _read(path)


def with_render_depsgraph(scene: Any, view_layer: Any, use: Callable[[Any], Result]) -> Result:
    """Call `use` with the scene evaluated as for a render: what is visible there, with modifiers as set for it.

    Python is handed such a dependency graph only as a render engine, so for this one call we are one. No pixel
    is drawn.

    Raises
    ------
    SceneError
        If the view layer is switched off for rendering; and whatever `use` raises.
    """
    outcome: list[Result] = []
    failure: list[BaseException] = []

    class RADIOSITY_RE_evaluate(bpy.types.RenderEngine):
        """Hands the dependency graph on."""

        bl_idname = "RADIOSITY_EVALUATE"
        bl_label = "Radiosity evaluation"
        bl_use_postprocess = False

        def render(self, depsgraph: Any) -> None:
            if outcome or failure:
                return  # a second view of a stereo scene
            try:
                outcome.append(use(depsgraph))
            except BaseException as error:  # noqa: BLE001 - Blender would swallow it; it is raised again below
                failure.append(error)

    bpy.utils.register_class(RADIOSITY_RE_evaluate)
    try:
        with _changed(scene.render, engine=RADIOSITY_RE_evaluate.bl_idname, use_compositing=False, use_sequencer=False,
                      use_lock_interface=False), _some_camera(scene), _render_result_kept():
            bpy.ops.render.render(scene=scene.name, layer=view_layer.name)
    finally:
        bpy.utils.unregister_class(RADIOSITY_RE_evaluate)
    if failure:
        raise failure[0]
    if not outcome:
        raise SceneError(f"view layer {view_layer.name!r} of scene {scene.name!r} is not rendered: "
                         "switch on View Layer > Use for Rendering")
    return outcome[0]


def bake_emission(item: Any, uv_map: str, width: int, height: int, frame: int) -> Float:
    """What an object shines with, by Cycles: (height, width, 4) float32, alpha 1 where its UV map lies, else 0.

    Parameters
    ----------
    item : object that is in no scene, with one material, of which it is the only user.
    uv_map : name of the UV map to bake over; values are those at the texels' middles.
    frame : number of the frame, for what is animated.

    Raises
    ------
    RuntimeError
        If Cycles is not there or can't bake.
    """
    scene = bpy.data.scenes.new("radiosity bake")
    image = bpy.data.images.new("radiosity bake", width, height, alpha=True, float_buffer=True)
    try:
        if not hasattr(scene, "cycles"):
            raise RuntimeError("Cycles is switched off: switch it on in Preferences > Add-ons")
        image.colorspace_settings.name = "Non-Color"
        image.pixels.foreach_set(np.zeros(width * height * 4, np.float32))
        nodes = item.active_material.node_tree.nodes
        nodes.active = nodes.new("ShaderNodeTexImage")
        nodes.active.image = image
        scene.collection.objects.link(item)
        scene.frame_current = frame
        _set_plain(scene)
        scene.cycles.samples = 1
        layer = scene.view_layers[0]
        item.select_set(True, view_layer=layer)
        layer.objects.active = item
        with _quiet(), bpy.context.temp_override(
                scene=scene, view_layer=layer, active_object=item, object=item, selected_objects=[item],
                selected_editable_objects=[item]):
            bpy.ops.object.bake(type="EMIT", target="IMAGE_TEXTURES", save_mode="INTERNAL", margin=0, use_clear=False,
                                uv_layer=uv_map)
        pixels = np.empty(width * height * 4, np.float32)
        image.pixels.foreach_get(pixels)
        return pixels.reshape(height, width, 4)
    finally:
        remove_scene(scene)
        bpy.data.images.remove(image)


def remove_scene(scene: Any) -> None:
    """Remove a scene of our own that no window shows.

    `bpy.data.scenes.remove` asks for the context's window: Blender 4.3 crashes where there is none, as under `-c`.
    """
    bpy.data.batch_remove([scene])


def _read(path: Path) -> Float:
    """(h, w, 3) float32 of a rendered file, row 0 at the bottom."""
    image = bpy.data.images.load(str(path), check_existing=False)
    try:
        image.colorspace_settings.name = "Linear Rec.709"
        values = np.empty(len(image.pixels), np.float32)
        image.pixels.foreach_get(values)
        width, height = image.size
        return np.ascontiguousarray(values.reshape(height, width, -1)[:, :, :3])
    finally:
        bpy.data.images.remove(image)


def set_up_render(scene: Any, width: int, height: int, samples: int) -> None:
    """Settings of a render of plain light: its size in pixels, and samples spread over each whole pixel, so that its
    value is the pixel's mean.
    """
    render = scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = width, height, 100
    _write_exr(render)
    _set_plain(scene)
    scene.cycles.samples = samples
    scene.cycles.pixel_filter_type = "BOX"


def _set_plain(scene: Any) -> None:
    """Let Cycles work on the CPU, with nothing thinned out, smoothed or clamped."""
    scene.render.engine = "CYCLES"
    settings = scene.cycles
    settings.device = "CPU"
    settings.use_adaptive_sampling = settings.use_denoising = False
    settings.sample_clamp_direct = settings.sample_clamp_indirect = 0.0


def _write_exr(render: Any) -> None:
    """Let a render be written as an EXR file of 32-bit floats, under its very path, with its background."""
    render.film_transparent = False
    render.use_file_extension = False
    render.image_settings.file_format = "OPEN_EXR"
    render.image_settings.color_mode = "RGB"
    render.image_settings.color_depth = "32"


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep a render's own lines off the terminal, where the bake's progress stands; errors still show."""
    try:
        sys.stdout.flush()
        kept = os.dup(1)
    except (OSError, AttributeError):
        yield  # a window without a terminal
        return
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 1)
        yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)
        os.close(nowhere)


@contextmanager
def _changed(data: Any, **values: Any) -> Iterator[None]:
    """Properties with other values for a while."""
    before = {name: getattr(data, name) for name in values}
    try:
        for name, value in values.items():
            setattr(data, name, value)
        yield
    finally:
        for name, value in before.items():
            setattr(data, name, value)


@contextmanager
def _some_camera(scene: Any) -> Iterator[None]:
    """Blender renders nothing without a camera: lend the scene one where it has none."""
    if scene.camera is not None:
        yield
        return
    data = bpy.data.cameras.new("radiosity camera")
    camera = bpy.data.objects.new("radiosity camera", data)
    try:
        scene.camera = camera
        yield
    finally:
        scene.camera = None
        bpy.data.objects.remove(camera)
        bpy.data.cameras.remove(data)


@contextmanager
def _render_result_kept() -> Iterator[None]:
    """Render into a slot of its own, so that the user's last render stays to be looked at."""
    image = bpy.data.images.get(RENDER_RESULT)
    if image is None:
        yield
        made = bpy.data.images.get(RENDER_RESULT)
        if made is not None:
            bpy.data.images.remove(made)
        return
    # Blender can't take a slot away again but by an operator of the image editor, so ours is made once and reused.
    active = image.render_slots.active_index
    # Blender up to 4.3 can't look slots up by name.
    if SLOT not in [slot.name for slot in image.render_slots]:
        image.render_slots.new(name=SLOT)
    image.render_slots.active_index = [slot.name for slot in image.render_slots].index(SLOT)
    try:
        yield
    finally:
        bpy.data.images[RENDER_RESULT].render_slots.active_index = active


# Bounces of a bake that is compared with ours.
BOUNCES = 64


def set_up_bake(scene: Any) -> None:
    """Settings of a bake without bias: nothing clamped, guessed, thinned out or smoothed; plain Sobol points (blue
    noise ties neighbours together).
    """
    _set_plain(scene)
    scene.render.use_simplify = False
    settings = scene.cycles
    settings.light_sampling_threshold = 0.0
    settings.use_light_tree = True
    settings.use_fast_gi = False
    settings.use_guiding = False
    settings.sampling_pattern = "TABULATED_SOBOL"
    settings.max_bounces = settings.diffuse_bounces = BOUNCES
    settings.min_light_bounces = 0
    scene.render.bake.use_clear = True
    scene.render.bake.margin = 0


def bake_diffuse(item: Any, passes: str) -> None:
    """Bake the diffuse light of an object, E / pi, into the active image of each of its materials.

    `passes` is a word of the settings; the layout is the active UV map. For scenes of our own: it selects.
    """
    for other in bpy.context.view_layer.objects:
        other.select_set(other == item)
    bpy.context.view_layer.objects.active = item
    kinds = {"both": {"DIRECT", "INDIRECT"}, "direct": {"DIRECT"}, "indirect": {"INDIRECT"}}[passes]
    bpy.ops.object.bake(type="DIFFUSE", pass_filter=kinds, target="IMAGE_TEXTURES", save_mode="INTERNAL", margin=0,
                        use_clear=True)


def render_still(scene: Any, path: Path, samples: int) -> Float:
    """Render the camera's view by Cycles: (h, w, 3) float32 of linear light, row 0 at the bottom; `path` is written.

    For a scene of our own.
    """
    scene.cycles.samples = samples
    return _render_to(scene, path)


def render_eevee(scene: Any, path: Path, samples: int) -> Float:
    """The same by Eevee, whose name was another before Blender 5."""
    try:
        scene.render.engine = "BLENDER_EEVEE_NEXT"
    except TypeError:
        scene.render.engine = "BLENDER_EEVEE"
    scene.eevee.taa_render_samples = samples
    return _render_to(scene, path)


def _render_to(scene: Any, path: Path) -> Float:
    render = scene.render
    render.use_compositing = render.use_sequencer = False
    render.filepath = str(path)
    _write_exr(render)
    bpy.ops.render.render(write_still=True, scene=scene.name)
    return _read(path)

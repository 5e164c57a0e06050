"""Draws the light of a bake on its way over the surfaces in the 3D viewports; nothing of the file is touched."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np

from .job import Job
from .look import Look
from .parts import Parts, some, whole

# One point, of no light.
NOTHING = Look("", np.zeros((1, 3, 3), np.float32), np.zeros((1, 3, 2), np.float32), np.full(1, -1, np.int32),
               np.zeros((1, 3, 3), np.float32), ())
# How far the light lies before its surfaces, as part of the depth buffer's range.
NEARER = 2e-5
# Triangles that are handed to the graphics card in one go, about so many seconds of that at a time, and about how many
# seconds pieces may take that are drawn for the first time: where a driver draws in software, it makes room for them.
PIECE, PART, FIRST_DRAWING = 2**13, 0.02, 0.03
# How much faster than thought such a drawing may turn out in one go.
FASTER = 1.5
# Seconds that a viewport has for drawing these before more are made; it may be hidden.
PATIENCE = 0.25

VERTEX = """
void main() {
    uv_inside = uv;
    colour_inside = colour;
    gl_Position = view_projection * vec4(position, 1.0);
    gl_Position.z -= nearer * gl_Position.w;
}
"""
# Linear light as a display shows it (IEC 61966-2-1).
FRAGMENT = """
void main() {
    vec3 light = texture(page, uv_inside).rgb * colour_inside * exposure;
    vec3 low = light * 12.92;
    vec3 high = 1.055 * pow(max(light, vec3(1e-6)), vec3(1.0 / 2.4)) - 0.055;
    shown = vec4(mix(low, high, step(vec3(0.0031308), light)), 1.0);
}
"""


Drawing = list[tuple[Any, Any]]


@dataclass
class _Drawn:
    """A look, the textures and batches that draw it, what there is yet to do for these and whether it is done; how many
    of them are to be drawn, whether that is all, how many have been drawn, and until when to wait for the others."""

    look: Look
    drawing: Drawing
    making: Parts[None]
    is_made: bool = False
    count: int = 0
    is_whole: bool = False
    seen: int = 0
    until: float = 0.0


_handles: list[Any] = []
# The shader, made once; what is drawn, the newest last, over what it is to replace; and whether a bake is likely, so
# that the shader is to be made.
_shader: list[Any] = []
_drawn: list[_Drawn] = []
_expected: list[bool] = []
# How often viewports were drawn, and seconds that a piece takes when first drawn.
_count = [0]
_pace = [FIRST_DRAWING / 3]


def attach() -> None:
    """Draw in all 3D viewports; nothing where Blender has no window."""
    if not bpy.app.background:
        _handles.append(bpy.types.SpaceView3D.draw_handler_add(_draw, (), "WINDOW", "POST_VIEW"))


def detach() -> None:
    """Draw no more."""
    while _handles:
        bpy.types.SpaceView3D.draw_handler_remove(_handles.pop(), "WINDOW")
    for kept in (_drawn, _shader, _expected):
        kept.clear()


def expect(area: Any) -> None:
    """A bake is likely, as its panel is shown in this area: what draws its looks is made now, and not while it runs."""
    if not (_shader or _expected):
        _expected.append(True)
        area.tag_redraw()


def drawings() -> int:
    """How often viewports were drawn so far."""
    return _count[0]


def _draw() -> None:
    job, context = Job.current, bpy.context
    _count[0] += 1
    if not _shader and (_expected or job is not None):
        # Drivers translate a shader when it first draws, if only a point.
        _shader.append(_made())
        nothing = _of(NOTHING, _shader[0])
        whole(nothing.making)
        _show(nothing.drawing, context)
    if job is None:
        _drawn.clear()
        return
    # Another window may show another scene: what is drawn stays for those that show this one.
    if job.scene_name != context.scene.name:
        return
    if job.look is None:
        _drawn.clear()
    for drawn in _drawn:
        begun = time.perf_counter()
        _show(drawn.drawing[:drawn.count], context)
        if drawn.seen < drawn.count:
            # Some drivers begin later than they are told to: a drawing that took no time is not believed at once.
            _pace[0] = max((time.perf_counter() - begun) / (drawn.count - drawn.seen), _pace[0] / FASTER)
        drawn.seen = drawn.count


def is_ready(look: Look | None) -> bool:
    """Whether what draws a look is there; None needs nothing.

    Before a viewport was drawn once there is no shader, and nothing can be made ready.
    """
    return look is None or not _shader or bool(_drawn and _drawn[-1].look is look and _drawn[-1].is_whole)


def prepare(look: Look | None) -> bool:
    """Make some of what draws a look, apart from drawing it, so that neither keeps a window for long; whether there is
    something new to be drawn."""
    assert look is not None
    if not _drawn or _drawn[-1].look is not look:
        _drawn[:] = [*[drawn for drawn in _drawn if drawn.is_whole][-1:], _of(look, _shader[0])]
    newest = _drawn[-1]
    if newest.seen < newest.count and time.monotonic() < newest.until:
        return False
    if not newest.is_made:
        try:
            some(newest.making, PART)
        except StopIteration:
            newest.is_made = True
    new = max(1, int(FIRST_DRAWING / max(_pace[0], 1e-6)))
    ready = min(len(newest.drawing), newest.count + new)
    if newest.is_made and ready == len(newest.drawing):
        newest.is_whole, newest.count = True, ready
        _drawn[:] = [newest]
        return True
    if ready < newest.count + new:
        return False
    newest.count, newest.until = ready, time.monotonic() + PATIENCE
    return True


def _show(drawing: Drawing, context: Any) -> None:
    """Draw textures and batches into the region of a 3D viewport."""
    import gpu

    gpu.state.depth_test_set("LESS_EQUAL")
    gpu.state.depth_mask_set(True)
    shader = _shader[0]
    shader.bind()
    shader.uniform_float("view_projection", context.region_data.perspective_matrix)
    shader.uniform_float("nearer", NEARER)
    shader.uniform_float("exposure", 2.0**context.scene.view_settings.exposure)
    for texture, batch in drawing:
        shader.uniform_sampler("page", texture)
        batch.draw(shader)
    gpu.state.depth_mask_set(False)
    gpu.state.depth_test_set("NONE")


def _of(look: Look, shader: Any) -> _Drawn:
    drawing: Drawing = []
    return _Drawn(look, drawing, _making(look, shader, drawing))


def _making(look: Look, shader: Any, drawing: Drawing) -> Parts[None]:
    pages, firsts, counts = np.unique(look.page, return_index=True, return_counts=True)
    for page, first, count in zip(pages, firsts, counts, strict=True):
        texture = _texture(look.pages[page] if page >= 0 else np.ones((1, 1, 3), np.float32))
        for start in range(first, first + count, PIECE):
            yield
            drawing.append((texture, _batch(look, slice(start, min(start + PIECE, first + count)), shader)))


def _texture(pixels: Any) -> Any:
    import gpu

    height, width = pixels.shape[:2]
    rgba = np.ones((height, width, 4), np.float32)
    rgba[:, :, :3] = pixels
    values = gpu.types.Buffer("FLOAT", rgba.size, rgba.reshape(-1))
    return gpu.types.GPUTexture((width, height), format="RGBA16F", data=values)


def _batch(look: Look, piece: slice, shader: Any) -> Any:
    import gpu

    count = piece.stop - piece.start
    values = {"position": look.corners[piece], "uv": look.uv[piece], "colour": look.colour[piece]}
    points = gpu.types.GPUVertBuf(shader.format_calc(), 3 * count)
    for name, array in values.items():
        points.attr_fill(name, np.ascontiguousarray(array.reshape(3 * count, -1), np.float32))
    return gpu.types.GPUBatch(type="TRIS", buf=points)


def _made() -> Any:
    """The shader."""
    import gpu

    between = gpu.types.GPUStageInterfaceInfo("radiosity_look")
    between.smooth("VEC2", "uv_inside")
    between.smooth("VEC3", "colour_inside")
    info = gpu.types.GPUShaderCreateInfo()
    info.push_constant("MAT4", "view_projection")
    info.push_constant("FLOAT", "nearer")
    info.push_constant("FLOAT", "exposure")
    info.sampler(0, "FLOAT_2D", "page")
    for slot, (kind, name) in enumerate((("VEC3", "position"), ("VEC2", "uv"), ("VEC3", "colour"))):
        info.vertex_in(slot, kind, name)
    info.vertex_out(between)
    info.fragment_out(0, "VEC4", "shown")
    info.vertex_source(VERTEX)
    info.fragment_source(FRAGMENT)
    return gpu.shader.create_from_info(info)

"""Draws the light of a bake on its way over the surfaces in the 3D viewports; nothing of the file is touched."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np

from .job import Job
from .look import Look

# One point, of no light.
NOTHING = Look("", np.zeros((1, 3, 3), np.float32), np.zeros((1, 3, 2), np.float32), np.full(1, -1, np.int32),
               np.zeros((1, 3, 3), np.float32), np.zeros((1, 3), np.float32), ())
# How far the light lies before its surfaces, as part of the depth buffer's range.
NEARER = 2e-5

VERTEX = """
void main() {
    uv_inside = uv;
    colour_inside = colour;
    glow_inside = glow;
    gl_Position = view_projection * vec4(position, 1.0);
    gl_Position.z -= nearer * gl_Position.w;
}
"""
# Linear light as a display shows it (IEC 61966-2-1).
FRAGMENT = """
void main() {
    vec3 light = (texture(page, uv_inside).rgb * colour_inside + glow_inside) * exposure;
    vec3 low = light * 12.92;
    vec3 high = 1.055 * pow(max(light, vec3(1e-6)), vec3(1.0 / 2.4)) - 0.055;
    shown = vec4(mix(low, high, step(vec3(0.0031308), light)), 1.0);
}
"""


@dataclass(frozen=True)
class _Drawn:
    """A look on its way to the screen: a texture and a batch for each page."""

    look: Look
    parts: tuple[tuple[Any, Any], ...]


_handles: list[Any] = []
# The shader, made once; what was drawn last; and whether a bake is likely, so that the shader is to be made.
_shader: list[Any] = []
_drawn: list[_Drawn] = []
_expected: list[bool] = []


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


def _draw() -> None:
    job, context = Job.current, bpy.context
    if not _shader and (_expected or job is not None):
        # Drivers translate a shader when it first draws, if only a point.
        _shader.append(_made())
        _show(_parts(NOTHING, _shader[0]), context)
    if job is None:
        _drawn.clear()
        return
    # Another window may show another scene: what is drawn stays for those that show this one.
    if job.scene_name != context.scene.name:
        return
    if job.look is None:
        _drawn.clear()
    elif _drawn:
        _show(_drawn[0].parts, context)


def prepare(look: Look | None) -> bool:
    """Make what draws a look, apart from drawing it, so that neither keeps a window for long; whether it is new.

    Before a viewport was drawn once there is no shader, and nothing is made.
    """
    if look is None or not _shader or (_drawn and _drawn[0].look is look):
        return False
    _drawn[:] = [_Drawn(look, tuple(_parts(look, _shader[0])))]
    return True


def _show(parts: Iterable[tuple[Any, Any]], context: Any) -> None:
    """Draw textures and batches into the region of a 3D viewport."""
    import gpu

    gpu.state.depth_test_set("LESS_EQUAL")
    gpu.state.depth_mask_set(True)
    shader = _shader[0]
    shader.bind()
    shader.uniform_float("view_projection", context.region_data.perspective_matrix)
    shader.uniform_float("nearer", NEARER)
    shader.uniform_float("exposure", 2.0**context.scene.view_settings.exposure)
    for texture, batch in parts:
        shader.uniform_sampler("page", texture)
        batch.draw(shader)
    gpu.state.depth_mask_set(False)
    gpu.state.depth_test_set("NONE")


def _parts(look: Look, shader: Any) -> list[tuple[Any, Any]]:
    parts = []
    for page in np.unique(look.page):
        here = np.flatnonzero(look.page == page)
        pixels = look.pages[page] if page >= 0 else np.ones((1, 1, 3), np.float32)
        parts.append((_texture(pixels), _batch(look, here, shader)))
    return parts


def _texture(pixels: Any) -> Any:
    import gpu

    height, width = pixels.shape[:2]
    rgba = np.ones((height, width, 4), np.float32)
    rgba[:, :, :3] = pixels
    values = gpu.types.Buffer("FLOAT", rgba.size, rgba.reshape(-1))
    return gpu.types.GPUTexture((width, height), format="RGBA16F", data=values)


def _batch(look: Look, here: Any, shader: Any) -> Any:
    import gpu

    values = {"position": look.corners[here], "uv": look.uv[here], "colour": look.colour[here],
              "glow": np.repeat(look.glow[here][:, None], 3, axis=1)}
    points = gpu.types.GPUVertBuf(shader.format_calc(), 3 * len(here))
    for name, array in values.items():
        points.attr_fill(name, np.ascontiguousarray(array.reshape(3 * len(here), -1), np.float32))
    return gpu.types.GPUBatch(type="TRIS", buf=points)


def _made() -> Any:
    """The shader."""
    import gpu

    between = gpu.types.GPUStageInterfaceInfo("radiosity_look")
    between.smooth("VEC2", "uv_inside")
    between.smooth("VEC3", "colour_inside")
    between.smooth("VEC3", "glow_inside")
    info = gpu.types.GPUShaderCreateInfo()
    info.push_constant("MAT4", "view_projection")
    info.push_constant("FLOAT", "nearer")
    info.push_constant("FLOAT", "exposure")
    info.sampler(0, "FLOAT_2D", "page")
    for slot, (kind, name) in enumerate((("VEC3", "position"), ("VEC2", "uv"), ("VEC3", "colour"),
                                         ("VEC3", "glow"))):
        info.vertex_in(slot, kind, name)
    info.vertex_out(between)
    info.fragment_out(0, "VEC4", "shown")
    info.vertex_source(VERTEX)
    info.fragment_source(FRAGMENT)
    return gpu.shader.create_from_info(info)

"""A twin as plain arrays, for programs that know no .blend: triangles, flat colours, emission, and the lumels.

What can be given to any path tracer alike: diffuse reflectance and emission that are constant over a triangle, area
lamps, and a sky of one colour. A twin that holds more (textures, suns, sky pictures) is refused with its reason.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from radiosity.solver.area_lamp import Area
from radiosity.solver.lumels import lumels as list_lumels
from radiosity.solver.scene import Scene
from radiosity.solver.settings import Settings

from ..cycles.blender import open_blend
from ..cycles.scenes import Case
from .environment import PeerError

Float = NDArray[np.floating[Any]]

FILE = "twin_arrays.npz"
# Corners of the polygon that stands for a round lamp: its outline strays by .1 % of the radius.
LAMP_CORNERS = 64


def write(case: Case, known: dict[str, Any], folder: Path) -> Path:
    """Write a twin's arrays to `folder`.

    Positions are in metres, relative to the middle of the scene's box.

    corners (t, 3, 3), reflectance (t, 3), radiance (t, 3) of each side of a triangle, surface (t,) its object;
    lamp_corners (l, 3, 3), lamp_radiance (l, 3): triangles of lamps, which shine where their corners turn left;
    sky (3,); layout (t, 3, 2), the corners in their image; page_of_surface (objects,), -1 where none;
    lumel_triangle (n,), lumel_weight (n, 2), lumel_step (n, 2, 2), lumel_normal (n, 3), lumel_page (n,) and
    lumel_pixel (n,) as `solver.lumels` has them; page_names.

    Raises
    ------
    PeerError
        If the twin holds what can't be handed on.
    """
    settings = Settings(uv_layer=known["uv_layer"], resolution=known["resolution"], margin=0,
                        only=tuple(row["object"] for row in known["receivers"]))
    scene = _exported(case, settings)
    lamps, lamp_radiance = _lamps(scene)
    found = list_lumels(scene, settings, [])
    owner = np.zeros(len(scene.triangles), np.int32)
    for index, surface in enumerate(scene.surfaces):
        owner[surface.triangles] = index
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / FILE
    np.savez(
        path,
        corners=(scene.vertices - scene.origin)[scene.triangles].astype(np.float32),
        reflectance=np.asarray(scene.reflectance),
        radiance=np.asarray(scene.emission) / np.float32(np.pi),
        surface=owner,
        lamp_corners=(lamps - scene.origin).astype(np.float32),
        lamp_radiance=lamp_radiance,
        sky=_sky(scene),
        page_of_surface=found.page_of_surface,
        layout=_layout(scene, found.uv),
        lumel_triangle=found.receivers.triangle,
        lumel_weight=found.receivers.barycentric,
        lumel_step=found.receivers.footprint,
        lumel_normal=found.receivers.normal,
        lumel_page=found.page,
        lumel_pixel=found.pixel,
        page_names=np.array([scene.surfaces[int(np.flatnonzero(found.page_of_surface == page)[0])].name
                             for page in range(len(found.pages))]),
    )
    return path


def images(values: Float, arrays: Any, resolution: int) -> dict[str, Float]:
    """(n, 3) values of the lumels as images (resolution, resolution, 3) by receiver, 0 where there is no lumel."""
    found = {}
    for page, name in enumerate(arrays["page_names"]):
        image = np.zeros((resolution * resolution, 3), np.float32)
        mine = arrays["lumel_page"] == page
        image[arrays["lumel_pixel"][mine]] = values[mine]
        found[str(name)] = image.reshape(resolution, resolution, 3)
    return found


def _layout(scene: Scene, layouts: tuple[Float | None, ...]) -> Float:
    uv = np.zeros((len(scene.triangles), 3, 2), np.float32)
    for surface, layout in zip(scene.surfaces, layouts, strict=True):
        if layout is not None:
            uv[surface.triangles] = layout
    return uv


def _exported(case: Case, settings: Settings) -> Scene:
    bpy = open_blend(case.folder / "twin.blend")
    from radiosity import radiosity_addon
    from radiosity.radiosity_addon.export import export_scene

    registered = hasattr(bpy.types.Object, "radiosity")
    if not registered:
        radiosity_addon.register()
    try:
        return export_scene(bpy.context.scene, bpy.context.view_layer, settings, []).scene
    finally:
        if not registered:
            radiosity_addon.unregister()


def _lamps(scene: Scene) -> tuple[Float, Float]:
    """Triangles (l, 3, 3) of the area lamps, world space, and their radiance (l, 3)."""
    corners, radiance = [np.empty((0, 3, 3))], [np.empty((0, 3), np.float32)]
    for lamp in scene.lights:
        if not isinstance(lamp, Area) or lamp.spread < np.pi:
            raise PeerError(f"the lamp {lamp.name!r} is no plain area lamp: only those are handed on")
        outline = lamp.outline(LAMP_CORNERS if lamp.round else 4)
        fan = np.stack([np.broadcast_to(outline[0], outline[1:-1].shape), outline[1:-1], outline[2:]], axis=1)
        corners.append(fan)
        radiance.append(np.broadcast_to(lamp.flux / np.float32(np.pi * lamp.area), (len(fan), 3)))
    return np.concatenate(corners), np.concatenate(radiance)


def _sky(scene: Scene) -> Float:
    for name in ("reflectance_texture", "emission_texture", "opacity_texture"):
        if (np.asarray(getattr(scene, name)) >= 0).any():
            raise PeerError(f"the {name.removesuffix('_texture')} varies by a texture: only flat colours are handed on")
    if (np.asarray(scene.opacity) < 1).any():
        raise PeerError("some triangles let light through: only opaque ones are handed on")
    picture = np.asarray(scene.sky.radiance)
    colours = picture.reshape(-1, 3)
    if np.ptp(colours, axis=0).max() > 1e-6 * max(float(colours.max()), 1e-30):
        raise PeerError("the sky is a picture: only a sky of one colour is handed on")
    return np.asarray(colours[0], np.float32)

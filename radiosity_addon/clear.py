"""Takes everything that we made out of the .blend."""

from __future__ import annotations

import bpy

from . import patch_mesh, preview, results, view_settings
from .baked_images import MARK
from .mesh_layers import remove_ours


def clear() -> tuple[int, int]:
    """Remove our views, images, UV maps, colour attributes and custom properties; counts of images and of meshes."""
    preview.hide()
    patch_mesh.remove()
    for scene in bpy.data.scenes:
        if scene.library is None:
            view_settings.forget(scene)
    meshes = sum(remove_ours(mesh) for mesh in bpy.data.meshes if mesh.library is None)
    for item in bpy.data.objects:
        if item.library is None:
            results.forget(item)
    ours = [image for image in bpy.data.images if image.library is None and MARK in image]
    for image in ours:
        bpy.data.images.remove(image)
    return len(ours), meshes

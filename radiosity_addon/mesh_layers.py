"""UV maps and colour attributes of ours on a user's mesh, beside the user's own, which are never touched."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..solver.errors import OutputError

Float = NDArray[np.floating[Any]]

UV_MAP = "UVMap_Lightmap"
COLOURS = "Radiosity"
# Custom properties of a mesh: the name of the UV map, and names of the colour attributes, that we made.
UV_MARK = "radiosity_uv_map"
COLOURS_MARK = "radiosity_colours"
# Custom property of a mesh: the name of its empty first UV map, where we made that too.
FILLER_MARK = "radiosity_empty_map"
# The map that is put into slot 0 where a mesh has none, so that ours stands in slot 1, where engines look for it.
FILLER = "UVMap"
# Blender's limit for a mesh.
MOST_UV_MAPS = 8


def put_uv(mesh: Any, uv: Float, name: str) -> str:
    """Store coordinates (corners, 2) in the UV map of ours, made if it is not there; returns its name.

    The active maps stay what they are. A mesh without any map gets an empty first one, which shows textures as no map
    does: engines read the lightmap from the second.

    Raises
    ------
    OutputError
        If the mesh has no room for another map. `name` is its object's, for the message.
    """
    layers = mesh.uv_layers
    values = np.ascontiguousarray(uv, np.float32).ravel()
    ours = mesh.get(UV_MARK, "")
    if ours not in layers:
        if len(layers) >= MOST_UV_MAPS:
            raise OutputError(f"object {name!r}: its mesh has {len(layers)} UV maps, and Blender takes no more: "
                              "remove one, or bake with one of them (--uv-layer)")
        active, rendered = layers.active_index, next((layer.name for layer in layers if layer.active_render), "")
        if not len(layers):
            filler = layers.new(name=FILLER, do_init=False)
            mesh[FILLER_MARK] = filler.name
            filler.uv.foreach_set("vector", np.zeros_like(values))
            active, rendered = 0, filler.name
        ours = layers.new(name=UV_MAP, do_init=False).name
        mesh[UV_MARK] = ours
        layers.active_index = active
        layers[rendered].active_render = True
    # Written through `uv_layers`, the last undo step would have the new coordinates too (Blender 4.3).
    mesh.attributes[ours].data.foreach_set("vector", values)
    mesh.update()
    return str(ours)


def put_colours(mesh: Any, name: str, colours: Float) -> str:
    """Store colours (corners, 3) in a float colour attribute of ours on the corners; returns its name."""
    known = mesh.get(COLOURS_MARK)
    names: dict[str, str] = dict(known.items()) if known is not None else {}
    rgba = np.ones((len(mesh.loops), 4), np.float32)
    rgba[:, :3] = colours
    attributes = mesh.color_attributes
    attribute = attributes.get(names.get(name, ""))
    if attribute is None or attribute.data_type != "FLOAT_COLOR" or attribute.domain != "CORNER":
        active, rendered = attributes.active_color_index, attributes.render_color_index
        attribute = attributes.new(name, "FLOAT_COLOR", "CORNER")
        mesh[COLOURS_MARK] = {**names, name: attribute.name}
        if active >= 0:
            attributes.active_color_index = active
        if rendered >= 0:
            attributes.render_color_index = rendered
    attribute.data.foreach_set("color", rgba.ravel())
    mesh.update()
    return str(attribute.name)


def remove_ours(mesh: Any) -> bool:
    """Take our UV map and colour attributes off a mesh; whether there was any."""
    found = False
    uv_map = mesh.get(UV_MARK, "")
    if uv_map in mesh.uv_layers:
        mesh.uv_layers.remove(mesh.uv_layers[uv_map])
        found = True
    known = mesh.get(COLOURS_MARK)
    for name in (list(known.values()) if known is not None else []):
        attribute = mesh.color_attributes.get(name)
        if attribute is not None:
            mesh.color_attributes.remove(attribute)
            found = True
    _remove_filler(mesh)
    for mark in (UV_MARK, COLOURS_MARK, FILLER_MARK):
        if mark in mesh:
            del mesh[mark]
    return found


def _remove_filler(mesh: Any) -> None:
    """Take our empty map away, if it is the only one and nobody has used it since."""
    name = mesh.get(FILLER_MARK, "")
    if len(mesh.uv_layers) != 1 or name not in mesh.uv_layers:
        return
    values = np.empty(len(mesh.loops) * 2, np.float32)
    mesh.uv_layers[name].uv.foreach_get("vector", values)
    if not values.any():
        mesh.uv_layers.remove(mesh.uv_layers[name])

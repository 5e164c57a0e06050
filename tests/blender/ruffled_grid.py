"""A ruffled grid of 1.2 m with a UV map, 24 x 24 lumels: what we export of its material, and what Cycles bakes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import bpy
import numpy as np
from radiosity.solver.scene import Scene

SIDE = 24
GRID = 6
WIDTH = 1.2
TOLERANCE = 0.01
Make = Callable[[Any, Any], Any]


def ruffled_grid(build: Any) -> Any:
    """A ruffled grid with a UV map, smooth, under a sun."""
    build.sun()
    across = np.linspace(0, 1, GRID + 1)
    x, y = np.meshgrid(across, across)
    height = 0.08 * np.sin(5 * x + 2) * np.cos(4 * y)
    points = np.column_stack([WIDTH * x.ravel(), WIDTH * y.ravel(), height.ravel()])
    low = np.arange(GRID * (GRID + 1)).reshape(GRID, GRID + 1)[:, :-1].ravel()
    item = build.mesh("Grid", points, np.column_stack([low, low + 1, low + GRID + 2, low + GRID + 1]).tolist())
    layer = item.data.uv_layers.new(name="Paint")
    corner = np.array([loop.vertex_index for loop in item.data.loops])
    layer.uv.foreach_set("vector", np.column_stack([x.ravel(), y.ravel()])[corner].astype(np.float32).ravel())
    item.data.polygons.foreach_set("use_smooth", np.ones(GRID * GRID, bool))
    return item


def diffuse(build: Any, make: Make) -> Any:
    """A Diffuse BSDF whose colour is what `make(tree, material)` gives."""
    material = build.material("Kind", (1, 1, 1))
    tree = material.node_tree
    node = tree.nodes.new("ShaderNodeBsdfDiffuse")
    tree.links.new(make(tree, material), node.inputs["Color"])
    tree.links.new(node.outputs[0], tree.get_output_node("CYCLES").inputs["Surface"])
    return material


def node(tree: Any, kind: str, inputs: dict[Any, Any] | None = None, **settings: Any) -> Any:
    """A new node with settings, and inputs that are values or sockets."""
    made = tree.nodes.new(f"ShaderNode{kind}")
    for name, value in settings.items():
        setattr(made, name, value)
    for name, value in (inputs or {}).items():
        if isinstance(value, bpy.types.NodeSocket):
            tree.links.new(value, made.inputs[name])
        else:
            made.inputs[name].default_value = value
    return made


def cycles(item: Any, kind: str) -> np.ndarray:
    """(24, 24, 3): Cycles' bake of the item's only material."""
    scene = bpy.context.scene
    before = scene.render.engine
    scene.render.engine = "CYCLES"
    scene.cycles.device, scene.cycles.samples = "CPU", 1
    scene.cycles.use_adaptive_sampling = scene.cycles.use_denoising = False
    image = bpy.data.images.new("Reference", SIDE, SIDE, float_buffer=True)
    image.colorspace_settings.name = "Non-Color"
    tree = item.data.materials[0].node_tree
    tree.nodes.active = tree.nodes.new("ShaderNodeTexImage")
    tree.nodes.active.image = image
    bpy.context.view_layer.objects.active = item
    item.select_set(True)
    bpy.ops.object.bake(type=kind, pass_filter={"COLOR"}, margin=0, uv_layer="Paint")
    scene.render.engine = before
    tree.nodes.remove(tree.nodes.active)
    return np.array(image.pixels[:]).reshape(SIDE, SIDE, 4)[..., :3]


def ours(scene: Scene, look: Callable[..., Any]) -> np.ndarray:
    """(24, 24, 3): what the exported scene has in the middle of each lumel; `look` asks for it at u, v of triangles."""
    middle = (np.arange(SIDE) + 0.5) / SIDE * WIDTH
    x, y = (part.ravel() for part in np.meshgrid(middle, middle))
    corner = np.asarray(scene.vertices)[scene.triangles][..., :2]
    a, ab, ac = corner[:, 0], corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    determinant = ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0]
    off = np.stack([x, y], axis=1)[:, None] - a
    u = (off[..., 0] * ac[:, 1] - off[..., 1] * ac[:, 0]) / determinant
    v = (ab[:, 0] * off[..., 1] - ab[:, 1] * off[..., 0]) / determinant
    triangle = np.argmax(np.minimum(np.minimum(u, v), 1 - u - v), axis=1)
    rows = np.arange(len(triangle))
    found = look(triangle, u[rows, triangle].astype(np.float32), v[rows, triangle].astype(np.float32))
    return np.asarray(found).reshape(SIDE, SIDE, -1)


def assert_agree(found: np.ndarray, expected: np.ndarray) -> None:
    assert expected.mean() > 0.02
    error = np.sqrt(((found - expected) ** 2).mean()) / expected.mean()
    assert error < TOLERANCE, f"{error:.3%}: mean {found.mean():.4f}, by Cycles {expected.mean():.4f}"


def checked_image(build: Any, alpha: Any = 1.0, is_float: bool = True) -> Any:
    """16 x 16 pixels of smooth colour; alpha may be an array."""
    y, x = np.mgrid[0:16, 0:16] / 16
    rgba = np.stack([0.5 + 0.4 * np.sin(7 * x), 0.5 + 0.4 * np.cos(5 * y), 0.3 + 0.5 * x * y, x * 0 + 1], axis=2)
    rgba[..., 3] = alpha
    return build.image("Picture", rgba, is_float=is_float)

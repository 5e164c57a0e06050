"""What tests of the addon share: an empty Blender file with the addon registered, and a hand to build things in it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy", reason="the bpy wheel is not installed")

UNIT_SQUARE = ((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0))


class Builder:
    """Builds meshes, materials and lamps in the open file."""

    def mesh(self, name: str, points: Any = UNIT_SQUARE, faces: Any = ((0, 1, 2, 3),), material: Any = None) -> Any:
        """An object of its own mesh; `material` may be a base colour."""
        data = bpy.data.meshes.new(name)
        data.from_pydata([tuple(point) for point in points], [], [tuple(face) for face in faces])
        if material is not None:
            data.materials.append(self.material(f"{name} paint", material) if isinstance(material, tuple) else material)
        return self.object(name, data)

    def object(self, name: str, data: Any) -> Any:
        """An object of any data."""
        made = bpy.data.objects.new(name, data)
        bpy.context.scene.collection.objects.link(made)
        return made

    def cube(self, name: str, side: float = 1.0, **options: Any) -> Any:
        """A cube about the origin, faces outward."""
        h = side / 2
        points = [(x, y, z) for z in (-h, h) for y in (-h, h) for x in (-h, h)]
        faces = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
        return self.mesh(name, points, faces, **options)

    def material(self, name: str, colour: tuple[float, ...], **inputs: Any) -> Any:
        """A Principled material of a base colour, with other inputs by name."""
        made = bpy.data.materials.new(name)
        if made.node_tree is None:
            made.use_nodes = True
        shader = self.shader(made)
        shader.inputs["Base Color"].default_value = (*colour, 1.0)
        for key, value in inputs.items():
            shader.inputs[key.replace("_", " ")].default_value = value
        return made

    def shader(self, material: Any) -> Any:
        """The Principled node of a material."""
        return next(node for node in material.node_tree.nodes if node.bl_idname == "ShaderNodeBsdfPrincipled")

    def image(self, name: str, rgba: Any, *, is_float: bool = False) -> Any:
        """An image of (h, w, 4) values as they are stored."""
        values = np.asarray(rgba, np.float32)
        made = bpy.data.images.new(name, values.shape[1], values.shape[0], alpha=True, float_buffer=is_float)
        made.pixels.foreach_set(values.ravel())
        made.pack()
        return made

    def textured(self, name: str, image: Any) -> Any:
        """A Principled material whose base colour is an image."""
        made = self.material(name, (1.0, 1.0, 1.0))
        node = made.node_tree.nodes.new("ShaderNodeTexImage")
        node.image = image
        made.node_tree.links.new(node.outputs["Color"], self.shader(made).inputs["Base Color"])
        return made

    def sun(self, strength: float = 1.0) -> Any:
        """A sun that shines straight down."""
        data = bpy.data.lights.new("Sun", "SUN")
        data.energy = strength
        return self.object("Sun", data)

    def world(self, colour: tuple[float, ...]) -> Any:
        """A world of one colour, strength 1."""
        made = bpy.data.worlds.new("World")
        bpy.context.scene.world = made
        made.color = colour
        if made.node_tree is None:
            made.use_nodes = True
        background = next(node for node in made.node_tree.nodes if node.bl_idname == "ShaderNodeBackground")
        background.inputs["Color"].default_value = (*colour, 1.0)
        background.inputs["Strength"].default_value = 1.0
        return made


@pytest.fixture
def build() -> Iterator[Builder]:
    """An empty file, a black world, the addon registered."""
    from radiosity import radiosity_addon

    bpy.ops.wm.read_factory_settings(use_empty=True)
    radiosity_addon.register()
    builder = Builder()
    builder.world((0.0, 0.0, 0.0))
    yield builder
    radiosity_addon.unregister()


@pytest.fixture
def grid(build: Any) -> Any:
    """A ruffled grid under a sun, for materials against Cycles (see `ruffled_grid.py`)."""
    from radiosity.tests.blender.ruffled_grid import ruffled_grid

    return ruffled_grid(build)


@pytest.fixture
def stage() -> Any:
    """A black world with two receivers and a plate above one of them, for light against Cycles (see `stage.py`)."""
    from radiosity.tests.blender.stage import set_stage

    return set_stage()


@pytest.fixture
def sunny(build: Any) -> Iterator[Any]:
    """The operators, a sun of 1 W/m2 straight down, and settings for the quickest bake; yields `build`."""
    from radiosity import operators

    operators.register()
    build.sun()
    settings = bpy.context.scene.radiosity
    settings.error, settings.resolution, settings.pack = 0.2, 32, True
    yield build
    operators.unregister()

"""Images on surfaces lie where Cycles lays them, and darken as theirs do: against its DIFFUSE bake of colour alone."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from radiosity.solver.geometry import Geometry
from radiosity.tests.blender.ruffled_grid import assert_agree, checked_image, cycles, diffuse, node, ours
from radiosity.tests.blender.stage import export


def _box(tree, picture):
    place = node(tree, "TexCoord").outputs["Object"]
    return node(tree, "TexImage", {"Vector": place}, image=picture, projection="BOX", projection_blend=0.3)


def _turned(tree, picture):
    place = node(tree, "Mapping", {"Vector": node(tree, "TexCoord").outputs["UV"], "Rotation": (0.5, 0.3, 0.7)})
    return node(tree, "TexImage", {"Vector": place.outputs[0]}, image=picture)


def _mapped(kind, **inputs):
    def make(tree, picture):
        place = node(tree, "Mapping", {"Vector": node(tree, "TexCoord").outputs["UV"], **inputs}, vector_type=kind)
        return node(tree, "TexImage", {"Vector": place.outputs[0]}, image=picture)
    make.__name__ = f"_{kind.lower()}_{inputs['Scale'][1]:g}"
    return make


def _unlinked(tree, picture):
    place = node(tree, "Mapping", {"Location": (0.3, 0.6, 0)})
    return node(tree, "TexImage", {"Vector": place.outputs[0]}, image=picture)


def _clipped(tree, picture):
    place = node(tree, "Mapping", {"Vector": node(tree, "TexCoord").outputs["UV"], "Scale": (1.7, 1.7, 1)})
    return node(tree, "TexImage", {"Vector": place.outputs[0]}, image=picture, extension="EXTEND")


def _plain(tree, picture):
    return node(tree, "TexImage", image=picture)


@pytest.mark.parametrize("make", [
    _box, _turned, _clipped, _plain, _unlinked,
    *(_mapped(kind, Rotation=(0, 0, 0.7), Scale=(1.7, 0.6, 1)) for kind in ("POINT", "TEXTURE", "VECTOR", "NORMAL")),
    *(_mapped(kind, Rotation=(0, 0, 0.7), Scale=(1.7, 0, 1)) for kind in ("POINT", "TEXTURE")),
], ids=lambda make: make.__name__.strip("_"))
def test_an_image_lies_where_cycles_lays_it(build, grid, make):
    # An image of bytes, whose layout alone may ask for Cycles.
    picture = checked_image(build, is_float=False)
    grid.data.materials.append(diffuse(build, lambda tree, _: make(tree, picture).outputs["Color"]))
    scene = export([])
    assert_agree(ours(scene, Geometry(scene).reflectance), cycles(grid, "DIFFUSE"))


@pytest.mark.parametrize("reader", ["Attribute", "UVMap"])
@pytest.mark.parametrize(("kind", "domain"), [
    ("FLOAT_VECTOR", "CORNER"), ("FLOAT2", "POINT"), ("FLOAT_VECTOR", "FACE")])
def test_an_image_is_laid_out_by_any_vectors_of_the_mesh(build, grid, kind, domain, reader):
    # What geometry nodes store as UVs is seldom a UV map: random vectors. Exact answer: Cycles' COLOR bake.
    layer = grid.data.attributes.new("Laid", kind, domain)
    width = 2 if kind == "FLOAT2" else 3
    values = np.random.default_rng(2).uniform(0, 1, (len(layer.data), width)).astype(np.float32)
    layer.data.foreach_set("vector", values.ravel())
    named = {"attribute_name": "Laid"} if reader == "Attribute" else {"uv_map": "Laid"}

    def laid(tree: Any, _material: Any) -> Any:
        place = node(tree, reader, **named)
        return node(tree, "TexImage", {"Vector": place.outputs["Vector" if reader == "Attribute" else "UV"]},
                    image=checked_image(build)).outputs["Color"]
    grid.data.materials.append(diffuse(build, laid))
    warnings: list[dict[str, Any]] = []
    scene = export(warnings)
    assert_agree(ours(scene, Geometry(scene).reflectance), cycles(grid, "DIFFUSE"))
    assert warnings == []


@pytest.mark.parametrize("mode", ["STRAIGHT", "CHANNEL_PACKED"])
@pytest.mark.parametrize("is_float", [False, True])
def test_an_images_alpha_darkens_its_colour_as_in_cycles(build, grid, mode, is_float):
    # An image with alpha from 0 to 1, of which the colour alone is used: Cycles multiplies it by alpha, unless packed.
    picture = checked_image(build, np.linspace(0, 1, 16), is_float)
    picture.alpha_mode = mode
    grid.data.materials.append(diffuse(build, lambda tree, _: _plain(tree, picture).outputs["Color"]))
    scene = export([])
    assert_agree(ours(scene, Geometry(scene).reflectance), cycles(grid, "DIFFUSE"))

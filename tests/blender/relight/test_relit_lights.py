"""Relight follows lights by their parts: channels of patterns, instances, libraries' lamps, nodes that give light."""

from __future__ import annotations

from typing import Any

import bpy
import pytest
from radiosity.radiosity_addon.relight_panel import kept_groups
from radiosity.radiosity_addon.relight_request import kept_in
from radiosity.tests.blender.relight.hand import lamp, pixels, refused, relight
from radiosity.tests.blender.stage import empty_tree


def patterned_lamp(stage: Any) -> Any:
    """A point lamp whose colour is .6 + .4 n of its direction n."""
    made = stage.object("Lamp", bpy.data.lights.new("Lamp", "POINT"))
    made.location, made.data.energy = (0.3, 0.2, 0.8), 20
    made.data.use_nodes = True
    tree = empty_tree(made.data)
    emission, output, place, step = (tree.nodes.new(f"ShaderNode{name}")
                                     for name in ("Emission", "OutputLight", "TexCoord", "VectorMath"))
    step.operation = "MULTIPLY_ADD"
    step.inputs[1].default_value, step.inputs[2].default_value = (0.4,) * 3, (0.6,) * 3
    tree.links.new(place.outputs["Normal"], step.inputs[0])
    tree.links.new(step.outputs[0], emission.inputs["Color"])
    tree.links.new(emission.outputs[0], output.inputs["Surface"])
    return made


def instanced_lamp(stage: Any) -> Any:
    """A point lamp that two empties show."""
    made = bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "POINT"))
    made.data.energy = 20
    both = bpy.data.collections.new("Lamps")
    both.objects.link(made)
    for number in range(2):
        shown = stage.object(f"Shown {number}", None)
        shown.instance_type, shown.instance_collection, shown.location = "COLLECTION", both, (number, 0.5, 1)
    return made


@pytest.mark.parametrize("make", [patterned_lamp, instanced_lamp])
def test_all_parts_of_a_lamp_follow(stage, make):
    # A lamp of several colours by direction, or at two places. Exact answer: relit with nothing changed, the bake; with
    # three times the power and half the green, three times as bright in red and blue, 1.5 times in green.
    bpy.data.objects["Sun"].hide_render = True
    made = make(stage)
    bpy.ops.radiosity.bake()
    before = pixels()
    assert before.mean(axis=0).min() > 0.1
    relight()
    assert pixels() == pytest.approx(before, rel=1e-3)
    made.data.energy, made.data.color = 60, (1, 0.5, 1)
    relight()
    assert pixels() == pytest.approx(before * [3, 1.5, 3], rel=1e-3)


@pytest.mark.parametrize(("mode", "names"), [("lamp", ["Sun", "Sun [library.blend]"]),
                                             ("collection", ["Key", "Lamps"])])
def test_a_librarys_lamp_of_the_same_name_is_another(stage, tmp_path, mode, names):
    # A sun of 1 W/m2 in a collection, and one of 2 of the same name, linked from another file. Exact answer: 3 W/m2,
    # and 7 with the first one made 5.
    sun = bpy.data.objects["Sun"]
    lamp().energy = 2
    bpy.data.libraries.write(str(tmp_path / "library.blend"), {sun})
    lamp().energy = 1
    key = bpy.data.collections.new("Key")
    bpy.context.scene.collection.children.link(key)
    bpy.context.scene.collection.objects.unlink(sun)
    key.objects.link(sun)
    with bpy.data.libraries.load(str(tmp_path / "library.blend"), link=True) as (_, into):
        into.objects = ["Sun"]
    bpy.context.scene.collection.objects.link(into.objects[0])
    bpy.ops.radiosity.bake(options=f"--groups {mode}")
    assert pixels() == pytest.approx(3, rel=0.01)
    assert sorted(group.name for group in kept_groups(kept_in(bpy.context.scene))) == names
    sun.data.energy = 5
    relight()
    assert pixels() == pytest.approx(7, rel=0.01)


def emissions(tree: Any, kind: str, joined: str) -> list[Any]:
    """Two nodes that give light. The second is linked to nothing ("loose"), is for the camera alone ("camera": by Mix
    Shader, "strength": by its strength), or is added to the first ("added").
    """
    first, second = (tree.nodes.new(f"ShaderNode{kind}") for _ in range(2))
    output = next(node for node in tree.nodes if node.bl_idname.startswith("ShaderNodeOutput"))
    is_camera = tree.nodes.new("ShaderNodeLightPath").outputs["Is Camera Ray"]
    shown = first
    if joined != "loose":
        shown = tree.nodes.new("ShaderNodeMixShader" if joined == "camera" else "ShaderNodeAddShader")
        shaders = [socket for socket in shown.inputs if socket.type == "SHADER"]
        for node, socket in zip((first, second), shaders, strict=True):
            tree.links.new(node.outputs[0], socket)
    if joined == "camera":
        tree.links.new(is_camera, shown.inputs[0])
    elif joined == "strength":
        tree.links.new(is_camera, second.inputs["Strength"])
    tree.links.new(shown.outputs[0], output.inputs["Surface"])
    return [first, second]


def two_emissions(stage: Any, kind: str, joined: str) -> list[Any]:
    """`emissions` of a panel over the square, or of the world."""
    bpy.data.objects["Sun"].hide_render = True
    if kind == "Background":
        tree = empty_tree(bpy.context.scene.world)
        tree.nodes.new("ShaderNodeOutputWorld")
    else:
        glow = stage.material("Glow", (0, 0, 0))
        tree = glow.node_tree
        stage.mesh("Panel", [(0, 0, 0.5), (0, 1, 0.5), (1, 1, 0.5), (1, 0, 0.5)], material=glow)
    return emissions(tree, kind, joined)


@pytest.mark.parametrize("kind", ["Emission", "Background"])
@pytest.mark.parametrize("joined", ["loose", "camera", "strength"])
def test_nodes_that_give_no_light_are_no_part_of_it(stage, kind, joined):
    # Two nodes of a material or world, of which one gives light; the other's color changed, then the one's strength
    # tripled. Exact answer: the bake, then three times as bright.
    first, second = two_emissions(stage, kind, joined)
    bpy.ops.radiosity.bake(options="--only Square")
    before = pixels()
    assert before.mean() > 0.1
    second.inputs["Color"].default_value = (0.1, 0.2, 0.9, 1)
    relight()
    assert pixels() == pytest.approx(before, rel=1e-3)
    first.inputs["Strength"].default_value *= 3
    relight()
    assert pixels() == pytest.approx(before * 3, rel=1e-3)


@pytest.mark.parametrize(("kind", "name"), [("Emission", "material 'Glow'"), ("Background", "world 'World'")])
def test_nodes_that_give_light_together_are_changed_together(stage, kind, name):
    # Two nodes of a material or world that are added. Exact answer: both tripled, three times as bright; one alone is
    # refused, and told what to do.
    both = two_emissions(stage, kind, "added")
    bpy.ops.radiosity.bake(options="--only Square")
    before = pixels()
    for node in both:
        node.inputs["Strength"].default_value *= 3
    relight()
    assert pixels() == pytest.approx(before * 3, rel=1e-3)
    both[0].inputs["Strength"].default_value = 1
    refused(f"the parts of {name} that give light were changed each otherwise, and their light is kept together: "
            "change them by the same factor, or bake again$")

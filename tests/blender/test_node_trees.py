"""How node trees are followed: through groups, past what is muted. Exact answers: what Cycles makes of these nodes."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np
import pytest
from radiosity.tests.blender.stage import emission_nodes, export, exported, lamp, read_world, warned

OWN = 0.8


@pytest.fixture
def colour(build):
    """The colour socket, .8, of the Diffuse BSDF on a square under a sun."""
    build.sun()
    material = build.material("Paint", (1, 1, 1))
    tree = material.node_tree
    diffuse = tree.nodes.new("ShaderNodeBsdfDiffuse")
    diffuse.inputs["Color"].default_value = (OWN, OWN, OWN, 1)
    tree.links.new(diffuse.outputs[0], tree.get_output_node("CYCLES").inputs["Surface"])
    build.mesh("Square", material=material)
    return diffuse.inputs["Color"]


def grey_node(tree: Any, grey: float) -> Any:
    made = tree.nodes.new("ShaderNodeRGB")
    made.outputs[0].default_value = (grey, grey, grey, 1)
    return made


def new_group(inputs: tuple[str, ...] = (), kind: str = "Color") -> tuple[Any, Any, Any]:
    """A group of inputs and one output, with its Group Input and Group Output nodes."""
    group = bpy.data.node_groups.new("Group", "ShaderNodeTree")
    for name in inputs:
        group.interface.new_socket(name, in_out="INPUT", socket_type="NodeSocketColor")
    group.interface.new_socket("Out", in_out="OUTPUT", socket_type=f"NodeSocket{kind}")
    return group, group.nodes.new("NodeGroupInput"), group.nodes.new("NodeGroupOutput")


def group_node(tree: Any, group: Any, **inputs: Any) -> Any:
    made = tree.nodes.new("ShaderNodeGroup")
    made.node_tree = group
    for name, value in inputs.items():
        made.inputs[name].default_value = (*value, 1)
    return made


def _node(tree, target):
    made = grey_node(tree, 0.1)
    made.mute = True
    tree.links.new(made.outputs[0], target)


def _link(tree, target):
    tree.links.new(grey_node(tree, 0.1).outputs[0], target).is_muted = True


def _image(tree, target):
    made = tree.nodes.new("ShaderNodeTexImage")
    made.image, made.mute = bpy.data.images.new("Black", 4, 4), True
    tree.links.new(made.outputs[0], target)


def _group(tree, target):
    group, _, end = new_group()
    group.links.new(grey_node(group, 0.1).outputs[0], end.inputs[0])
    made = group_node(tree, group)
    made.mute = True
    tree.links.new(made.outputs[0], target)


def _node_that_passes_on(tree, target):
    # A muted node hands on what comes in, which is nothing here.
    made = tree.nodes.new("ShaderNodeHueSaturation")
    made.inputs["Color"].default_value, made.mute = (0.1, 0.1, 0.1, 1), True
    tree.links.new(made.outputs[0], target)


def _among_others(tree, target):
    # A mask made by nodes is evaluated by Cycles, and with it the colour: half of it is black.
    _node_that_passes_on(tree, target)
    output, diffuse = tree.get_output_node("CYCLES"), target.node
    half, mix, black = (tree.nodes.new(f"ShaderNode{kind}") for kind in ("Math", "MixShader", "BsdfDiffuse"))
    half.operation, half.inputs[0].default_value, half.inputs[1].default_value = "POWER", 0.25, 0.5
    black.inputs["Color"].default_value = (0, 0, 0, 1)
    for source, socket in ((half.outputs[0], mix.inputs[0]), (black.outputs[0], mix.inputs[1]),
                           (diffuse.outputs[0], mix.inputs[2]), (mix.outputs[0], output.inputs["Surface"])):
        tree.links.new(source, socket)
    return 0.5


WAYS = (_node, _link, _image, _group, _node_that_passes_on, _among_others)


@pytest.mark.parametrize("mute", WAYS, ids=lambda mute: mute.__name__.strip("_"))
def test_what_is_muted_leaves_a_socket_its_own_colour(colour, mute):
    part = mute(colour.id_data, colour) or 1.0
    assert np.allclose(export().reflectance, part * OWN, atol=1e-5)


def test_a_muted_emission_does_not_shine(colour):
    # Diffuse plus a muted Emission of strength 5: the diffuse shader alone.
    tree = colour.id_data
    add, glow = tree.nodes.new("ShaderNodeAddShader"), tree.nodes.new("ShaderNodeEmission")
    glow.inputs["Strength"].default_value, glow.mute = 5, True
    tree.links.new(colour.node.outputs[0], add.inputs[0])
    tree.links.new(glow.outputs[0], add.inputs[1])
    tree.links.new(add.outputs[0], tree.get_output_node("CYCLES").inputs["Surface"])
    scene = export()
    assert not scene.emission.any()
    assert np.allclose(scene.reflectance, OWN)


def test_a_muted_mix_of_shaders_hands_its_first_on(colour):
    # The first one's link is muted: nothing is handed on, and what a gamma makes of .25, its square root, is left.
    tree = colour.id_data
    gamma, mix, add, other = (tree.nodes.new(f"ShaderNode{kind}") for kind in (
        "Gamma", "MixShader", "AddShader", "BsdfDiffuse"))
    gamma.inputs["Color"].default_value, gamma.inputs["Gamma"].default_value = (0.25, 0.25, 0.25, 1), 0.5
    mix.mute = True
    tree.links.new(gamma.outputs[0], colour)
    tree.links.new(other.outputs[0], mix.inputs[1]).is_muted = True
    tree.links.new(other.outputs[0], mix.inputs[2])
    for source, socket in ((mix.outputs[0], add.inputs[0]), (colour.node.outputs[0], add.inputs[1]),
                           (add.outputs[0], tree.get_output_node("CYCLES").inputs["Surface"])):
        tree.links.new(source, socket)
    assert np.allclose(export().reflectance, 0.5, atol=1e-5)


@pytest.mark.parametrize("what", ["node", "link"])
def test_a_muted_background_gives_no_light(build, what):
    tree = build.world((1, 1, 1)).node_tree
    background = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeBackground")
    if what == "node":
        background.mute = True
    else:
        background.outputs[0].links[0].is_muted = True
    assert not read_world(bpy.context.scene.world, [])[0].radiance.any()


def test_a_muted_link_leaves_a_background_its_own_strength(build):
    tree = build.world((1, 0.5, 0.25)).node_tree
    background = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeBackground")
    tree.links.new(tree.nodes.new("ShaderNodeTexNoise").outputs[0], background.inputs["Strength"]).is_muted = True
    assert np.allclose(read_world(bpy.context.scene.world, [])[0].radiance, (1, 0.5, 0.25))


def test_a_muted_emission_makes_a_lamp_dark(stage):
    bulb = lamp("POINT", energy=10)
    emission = emission_nodes(bulb, (1, 1, 1), 2)
    assert len(exported()) == 1
    emission.mute = True
    lights, message = warned()
    assert lights == ()
    assert "give no light" in message


def test_a_group_met_twice_in_a_chain_has_its_own_inputs_each_time(colour):
    # In times By, twice: (.8, .8, .8) (1, .25, .25) (.25, 1, 1).
    group, begin, end = new_group(("In", "By"))
    times = group.nodes.new("ShaderNodeMixRGB")
    times.blend_type, times.inputs[0].default_value = "MULTIPLY", 1
    for source, socket in ((begin.outputs[0], times.inputs[1]), (begin.outputs[1], times.inputs[2]),
                           (times.outputs[0], end.inputs[0])):
        group.links.new(source, socket)
    tree = colour.id_data
    first = group_node(tree, group, In=(0.8, 0.8, 0.8), By=(1, 0.25, 0.25))
    second = group_node(tree, group, By=(0.25, 1, 1))
    tree.links.new(first.outputs[0], second.inputs["In"])
    tree.links.new(second.outputs[0], colour)
    assert np.allclose(export().reflectance, 0.2)


def test_a_group_of_shaders_met_twice_adds_up(colour):
    # A group adds its Tint to the shader that comes in: black plus (.2, 0, 0) plus (0, .4, 0).
    group, begin, end = new_group(("Tint",), "Shader")
    group.interface.new_socket("In", in_out="INPUT", socket_type="NodeSocketShader")
    add, diffuse = group.nodes.new("ShaderNodeAddShader"), group.nodes.new("ShaderNodeBsdfDiffuse")
    for source, socket in ((begin.outputs["In"], add.inputs[0]), (diffuse.outputs[0], add.inputs[1]),
                           (begin.outputs["Tint"], diffuse.inputs["Color"]), (add.outputs[0], end.inputs[0])):
        group.links.new(source, socket)
    tree = colour.id_data
    first, second = (group_node(tree, group, Tint=tint) for tint in ((0.2, 0, 0), (0, 0.4, 0)))
    tree.links.new(first.outputs[0], second.inputs["In"])
    tree.links.new(second.outputs[0], tree.get_output_node("CYCLES").inputs["Surface"])
    assert np.allclose(export().reflectance, (0.2, 0.4, 0))


def test_a_groups_output_that_nothing_feeds_gives_its_own_colour(colour):
    group, _, end = new_group()
    end.inputs[0].default_value = (0.3, 0.3, 0.3, 1)
    colour.id_data.links.new(group_node(colour.id_data, group).outputs[0], colour)
    assert np.allclose(export().reflectance, 0.3)


def test_a_mix_beyond_its_ends_goes_on_where_its_factor_is_not_clamped(colour):
    # .2 and .3 mixed by a factor of 2: .2 + 2 (.3 - .2).
    tree = colour.id_data
    mix = tree.nodes.new("ShaderNodeMix")
    mix.data_type = "RGBA"
    factor, first, second = (socket for socket in mix.inputs if socket.enabled)
    factor.default_value, first.default_value, second.default_value = 2, (0.2, 0.2, 0.2, 1), (0.3, 0.3, 0.3, 1)
    tree.links.new(next(socket for socket in mix.outputs if socket.enabled), colour)
    assert np.allclose(export().reflectance, 0.3)
    mix.clamp_factor = False
    assert np.allclose(export().reflectance, 0.4)


def test_a_ramp_that_was_turned_is_evaluated_anew(colour):
    # A ramp over noise, the same colour at both ends, then another. Exact answer: these colours.
    tree = colour.id_data
    ramp = tree.nodes.new("ShaderNodeValToRGB")
    tree.links.new(tree.nodes.new("ShaderNodeTexNoise").outputs[0], ramp.inputs[0])
    tree.links.new(ramp.outputs["Color"], colour)
    for grey in (0.2, 0.6):
        for element in ramp.color_ramp.elements:
            element.color = (grey, grey, grey, 1)
        assert np.allclose(export([]).reflectance, grey, atol=1e-4)

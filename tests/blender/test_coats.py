"""What a Principled's coat does to the light from below, against Cycles: what the receivers see of a plate above them
that fills nearly all of their sky (see `stage`).
"""

import bpy
import numpy as np
import pytest
from radiosity.radiosity_addon.materials import read_material
from radiosity.tests.blender.stage import cycles_irradiance, export, lamp, material, mesh

# Half of the plate's side, and its height above the receivers, metres.
HALF, HEIGHT = 4000, 20
TINT = (1, 0.7, 0.4, 1)
COATS = {
    "thin": {"Coat Weight": 0.3},
    "full": {"Coat Weight": 1.0},
    "dense": {"Coat Weight": 1.0, "Coat IOR": 2.2},
}
GLOW = {"Base Color": (0, 0, 0, 1), "Emission Color": (0.5, 0.8, 1, 1), "Emission Strength": 2.0}
BLACK = {"Base Color": (0, 0, 0, 1), "Emission Color": (0, 0, 0, 1)}
MATT = {"Base Color": (0.5, 0.8, 0.9, 1)}


def _plate(**values):
    """A material without gloss of its own, on the plate."""
    paint = material("Coated", "ShaderNodeBsdfPrincipled", **{"Specular IOR Level": 0.0, **values})
    corners = [(-HALF, -HALF, HEIGHT), (HALF, -HALF, HEIGHT), (HALF, HALF, HEIGHT), (-HALF, HALF, HEIGHT)]
    mesh("Coated", corners, [(0, 1, 2, 3)], paint)
    return paint


def _seen(passes, **values):
    """(3,) mean light of the receivers by Cycles, and our shading of the plate."""
    bpy.data.objects.remove(bpy.data.objects["Plate"])
    warnings = []
    shading = read_material(_plate(**values), warnings)
    assert warnings == []
    return cycles_irradiance(passes).mean(axis=(0, 1)), shading


@pytest.fixture
def ratio(build):
    """How much dimmer Cycles shows a plate under a tinted coat than under a clear one, and how much dimmer ours is.

    The gloss of the coat, all that it shows over a black plate, is left out of both.
    """
    from radiosity.tests.blender.stage import set_stage

    def compare(passes, part, coat, **values):
        found = []
        for colour in ({"Coat Tint": TINT}, {}, BLACK):
            set_stage()
            # From below, so that it lights the plate alone.
            lamp("SUN", energy=3, rotation=(np.pi, 0, 0))
            light, shading = _seen(passes, **values | coat | colour)
            found.append((light, np.array(getattr(shading, part).factor)))
        (tinted, ours), (clear, plain), (gloss, _) = found
        return (tinted - gloss) / (clear - gloss), ours / plain

    return compare


@pytest.mark.parametrize("kind", COATS)
def test_a_coat_tints_emission_as_in_cycles(ratio, kind):
    cycles, ours = ratio({"DIRECT"}, "emission", COATS[kind], **GLOW)
    assert ours == pytest.approx(cycles, rel=0.01)


@pytest.mark.parametrize("kind", COATS)
def test_a_coat_tints_what_is_reflected_as_in_cycles(ratio, kind):
    cycles, ours = ratio({"INDIRECT"}, "reflectance", COATS[kind], **MATT)
    assert ours == pytest.approx(cycles, rel=0.01)


@pytest.mark.parametrize("socket", ["Coat Weight", "Coat Tint"])
def test_a_coat_by_nodes_is_the_one_of_plain_values(build, stage, socket):
    # A weight of .4 or a tint of a quarter, by nodes that Cycles evaluates. Exact answer: that of the plain values.
    values = {"Coat Weight": 0.4, "Coat Tint": (0.25, 0.25, 0.25, 1)}
    paint = _plate(**GLOW | MATT | values)
    expected = read_material(paint, [])
    tree = paint.node_tree
    shader = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeBsdfPrincipled")
    add = tree.nodes.new("ShaderNodeMath")
    add.inputs[0].default_value, add.inputs[1].default_value = (0.4, 0) if socket == "Coat Weight" else (0.25, 0)
    tree.links.new(add.outputs[0], shader.inputs[socket])
    scene = export()
    lit = np.flatnonzero(np.asarray(scene.emission).any(axis=1))
    assert len(lit) == 2
    for values, colour in ((scene.emission / np.pi, expected.emission), (scene.reflectance, expected.reflectance)):
        assert np.asarray(values)[lit] == pytest.approx(np.tile(colour.factor, (2, 1)), rel=0.002)

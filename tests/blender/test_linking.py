"""Light and shadow linking against Cycles, on the stage with a red wall that throws light at its receivers."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np
import pytest
from radiosity import radiosity_addon, solver
from radiosity.radiosity_addon.export import export_scene
from radiosity.radiosity_addon.first_look import Shapes, first_look
from radiosity.solver.linking import links_of
from radiosity.tests.blender.stage import (
    OPEN_X,
    SAMPLES,
    SHADED_X,
    cycles_irradiance,
    footprint_points,
    lamp,
    material,
    mesh,
)

BOTH = ("DIRECT", "INDIRECT")
# Where the wall's bounce is all that a receiver gets, Cycles' mean is then within .5 %.
BOUNCE_SAMPLES = 8192
# Another plate that shades the receiver on the right, beside the stage's own.
SECOND = ((0.25, 0.75), (-0.75, 0.25), 0.7)
PLATES = ("Plate", "Second")


@pytest.fixture
def linked(stage: Any) -> Any:
    """A wall, a second plate, and the addon registered."""
    radiosity_addon.register()
    mesh("Wall", [(-2, 0.7, 0), (2, 0.7, 0), (2, 0.7, 2), (-2, 0.7, 2)], [(0, 1, 2, 3)],
         material("Red", "ShaderNodeBsdfDiffuse", Color=(0.9, 0.2, 0.1, 1)))
    (x0, x1), (y0, y1), z = SECOND
    mesh("Second", [(x0, y0, z), (x1, y0, z), (x1, y1, z), (x0, y1, z)], [(0, 1, 2, 3)],
         bpy.data.materials["Black"])
    yield
    radiosity_addon.unregister()


def collection(include: Any = (), exclude: Any = ()) -> Any:
    """A linking collection of objects and collections, by name."""
    made = bpy.data.collections.new("Linked")
    for state, names in (("INCLUDE", include), ("EXCLUDE", exclude)):
        for name in names:
            if name in bpy.data.objects:
                made.objects.link(bpy.data.objects[name])
                made.collection_objects[-1].light_linking.link_state = state
            else:
                made.children.link(bpy.data.collections[name])
                made.collection_children[-1].light_linking.link_state = state
    return made


def nested(include: Any = (), exclude: Any = ()) -> str:
    """The name of a collection in a collection of nothing else."""
    outer = bpy.data.collections.new("Outer")
    outer.children.link(collection(include, exclude))
    return str(outer.name)


def exported() -> tuple[solver.Scene, list[str]]:
    """The whole scene, and what was told."""
    warnings: list[Any] = []
    found = export_scene(bpy.context.scene, bpy.context.view_layer, solver.Settings(), warnings)
    return found.scene, [warning["message"] for warning in warnings]


def ours(passes: str = "both") -> Any:
    """(2, 3) mean irradiance of the open and of the shaded lumels."""
    scene, told = exported()
    assert told == []
    points = np.concatenate([footprint_points(left)[:, :16].reshape(-1, 3) for left in (OPEN_X, SHADED_X)])
    surface = [item.name for item in scene.surfaces].index("Receiver")
    value = solver.irradiance(scene, solver.Settings(error=0.03, passes=passes), points,
                              np.tile(np.float32([0, 0, 1]), (len(points), 1)),
                              surfaces=np.full(len(points), surface))
    return value.reshape(2, -1, 3).mean(axis=1)


def assert_agree(passes: tuple[str, ...] = BOTH, samples: int = SAMPLES) -> Any:
    """Both means in every channel as Cycles', to 1 %; returned."""
    found = ours("both" if passes == BOTH else "direct")
    assert found == pytest.approx(cycles_irradiance(passes, samples).mean(axis=1), rel=0.01)
    return found


LIGHT_LINKS = {
    "one included": {"include": ["Receiver"]},
    "the wall included": {"include": ["Wall"]},
    "the wall excluded": {"exclude": ["Wall"]},
    "nothing": {},
}


@pytest.mark.parametrize("links", LIGHT_LINKS.values(), ids=LIGHT_LINKS)
def test_a_lamp_lights_its_receivers_and_bounces_off_these_alone(linked, links):
    bulb = lamp("POINT", energy=100, shadow_soft_size=0.05)
    bulb.light_linking.receiver_collection = collection(**links)
    assert_agree(BOTH, BOUNCE_SAMPLES if links.get("include") == ["Wall"] else SAMPLES)


def test_what_is_excluded_gets_nothing_straight(linked):
    lamp("POINT", energy=100).light_linking.receiver_collection = collection(exclude=["Receiver"])
    assert not ours("direct").any()
    assert not cycles_irradiance().any()


@pytest.mark.parametrize(("include", "exclude", "reached"), [
    (lambda: [nested(exclude=["Receiver"])], list, True),
    (list, lambda: [nested(include=["Receiver"])], False),
    (lambda: ["Receiver"], lambda: [nested(include=["Receiver"])], True),
    (lambda: [nested(include=["Receiver"])], lambda: ["Receiver"], False),
    (lambda: ["Lamp"], list, False),
], ids=["a child's own exclusions do not count", "a child excluded", "objects after children, included",
        "objects after children, excluded", "something that is no mesh included"])
def test_collections_in_collections_are_read_as_cycles_reads_them(linked, include, exclude, reached):
    # A lamp, and another of a thousandth of its power for all; the receivers in the open get 1 W/m2 of the first.
    bulb = lamp("POINT", energy=100, shadow_soft_size=0)
    lamp("POINT", energy=0.1, shadow_soft_size=0)
    bulb.light_linking.receiver_collection = collection(include(), exclude())
    scene, _ = exported()
    index = [item.name for item in scene.surfaces].index("Receiver")
    links = [links_of(light).receivers for light in scene.lights if light.name == bulb.name]
    assert any(np.broadcast_to(receivers, len(scene.surfaces))[index] for receivers in links) == reached
    assert (cycles_irradiance()[0].mean() > 0.1) == reached


def test_a_lamp_that_is_linked_to_nothing_that_is_shown_is_told_of_and_left_out(linked):
    bpy.data.objects["Wall"].hide_render = True
    lamp("POINT", energy=100).light_linking.receiver_collection = collection(include=["Wall"])
    lamp("SUN", energy=0.01)
    scene, (told,) = exported()
    assert [light.name for light in scene.lights] == ["Lamp.001"]
    assert "'Linked' (Light Linking): it is left out" in told
    assert cycles_irradiance()[0].mean() == pytest.approx(0.01, rel=0.01)


SHADOW_LINKS = {
    "one included": {"include": ["Plate"]},
    "one excluded": {"exclude": ["Plate"]},
    "both excluded": {"exclude": PLATES},
    "nothing": {},
}
POINT = ("POINT", {"energy": 100, "shadow_soft_size": 0})


@pytest.mark.parametrize(("kind", "links"), [
    *((POINT, links) for links in SHADOW_LINKS), (("AREA", {"energy": 100, "size": 0.3}), "one included"),
    (("SUN", {"energy": 3, "angle": 0.1}), "one excluded")])
def test_a_lamp_throws_the_shadows_of_its_blockers(linked, kind, links):
    lamp_type, settings = kind
    bulb = lamp(lamp_type, **settings)
    # See `test_cycles_loses_light...`.
    bulb.data.cycles.use_multiple_importance_sampling = False
    bulb.light_linking.blocker_collection = collection(**SHADOW_LINKS[links])
    assert_agree(("DIRECT",))


def test_cycles_loses_light_of_wide_lamps_behind_what_is_not_included(linked):
    # A square of 3 m, the plate included: with multiple importance sampling Cycles' rays that are to find the lamp by
    # chance end at the second plate. Without it, Cycles renders what we bake.
    bulb = lamp("AREA", energy=100, size=3)
    bulb.light_linking.blocker_collection = collection(include=["Plate"])
    bulb.data.cycles.use_multiple_importance_sampling = False
    right = assert_agree(("DIRECT",))[1]
    bulb.data.cycles.use_multiple_importance_sampling = True
    assert cycles_irradiance()[1].mean(axis=0).mean() < 0.97 * right.mean()


def test_light_and_shadow_links_are_followed_together(linked):
    bulb = lamp("SPOT", energy=300, shadow_soft_size=0.05, spot_size=2.5)
    bulb.light_linking.receiver_collection = collection(exclude=["Wall"])
    bulb.light_linking.blocker_collection = collection(exclude=["Second"])
    assert_agree()


def instance_of(*names: str) -> Any:
    """A collection instance of objects, which are nowhere else."""
    inside = bpy.data.collections.new("Inside")
    for name in names:
        item = bpy.data.objects[name]
        bpy.context.collection.objects.unlink(item)
        inside.objects.link(item)
    made = bpy.data.objects.new("Instancer", None)
    made.instance_type, made.instance_collection = "COLLECTION", inside
    bpy.context.collection.objects.link(made)
    return made


@pytest.mark.parametrize(("include", "other"), [
    (["Plate"], None), (["Instancer"], None), (["Plate"], ["Instancer"]), (["Second"], None)],
    ids=["the object", "the instancer", "the object, and the instancer for another lamp", "neither"])
def test_an_instance_is_linked_as_its_instancer_or_else_as_what_it_shows(linked, include, other):
    bulb = lamp("POINT", energy=100, shadow_soft_size=0)
    instance_of("Plate")
    bulb.light_linking.blocker_collection = collection(include=include)
    if other is not None:
        faint = lamp("POINT", energy=1e-6)
        faint.light_linking.blocker_collection = collection(include=other)
    assert_agree(("DIRECT",))


def glow(size: float, strength: float) -> Any:
    """A square that glows at z = 2, as wide as twice the size."""
    return mesh("Glow", [(-size, -size, 2), (size, -size, 2), (size, size, 2), (-size, size, 2)], [(0, 1, 2, 3)],
                material("Glow", "ShaderNodeEmission", Strength=strength))


@pytest.mark.parametrize("word", ["include", "exclude"])
@pytest.mark.parametrize("name", ["Receiver", "Wall"])
def test_a_mesh_that_glows_lights_its_receivers_alone(linked, word, name):
    glow(0.5, 20).light_linking.receiver_collection = collection(**{word: [name]})
    assert_agree()


@pytest.mark.parametrize("links", [{"exclude": ["Plate"]}, {"exclude": PLATES}])
def test_a_mesh_that_glows_throws_the_shadows_of_its_blockers(linked, links):
    glow(0.4, 20).light_linking.blocker_collection = collection(**links)
    assert_agree(("DIRECT",))


def test_the_first_look_shows_no_light_where_a_lamp_does_not_reach(linked):
    lamp("POINT", energy=100).light_linking.receiver_collection = collection(include=["Wall"])
    bpy.data.materials["Red"].node_tree.nodes["Diffuse BSDF"].inputs["Color"].default_value = (0, 0, 0, 1)
    scene, _ = exported()
    look = look_at(scene)
    at_floor = (look.corners[..., 2] == 0).all(axis=1)
    assert at_floor.any()
    assert not look.colour[at_floor].any()
    # Black walls show nothing either: as white ones they do.
    lamp("POINT", energy=100, location=(0, 0, 1))
    assert look_at(exported()[0]).colour[at_floor].any()


def look_at(scene):
    return first_look(Shapes(scene), (scene.sky, ()), solver.Settings(), lambda: False)

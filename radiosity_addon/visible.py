"""What a render shows: objects, and as meshes these, curves and text, and every instance by itself."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..solver.errors import SceneError
from .object_random import random_of
from .slots import own
from .warn import Warnings, warn

# Kinds of rays that lightmaps know, by Blender's words for whether they meet an object.
RAYS = ("visible_shadow", "visible_diffuse")
# What has no faces and is shown all the same, and what to do about it; by Blender's types but for particles.
CURVE_TO_MESH = "make a mesh with faces of it (Curve to Mesh in geometry nodes)"
UNMESHED = {
    "CURVES": ("hair curves", CURVE_TO_MESH),
    "HAIR": ("hair", f"convert it to curves (Object > Convert), and {CURVE_TO_MESH}"),
    "POINTCLOUD": ("a point cloud", "make meshes of it (Instance on Points and Realize Instances in geometry nodes)"),
    "VOLUME": ("a volume", "light goes through it as through air"),
}
# Where the elements of what may be empty are.
ELEMENTS = {"CURVES": "curves", "POINTCLOUD": "points"}
# What `persistent_id` is filled up with.
NO_STEP = 2**31 - 1


@dataclass(frozen=True, eq=False)
class Shown:
    """One mesh at one place. Its references are valid only while the dependency graph is.

    Attributes
    ----------
    name : unique; the object's, or `instancer:object`, with `#2` and so on for further ones.
    original : the original bpy object.
    instancer : name of the object that shows it as an instance, or "".
    parent : the original bpy object that shows it as an instance, itself if it was made on the way, or None.
    layer : the view layer that it is shown in, with its scene and world.
    mesh : the evaluated bpy mesh.
    matrix : (4, 4) float64 to world space.
    materials : the user's, of its slots; None for an empty slot.
    random : between 0 and 1, the same in every render: what Object Info calls random.
    own_mesh : whether `mesh` is the evaluated mesh of `original`, and nothing that was made on the way.
    missed : the kinds of rays, words of `RAYS`, that do not meet it.
    """

    name: str
    original: Any
    instancer: str
    parent: Any
    layer: tuple[Any, ...]
    mesh: Any
    matrix: NDArray[np.float64]
    materials: tuple[Any, ...]
    random: float
    own_mesh: bool
    missed: tuple[str, ...]


def rendered_objects(view_layer: Any) -> list[Any]:
    """The objects that a render of a view layer shows, in the order of its collections, each once; not their instances.

    Neither they nor a collection that they are in are hidden from renders, and the layer does not exclude it.
    """
    return list(dict.fromkeys(_of_layer(view_layer.layer_collection)))


def _of_layer(layer: Any) -> Iterator[Any]:
    if layer.collection.hide_render:
        return
    if not layer.exclude:
        yield from (item for item in layer.collection.objects if not item.hide_render)
    for child in layer.children:
        yield from _of_layer(child)


def rendered_meshes(depsgraph: Any, warnings: Warnings) -> list[Shown]:
    """`shown_meshes` with the materials that a render gives them: the view layer's Material Override, if it has one.

    Raises
    ------
    SceneError
        As `shown_meshes`.
    """
    shown = shown_meshes(depsgraph, warnings)
    override = depsgraph.view_layer_eval.material_override
    if override is None:
        return shown
    return [replace(item, materials=(override,) * max(len(item.materials), 1)) for item in shown]


def shown_meshes(depsgraph: Any, warnings: Warnings) -> list[Shown]:
    """All meshes with at least one face, in Blender's order.

    Raises
    ------
    SceneError
        If an object's transform is not finite, or if it is being edited.
    """
    shown: list[Shown] = []
    names: Counter[str] = Counter()
    layer = depsgraph.view_layer, depsgraph.scene, depsgraph.scene.world
    for instance in depsgraph.object_instances:
        item = instance.object
        _tell_unmeshed(instance, warnings)
        if item.type != "MESH" or not instance.show_self or item.data is None:
            continue
        original = item.original
        # Of a mesh in Edit Mode a render's view has no faces.
        if getattr(original.data, "is_editmode", False):
            raise SceneError(f"object {_edited(original, layer[0]).name!r} is in Edit Mode: leave it (Tab) and bake "
                             "again")
        if not len(item.data.polygons):
            continue
        parent = instance.parent.original if instance.is_instance and instance.parent is not None else None
        # What nodes make goes by its maker's name, with other data.
        made_on_the_way = original.type != "MESH" or (parent is not None
                                                      and item.data != instance.instance_object.data)
        instancer = parent.name if parent is not None and parent != original else ""
        name = f"{instancer}:{original.name}" if instancer else original.name
        names[name] += 1
        if names[name] > 1:
            name = f"{name}#{names[name]}"
        matrix = np.array(instance.matrix_world, np.float64)
        if not np.isfinite(matrix).all():
            raise SceneError(f"object {name!r}: its transform is not finite: "
                             "reset location, rotation and scale, or remove the constraint that makes it")
        missed = tuple(word for word in RAYS if not meets(instance, word))
        if "visible_shadow" in missed:
            hidden = original if parent is None or not original.visible_shadow else parent
            warn(warnings, hidden.name, "visibility", "casts no shadow of lamps, as it is set (Ray Visibility); "
                 "light of the sky, but for its suns, it stops all the same")
        # Linked from a library that was saved while a view was on, they still hold its materials.
        materials = tuple(own(slot.material) for slot in item.material_slots)
        shown.append(Shown(name, original, instancer, parent, layer, item.data, matrix, materials,
                           random_of(instance), not made_on_the_way, missed))
    return shown


def _tell_unmeshed(instance: Any, warnings: Warnings) -> None:
    """Tell of what a render shows and no mesh stands for: hair, points and volumes."""
    item, original = instance.object, instance.object.original
    kind = ""
    if instance.show_self and item.type in UNMESHED:
        kind = item.type if item.type not in ELEMENTS or len(getattr(item.data, ELEMENTS[item.type])) else ""
    elif instance.show_particles and any(_shows_hair(modifier) for modifier in original.modifiers):
        kind = "HAIR"
    if kind:
        what, advice = UNMESHED[kind]
        warn(warnings, original.name, "not_baked", f"shows {what}, which a bake leaves out, so that nothing of it "
             f"stops, reflects or gives light: {advice}")


def _shows_hair(modifier: Any) -> bool:
    """Whether a modifier makes strands that a render shows."""
    if modifier.type != "PARTICLE_SYSTEM" or not modifier.show_render:
        return False
    settings = modifier.particle_system.settings
    return bool(settings.type == "HAIR" and settings.render_type == "PATH")


def meets(instance: Any, word: str) -> bool:
    """Whether rays of a kind meet what an instance shows: an object, and the one that shows it as an instance."""
    instancer = instance.parent if instance.is_instance else None
    return bool(getattr(instance.object, word) and (instancer is None or getattr(instancer, word)))


def _edited(item: Any, view_layer: Any) -> Any:
    """The object by which an object's data is edited: others may use the same."""
    return next((other for other in view_layer.objects if other.mode == "EDIT" and other.data == item.data), item)


def carriers(depsgraph: Any) -> set[str]:
    """Names of the objects that show more than meshes of their own: others, lamps or hair, on points, faces, particles.

    Without its modifiers an object shows none of that.
    """
    found: set[str] = set()
    # Original objects by whose instances they are, and by which: `persistent_id` is a path, the innermost step first.
    known: dict[tuple[Any, tuple[int, ...]], Any] = {}
    for instance in depsgraph.object_instances:
        item, original = instance.object, instance.object.original
        if original.particle_systems:
            found.add(original.name)
        if not instance.is_instance or instance.parent is None:
            continue
        parent = instance.parent.original
        path = tuple(step for step in instance.persistent_id if step != NO_STEP)
        makers = [parent, *(known[parent, path[depth:]] for depth in range(1, len(path))
                            if (parent, path[depth:]) in known)]
        found.update(maker.name for maker in makers
                     if item.type != "EMPTY" and (maker != original or item.type != "MESH"))
        known[parent, path] = original
    return found

"""What ties a surface of the solver's scene to Blender: names, as no reference to its data outlives the export."""

from __future__ import annotations

from dataclasses import dataclass

# What is told where nothing can hold light.
NO_OPAQUE_FACE = ("no object that is to be baked has an opaque face with an area: give its faces a material that light "
                  "does not go straight through (Principled BSDF), or bake other objects")


@dataclass(frozen=True)
class Binding:
    """Where a surface came from, and whether results can be written back there.

    Attributes
    ----------
    surface : the surface's name, unique in the scene.
    object : name of the Blender object whose mesh it is.
    instancer : name of the object that shows it as an instance, "" for a real object.
    mesh : name of the object's own mesh, "" where it has none (curves, generated instances).
    receives : whether it is baked.
    same_topology : whether the evaluated mesh has the corners of the object's own mesh, so that they can hold results.
    layout : surfaces of the same non-empty layout show the same mesh, which holds one UV map for all of them.
    corner_count : corners of the evaluated mesh.
    linked : whether object or mesh belong to a linked library.
    """

    surface: str
    object: str
    instancer: str
    mesh: str
    receives: bool
    same_topology: bool
    layout: str
    corner_count: int
    linked: bool

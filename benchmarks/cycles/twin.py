"""The diffuse twin of a scene: what both programs are given, and the lumels that both bake.

    python -m benchmarks.cycles.twin cornell classroom ...

Every material becomes its base colour and its emission, faces that light passes through are taken out, instances and
modifiers become meshes of their own, and the receivers get the UV layer `Benchmark`. World, lamps and shading normals
stay. The twin lies in out/benchmarks/NAME/ as twin.blend, twin.json (what was done) and lumels.npz (the charts).
"""

from __future__ import annotations

import argparse
import hashlib
import json
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import charts, diffuse, unwrap
from .blender import open_blend
from .scenes import CASES, UV_LAYER, Box, Case, case_named

# Kinds of object that have a surface to render.
SURFACES = {"MESH", "CURVE", "SURFACE", "FONT", "META"}
VERSION = 4
# Images' sides are multiples of this, pixels.
RESOLUTION_STEP = 16
# Shading normals this near to the face's own are the face's own (custom normals are stored in 16 bits).
FLAT = 1e-3


def make_twin(case: Case, again: bool = False) -> dict[str, Any]:
    """Make the twin of `case` unless it is there already; returns what twin.json says."""
    description = case.folder / "twin.json"
    if description.is_file() and not again:
        known: dict[str, Any] = json.loads(description.read_text())
        if known["made_from"] == _recipe(case):
            return known
    started = time.perf_counter()
    bpy = open_blend(case.blend)
    case.folder.mkdir(parents=True, exist_ok=True)
    objects = _realised(bpy)
    reduced = {m.name: diffuse.reduce_material(bpy, m) for m in sorted(_used_materials(objects), key=lambda m: m.name)}
    transmissive = {name for name, what in reduced.items() if what.kind == "transmissive"}
    removed = _without_materials(bpy, objects, transmissive)
    copies = _without_copies(objects)
    _fill_empty_slots(bpy, objects)
    for name, box in case.crop.items():
        _crop(bpy, objects, name, box)
    _without_terminator_offsets(objects)
    missing = [name for name in case.receivers if name not in objects]
    if missing:
        raise KeyError(f"scene {case.name!r} has no object {missing[0]!r} left to receive: mend the table in scenes.py")
    for name in case.receivers:
        _triangulate(objects[name])
    resolution, layout = _lay_out(case, objects)
    for unused in (bpy.data.materials, bpy.data.meshes, bpy.data.images):
        for block in [block for block in unused if not block.users]:
            unused.remove(block)
    bpy.context.scene.render.engine = "CYCLES"
    bpy.context.preferences.filepaths.save_version = 0
    bpy.ops.wm.save_as_mainfile(filepath=str(case.folder / "twin.blend"), compress=False, check_existing=False)
    known = {
        "scene": case.name,
        "made_from": _recipe(case),
        "content": _content(objects),
        "uv_layer": UV_LAYER,
        "resolution": resolution,
        "receivers": layout,
        "lumels": sum(row["lumels"] for row in layout),
        "triangles": sum(len(o.data.loop_triangles) for o in objects.values()),
        "objects": len(objects),
        "removed": removed,
        "copies": copies,
        "notes": {name: what.note for name, what in reduced.items() if what.note},
        "seconds": round(time.perf_counter() - started, 2),
    }
    description.write_text(json.dumps(known, indent=1) + "\n")
    return known


def _recipe(case: Case) -> str:
    """Hash of the scene's file and of the table's row: the twin is made again when either changes."""
    content = hashlib.sha256(case.blend.read_bytes())
    content.update(repr((VERSION, case.receivers, case.lumels, case.density, case.crop)).encode())
    return content.hexdigest()[:16]


def _content(objects: dict[str, Any]) -> str:
    """Hash of what the twin holds: positions, triangles and layouts, object by object."""
    content = hashlib.sha256()
    for name in sorted(objects):
        mesh = objects[name].data
        mesh.calc_loop_triangles()
        content.update(name.encode())
        for collection, attribute, width, kind in (
            (mesh.vertices, "co", 3, np.float32),
            (mesh.loop_triangles, "vertices", 3, np.int32),
        ):
            values = np.empty(len(collection) * width, kind)
            collection.foreach_get(attribute, values)
            content.update(values.tobytes())
        if UV_LAYER in mesh.uv_layers:
            content.update(unwrap.triangle_uv(mesh, UV_LAYER).tobytes())
    return content.hexdigest()[:16]


def _realised(bpy: Any) -> dict[str, Any]:
    """Every rendered surface as a mesh object of its own, by name; all others but lamps and cameras are gone."""
    graph = bpy.context.evaluated_depsgraph_get()
    found = []
    for instance in graph.object_instances:
        source = instance.object
        if source.type in SURFACES and instance.show_self and not source.original.hide_render:
            mesh = bpy.data.meshes.new_from_object(source, preserve_all_data_layers=True, depsgraph=graph)
            if mesh is not None and len(mesh.polygons):
                found.append((source.original.name, mesh, instance.matrix_world.copy()))
    kept = [other for other in bpy.data.objects if other.type in {"LIGHT", "CAMERA"}]
    places = [other.matrix_world.copy() for other in kept]
    for other in list(bpy.data.objects):
        if other not in kept:
            bpy.data.objects.remove(other)
    for other, place in zip(kept, places, strict=True):
        other.parent = None
        other.matrix_world = place
    objects = {}
    for name, mesh, place in found:
        made = bpy.data.objects.new(name, mesh)
        bpy.context.scene.collection.objects.link(made)
        made.matrix_world = place
        objects[made.name] = made
    bpy.context.view_layer.update()
    return objects


def _used_materials(objects: dict[str, Any]) -> set[Any]:
    return {material for made in objects.values() for material in made.data.materials if material is not None}


def _without_materials(bpy: Any, objects: dict[str, Any], unwanted: set[str]) -> dict[str, str]:
    """Take the faces of `unwanted` materials out; returns the objects that changed, with what went."""
    import bmesh

    changed = {}
    for name, made in list(objects.items()):
        slots = [material.name if material else "" for material in made.data.materials]
        bad = {slot for slot, material in enumerate(slots) if material in unwanted}
        if not bad:
            continue
        edit = bmesh.new()
        edit.from_mesh(made.data)
        faces = [face for face in edit.faces if face.material_index in bad]
        changed[name] = f"{len(faces)} of {len(edit.faces)} faces: {', '.join(sorted({slots[slot] for slot in bad}))}"
        if len(faces) == len(edit.faces):
            bpy.data.objects.remove(objects.pop(name))
        else:
            bmesh.ops.delete(edit, geom=faces, context="FACES")
            edit.to_mesh(made.data)
        edit.free()
    return changed


def _without_copies(objects: dict[str, Any]) -> dict[str, str]:
    """Take out triangles that lie exactly on another of their object; returns what went.

    A ray that leaves one copy meets the other or not by rounding alone: Cycles bakes about half the light there (.39
    instead of .71 in pc_house, where 2,506 of 6,035 triangles are copies), and no answer is right.
    """
    changed = {}
    for name, made in objects.items():
        doubles = _copies(made.data)
        if len(doubles):
            changed[name] = f"{len(doubles)} of {len(made.data.polygons)} faces lie on another"
            _delete_faces(made.data, doubles)
    return changed


def _copies(mesh: Any) -> NDArray[np.int64]:
    """Triangles whose three corners are where an earlier triangle of the mesh has them, in any order."""
    sides, first = np.empty(len(mesh.polygons), np.int32), np.empty(len(mesh.polygons), np.int32)
    mesh.polygons.foreach_get("loop_total", sides)
    mesh.polygons.foreach_get("loop_start", first)
    corner, position = np.empty(len(mesh.loops), np.int32), np.empty(len(mesh.vertices) * 3, np.float32)
    mesh.loops.foreach_get("vertex_index", corner)
    mesh.vertices.foreach_get("co", position)
    place = np.unique(position.reshape(-1, 3), axis=0, return_inverse=True)[1].reshape(-1)
    polygon = np.flatnonzero(sides == 3)
    key = np.sort(place[corner[first[polygon][:, None] + np.arange(3)]], axis=1)
    kept = np.unique(key, axis=0, return_index=True)[1]
    # Triangles without area cover no lumel and stop no ray: they stay, as the scene has them.
    flat = (key[:, 0] == key[:, 1]) | (key[:, 1] == key[:, 2])
    return np.asarray(np.setdiff1d(polygon[~flat], polygon[kept]))


def _delete_faces(mesh: Any, faces: NDArray[np.int64]) -> None:
    """Take faces out of a mesh; the shading normals of the others stay what they were."""
    import bmesh

    normals = np.array([corner.vector for corner in mesh.corner_normals])
    stays = np.ones(len(mesh.polygons), bool)
    stays[faces] = False
    sides = np.array([polygon.loop_total for polygon in mesh.polygons])
    edit = bmesh.new()
    edit.from_mesh(mesh)
    edit.faces.ensure_lookup_table()
    bmesh.ops.delete(edit, geom=[edit.faces[int(index)] for index in faces], context="FACES")
    edit.to_mesh(mesh)
    edit.free()
    mesh.normals_split_custom_set(normals[np.repeat(stays, sides)].tolist())
    mesh.update()


def _fill_empty_slots(bpy: Any, objects: dict[str, Any]) -> None:
    default = None
    for made in objects.values():
        slots = made.data.materials
        if not len(slots) or any(material is None for material in slots):
            default = default or diffuse.default_material(bpy)
            if not len(slots):
                slots.append(default)
            for index, material in enumerate(slots):
                if material is None:
                    slots[index] = default


def _crop(bpy: Any, objects: dict[str, Any], name: str, box: Box) -> None:
    """Cut an object at the box's six planes; what lies outside becomes the object `<name>.outside`."""
    inside = objects[name]
    outside = bpy.data.objects.new(f"{name}.outside", inside.data.copy())
    bpy.context.scene.collection.objects.link(outside)
    outside.matrix_world = inside.matrix_world
    _cut(inside, box, keep_inside=True)
    _cut(outside, box, keep_inside=False)
    objects[outside.name] = outside


def _cut(made: Any, box: Box, keep_inside: bool) -> None:
    import bmesh

    place, to_local = made.matrix_world, made.matrix_world.inverted()
    low, high = box
    with _edited(made) as edit:
        for axis in range(3):
            for corner in box:
                bmesh.ops.bisect_plane(
                    edit,
                    geom=[*edit.verts, *edit.edges, *edit.faces],
                    plane_co=to_local @ _vector(corner),
                    plane_no=place.to_3x3().transposed() @ _vector([float(axis == other) for other in range(3)]),
                )
        centres = [(face, place @ face.calc_center_median()) for face in edit.faces]
        unwanted = [
            face
            for face, centre in centres
            if keep_inside != all(low[axis] <= centre[axis] <= high[axis] for axis in range(3))
        ]
        bmesh.ops.delete(edit, geom=unwanted, context="FACES")


def _triangulate(made: Any) -> None:
    """Cut faces of more than three corners into triangles: then a layout by triangles is a layout by corners."""
    import bmesh

    if len(made.data.loops) != 3 * len(made.data.polygons):
        with _edited(made) as edit:
            bmesh.ops.triangulate(edit, faces=list(edit.faces))


@contextmanager
def _edited(made: Any) -> Iterator[Any]:
    """A mesh to cut up; its shading normals must be those of its faces, which are the only ones that stay exact."""
    import bmesh

    mesh = made.data
    face = np.repeat(
        np.array([polygon.normal for polygon in mesh.polygons]), [len(p.vertices) for p in mesh.polygons], 0
    )
    bend = np.abs(np.array([corner.vector for corner in mesh.corner_normals]) - face).max()
    if bend > FLAT:
        raise ValueError(f"object {made.name!r} has smooth normals (off by {bend:.3f}): it can't be cut faithfully")
    edit = bmesh.new()
    edit.from_mesh(mesh)
    yield edit
    edit.to_mesh(mesh)
    edit.free()
    if "custom_normal" in mesh.attributes:
        mesh.attributes.remove(mesh.attributes["custom_normal"])
    mesh.shade_flat()
    mesh.update()


def _vector(values: Any) -> Any:
    from mathutils import Vector

    return Vector(values)


def _without_terminator_offsets(objects: dict[str, Any]) -> None:
    """Both of Cycles' cures for shadows on coarse smooth meshes move rays off the surface: no transport, so off."""
    for made in objects.values():
        made.shadow_terminator_geometry_offset = 0.0
        made.shadow_terminator_normal_offset = 0.0


def _lay_out(case: Case, objects: dict[str, Any]) -> tuple[int, list[dict[str, Any]]]:
    """Give every receiver its UV layer and write the charts to lumels.npz; the resolution, and a row a receiver."""
    factors = np.array([case.density.get(name, 1.0) for name in case.receivers])
    areas = np.array([unwrap.world_area(objects[name]) for name in case.receivers])
    base = unwrap.base_density(areas, factors, case.lumels)
    layouts = [
        unwrap.packed_texels(objects[name], base * factor) for name, factor in zip(case.receivers, factors, strict=True)
    ]
    # One resolution serves every receiver: a small object uses a corner of its image, and the rest costs nothing.
    resolution = -(-max(side for _, side in layouts) // RESOLUTION_STEP) * RESOLUTION_STEP
    images: dict[str, NDArray[np.int32]] = {}
    rows = []
    for name, area, factor, (texels, side) in zip(case.receivers, areas, factors, layouts, strict=True):
        unwrap.write_layer(objects[name], UV_LAYER, texels / resolution)
        image, overlaps = charts.chart_image(unwrap.triangle_uv(objects[name].data, UV_LAYER), resolution)
        images[name] = image
        rows.append(
            {
                "object": name,
                "area": round(float(area), 4),
                "texels_per_metre": round(float(base * factor), 3),
                "square": side,
                "lumels": int(np.count_nonzero(image >= 0)),
                "inner": _inner(image),
                "charts": len(np.unique(image[image >= 0])),
                "overlapping": overlaps,
            }
        )
    np.savez_compressed(case.folder / "lumels.npz", **images)
    return resolution, rows


def _inner(image: NDArray[np.int32]) -> int:
    from radiosity.solver.estimator import counted_lumels

    lit = np.ones((*image.shape, 3))
    return int(counted_lumels(image, lit, lit).inner.sum())


def main(arguments: list[str] | None = None) -> None:
    """Command line: make the twins of the scenes named."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.cycles.twin", description=(__doc__ or "").splitlines()[0]
    )
    parser.add_argument("scene", nargs="+", help=f"one or more of {', '.join(CASES)}, or all")
    parser.add_argument("--again", action="store_true", help="make it even if it is there")
    chosen = parser.parse_args(arguments)
    for name in CASES if chosen.scene == ["all"] else chosen.scene:
        known = make_twin(case_named(name), chosen.again)
        print(f"{name}: {known['triangles']} triangles, {known['lumels']} lumels, {known['seconds']} s")
        for row in known["receivers"]:
            print("   ", ", ".join(f"{key} {value}" for key, value in row.items()))
        for what in ("removed", "copies", "notes"):
            for key, text in known[what].items():
                print(f"    {what}: {key}: {text}")


if __name__ == "__main__":
    main()

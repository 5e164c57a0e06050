"""Render a baked scene by its lightmaps alone: `python tools/picture.py BAKED.blend OUT.png`.

Every diffuse shader of a baked object becomes an emitter of lightmap x base colour, so what the picture shows was
baked: no light is traced while rendering. Needs the bpy wheel, and report.json beside the .blend (or --report).
"""

from __future__ import annotations

import argparse
import json
import math
import os
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

SIDE = 800
SAMPLES = 16
# Where the upper quartile of the picture's brightest channel is put, in display-linear light, and the small picture
# that it is found from.
UPPER_QUARTILE = 0.6
METER_PERCENTAGE, METER_SAMPLES = 25, 4


class PictureError(Exception):
    """The picture can't be made; the message says why."""


def lightmap_colour(nodes: Any, links: Any, output: dict[str, Any], folder: Path) -> Any:
    """The socket of a node tree that reads the baked light of one output."""
    if output["target"] == "vertex":
        attribute = nodes.new("ShaderNodeVertexColor")
        attribute.layer_name = output.get("attribute") or output["image"]
        return attribute.outputs["Color"]
    import bpy

    image = bpy.data.images.load(str(folder / output["image"]), check_existing=True)
    texture, uv_map = nodes.new("ShaderNodeTexImage"), nodes.new("ShaderNodeUVMap")
    texture.image, texture.extension = image, "EXTEND"
    uv_map.uv_map = output["uv_layer"]
    links.new(uv_map.outputs["UV"], texture.inputs["Vector"])
    return texture.outputs["Color"]


def emit_instead(tree: Any, output: dict[str, Any], folder: Path, quantity: str) -> None:
    """Replace each diffuse shader of a node tree, groups included, by emission of baked light x base colour."""
    from radiosity.radiosity_addon.baked_light import TO_RADIANCE

    nodes, links = tree.nodes, tree.links
    for node in list(nodes):
        if node.bl_idname == "ShaderNodeGroup" and node.node_tree is not None:
            node.node_tree = node.node_tree.copy()
            emit_instead(node.node_tree, output, folder, quantity)
        if node.bl_idname not in {"ShaderNodeBsdfPrincipled", "ShaderNodeBsdfDiffuse"}:
            continue
        principled = node.bl_idname == "ShaderNodeBsdfPrincipled"
        product = nodes.new("ShaderNodeVectorMath")
        product.operation = "MULTIPLY"
        links.new(lightmap_colour(nodes, links, output, folder), product.inputs[0])
        product.inputs[1].default_value = (1.0, 1.0, 1.0)
        if quantity != "radiosity":
            connect(links, node.inputs["Base Color" if principled else "Color"], product.inputs[1])
        shader = nodes.new("ShaderNodeEmission")
        links.new(product.outputs["Vector"], shader.inputs["Color"])
        shader.inputs["Strength"].default_value = TO_RADIANCE[quantity]
        result = shader.outputs["Emission"]
        if principled:
            own, both = nodes.new("ShaderNodeEmission"), nodes.new("ShaderNodeAddShader")
            connect(links, node.inputs["Emission Color"], own.inputs["Color"])
            connect(links, node.inputs["Emission Strength"], own.inputs["Strength"])
            links.new(result, both.inputs[0])
            links.new(own.outputs["Emission"], both.inputs[1])
            result = cut_out(nodes, links, node, both.outputs["Shader"])
        for link in list(node.outputs["BSDF"].links):
            links.new(result, link.to_socket)
        nodes.remove(node)


def cut_out(nodes: Any, links: Any, principled: Any, shader: Any) -> Any:
    """A shader that is seen through where the Principled one was."""
    mix, clear = nodes.new("ShaderNodeMixShader"), nodes.new("ShaderNodeBsdfTransparent")
    connect(links, principled.inputs["Alpha"], mix.inputs["Fac"])
    links.new(clear.outputs["BSDF"], mix.inputs[1])
    links.new(shader, mix.inputs[2])
    return mix.outputs["Shader"]


def connect(links: Any, source: Any, target: Any) -> None:
    """Give the target what feeds the source: its link, or its own value."""
    if source.is_linked:
        links.new(source.links[0].from_socket, target)
        return
    value = source.default_value
    if hasattr(value, "__len__"):
        target.default_value = tuple(value)[: len(target.default_value)]
    else:
        target.default_value = value


def show_baked(report: dict[str, Any], folder: Path) -> None:
    """Give every baked object materials of its own that show its lightmap."""
    import bpy

    quantity = report["settings"]["quantity"]
    real = made_real([output["object"] for output in report["outputs"]])
    for output in report["outputs"]:
        name = output["object"]
        thing = real.get(name) or bpy.data.objects.get(name)
        if thing is None or thing.type != "MESH":  # a bake made a mesh of it
            thing = bpy.data.objects.get(f"{name} mesh")
        if thing is None or (output["target"] == "lightmap" and not output["uv_layer"]):
            # A mesh that could not hold its UV map; the report's warnings tell which.
            print(f"not in the picture: {name}", file=sys.stderr)
            continue
        if not thing.material_slots:
            thing.data.materials.append(None)
        for slot in thing.material_slots:
            material = slot.material.copy() if slot.material else bpy.data.materials.new("Grey")
            slot.link = "OBJECT"
            slot.material = material
            if material.node_tree is None:
                material.use_nodes = True
            emit_instead(material.node_tree, output, folder, quantity)


def made_real(names: list[str]) -> dict[str, Any]:
    """Objects in place of the instances of collections that have these names in a report, so that each can show its own
    light."""
    import bpy
    from mathutils import Matrix
    from radiosity.radiosity_addon.conversion import copied
    from radiosity.radiosity_addon.visible import shown_meshes

    shown = [item for item in shown_meshes(bpy.context.evaluated_depsgraph_get(), [])
             if item.instancer and item.name in names]
    real = {}
    for item in shown:
        mesh = copied(item.mesh, item.materials)
        mesh.transform(Matrix(item.matrix.tolist()))
        real[item.name] = bpy.data.objects.new(item.name, mesh)
    for instancer in {item.instancer for item in shown}:
        bpy.data.objects[instancer].instance_type = "NONE"
    for made in real.values():
        bpy.context.scene.collection.objects.link(made)
    return real


def metered(scene: Any, folder: Path) -> float:
    """The exposure, in stops, that puts the upper quartile of what the camera sees where it belongs."""
    import bpy

    shape = scene.render
    whole = shape.resolution_percentage
    shape.resolution_percentage, scene.cycles.samples = METER_PERCENTAGE, METER_SAMPLES
    shape.image_settings.file_format, shape.filepath = "OPEN_EXR", str(folder / "meter.exr")
    bpy.ops.render.render(write_still=True)
    shape.resolution_percentage = whole
    image = bpy.data.images.load(shape.filepath)
    pixels = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(pixels)
    light = pixels.reshape(-1, image.channels)[:, :3].max(axis=1)
    light = light[light > 0]
    return math.log2(UPPER_QUARTILE / float(np.quantile(light, 0.75))) if len(light) else 0.0


def place_camera(scene: Any, names: list[str]) -> None:
    """A camera that sees all the baked objects, for a scene that has none."""
    import bpy
    from mathutils import Vector

    names = [name for name in names if name in bpy.data.objects]
    if not names:
        raise PictureError("none of the report's objects is in the .blend: give the report of this bake")
    corners = [bpy.data.objects[name].matrix_world @ Vector(corner)
               for name in names for corner in bpy.data.objects[name].bound_box]
    middle = sum(corners, Vector()) / len(corners)
    radius = max((corner - middle).length for corner in corners)
    direction = Vector((0.6, -0.8, 0.45)).normalized()
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.location = middle + direction * radius * 2.6
    camera.rotation_euler = (-direction).to_track_quat("-Z", "Y").to_euler()
    camera.data.clip_end = radius * 10
    scene.collection.objects.link(camera)
    scene.camera = camera


def render(blend: Path, report_path: Path, picture: Path, exposure: float | None, side: int = SIDE) -> None:
    """Open the .blend, show the lightmaps, write the PNG."""
    import bpy

    report = json.loads(report_path.read_text(encoding="utf-8"))
    if not report["outputs"]:
        raise PictureError(f"{report_path} lists no outputs: nothing was baked")
    bpy.ops.wm.open_mainfile(filepath=str(blend))
    scene = bpy.context.scene
    show_baked(report, report_path.parent)
    if scene.camera is None:
        place_camera(scene, [output["object"] for output in report["outputs"]])
    scene.view_settings.view_transform = "Standard"
    scene.view_settings.look = "None"
    shape = scene.render
    scale = side / max(shape.resolution_x, shape.resolution_y)
    shape.resolution_x, shape.resolution_y = round(shape.resolution_x * scale), round(shape.resolution_y * scale)
    shape.resolution_percentage = 100
    shape.engine = "CYCLES"
    scene.cycles.device = "CPU"
    scene.cycles.max_bounces = 0
    scene.cycles.use_denoising = False
    shape.use_compositing = shape.use_sequencer = False
    with tempfile.TemporaryDirectory(prefix="radiosity-meter-") as folder:
        scene.view_settings.exposure = metered(scene, Path(folder)) if exposure is None else exposure
    scene.cycles.samples = SAMPLES
    shape.image_settings.file_format, shape.image_settings.color_depth = "PNG", "8"
    shape.image_settings.color_mode = "RGB"
    shape.filepath = str(picture)
    bpy.ops.render.render(write_still=True)


def main() -> int:
    """Command line; 1 if the picture can't be made."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("blend", type=Path, help="the .blend that the bake saved")
    parser.add_argument("picture", type=Path, help="the PNG to write")
    parser.add_argument("--report", type=Path, help="the bake's report (default: report.json beside the .blend)")
    parser.add_argument("--exposure", type=float, help="stops; by default from what the camera sees")
    parser.add_argument("--side", type=int, default=SIDE, help=f"pixels of the longer side (default: {SIDE})")
    arguments = parser.parse_args()
    report = arguments.report or arguments.blend.parent / "report.json"
    for path in (arguments.blend, report):
        if not path.is_file():
            print(f"error: {path} not found: bake first, with --save and --report", file=sys.stderr)
            return 1
    with tempfile.TemporaryDirectory(prefix="radiosity-picture-") as folder:
        os.environ.setdefault("BLENDER_USER_RESOURCES", folder)
        try:
            render(arguments.blend.absolute(), report.absolute(), arguments.picture.absolute(), arguments.exposure,
                   arguments.side)
        except PictureError as error:
            print(f"error: {error}", file=sys.stderr)
            return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())

"""A stage for light against Cycles: the same lumels, once in the open and once half in the shade.

The receivers are two squares of 1 m at z = 0 with 8 x 8 lumels each, in one image. A black plate of 1 m at z = .5 m
hovers over the second one, a quarter of a metre aside, so that the shade's edges cross it. Cycles bakes the direct
diffuse light without colour, radiance = irradiance / pi. Ours comes twice: as the mean of the lamp's weights over
shadow rays that miss the plate, over the same part of each lumel; and from the solver's direct light.
"""

import bpy
import numpy as np
import pytest
from radiosity.radiosity_addon import compat
from radiosity.radiosity_addon.export import export_scene
from radiosity.radiosity_addon.lamp_nodes import emission_parts
from radiosity.radiosity_addon.lights import export_lights, lamp_data
from radiosity.radiosity_addon.linking import Linking
from radiosity.radiosity_addon.parts import whole
from radiosity.radiosity_addon.visible import shown_meshes
from radiosity.radiosity_addon.world import world_parts
from radiosity.solver.direct import DirectLight
from radiosity.solver.footprints import ReceiverFootprints
from radiosity.solver.geometry import Geometry
from radiosity.solver.parallel import Run
from radiosity.solver.receivers import Receivers
from radiosity.solver.sampling import kronecker, shifts
from radiosity.solver.scene import Scene
from radiosity.solver.settings import Settings

SIDE = 8
# Cycles' mean over a receiver's lumels is then within .1 % in the open and .4 % in the shade.
SAMPLES = 1024
RAYS = 1024
TOLERANCE = 0.005
OPEN_X, SHADED_X = -1.5, 0.5
# Lumels on the squares' diagonals are left out: two triangles share them, and Cycles samples one of the two.
LUMELS = np.flatnonzero(np.arange(SIDE * SIDE) // SIDE != np.arange(SIDE * SIDE) % SIDE)
PLATE = ((0.75, 1.75), (-0.25, 0.75), 0.5)


def set_stage():
    """An empty scene with the receivers and the plate; the world is black."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.world = bpy.data.worlds.new("World")
    set_world((0, 0, 0))
    x, y, z = PLATE
    corners = [(OPEN_X, -0.5, 0), (OPEN_X + 1, -0.5, 0), (OPEN_X + 1, 0.5, 0), (OPEN_X, 0.5, 0),
               (SHADED_X, -0.5, 0), (SHADED_X + 1, -0.5, 0), (SHADED_X + 1, 0.5, 0), (SHADED_X, 0.5, 0)]
    receiver = mesh("Receiver", corners, [(0, 1, 2, 3), (4, 5, 6, 7)], material("White", "ShaderNodeBsdfDiffuse"))
    uv = receiver.data.uv_layers.new(name="UVMap")
    places = [(0, 0), (0.5, 0), (0.5, 1), (0, 1), (0.5, 0), (1, 0), (1, 1), (0.5, 1)]
    uv.data.foreach_set("uv", np.ravel(places))
    mesh("Plate", [(x[0], y[0], z), (x[1], y[0], z), (x[1], y[1], z), (x[0], y[1], z)], [(0, 1, 2, 3)],
         material("Black", "ShaderNodeBsdfDiffuse", Color=(0, 0, 0, 1)))
    return scene


def mesh(name, corners, faces, paint):
    """An object of one material."""
    data = bpy.data.meshes.new(name)
    data.from_pydata(corners, [], faces)
    data.materials.append(paint)
    thing = bpy.data.objects.new(name, data)
    bpy.context.collection.objects.link(thing)
    return thing


def empty_tree(data):
    """The node tree of a material, world or lamp, without nodes."""
    if data.node_tree is None:  # Blender 5 gives materials and worlds a tree from the start
        data.use_nodes = True
    data.node_tree.nodes.clear()
    return data.node_tree


def material(name, shader, **values):
    """A material of one shader."""
    made = bpy.data.materials.new(name)
    tree = empty_tree(made)
    node, output = tree.nodes.new(shader), tree.nodes.new("ShaderNodeOutputMaterial")
    for socket, value in values.items():
        node.inputs[socket].default_value = value
    tree.links.new(node.outputs[0], output.inputs["Surface"])
    return made


def set_world(colour):
    """A world of one colour; returns its Background node."""
    tree = empty_tree(bpy.context.scene.world)
    background, output = (tree.nodes.new(f"ShaderNode{kind}") for kind in ("Background", "OutputWorld"))
    background.inputs["Color"].default_value = (*colour, 1)
    tree.links.new(background.outputs[0], output.inputs["Surface"])
    return background


def lamp(kind, location=(0, 0.3, 2), rotation=(0, 0, 0), scale=(1, 1, 1), **settings):
    """A lamp called Lamp."""
    data = bpy.data.lights.new("Lamp", kind)
    for name, value in settings.items():
        setattr(data, name, value)
    made = bpy.data.objects.new("Lamp", data)
    made.location, made.rotation_euler, made.scale = location, rotation, scale
    bpy.context.collection.objects.link(made)
    return made


def cycles_irradiance(passes=("DIRECT",), samples=SAMPLES):
    """(2, 56, 3): irradiance of the open and the shaded lumels by Cycles."""
    scene, receiver = bpy.context.scene, bpy.data.objects["Receiver"]
    scene.render.engine = "CYCLES"
    scene.cycles.device = "CPU"
    scene.cycles.samples = samples
    scene.cycles.use_adaptive_sampling = scene.cycles.use_denoising = False
    scene.cycles.sample_clamp_direct = scene.cycles.sample_clamp_indirect = 0
    # Blue noise ties the errors of neighbours together: means over a few lumels are then worse.
    scene.cycles.sampling_pattern = "TABULATED_SOBOL"
    image = bpy.data.images.new("Baked", 2 * SIDE, SIDE, float_buffer=True)
    image.colorspace_settings.name = "Non-Color"
    tree = receiver.data.materials[0].node_tree
    tree.nodes.active = tree.nodes.new("ShaderNodeTexImage")
    tree.nodes.active.image = image
    bpy.context.view_layer.objects.active = receiver
    receiver.select_set(True)
    bpy.ops.object.bake(type="DIFFUSE", pass_filter=set(passes), margin=0)
    pixels = np.array(image.pixels[:], np.float64).reshape(SIDE, 2, SIDE, 4)[..., :3]
    return pixels.transpose(1, 0, 2, 3).reshape(2, SIDE * SIDE, 3)[:, LUMELS] * np.pi


def footprint_points(left):
    """(56, RAYS, 3): points over the part of each lumel that Cycles bakes, of the receiver whose left edge is at x."""
    index = LUMELS[:, None]
    jitter = 0.5 + (random_numbers()[..., 2:] - np.float32(0.5)) * np.float32(compat.baked_footprint())
    points = np.zeros((len(LUMELS), RAYS, 3), np.float32)
    points[..., 0] = left + (index % SIDE + jitter[..., 0]) / SIDE
    points[..., 1] = -0.5 + (index // SIDE + jitter[..., 1]) / SIDE
    return points


def random_numbers():
    """(56, RAYS, 4): quasi-random points over light and footprint, moved at random for each lumel."""
    return (kronecker(RAYS, 4) + shifts(LUMELS, 4, seed=0)[:, None]) % np.float32(1)


def hits_plate(points, directions, distances):
    x, y, z = PLATE
    t = (z - points[:, 2]) / np.where(directions[:, 2] > 1e-6, directions[:, 2], 1e-6)
    at = points + t[:, None] * directions
    inside = (at[:, 0] > x[0]) & (at[:, 0] < x[1]) & (at[:, 1] > y[0]) & (at[:, 1] < y[1])
    return inside & (directions[:, 2] > 1e-6) & (t < distances)


def our_irradiance(lights):
    """(2, 56, 3): the same by our lamps' samples; (56, 3): closed form of the open ones, nan if there is none."""
    uv = random_numbers()[..., :2].reshape(-1, 2)
    result, closed = np.zeros((2, len(LUMELS), 3)), np.zeros((len(LUMELS), 3))
    for row, left in enumerate((OPEN_X, SHADED_X)):
        points = footprint_points(left).reshape(-1, 3)
        normals = np.tile(np.float32([0, 0, 1]), (len(points), 1))
        for light in lights:
            rays = light.sample(points, normals, uv)
            free = ~hits_plate(points, rays.direction, rays.distance)
            result[row] += (rays.weight * free).reshape(len(LUMELS), -1).mean(axis=1)[:, None] * light.colour
            if row == 0:
                formula = light.irradiance(points, normals)
                closed += np.nan if formula is None else formula.reshape(len(LUMELS), -1, 3).mean(axis=1)
    return result, closed


def solver_irradiance(lights, tolerance):
    """(2, 56, 3): the same by the solver's direct light, to a standard deviation of `tolerance` W/m2 a lumel."""
    x, y, z = PLATE
    squares = [[(left + i, j - 0.5, 0) for i, j in ((0, 0), (1, 0), (1, 1), (0, 1))] for left in (OPEN_X, SHADED_X)]
    plate = [(x[i], y[j], z) for i, j in ((0, 0), (1, 0), (1, 1), (0, 1))]
    vertices = np.array([*squares, plate], float).reshape(-1, 3)
    scene = Scene(vertices, np.array([(4 * k, 4 * k + i, 4 * k + i + 1) for k in range(3) for i in (1, 2)]))
    geometry = Geometry(scene)
    across, up = (LUMELS % SIDE + 0.5) / SIDE, (LUMELS // SIDE + 0.5) / SIDE
    lower = up < across  # the triangle of corners 0, 1, 2
    barycentric = np.where(lower, (across - up, up), (across, up - across)).T
    step = np.where(lower[:, None, None], [[1, 0], [-1, 1]], [[1, -1], [0, 1]]) / SIDE
    triangle = np.concatenate([np.where(lower, 2 * square, 2 * square + 1) for square in (0, 1)]).astype(np.int32)
    both = [np.tile(array, (2, *[1] * (array.ndim - 1))).astype(np.float32) for array in (barycentric, step)]
    receivers = Receivers(geometry.point(triangle, *both[0].T), np.tile(np.float32([0, 0, 1]), (len(triangle), 1)),
                          triangle, *both)
    direct = DirectLight(geometry, [light.translated(-scene.origin) for light in lights], seed=0)
    places = ReceiverFootprints(geometry, receivers, compat.baked_footprint(), seed=0)
    irradiance = direct.irradiance(places, Run(threads=1), tolerance, neighbours=neighbours())
    return irradiance.reshape(2, len(LUMELS), 3)


def neighbours():
    """(112, 8) rows of the lumels around each; -1 where there is none."""
    row_of = np.full((SIDE + 2, SIDE + 2), -1)
    row_of[1 + LUMELS // SIDE, 1 + LUMELS % SIDE] = np.arange(len(LUMELS))
    around = [row_of[1 + j + LUMELS // SIDE, 1 + i + LUMELS % SIDE] for j in (-1, 0, 1) for i in (-1, 0, 1) if i or j]
    one = np.stack(around, axis=1)
    return np.concatenate([one, np.where(one >= 0, one + len(LUMELS), -1)])


def assert_agree(lights):
    """Means of the open and of the shaded lumels as Cycles' to .5 %, each lumel to 3 % of the mean (RMS)."""
    cycles, (ours, closed) = cycles_irradiance(), our_irradiance(lights)
    mean = cycles.mean(axis=1)
    assert mean.min() > 0
    for irradiance in (ours, solver_irradiance(lights, 0.001 * mean.min())):
        assert irradiance.mean(axis=1) == pytest.approx(mean, rel=TOLERANCE)
        deviation = np.sqrt(((irradiance - cycles) ** 2).mean(axis=(1, 2))) / mean.mean(axis=1)
        assert deviation.max() < 0.03
    if not np.isnan(closed).any():
        assert closed.mean(axis=0) == pytest.approx(mean[0], rel=TOLERANCE)


def export(warnings=None):
    """The whole scene as the solver gets it."""
    scene, layer = bpy.context.scene, bpy.context.view_layer
    return export_scene(scene, layer, Settings(), [] if warnings is None else warnings).scene


def read_world(world, warnings):
    """What is left of a world's sky, and the lamps that its bright spots become."""
    return whole(world_parts(world, warnings))


def _export():
    warnings = []
    scene, layer = bpy.context.scene, bpy.context.view_layer
    emissions = whole(emission_parts(lamp_data(scene), scene, layer, warnings))
    depsgraph = bpy.context.evaluated_depsgraph_get()
    linking = Linking(depsgraph, shown_meshes(depsgraph, warnings))
    return export_lights(depsgraph, linking, warnings, emissions), warnings


def exported():
    """The scene's lamps, which export without a warning."""
    lights, warnings = _export()
    assert warnings == []
    return lights


def warned():
    """The scene's lamps, and the one warning that exporting them gave."""
    lights, warnings = _export()
    (warning,) = warnings
    assert (warning["object"], warning["code"]) == ("Lamp", "lamp")
    return lights, warning["message"]


def geometry_nodes(item, build_tree):
    """A geometry nodes modifier whose tree gives what `build_tree(tree, group input)` returns."""
    tree = bpy.data.node_groups.new("Geometry", "GeometryNodeTree")
    tree.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    start, end = tree.nodes.new("NodeGroupInput"), tree.nodes.new("NodeGroupOutput")
    tree.links.new(build_tree(tree, start.outputs[0]), end.inputs[0])
    item.modifiers.new("Nodes", "NODES").node_group = tree


def emission_nodes(thing, colour, strength):
    """Give a lamp a tree of one Emission node, and return it."""
    tree = empty_tree(thing.data)
    if not compat.uses_nodes(thing.data):
        thing.data.use_nodes = True
    emission, output = tree.nodes.new("ShaderNodeEmission"), tree.nodes.new("ShaderNodeOutputLight")
    emission.inputs["Color"].default_value = (*colour, 1)
    emission.inputs["Strength"].default_value = strength
    tree.links.new(emission.outputs[0], output.inputs["Surface"])
    return emission

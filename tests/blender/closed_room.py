"""A closed room, as a .blend and as path tracing written here, in which no line of the product takes part."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.floating[Any]]

# A closed room, metres, with a panel that hangs in it and shines both ways, and a block on its floor that stands on
# whole lumels.
SIDE = 2.0
PANEL = ((0.5, 0.5, 1.4), (1.5, 1.5, 1.4))
BLOCK = ((5 / 12, 1.0, 0.0), (10 / 12, 1.5, 1.0))
RADIANCE = 5.0
WHITE, RED, GREEN = (0.7, 0.7, 0.7), (0.6, 0.1, 0.1), (0.1, 0.5, 0.1)
# Each wall: the corner at (u, v) = (0, 0), its two sides, and its colour; the normal, u x v, points into the room.
WALLS = {
    "Floor": ((0, 0, 0), (SIDE, 0, 0), (0, SIDE, 0), WHITE),
    "Ceiling": ((0, SIDE, SIDE), (SIDE, 0, 0), (0, -SIDE, 0), WHITE),
    "Front": ((0, 0, SIDE), (SIDE, 0, 0), (0, 0, -SIDE), WHITE),
    "Back": ((0, SIDE, 0), (SIDE, 0, 0), (0, 0, SIDE), WHITE),
    "Left": ((0, 0, 0), (0, SIDE, 0), (0, 0, SIDE), RED),
    "Right": ((SIDE, SIDE, 0), (0, -SIDE, 0), (0, 0, SIDE), GREEN),
}
BAKED = ("Floor", "Back", "Left", "Right")
RESOLUTION = 24
# Paths of each lumel in each of the two references made here, and of so many at once.
PATHS, AT_ONCE = 512, 1 << 17
# Steps of an even sequence in four dimensions: powers of the root of x^5 = x + 1.
EVEN = 1.1673039782614187 ** -np.arange(1.0, 5.0)


def save_room(path: Path) -> Path:
    """The room as a .blend, every wall with a UV map that is the whole of its image."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    for name, (corner, along, up, colour) in WALLS.items():
        c, u, v = (np.array(value, float) for value in (corner, along, up))
        add(name, [c, c + u, c + u + v, c + v], [(0, 1, 2, 3)], colour)
    low, high = np.array(BLOCK)
    points = [np.where([x, y, z], high, low) for z in (0, 1) for y in (0, 1) for x in (0, 1)]
    add("Block", points, [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)], WHITE)
    (x0, y0, z), (x1, y1, _) = PANEL
    panel = add("Panel", [(x0, y0, z), (x0, y1, z), (x1, y1, z), (x1, y0, z)], [(0, 1, 2, 3)], (0, 0, 0))
    shader = principled(panel.data.materials[0])
    shader.inputs["Emission Color"].default_value = (1, 1, 1, 1)
    shader.inputs["Emission Strength"].default_value = RADIANCE
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    return path


def add(name: str, points: Any, faces: Any, colour: tuple[float, ...]) -> Any:
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata([tuple(map(float, point)) for point in points], [], faces)
    material = bpy.data.materials.new(name)
    if material.node_tree is None:
        material.use_nodes = True
    principled(material).inputs["Base Color"].default_value = (*colour, 1.0)
    mesh.materials.append(material)
    if len(faces) == 1:
        mesh.uv_layers.new(name="Mine").uv.foreach_set("vector", np.array([0, 0, 1, 0, 1, 1, 0, 1], np.float32))
    made = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(made)
    return made


def principled(material: Any) -> Any:
    return next(node for node in material.node_tree.nodes if node.bl_idname == "ShaderNodeBsdfPrincipled")


def hit(origin: Float, direction: Float) -> tuple[Float, Float, NDArray[np.bool_], Float]:
    """Nearest surface of the room along rays (n, 3): point, normal, whether it is the panel, reflectance."""
    with np.errstate(divide="ignore", invalid="ignore"):
        to_walls = np.where(direction > 0, (SIDE - origin) / direction, -origin / direction)
        to_walls[direction == 0] = np.inf
        axis = to_walls.argmin(axis=1)
        distance = to_walls.min(axis=1)
        side = np.take_along_axis(direction, axis[:, None], 1)[:, 0] > 0
        normal = np.zeros_like(origin)
        normal[np.arange(len(axis)), axis] = np.where(side, -1, 1)
        colour = np.full_like(origin, WHITE[0])
        colour[(axis == 0) & ~side], colour[(axis == 0) & side] = RED, GREEN
        # The block, by slabs (Kay & Kajiya 1986).
        low, high = np.array(BLOCK, origin.dtype)
        near, far = (low - origin) / direction, (high - origin) / direction
        near, far = np.minimum(near, far), np.maximum(near, far)
        enter, leave = near.max(axis=1), far.min(axis=1)
        met = (enter < leave) & (enter > 1e-5) & (enter < distance)
        rows, face = np.flatnonzero(met), near.argmax(axis=1)[met]
        normal[rows] = 0
        normal[rows, face] = -np.sign(direction[rows, face])
        colour[rows] = WHITE
        distance = np.where(met, enter, distance)
        # The panel, a rectangle at one height.
        (x0, y0, z), (x1, y1, _) = PANEL
        height = (z - origin[:, 2]) / direction[:, 2]
        x, y = (origin[:, i] + height * direction[:, i] for i in (0, 1))
        panel = (height > 1e-5) & (height < distance) & (x > x0) & (x < x1) & (y > y0) & (y < y1)
    return origin + distance[:, None] * direction, normal, panel, colour


def cosine(normal: Float, numbers: Float) -> Float:
    """Directions about unit normals, with a density in proportion to the cosine: normal plus a point on a sphere."""
    height, angle = 1 - 2 * numbers[:, 0], 2 * np.pi * numbers[:, 1]
    ring = np.sqrt(np.maximum(1 - height**2, 0))
    ball = np.stack([ring * np.cos(angle), ring * np.sin(angle), height], axis=1)
    direction = normal + ball * np.float32(0.99999)
    return np.asarray(direction / np.linalg.norm(direction, axis=1, keepdims=True))


def from_panel(origin: Float, normal: Float, numbers: Float) -> Float:
    """The panel's own light E / pi at points (n, 3), (n, 1): one shadow ray each, to the point that (n, 2) say."""
    low, high = np.array(PANEL, np.float32)
    towards = low + np.pad(numbers, ((0, 0), (0, 1))) * (high - low) - origin
    square = np.maximum((towards**2).sum(axis=1), 1e-8)
    with np.errstate(divide="ignore", invalid="ignore"):
        near, far = (np.array(BLOCK, np.float32)[:, None] - origin) / towards
    enter, leave = np.minimum(near, far).max(axis=1), np.maximum(near, far).min(axis=1)
    free = ~((enter < leave) & (enter < 1) & (leave > 1e-4))
    cosines = np.maximum((towards * normal).sum(axis=1), 0) * np.abs(towards[:, 2]) / square
    area = np.prod((high - low)[:2])
    return np.asarray(RADIANCE * area / np.pi * free * cosines / square)[:, None]


def path_traced(origin: Float, normal: Float, numbers: Float, random: np.random.Generator) -> Float:
    """Radiance E / pi at points (n, 3), one path each, with a shadow ray to the panel from every vertex.

    `numbers` (n, 4) say where the first shadow ray and the first direction go; chance says the rest.
    """
    radiance = from_panel(origin, normal, numbers[:, :2]) * np.ones(3, np.float32)
    numbers = numbers[:, 2:]
    carried = np.ones_like(origin)
    alive = np.arange(len(origin))
    for bounce in range(1000):
        place, facing, panel, colour = hit(origin, cosine(normal, numbers))
        carried = carried * colour
        # The panel reflects nothing; other paths end by chance, and those that go on carry more for it.
        chance = np.where(panel, 0, carried.max(axis=1) if bounce > 1 else 1)
        keep = random.random(len(chance)) < chance
        alive, origin, normal = alive[keep], place[keep] + facing[keep] * np.float32(1e-4), facing[keep]
        carried = carried[keep] / chance[keep, None].astype(np.float32)
        if not len(alive):
            break
        numbers = random.random((len(alive), 2), np.float32)
        radiance[alive] += carried * from_panel(origin, normal, random.random((len(alive), 2), np.float32))
    return radiance


def independent_reference(seed: int) -> dict[str, Float]:
    """E / pi of the baked walls' lumels, (n, n, 3) each: the mean over the middle half of a texel each way."""
    random = np.random.default_rng(seed)
    found = {}
    for name in BAKED:
        corner, u, v, _ = (np.array(value, np.float32) for value in WALLS[name])
        normal = np.cross(u, v) / SIDE**2
        row, column = np.divmod(np.repeat(np.arange(RESOLUTION**2), PATHS), RESOLUTION)
        # For each lumel the same even sequence (Kronecker's, Roberts 2018), shifted by chance.
        even = np.outer(np.tile(np.arange(PATHS), RESOLUTION**2), EVEN)
        even = ((even + np.repeat(random.random((RESOLUTION**2, 4)), PATHS, axis=0)) % 1).astype(np.float32)
        total = np.zeros((RESOLUTION**2, 3))
        for start in range(0, len(row), AT_ONCE):
            part = slice(start, start + AT_ONCE)
            x, y = (random.random((2, len(row[part]))) - 0.5) * 0.5 + 0.5 + np.stack([column[part], row[part]])
            points = corner + (x[:, None] * u + y[:, None] * v) / RESOLUTION + normal * 1e-4
            light = path_traced(points.astype(np.float32), np.broadcast_to(normal, points.shape).astype(np.float32),
                                even[part], random)
            np.add.at(total, row[part] * RESOLUTION + column[part], light)
        found[name] = (total / PATHS).reshape(RESOLUTION, RESOLUTION, 3)
    return found

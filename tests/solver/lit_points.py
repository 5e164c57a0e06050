"""Points that lamps shine on, and what they get there by sampling."""

import numpy as np
from radiosity.solver.sampling import kronecker


def arrays(points, normals):
    """Both as (n, 3) float32, broadcast to one another."""
    points, normals = np.broadcast_arrays(np.asarray(points, np.float32), np.asarray(normals, np.float32))
    return np.atleast_2d(points), np.atleast_2d(normals)


def sampled(light, points, normals, count):
    """(n, 3): mean of weight * colour over `count` quasi-random points of the lamp."""
    uv = np.tile(kronecker(count, 2), (len(points), 1))
    rays = light.sample(np.repeat(points, count, axis=0), np.repeat(normals, count, axis=0), uv)
    return rays.weight.reshape(len(points), count).mean(axis=1, dtype=np.float64)[:, None] * light.colour


def scattered(count=200):
    """Points around the origin with normals every way."""
    rng = np.random.default_rng(7)
    normals = rng.normal(size=(count, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    points = rng.uniform(-1, 1, (count, 3)) * (1, 1, 0.5)
    return arrays(points, normals)


def shell(count=20000, radius=5.0, centre=(0, 0, 2)):
    """Points and inward normals spread evenly over a sphere (Fibonacci), and its area."""
    z = 1 - (2 * np.arange(count) + 1) / count
    angle = np.arange(count) * np.pi * (3 - np.sqrt(5))
    outward = np.stack([np.sqrt(1 - z**2) * np.cos(angle), np.sqrt(1 - z**2) * np.sin(angle), z], axis=1)
    return *arrays(centre + radius * outward, -outward), 4 * np.pi * radius**2

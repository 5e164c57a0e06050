"""What a bake will about cost: lumels, memory and time, before it is done.

The order of magnitude, no more: how many rays a lumel takes, and how many cells they meet, is known when they are shot.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from ..solver.geometry import Geometry
from ..solver.layout import world_areas
from ..solver.scene import Scene
from ..solver.settings import DEFAULT_PAGE, Settings

# Part of a page that charts cover, about.
FILL = 0.7
# Bytes of a bake beside Blender's own: at its start, a lumel, a triangle (with the cells that rays meet on it).
BYTES, BYTES_LUMEL, BYTES_TRIANGLE = 2e8, 1500.0, 2500.0
# Rays a lumel at an error of 10 %, and the power of the error that they go with.
RAYS, RAYS_POWER = 150.0, 1.3
# Part of the speed of bare rays that a bake keeps.
KEPT = 0.25
# Seconds to read and unwrap a triangle.
SECONDS_TRIANGLE = 7e-5
# Rays of the speed test.
TRIAL = 1 << 16


@dataclass(frozen=True)
class Cost:
    """About what a bake takes: lumels (or corners), bytes beside Blender's own, seconds."""

    lumels: int
    memory_bytes: int
    seconds: float

    def line(self) -> str:
        """In words."""
        minutes = f"{self.seconds:.0f} s" if self.seconds < 90 else f"{self.seconds / 60:.0f} min"
        return f"about {self.lumels:,} lumels, {self.memory_bytes / 2**30:.1f} GiB, {minutes}"


def expected_cost(scene: Scene, settings: Settings, lumels: int = 0) -> Cost:
    """Estimate; `lumels` where they are known already."""
    count = lumels or _lumels(scene, settings)
    rays = count * RAYS * max(0.1 / settings.error, 0.3) ** RAYS_POWER
    seconds = rays / (_rays_per_second(scene) * KEPT * settings.thread_count) + len(scene.triangles) * SECONDS_TRIANGLE
    return Cost(count, int(BYTES + count * BYTES_LUMEL + len(scene.triangles) * BYTES_TRIANGLE), seconds)


def _lumels(scene: Scene, settings: Settings) -> int:
    """Lumels of an unwrap that has not been made."""
    receiving = [item for item in scene.surfaces if item.receives]
    if settings.target == "vertex":
        return 3 * sum(item.count for item in receiving)
    pages = settings.max_pages if settings.effective_atlas == "shared" else len(receiving)
    if settings.texel_density is not None:
        areas = world_areas(scene)
        whole = sum(float(areas[item.triangles].sum()) * item.density**2 for item in receiving)
        return int(whole * settings.texel_density**2)
    if settings.resolution is None:
        pages = settings.max_pages
    return int(FILL * pages * (settings.resolution or DEFAULT_PAGE) ** 2)


def _rays_per_second(scene: Scene) -> float:
    """Bare rays a second of one thread, through this scene on this machine."""
    geometry = Geometry(scene)
    random = np.random.default_rng(0)
    triangle = random.integers(0, len(scene.triangles), TRIAL)
    third = np.full(TRIAL, 1 / 3, np.float32)
    points = geometry.lifted(geometry.point(triangle, third, third), triangle, np.ones(TRIAL, bool))
    ways = random.normal(size=(TRIAL, 3)).astype(np.float32)
    ways = geometry.normal[triangle] + ways / np.linalg.norm(ways, axis=1, keepdims=True)
    caster = geometry.visibility
    start = time.thread_time()  # not the clock on the wall: other programs don't make the estimate longer
    caster.hits(points, np.asarray(ways, np.float32))
    return TRIAL / max(time.thread_time() - start, 1e-6)

"""What a bake will about cost: lumels, memory and time, before it is done.

The order of magnitude, no more: how many rays a lumel takes, and how many cells they meet, is known when they are shot.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from ..solver.direct import FEW_LAMPS
from ..solver.geometry import Geometry
from ..solver.layout import world_areas
from ..solver.scene import Scene
from ..solver.settings import DEFAULT_PAGE, Settings
from ..solver.sources import light_sources
from ..solver.vertices import sample_count

# Part of a page that charts cover, about.
FILL = 0.7
# Bytes of a bake beside Blender's own: at its start, a lumel, a triangle (with the cells that rays meet on it).
BYTES, BYTES_LUMEL, BYTES_TRIANGLE = 2e8, 1500.0, 2500.0
# Rays a lumel: some always, and others at an error of 10 % that go with this power of the error. (On a page of
# 1,024 pixels: 52 to 84 rays at .1 and 94 to 211 at .03 in seven scenes, 352 to 491 at .01 in three.)
RAYS, MORE_RAYS, RAYS_POWER = 50.0, 12.0, 1.5
# So many times as many where there are many lamps (pandora: 239 and 584).
LAMPS_FACTOR = 4.0
# Seconds of a thread that a ray takes beside its way through the scene.
SECONDS_RAY = 2.5e-7
# Seconds to read and unwrap a triangle.
SECONDS_TRIANGLE = 4e-5
# Rays of the speed test.
TRIAL = 1 << 16


@dataclass(frozen=True)
class Cost:
    """About what a bake takes: lumels (or samples in triangles), bytes beside Blender's own, seconds."""

    lumels: int
    memory_bytes: int
    seconds: float

    def line(self) -> str:
        """In words."""
        minutes = f"{self.seconds:.0f} s" if self.seconds < 90 else f"{self.seconds / 60:.0f} min"
        return f"about {self.lumels:,} lumels, {self.memory_bytes / 2**30:.1f} GiB, {minutes}"


def expected_cost(geometry: Geometry, settings: Settings, lumels: int = 0) -> Cost:
    """Estimate; `lumels` where they are known already."""
    scene = geometry.scene
    count = lumels or _lumels(scene, settings)
    ray = SECONDS_RAY + 1 / _rays_per_second(geometry)
    seconds = expected_rays(geometry, settings, count) * ray / settings.thread_count
    return Cost(count, int(BYTES + count * BYTES_LUMEL + len(scene.triangles) * BYTES_TRIANGLE),
                seconds + len(scene.triangles) * SECONDS_TRIANGLE)


def expected_rays(geometry: Geometry, settings: Settings, lumels: int) -> float:
    """About how many rays a bake of so many lumels traces."""
    lamps, _ = light_sources(geometry)
    each = RAYS + MORE_RAYS * max(0.1 / settings.error, 0.3) ** RAYS_POWER
    return float(lumels * each * (LAMPS_FACTOR if len(lamps) > FEW_LAMPS else 1.0))


def _lumels(scene: Scene, settings: Settings) -> int:
    """Lumels of an unwrap that has not been made."""
    if settings.target == "vertex":
        return sample_count(scene, settings)
    receiving = [item for item in scene.surfaces if item.receives]
    pages = settings.max_pages if settings.effective_atlas == "shared" else len(receiving)
    if settings.texel_density is not None:
        areas = world_areas(scene)
        whole = sum(float(areas[item.triangles].sum()) * item.density**2 for item in receiving)
        return int(whole * settings.texel_density**2)
    if settings.resolution is None:
        pages = settings.max_pages
    return int(FILL * pages * (settings.resolution or DEFAULT_PAGE) ** 2)


def _rays_per_second(geometry: Geometry) -> float:
    """Bare rays a second of one thread, through this scene on this machine."""
    random = np.random.default_rng(0)
    # Neighbours trace neighbouring rays, as lumels do.
    triangle = np.sort(random.integers(0, len(geometry.normal), TRIAL))
    third = np.full(TRIAL, 1 / 3, np.float32)
    points = geometry.lifted(geometry.point(triangle, third, third), triangle, np.ones(TRIAL, bool))
    ways = random.normal(size=(TRIAL, 3)).astype(np.float32)
    ways = np.asarray(geometry.normal[triangle] + ways / np.linalg.norm(ways, axis=1, keepdims=True), np.float32)
    caster = geometry.visibility
    caster.hits(points[:1], ways[:1])  # Embree builds its tree for the first of all rays
    start = time.thread_time()  # not the clock on the wall: other programs don't make the estimate longer
    caster.hits(points, ways)
    return TRIAL / max(time.thread_time() - start, 1e-6)

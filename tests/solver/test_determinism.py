"""The same input and seed give the same bits, whatever the number of threads."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys

import numpy as np
import pytest
from radiosity.solver import Settings, Sky, bake, tables
from radiosity.solver.geometry import Geometry
from radiosity.solver.lamps import Point
from radiosity.solver.sampling import combined
from radiosity.tests.solver.rooms import CEILING, box, quad, shape


def _scene():
    """A room with a hole in its lid, a block, a glowing plate, a soft lamp and a sky: every way light can take."""
    room = box((0, 0, 0), (3, 3, 2), 0.6)
    keep = np.delete(np.arange(12), 2 * CEILING)
    walls = shape(room.corners[keep], room.reflectance[keep])
    whole = (walls + box((1, 1, 0), (1.7, 1.7, 0.8), 0.4, inward=False)
             + quad((0.2, 0.2, 1.5), (0.3, 0, 0), (0, 0.3, 0), 0.5, 40.0))
    return whole.scene(lights=(Point("lamp", (2, 2, 1.5), (50, 40, 30), 0.1),), sky=Sky((0.5, 0.6, 0.8)))


def _bits(bake_):
    return [lightmap.pixels.tobytes() for lightmap in bake_.lightmaps] + [
        colours.tobytes() for colours in bake_.corner_colours or ()]


@pytest.fixture(scope="module")
def by_two():
    """The scene's corner colours, baked by two threads."""
    return bake(_scene(), Settings(error=0.1, threads=2, target="vertex"))


def _same(one, other):
    assert _bits(one)
    assert _bits(one) == _bits(other)
    assert one.report["error"] == other.report["error"]
    assert one.report["rays"] == other.report["rays"]


def test_one_thread_and_two_bake_the_same_corner_colours(by_two):
    # Every step by one thread, then by two: equal to the last bit, the error bar too.
    _same(bake(_scene(), Settings(error=0.1, threads=1, target="vertex")), by_two)


def test_one_thread_and_two_bake_the_same_images():
    # Lumels have what corners lack: an atlas, neighbours, smoothing, dilation.
    _same(*(bake(_scene(), Settings(error=0.1, threads=threads, texel_density=6.0)) for threads in (1, 2)))


def test_a_geometry_serves_more_than_one_bake(by_two):
    # Drafts and result share one: what the first bake has looked up in it changes nothing in the second.
    geometry = Geometry(_scene())
    for _ in range(2):
        done = bake(geometry.scene, Settings(error=0.1, threads=2, target="vertex"), geometry=geometry)
        _same(done, by_two)


def products():
    """What the solver's products over many rays come to, as a hash."""
    rng = np.random.default_rng(3)
    long = [tables.mean_over_rays(rng.random((2**16, 4), np.float32), 2**power) for power in range(4, 17)]
    points, axes = rng.random((99_999, 3), np.float32), rng.random((3, 3), np.float32)
    return hashlib.sha256(b"".join(each.tobytes() for each in (*long, combined(points, axes)))).hexdigest()


def test_libraries_with_one_thread_and_two_leave_the_same_bits():
    # NumPy's BLAS shares products out to as many threads as the machine has cores, and adds up in another order then.
    code = "from radiosity.tests.solver.test_determinism import products; print(products())"
    names = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")
    one, two = (subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True,
                               env={**os.environ, **dict.fromkeys(names, threads)}).stdout for threads in ("1", "2"))
    assert one == two


def test_another_seed_bakes_other_noise(by_two):
    # Seeds 0 and 1: not the same bits, but the same light within twice the error asked for.
    other = bake(_scene(), Settings(error=0.1, threads=2, target="vertex", seed=1))
    assert _bits(by_two) != _bits(other)
    a, b = (np.concatenate([colours.reshape(-1) for colours in each.corner_colours]) for each in (by_two, other))
    assert np.sqrt(np.mean((a - b) ** 2)) / a.mean() < 0.2

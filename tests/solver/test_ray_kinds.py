"""Surfaces that only shadow rays, or only gather rays, meet."""

import numpy as np
import pytest
from radiosity import solver
from radiosity.solver.geometry import Geometry
from radiosity.solver.lamps import Point
from radiosity.solver.scene import Scene

LOW, HIGH = 1.0, 2.0


def _stack(**kinds):
    """Two plates of 2 m over one another, at z = 1 and 2, over the origin."""
    plates = [[(x, y, z) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))] for z in (LOW, HIGH)]
    triangles = [(0, 1, 2), (0, 2, 3), (4, 5, 6), (4, 6, 7)]
    return Scene(np.array(plates, float).reshape(-1, 3), triangles, reflectance=0.0, **kinds)


@pytest.mark.parametrize(("seen", "casts", "met", "distance"), [
    ((1, 1), (1, 1), (0, 1), 1.0), ((0, 1), (1, 1), (2, 3), 2.0), ((1, 1), (0, 1), (0, 1), 1.0),
    ((0, 0), (0, 1), (-1,), np.inf),
])
def test_each_kind_of_ray_meets_its_own_triangles_by_their_own_numbers(seen, casts, met, distance):
    # A ray from the origin upward; shadow rays of 1.5 m are stopped by the low plate alone.
    scene = _stack(seen=np.repeat(seen, 2).astype(bool), casts_shadow=np.repeat(casts, 2).astype(bool))
    visibility = Geometry(scene).visibility
    start = np.float32([(0.3, 0.1, 0)]) - scene.origin.astype(np.float32)
    up = np.float32([(0, 0, 1)])
    hits = visibility.hits(start, up)
    assert hits.triangle[0] in met
    if met != (-1,):
        assert hits.distance[0] == pytest.approx(distance)
    assert visibility.occluded(start, up, np.float32([1.5]))[0] == bool(casts[0])


@pytest.mark.parametrize(("casts", "factor"), [(True, 0.0), (False, 1.0)])
def test_a_plate_without_shadow_lets_a_lamps_light_through(casts, factor):
    # 4 pi W at 3 m straight above: I / d^2 = 1 / 9.
    scene = _stack(casts_shadow=casts)
    scene = Scene(scene.vertices, scene.triangles, reflectance=0.0, casts_shadow=casts,
                  lights=(Point("bulb", (0, 0, 3), 4 * np.pi),))
    value = solver.irradiance(scene, solver.Settings(), np.zeros((1, 3)), np.float32([(0, 0, 1)]))
    assert value[0] == pytest.approx(factor / 9, rel=1e-4)

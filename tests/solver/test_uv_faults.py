"""Distortion of layouts, against maps whose stretch is known."""

from __future__ import annotations

import numpy as np
import pytest
from radiosity.solver.lumels import lumels
from radiosity.solver.scene import Scene, Surface
from radiosity.solver.settings import Settings
from radiosity.solver.uv_faults import distorted_parts, stretch

SQUARE = np.array([[[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 0, 0], [1, 1, 0], [0, 1, 0]]], float)


@pytest.mark.parametrize("factors", [(1, 1), (3, 1), (1, 0.25), (0.1, 0.2)])
@pytest.mark.parametrize("turn", [0.0, 0.7])
def test_stretch_is_the_ratio_of_a_maps_singular_values(factors, turn):
    # A unit square laid out by a turn after a scaling. Exact answer: the factors' ratio; density their root.
    matrix = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]) @ np.diag(factors)
    ratio, density = stretch(SQUARE, SQUARE[:, :, :2] @ matrix.T)
    assert ratio == pytest.approx(max(factors) / min(factors), rel=1e-6)
    assert density == pytest.approx(np.sqrt(factors[0] * factors[1]), rel=1e-6)


def test_a_triangle_without_area_is_stretched_without_bound_and_a_good_one_beside_it_is_measured():
    # One tilted triangle, in the layout as it is, as a line, a line across, a point; in space a line, a point.
    # Exact answer: 1 for the first, infinity and no density for all others, and no warning of NumPy's.
    flat = SQUARE[0, :, :2]
    uv = np.array([flat, flat * (1, 0), flat @ [[1, 2], [1, 2]], flat * 0, flat, flat])
    tilted = SQUARE[0] @ np.linalg.qr([[1, 2, 3], [2, -1, 1], [1, 1, -2]])[0]
    positions = np.array([tilted] * 4 + [tilted * (0, 1, 0), tilted * 0])
    ratio, density = stretch(positions, uv)
    assert [ratio[0], density[0]] == pytest.approx([1, 1])
    assert np.isinf(ratio[1:]).all()
    assert not density[1:].any()


def _floors(scales):
    """Unit squares side by side, each with its own scaling in the layout."""
    positions = np.concatenate([SQUARE + np.array([2 * k, 0, 0]) for k in range(len(scales))])
    uv = np.concatenate([SQUARE[:, :, :2] * scale for scale in scales])
    return positions, uv


@pytest.mark.parametrize(("scales", "expected"), [
    ([(1, 1), (1, 1), (1, 1), (1, 1)], (0, 0, 0)),
    ([(1, 1), (1, 1), (1, 1), (1, 0.2)], (0.25, 0, 0)),
    ([(1, 1), (1, 1), (1, 1), (0.2, 0.2)], (0, 0.25, 0)),
    ([(1, 1), (1, 1), (1, 1), (0, 0)], (0, 0, 0.25)),
])
def test_the_distorted_part_of_an_object_is_measured_by_area(scales, expected):
    # Four squares, one of them stretched, coarse, or a point. Exact answer: a quarter of the area.
    assert distorted_parts(*_floors(scales)) == pytest.approx(expected)


@pytest.mark.parametrize(("scale", "code"), [
    ((0.2, 0.2), ""), ((0.2, 0.02), "uv_stretch"), ((0.02, 0.02), "uv_density"), ((0, 0), "uv_no_area")])
def test_a_bake_with_the_users_map_tells_of_its_distortion(scale, code):
    # Four squares in a map, the last one distorted. Exact answer: one warning that names the object; none if not.
    positions, uv = _floors([(0.2, 0.2)] * 3 + [scale])
    uv += np.repeat([[0.02, 0.02], [0.25, 0.02], [0.5, 0.02], [0.75, 0.02]], 2, axis=0)[:, None]
    scene = Scene(positions.reshape(-1, 3), np.arange(24).reshape(-1, 3),
                  surfaces=(Surface("floors", 0, 8, lightmap_uv=uv.astype(np.float32)),))
    warnings: list[dict[str, str]] = []
    lumels(scene, Settings(uv_layer="UVMap", resolution=256), warnings)
    assert [(entry["object"], entry["code"]) for entry in warnings] == ([("floors", code)] if code else [])

"""Rays through surfaces with holes: against counting, in closed boxes, and the same whichever way they are cast."""

from __future__ import annotations

import numpy as np
import pytest
from radiosity.solver import SceneError, Settings, bake
from radiosity.solver.cutouts import CutoutVisibility
from radiosity.solver.geometry import Geometry
from radiosity.solver.sampling import kronecker
from radiosity.solver.scene import Scene, Texture
from radiosity.solver.sheet_layers import MOST_LAYERS, sheet_layers
from radiosity.solver.visibility import Visibility

UP = np.array([0, 0, 1], np.float32)
# Stops what falls on its left half, in a texture of 64 x 64 texels.
LEFT = Texture((np.arange(64) < 32).astype(np.float32)[None, :, None].repeat(64, 0).repeat(3, 2))


def stack(heights, opacity, texture=None, **options):
    """Unit squares one above the other; the last one is a solid lid."""
    corners = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], float)
    points = np.concatenate([np.column_stack([corners, np.full(4, height)]) for height in heights])
    triangles = np.concatenate([np.array([(0, 1, 2), (0, 2, 3)]) + 4 * index for index in range(len(heights))])
    sheets = 2 * len(heights) - 2
    which = np.r_[np.full(sheets, -1 if texture is None else 0), -1, -1].astype(np.int32)
    uv = None if texture is None else points[triangles][..., :2]
    return Scene(points, triangles, opacity=np.r_[np.full(sheets, opacity), 1, 1], opacity_texture=which, uv=uv,
                 textures=() if texture is None else (texture,), **options)


def rays(count=4096, height=-1.0):
    """Upward rays spread over the square, about the scene's origin of a stack from 0 to 1."""
    start = np.column_stack([kronecker(count, 2) - 0.5, np.full(count, height - 0.5)]).astype(np.float32)
    return start, np.tile(UP, (count, 1))


def test_a_texture_of_opacity_cuts_a_hole():
    # The left half of a sheet below a lid. Exact answer: rays on the left stop at the sheet, others at the lid.
    geometry = Geometry(stack((0, 1), 1.0, LEFT))
    origins, directions = rays()
    hits = geometry.visibility.hits(origins, directions)
    # The image is repeated: at the square's outer edges, too, both halves blend.
    clear = np.abs(np.abs(origins[:, 0]) - 0.25) < 0.23
    left = origins[:, 0] < 0
    assert (hits.triangle[clear & left] < 2).all()
    assert (hits.triangle[clear & ~left] >= 2).all()
    assert np.allclose(hits.distance[clear], np.where(left, 1, 2)[clear], atol=1e-5)


@pytest.mark.parametrize(("sheets", "height"), [(1, 0.5), (3, 0.5), (2, 0.0), (4, 0.0)])
def test_sheets_multiply(sheets, height):
    # Sheets of opacity .3 below a lid, one behind the other or all in one place. Exact answer: .7 to their number of
    # the rays reach it, to 3 standard errors. When rays went on behind the first, they missed others in its place.
    geometry = Geometry(stack((*np.linspace(0, height, sheets), 1), 0.3))
    origins, directions = rays(1 << 15)
    through = geometry.visibility.hits(origins, directions).triangle >= 2 * sheets
    free = ~geometry.visibility.occluded(origins, directions, np.full(len(origins), 1.8, np.float32))
    expected = 0.7**sheets
    for part in (through, free):
        assert abs(part.mean() - expected) < 3 * np.sqrt(expected * (1 - expected) / len(part))


def test_a_hole_in_a_decal_shows_the_wall_that_it_lies_on():
    # A sheet with a hole on its right half, exactly on the lid. Exact answer: no ray gets past both.
    geometry = Geometry(stack((1, 1), 1.0, LEFT))
    origins, directions = rays()
    hits = geometry.visibility.hits(origins, directions)
    assert np.allclose(hits.distance, 1.5, atol=1e-5)
    hole = (origins[:, 0] > 0.02) & (origins[:, 0] < 0.48)
    assert (hits.triangle[hole] >= 2).all()
    assert geometry.visibility.occluded(origins, directions, np.full(len(origins), 3, np.float32)).all()


def test_what_lies_together_is_in_layers_of_its_own():
    # Squares at heights 0, 0, .5, .5, .5 and a solid lid at .5. Exact answer: of sheets at one height no two share a
    # layer, and none at the lid's is in the layer of the lid. Halves of one square share an edge alone, and no place.
    scene = stack((0, 0, 0.5, 0.5, 0.5, 0.5), 0.5)
    geometry = Geometry(scene)
    layer = sheet_layers(geometry.corners, geometry.offset, np.arange(12) < 10).reshape(6, 2)
    for half in layer.T:
        assert sorted(half[:2]) == [0, 1]
        assert sorted(half[2:5]) == [1, 2, 3]
        assert half[5] == 0


def test_sheets_beyond_the_last_layer_stay_together_in_it():
    scene = stack((*np.zeros(2 * MOST_LAYERS), 1), 0.5)
    geometry = Geometry(scene)
    layer = sheet_layers(geometry.corners, geometry.offset, np.arange(len(geometry.corners)) < 4 * MOST_LAYERS)
    assert layer.max() == MOST_LAYERS - 1
    assert geometry.visibility.hits(*rays(64)).triangle.min() >= 0


def test_shadow_rays_and_hits_agree_ray_by_ray():
    # Sheets of opacity .5. Exact answer: what stops a ray before the lid stops its shadow ray too.
    geometry = Geometry(stack((0, 0.25, 0.25, 0.5, 1), 0.5))
    origins, directions = rays()
    met = geometry.visibility.hits(origins, directions).triangle < 8
    assert np.array_equal(met, geometry.visibility.occluded(origins, directions, np.full(len(met), 1.8, np.float32)))


def test_rays_are_the_same_in_any_chunk_and_by_either_caster():
    geometry = Geometry(stack((0, 0.25, 0.5, 1), 1.0, LEFT))
    origins, directions = rays(1000)
    whole = geometry.visibility.hits(origins, directions)
    parts = [geometry.visibility.hits(origins[start:start + 77], directions[start:start + 77]).triangle
             for start in range(0, 1000, 77)]
    assert np.array_equal(whole.triangle, np.concatenate(parts))
    twin = CutoutVisibility(geometry.corners, geometry.offset, np.arange(8) < 6, geometry.opacity, embree=False)
    assert np.array_equal(twin.hits(origins, directions).triangle // 2, whole.triangle // 2)
    far = np.full(1000, 1.8, np.float32)
    hidden = geometry.visibility.occluded(origins, directions, far)
    assert np.array_equal(twin.occluded(origins, directions, far), hidden)


def test_a_ray_starts_from_a_sheet_and_does_not_meet_it_again():
    # Rays from just above a sheet of opacity .5, upward. Exact answer: all reach the lid.
    geometry = Geometry(stack((0, 1), 0.5))
    origins, directions = rays(height=float(geometry.offset[0]))
    assert (geometry.visibility.hits(origins, directions).triangle >= 2).all()


def test_a_scene_without_holes_has_the_plain_caster():
    assert type(Geometry(stack((0, 1), 1.0)).visibility) is Visibility


def test_opacity_outside_of_0_to_1_is_refused():
    with pytest.raises(SceneError, match="opacity"):
        stack((0, 1), 1.5)


def test_a_film_in_a_lit_box_absorbs_its_share():
    # A closed box of reflectance .5, its floor a lamp of 3 W, with a film of opacity .4 across the middle.
    # Exact answer: all is absorbed, to half a percent; without the film's opacity it would be 20 % too much.
    corner = np.array([(x, y, z) for z in (0, 1) for y in (0, 1) for x in (0, 1)], float)
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3), (8, 9, 10, 11)]
    points = np.r_[corner, [(0, 0, 0.5), (1, 0, 0.5), (1, 1, 0.5), (0, 1, 0.5)]]
    triangles = np.array([triangle for a, b, c, d in quads for triangle in ((a, b, c), (a, c, d))])
    scene = Scene(points, triangles, reflectance=0.5, emission=np.r_[np.full(2, 3.0), np.zeros(12)],
                  opacity=np.r_[np.ones(12), 0.4, 0.4])
    energy = bake(scene, Settings(error=0.03, resolution=32, threads=1)).report["energy"]
    assert energy["emitted"] == pytest.approx(3, rel=1e-3)
    assert abs(energy["imbalance"]) < 0.005

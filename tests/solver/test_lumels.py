"""Lumels: which texels there are, where they lie, which way they look and how large they are."""

import numpy as np
import pytest
from radiosity.solver.errors import NothingToBake, SettingsError
from radiosity.solver.layout import make_layout
from radiosity.solver.lumels import lumels
from radiosity.solver.scene import Scene, Surface
from radiosity.solver.settings import Settings

SQUARE = np.array([[0, 0, 0], [4, 0, 0], [4, 4, 0], [0, 4, 0]], float)
QUAD = np.array([[0, 1, 2], [0, 2, 3]])
ABOVE = SQUARE + np.array([0, 0, 1])


def square_scene(uv=None, shift=(0, 0, 0), **surface):
    """A square of 4 m in z = 0, its UV the square [0, 1]^2 unless given."""
    uv = SQUARE[QUAD][:, :, :2] / 4 if uv is None else uv
    return Scene(SQUARE + shift, QUAD, surfaces=(Surface("square", 0, 2, lightmap_uv=uv, **surface),))


def of(scene, warnings=None, **words):
    return lumels(scene, Settings(uv_layer="UVMap", **words), [] if warnings is None else warnings)


def test_a_square_over_the_whole_image_has_every_texel_once():
    # 4 m square on 8 x 8 texels: 64 lumels of .5 m; texel (c, r) is at (c + .501, r + .502) / 2 m, row 0 at v = 0.
    scene = square_scene()
    result = of(scene, resolution=8)
    assert result.pixel.tolist() == list(range(64))
    expected = np.stack([result.pixel % 8 + .501, result.pixel // 8 + .502, np.zeros(64)], axis=1) / (2, 2, 1)
    assert np.allclose(result.receivers.position + scene.origin, expected, atol=1e-6)
    assert np.allclose(result.receivers.normal, (0, 0, 1), atol=1e-7)
    assert result.pages[0].name == "Lightmap_square"


def test_the_barycentric_weights_give_the_position():
    # Position = corner0 (1 - u - v) + corner1 u + corner2 v for every lumel of a tilted, skewed quad.
    corners = np.array([[0, 0, 1], [3, .2, 2], [3.3, 2, 0], [.5, 2.5, 1]], float)
    uv = np.array([[.1, .05], [.9, .2], [.8, .95], [.05, .7]], np.float32)[QUAD]
    scene = Scene(corners, QUAD, surfaces=(Surface("quad", 0, 2, lightmap_uv=uv),))
    r = of(scene, resolution=40).receivers
    weights = np.column_stack([1 - r.barycentric.sum(axis=1), r.barycentric])
    expected = np.einsum("nc,ncx->nx", weights, corners[QUAD][r.triangle])
    assert np.allclose(r.position + scene.origin, expected, atol=1e-6)
    assert weights.min() >= -1e-6


def test_the_footprint_is_one_texel_in_space():
    # 4 m on 8 texels: one texel to the right moves the point by (.5, 0, 0) m, one up by (0, .5, 0).
    scene = square_scene()
    r = of(scene, resolution=8).receivers
    corners = scene.vertices[scene.triangles[r.triangle]]
    sides = np.stack([corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]], axis=1)
    steps = np.einsum("nsc,ncx->nsx", r.footprint, sides)
    assert np.allclose(steps[:, 0], (.5, 0, 0), atol=1e-5)
    assert np.allclose(steps[:, 1], (0, .5, 0), atol=1e-5)


def test_far_from_zero_positions_keep_their_digits():
    # The same square 100 km away: relative to the scene's origin nothing changes, to float32's digits.
    near, far = of(square_scene(), resolution=16), of(square_scene(shift=(1e5, -1e5, 1e4)), resolution=16)
    assert np.allclose(near.receivers.position, far.receivers.position, atol=1e-6)


def test_lumels_match_a_slow_rasteriser():
    # 60 random triangles, overlapping, both windings, partly outside: the loop over texels and triangles agrees.
    uv = np.random.default_rng(3).uniform(-.2, 1.2, (60, 3, 2)).astype(np.float32)
    vertices = np.random.default_rng(4).uniform(0, 1, (180, 3))
    scene = Scene(vertices, np.arange(180).reshape(60, 3), surfaces=(Surface("soup", 0, 60, lightmap_uv=uv),))
    result = of(scene, resolution=24)
    owner = {}
    for triangle, corners in enumerate(uv.astype(float) * 24):
        for row in range(24):
            for column in range(24):
                sides = [(b[0] - a[0]) * (row + .502 - a[1]) - (b[1] - a[1]) * (column + .501 - a[0])
                         for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)]
                if min(sides) >= 0 or max(sides) <= 0:
                    owner[row * 24 + column] = triangle
    assert dict(zip(result.pixel.tolist(), result.receivers.triangle.tolist(), strict=True)) == owner


def test_shared_edges_leave_no_gap_and_no_double():
    # A fan of 40 triangles round the middle of the image: 32 x 32 texels, each exactly once, no overlap told.
    angle = np.linspace(0, 2 * np.pi, 41)[:40]
    ring = .5 + 2 * np.column_stack([np.cos(angle), np.sin(angle)])
    uv2 = np.vstack([[.5, .5], ring])
    triangles = np.array([[0, 1 + i, 1 + (i + 1) % 40] for i in range(40)])
    scene = Scene(np.column_stack([uv2, np.zeros(41)]), triangles,
                  surfaces=(Surface("fan", 0, 40, lightmap_uv=uv2[triangles]),))
    warnings = []
    assert len(of(scene, warnings, resolution=32)) == 1024
    assert [w["code"] for w in warnings] == ["uv_outside"]


def test_shading_normals_are_interpolated_and_unit():
    # Corner normals of a sphere's patch: the lumel's normal is the normalised mean of them, weighted.
    normals = np.random.default_rng(5).normal((0, 0, 2), .4, (4, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    uv = SQUARE[QUAD][:, :, :2] / 4
    scene = Scene(SQUARE, QUAD, corner_normals=normals[QUAD], surfaces=(Surface("square", 0, 2, lightmap_uv=uv),))
    r = of(scene, resolution=8).receivers
    weights = np.column_stack([1 - r.barycentric.sum(axis=1), r.barycentric])
    expected = np.einsum("nc,ncx->nx", weights, normals[QUAD][r.triangle])
    assert np.allclose(r.normal, expected / np.linalg.norm(expected, axis=1, keepdims=True), atol=1e-6)


def test_charts_are_the_connected_pieces_of_the_layout():
    # Two triangles that share an edge in space: one chart if they share it in UV too, two if not.
    assert set(of(square_scene(), resolution=16).chart.tolist()) == {0}
    uv = (SQUARE[QUAD][:, :, :2] / 8).copy()
    uv[1] += .5
    assert set(of(square_scene(uv), resolution=16).chart.tolist()) == {0, 1}


def test_overlapping_uvs_are_told():
    # Both halves of the square on the same texels: one warning with the object's name.
    uv = (SQUARE[QUAD][:, :, :2] / 4).copy()
    uv[1] = uv[0]
    warnings = []
    of(square_scene(uv), warnings, resolution=32)
    assert [(w["object"], w["code"]) for w in warnings] == [("square", "uv_overlap")]


def test_uvs_outside_the_image_are_told_and_cut():
    # The square's UV is twice the image: a quarter of it lies inside, on all 16 x 16 texels.
    warnings = []
    result = of(square_scene(SQUARE[QUAD][:, :, :2] / 2), warnings, resolution=16)
    assert len(result) == 256
    assert (result.receivers.position + square_scene().origin)[:, :2].max() < 2
    assert [w["code"] for w in warnings] == ["uv_outside"]


def test_triangles_without_area_get_no_lumels_and_are_told():
    # A third triangle, a line in space, lies over the lower half in UV: the square keeps its 64 lumels.
    uv = np.concatenate([SQUARE[QUAD][:, :, :2] / 4, [[[0, 0], [1, 0], [1, 1]]]])
    vertices = np.vstack([SQUARE, [[2, 2, 0]]])
    triangles = np.vstack([QUAD, [[0, 4, 2]]])
    scene = Scene(vertices, triangles, surfaces=(Surface("square", 0, 3, lightmap_uv=uv),))
    warnings = []
    result = of(scene, warnings, resolution=8)
    assert len(result) == 64
    assert set(result.receivers.triangle.tolist()) == {0, 1}
    assert [w["code"] for w in warnings] == ["zero_area"]


def test_a_degenerate_uv_gives_no_lumels():
    # Triangle 1 has its three corners on one point of the UV: only triangle 0 gets lumels, all finite.
    uv = (SQUARE[QUAD][:, :, :2] / 4).copy()
    uv[1] = .5
    result = of(square_scene(uv), resolution=16)
    assert set(result.receivers.triangle.tolist()) == {0}
    assert np.isfinite(result.receivers.footprint).all()


def test_texel_density_sizes_the_image():
    # 4 m over the whole UV at 16 px/m: 64 pixels; over a quarter of the UV's area: 128.
    assert of(square_scene(), texel_density=16.).pages[0].width == 64
    assert of(square_scene(SQUARE[QUAD][:, :, :2] / 8), texel_density=16.).pages[0].width == 128


def test_every_object_has_its_own_page_or_shares_one():
    # Two squares with UVs of their own: two pages named after them; with a shared atlas one page, overlap told.
    uv = SQUARE[QUAD][:, :, :2] / 4
    scene = Scene(np.vstack([SQUARE, ABOVE]), np.vstack([QUAD, QUAD + 4]),
                  surfaces=(Surface("a", 0, 2, lightmap_uv=uv), Surface("b", 2, 2, lightmap_uv=uv)))
    result = of(scene, resolution=8)
    assert [page.name for page in result.pages] == ["Lightmap_a", "Lightmap_b"]
    assert result.page_of_surface.tolist() == [0, 1]
    assert np.array_equal(result.page, result.surface)
    warnings = []
    shared = of(scene, warnings, resolution=8, atlas="shared")
    assert [page.name for page in shared.pages] == ["Lightmap_1"]
    assert {w["code"] for w in warnings} == {"uv_overlap", "no_lumels"}


def test_only_the_named_objects_get_lumels():
    # Of two squares one is named, the other does not receive: page -1, no layout.
    uv = SQUARE[QUAD][:, :, :2] / 4
    scene = Scene(np.vstack([SQUARE, ABOVE]), np.vstack([QUAD, QUAD + 4]),
                  surfaces=(Surface("a", 0, 2, lightmap_uv=uv), Surface("b", 2, 2, lightmap_uv=uv)))
    result = of(scene, resolution=8, only=("b",))
    assert result.page_of_surface.tolist() == [-1, 0]
    assert result.uv[0] is None
    assert set(result.surface.tolist()) == {1}


def test_an_unknown_name_or_no_receiver_is_refused():
    # `only` with a name that is not there: SettingsError that says it; no receiver: NothingToBake.
    with pytest.raises(SettingsError, match="'lamp'"):
        of(square_scene(), only=("lamp",))
    with pytest.raises(NothingToBake):
        of(square_scene(receives=False))


def test_a_density_that_no_image_can_hold_is_told():
    # 4 m at 1e4 px/m would be 40,000 pixels: the side is known and the warning says so, before any lumel is made.
    warnings = []
    layout = make_layout(square_scene(), Settings(uv_layer="UVMap", texel_density=1e4), warnings)
    assert layout.pages[0].width == 16384
    assert [(w["object"], w["code"]) for w in warnings] == [("square", "density_lowered")]

"""Unwrapping: every triangle gets its place, no two the same one, all at the same scale."""

import subprocess
import sys

import numpy as np
import pytest
from radiosity.solver.charts import Charts, cut_wasteful, uv_areas
from radiosity.solver.components import components
from radiosity.solver.errors import Cancelled, NothingToBake, UnwrapError
from radiosity.solver.lumels import lumels
from radiosity.solver.packing import Packer, largest_density, skyline
from radiosity.solver.pieces import PIECE_SIZE, originals, pieces, weld
from radiosity.solver.scene import Scene, Surface
from radiosity.solver.settings import Settings
from radiosity.solver.unwrap import _flatten_curved, flatten

CUBE_CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
CUBE = np.array([[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6],
                 [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]])


def sphere(rings):
    """A unit sphere of 4 rings^2 triangles, wound outwards; at its poles the triangles of one side have no area."""
    theta, phi = np.linspace(0, np.pi, rings + 1), np.linspace(0, 2 * np.pi, 2 * rings + 1)[:-1]
    t, p = np.meshgrid(theta, phi, indexing="ij")
    vertices = np.stack([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)], axis=-1)
    vertices[0, :], vertices[-1, :] = (0, 0, 1), (0, 0, -1)
    i, j = np.meshgrid(np.arange(rings), np.arange(2 * rings), indexing="ij")
    number = lambda i, j: i * 2 * rings + j % (2 * rings)  # noqa: E731
    a, b, c, d = (number(i + di, j + dj).ravel() for di, dj in ((0, 0), (1, 0), (1, 1), (0, 1)))
    return vertices.reshape(-1, 3), np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])


def scene_of(*meshes, **surface):
    """One scene of meshes (vertices, triangles), an object each."""
    vertices, triangles, surfaces, base, first = [], [], [], 0, 0
    for number, (v, t) in enumerate(meshes):
        vertices.append(np.asarray(v))
        triangles.append(np.asarray(t) + base)
        surfaces.append(Surface(f"object {number}", first, len(t), **surface))
        base, first = base + len(v), first + len(t)
    return Scene(np.concatenate(vertices), np.concatenate(triangles), surfaces=tuple(surfaces))


def laid_out(scene, **words):
    warnings = []
    return lumels(scene, Settings(**words), warnings), warnings


def texel_areas(scene, result):
    """(n,) m2 of surface that each lumel's texel spans."""
    corners = scene.vertices[scene.triangles[result.receivers.triangle]]
    sides = np.stack([corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]], axis=1)
    steps = np.einsum("nsc,ncx->nsx", result.receivers.footprint.astype(float), sides)
    return np.linalg.norm(np.cross(steps[:, 0], steps[:, 1]), axis=1)


def test_a_cube_becomes_six_squares_of_the_same_density():
    # Unit cube at 100 px/m: six charts of 100 x 100 texels, .0001 m2 each, no overlap.
    scene = scene_of((CUBE_CORNERS, CUBE))
    result, warnings = laid_out(scene, texel_density=100.)
    assert warnings == []
    assert np.bincount(result.chart).tolist() == [10000] * 6
    assert np.allclose(texel_areas(scene, result), 1e-4, rtol=1e-4)


def test_a_sphere_is_unwrapped_without_overlap_or_loss():
    # Unit sphere, 4,096 triangles, 512 x 512: lumels' areas add up to 4 pi within 1 %, nothing is told, and texel
    # areas stay within 25 % of each other for 98 % of the lumels (flattening a curved chart stretches it).
    scene = scene_of(sphere(32))
    result, warnings = laid_out(scene, resolution=512)
    assert warnings == []
    areas = texel_areas(scene, result)
    assert areas.sum() == pytest.approx(4 * np.pi, rel=.01)
    low, high = np.percentile(areas, (1, 99))
    assert high / low < 1.25


@pytest.mark.parametrize("factor", [1e-4, 1e4])
def test_size_does_not_matter(factor):
    # A sphere of .1 mm and one of 10 km radius cover as many lumels as one of 1 m, within 2 %.
    vertices, triangles = sphere(12)
    reference, _ = laid_out(scene_of((vertices, triangles)), resolution=256)
    result, warnings = laid_out(scene_of((vertices * factor, triangles)), resolution=256)
    assert warnings == []
    assert len(result) == pytest.approx(len(reference), rel=.02)


def test_the_same_scene_gives_the_same_layout():
    # Two runs on 6,400 triangles: the same bits.
    scene = scene_of(sphere(40))
    first, second = laid_out(scene, resolution=256)[0], laid_out(scene, resolution=256)[0]
    assert np.array_equal(first.uv[0], second.uv[0])
    assert np.array_equal(first.pixel, second.pixel)


def test_an_object_lies_on_one_page_and_pages_share_a_density():
    # Seven cubes on three pages: every object on one of them, all pages used, one texel area everywhere.
    scene = scene_of(*[(CUBE_CORNERS + 3 * k, CUBE) for k in range(7)])
    result, warnings = laid_out(scene, resolution=128, max_pages=3)
    assert warnings == []
    assert set(result.page_of_surface.tolist()) == {0, 1, 2}
    assert np.array_equal(result.page, result.page_of_surface[result.surface])
    assert [page.name for page in result.pages] == ["Lightmap_1", "Lightmap_2", "Lightmap_3"]
    assert np.ptp(texel_areas(scene, result)) < 1e-3 * texel_areas(scene, result).mean()


def test_objects_of_their_own_get_pages_of_their_own():
    # A cube and one three times as large, 20 px/m: pages named after them, nine times the lumels.
    scene = scene_of((CUBE_CORNERS, CUBE), (CUBE_CORNERS * 3 + 5, CUBE))
    result, _ = laid_out(scene, texel_density=20., atlas="object")
    assert [page.name for page in result.pages] == ["Lightmap_object 0", "Lightmap_object 1"]
    assert np.bincount(result.page).tolist() == [6 * 400, 6 * 3600]


def test_a_density_factor_counts():
    # Of two equal cubes at 20 px/m one has the factor 2: four times the lumels.
    scene = scene_of((CUBE_CORNERS, CUBE), (CUBE_CORNERS + 5, CUBE))
    scene = Scene(scene.vertices, scene.triangles, surfaces=(Surface("a", 0, 12), Surface("b", 12, 12, density=2.)))
    result, _ = laid_out(scene, texel_density=20.)
    assert np.bincount(result.surface).tolist() == [2400, 9600]


def test_most_triangles_without_area_do_no_harm():
    # A cube and 40 triangles whose corners lie on a line: the cube's lumels as without them, one point each for those.
    line = np.tile([0, 0, 1], (40, 1))
    plain, _ = laid_out(scene_of((CUBE_CORNERS, CUBE)), texel_density=30.)
    scene = scene_of((CUBE_CORNERS, np.vstack([line, CUBE])))
    result, warnings = laid_out(scene, texel_density=30.)
    assert len(result) == len(plain)
    assert warnings == []
    assert np.isfinite(result.uv[0]).all()
    assert np.ptp(result.uv[0][:40], axis=1).max() == 0


def test_an_object_without_any_area_gets_no_page():
    # One object of area zero beside a cube: told, page -1; alone: nothing to bake.
    nothing = (CUBE_CORNERS, np.array([[0, 0, 1], [2, 2, 2]]))
    result, warnings = laid_out(scene_of((CUBE_CORNERS, CUBE), nothing), resolution=64)
    assert result.page_of_surface.tolist() == [0, -1]
    assert [(w["object"], w["code"]) for w in warnings] == [("object 1", "zero_area")]
    with pytest.raises(NothingToBake):
        laid_out(scene_of(nothing), resolution=64)


def test_a_copy_of_a_triangle_shares_its_lumels():
    # Every triangle of a cube twice, the copies begun at another corner: the lumels of one cube, no overlap told.
    scene = scene_of((CUBE_CORNERS, np.vstack([CUBE, np.roll(CUBE, 1, axis=1)])))
    result, warnings = laid_out(scene, texel_density=30.)
    assert warnings == []
    assert len(result) == 6 * 900
    assert np.array_equal(result.uv[0][12:], np.roll(result.uv[0][:12], 1, axis=1))


def test_a_strip_thinner_than_a_texel_still_gets_light():
    # 50 strips of 4 m x 1 mm at 10 px/m, a hundredth of a texel wide: each has about 40 lumels.
    quad = np.array([[0, 0, 0], [4, 0, 0], [4, .001, 0], [0, .001, 0]])
    scene = scene_of(*[(quad + np.array([0, k, 0]), np.array([[0, 1, 2], [0, 2, 3]])) for k in range(50)])
    result, _ = laid_out(scene, texel_density=10.)
    assert np.bincount(result.surface, minlength=50).min() >= 38


def test_charts_stay_apart():
    # 40 cubes on a page of 256: between texels of different charts lie at least two free ones.
    scene = scene_of(*[(CUBE_CORNERS * (1 + .1 * k) + 9 * k, CUBE) for k in range(40)])
    result, _ = laid_out(scene, resolution=256)
    image = np.full((260, 260), -1)
    image[2 + result.pixel // 256, 2 + result.pixel % 256] = result.chart
    for down in range(3):
        for right in range(-2, 3):
            a, b = image[2:258, 2:258], image[2 + down:258 + down, 2 + right:258 + right]
            assert not ((a >= 0) & (b >= 0) & (a != b)).any()


def test_too_many_charts_are_refused_in_one_line():
    # 240 charts on one page of 16 x 16 pixels: an error that says what to raise.
    scene = scene_of(*[(CUBE_CORNERS + 3 * k, CUBE) for k in range(40)])
    with pytest.raises(UnwrapError, match="raise resolution") as caught:
        laid_out(scene, resolution=16)
    assert "\n" not in str(caught.value)


def test_unwrapping_can_be_cancelled():
    # The callback raises on its first call: the error comes through.
    def stop(fraction):
        raise Cancelled("enough")

    with pytest.raises(Cancelled):
        lumels(scene_of(sphere(16)), Settings(), [], stop)


def flatten_often(times):
    """Flatten a quad that is folded by 90 degrees and curved, as often as asked for."""
    positions = np.array([[[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 0, 0], [1, 1, 0], [0, 1, 0.2]]], float)
    for _ in range(times):
        _flatten_curved(positions, np.array([[0, 1, 2], [0, 2, 3]]), np.arange(2), np.zeros(2, int), None)


def test_flattening_never_waits_for_a_thread_of_xatlas_that_missed_its_end():
    # 6,000 atlases of two triangles, in a process of its own. With each ended at once, xatlas waited for ever after
    # some thousands of them, holding the interpreter.
    code = "from radiosity.tests.solver.test_unwrap import flatten_often; flatten_often(6000)"
    subprocess.run([sys.executable, "-c", code], check=True, timeout=120)


def test_flattening_keeps_areas_and_lengths_of_flat_faces():
    # A box of 1 x 7 x .01 m: every side of every triangle as long in its chart as in space, to 1e-3.
    positions = (CUBE_CORNERS * (1, 7, .01))[CUBE]
    charts = flatten(positions, CUBE, np.arange(12))
    lengths = lambda corners: np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)  # noqa: E731
    assert charts.count == 6
    assert np.allclose(lengths(charts.uv), lengths(positions), rtol=1e-3)


def test_needles_that_xatlas_drops_become_charts_of_their_own():
    # A needle of 1 m x 1 micrometre beside a square: both have their area in the charts.
    positions = np.array([[[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 0, 0], [1, 1, 0], [0, 1, 0]],
                          [[0, 1, 0], [1, 1, 0], [.5, 1 + 1e-6, 0]]], float)
    charts = flatten(positions, np.array([[0, 1, 2], [0, 2, 3], [3, 2, 4]]), np.arange(3))
    assert np.allclose(np.abs(uv_areas(charts.uv)), [.5, .5, 5e-7], rtol=.05)


def test_a_frame_is_cut_into_its_bars():
    # A frame of 10 x 10 m and 1 cm, four bars of two triangles: the boxes need .4 m2 and some corners instead of 100.
    outer = np.array([[0, 0], [10, 0], [10, 10], [0, 10]], float)
    inner = 5 + (outer - 5) * .998
    points = np.vstack([outer, inner])
    corner = np.array([t for k in range(4) for t in ([k, (k + 1) % 4, 4 + (k + 1) % 4], [k, 4 + (k + 1) % 4, 4 + k])])
    cut = cut_wasteful(Charts(points[corner], np.zeros(8, int), corner, np.arange(8)))
    assert cut.count == 4
    assert cut.boxes()[1].prod(axis=1).sum() < .5


def test_pieces_are_small_and_end_at_creases():
    # A sphere of 16,384 triangles: pieces of 500 at most; a cube: its six sides.
    vertices, triangles = sphere(64)
    keep = np.array([len(set(map(tuple, vertices[t]))) == 3 for t in triangles])
    node = weld(vertices)[triangles[keep]]
    assert np.bincount(pieces(vertices[triangles[keep]], node, np.arange(len(node)))).max() <= PIECE_SIZE
    assert np.bincount(pieces(CUBE_CORNERS[CUBE], CUBE, np.arange(12))).tolist() == [2] * 6


def test_vertices_weld_by_place_and_copies_are_found():
    # -0 and 0 are one place; a triangle turned is a copy, one turned over is not.
    assert weld(np.array([[0., 1, 2], [-0., 1, 2], [0, 1, 3]])).tolist() in ([0, 0, 1], [1, 1, 0])
    assert originals(np.array([[5, 6, 7], [6, 7, 5], [5, 7, 6]])).tolist() == [0, 0, 2]


def test_components_of_a_long_chain_are_one():
    # 10,000 nodes in a chain with shuffled numbers, and one alone: two components.
    order = np.random.default_rng(0).permutation(10000)
    label = components(10001, order[:-1], order[1:])
    assert set(label[:10000].tolist()) == {0}
    assert label[10000] == 1


def test_boxes_on_a_skyline_do_not_overlap():
    # 300 random boxes in a strip of 100: drawn as rectangles every texel is drawn once, below the stated height.
    random = np.random.default_rng(7)
    size = np.sort(random.integers(1, 20, (300, 2)), axis=1)
    corner, laid, height = skyline(size, 100)
    drawn = np.zeros((height, 100), int)
    for (x, y), (w, h), turn in zip(corner, size, laid, strict=True):
        w, h = (h, w) if turn else (w, h)
        drawn[y:y + h, x:x + w] += 1
    assert drawn.max() == 1
    assert drawn.sum() == size.prod(axis=1).sum()
    assert size.prod(axis=1).sum() > .85 * height * 100


def test_the_largest_density_fits_and_two_percent_more_does_not():
    # 100 squares of 1 m on a page of 128 with 2 texels between: 10 x 10 squares of 11 texels are the most.
    corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float)
    index = np.array([[0, 1, 2], [0, 2, 3]])
    uv = np.tile(corners[index], (100, 1, 1))
    chart = np.repeat(np.arange(100), 2)
    packer = Packer(Charts(uv, chart, np.tile(index, (100, 1)) + 4 * chart[:, None], np.arange(len(chart))), 2)
    density = largest_density([packer], 128)
    assert 11 / 1.02 <= density <= 11
    packed = packer.pack(density, 128)
    assert packed.height <= 128
    assert packed.uv.min() >= 0
    assert packed.uv.max() <= 128


def test_many_small_boxes_are_joined_to_strips_without_overlap():
    # 11,000 boxes, most of 2 to 9 texels: each texel of the strip of 800 is drawn once, and more than .85 are drawn.
    random = np.random.default_rng(8)
    size = np.sort(np.where(random.random((11000, 1)) < .02, random.integers(30, 60, (11000, 2)),
                            random.integers(2, 10, (11000, 2))), axis=1)
    corner, laid, height = skyline(size, 800)
    drawn = np.zeros((height, 800), int)
    for (x, y), (w, h), turn in zip(corner, size, laid, strict=True):
        w, h = (h, w) if turn else (w, h)
        drawn[y:y + h, x:x + w] += 1
    assert drawn.max() == 1
    assert drawn.sum() == size.prod(axis=1).sum()
    assert drawn.mean() > .85


def test_a_plane_folded_onto_itself_is_cut():
    # Three coplanar triangles, wound alike, at one edge, two of them over each other: no overlap is told, and the
    # lumels' areas add up to that of all three, within 5 %.
    vertices = np.array([[0, 0, 0], [1, 0, 0], [.5, 1, 0], [.6, .8, 0], [.5, -1, 0]], float)
    scene = scene_of((vertices, np.array([[0, 1, 2], [0, 1, 3], [1, 0, 4]])))
    result, warnings = laid_out(scene, resolution=128)
    assert warnings == []
    assert texel_areas(scene, result).sum() == pytest.approx(.5 + .4 + .5, rel=.05)


def test_without_a_size_a_page_of_1024_is_filled():
    # Ten cubes of different sizes, no resolution, no density: one page of 1,024 x 1,024, more than .65 of it covered;
    # with two pages each is used, and the density grows by more than 1.3.
    scene = scene_of(*[(CUBE_CORNERS * (1 + .1 * k) + 9 * k, CUBE) for k in range(10)])
    one, _ = laid_out(scene)
    two, _ = laid_out(scene, max_pages=2)
    assert [(page.width, page.height) for page in one.pages] == [(1024, 1024)]
    assert len(one) > .65 * 1024**2
    assert [(page.width, page.height) for page in two.pages] == [(1024, 1024)] * 2
    assert texel_areas(scene, one).mean() / texel_areas(scene, two).mean() > 1.3**2


def test_a_page_that_nobody_sized_grows_until_its_charts_fit(monkeypatch):
    # 5,000 loose triangles need 15 texels each with the space between them, 75,000 in all: a default page of 256 x 256
    # has 65,536, so it becomes 512 x 512, and nearly every triangle has a lumel.
    monkeypatch.setattr("radiosity.solver.atlas.DEFAULT_PAGE", 256)
    random = np.random.default_rng(1)
    vertices = (random.uniform(0, 10, (5000, 1, 3)) + random.normal(0, .1, (5000, 3, 3))).reshape(-1, 3)
    result, _ = laid_out(scene_of((vertices, np.arange(15000).reshape(-1, 3))))
    assert [(page.width, page.height) for page in result.pages] == [(512, 512)]
    assert len(np.unique(result.receivers.triangle)) > 4990


def test_own_pages_share_the_default_budget():
    # Three cubes, an image each, no size asked for: together about one page of 1,024 x 1,024.
    scene = scene_of(*[(CUBE_CORNERS * (1 + k) + 9 * k, CUBE) for k in range(3)])
    result, _ = laid_out(scene, atlas="object")
    assert sum(page.width * page.height for page in result.pages) == pytest.approx(1024**2, rel=.15)

"""Faces of the mesh stay whole in the layout, though triangles are what is flattened."""

import numpy as np
import pytest
from radiosity.solver.atlas import unwrap
from radiosity.solver.charts import Charts, uv_areas
from radiosity.solver.faces import _overlap, faces, mend
from radiosity.solver.layout import flat_triangles
from radiosity.solver.pieces import weld
from radiosity.solver.raster import rasterise
from radiosity.solver.scene import Scene, Surface
from radiosity.solver.settings import Settings
from radiosity.solver.unwrap import flatten


def grid(side, height, seed=0):
    """A square of side^2 quads, heights at random: vertices, triangles and their mesh corners."""
    x, y = np.meshgrid(np.arange(side + 1.0), np.arange(side + 1.0), indexing="ij")
    z = height * np.random.default_rng(seed).random(x.shape)
    i, j = np.meshgrid(np.arange(side), np.arange(side), indexing="ij")
    a = (i * (side + 1) + j).ravel()
    quads = np.stack([a, a + side + 1, a + side + 2, a + 1], axis=1)
    return np.stack([x, y, z], axis=-1).reshape(-1, 3), *triangulated(quads)


def torus(major, minor):
    """A torus of quads, as `grid`."""
    u, v = np.meshgrid(np.arange(major) * 2 * np.pi / major, np.arange(minor) * 2 * np.pi / minor, indexing="ij")
    ring = 1 + .25 * np.cos(v)
    vertices = np.stack([ring * np.cos(u), ring * np.sin(u), .25 * np.sin(v)], axis=-1).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(major), np.arange(minor), indexing="ij")
    number = lambda di, dj: ((i + di) % major * minor + (j + dj) % minor).ravel()  # noqa: E731
    return vertices, *triangulated(np.stack([number(0, 0), number(1, 0), number(1, 1), number(0, 1)], axis=1))


def triangulated(quads):
    """(2 q, 3) vertices and corners of quads (q, 4)."""
    corner = np.arange(4 * len(quads)).reshape(-1, 4)
    split = lambda four: np.concatenate([four[:, [0, 1, 2]], four[:, [0, 2, 3]]])  # noqa: E731
    return split(quads), split(corner)


def flattened(mesh, face):
    vertices, triangles, _ = mesh
    return flatten(vertices[triangles], weld(vertices)[triangles], face)


def torn_corners(uv, corner):
    """How many corners of the mesh have two places."""
    place = np.zeros((corner.max() + 1, 2))
    place[corner] = uv
    return len(np.unique(corner[(np.abs(place[corner] - uv) > 1e-9).any(axis=2)]))


def laid(vertices, triangles, corner):
    """The layout of one object, and its page's sides."""
    scene = Scene(vertices, triangles, surfaces=(Surface("thing", 0, len(triangles), corner_ids=corner),))
    atlas = unwrap(scene, Settings(resolution=512), [0], flat_triangles(scene))
    return atlas.uv[0], atlas.sides[0], flat_triangles(scene)


MESHES = {"hills": lambda: grid(40, 1.0), "rocks": lambda: grid(20, 2.0), "torus": lambda: torus(96, 32)}


@pytest.mark.parametrize("name", MESHES)
def test_no_corner_of_a_face_has_two_places(name):
    # Quads on curved surfaces. Exact answer: one place a corner. (Triangle by triangle, as xatlas has it, some corners
    # have two: a polygon drawn between them would show light of all that lies between.)
    mesh = MESHES[name]()
    corner = mesh[2]
    assert torn_corners(flattened(mesh, np.arange(len(corner))).uv, corner) > 0
    assert torn_corners(flattened(mesh, faces(corner)).uv, corner) == 0


@pytest.mark.parametrize("name", MESHES)
def test_whole_faces_lie_nowhere_over_others(name):
    # The same meshes on a page of 512 x 512, looked at eight times as fine: less than 1e-4 of it is claimed twice, and
    # every triangle has half its part of the area at least.
    vertices, triangles, corner = MESHES[name]()
    uv, (width, height), _ = laid(vertices, triangles, corner)
    cover = rasterise(uv, 8 * width, 8 * height)
    assert len(cover.overlapped) < 1e-4 * (cover.owner >= 0).sum()
    space = np.linalg.norm(np.cross(*np.diff(vertices[triangles], axis=1).transpose(1, 0, 2)), axis=1) / 2
    share = np.abs(uv_areas(uv.astype(float))) / space
    assert share.min() > np.median(share) / 2


def test_a_torn_quad_is_folded_out_beside_its_larger_half():
    # A quad of 2 m x 1 m folded along its diagonal, its halves flattened far apart, one at half the scale. Exact
    # answer: one chart, a rectangle of 2 x 1 at the larger half's place; its scale is kept.
    positions, node = folded_quad()
    apart = np.array([[[5, 5], [7, 5], [7, 6]], [[0, 0], [1, .5], [0, .5]]], float)
    charts = mend(positions, node, Charts(apart, np.array([0, 1]), np.array([[0, 1, 2], [3, 4, 5]]), np.zeros(2, int)),
                  np.array([False, False]))
    assert charts.count == 1
    assert charts.uv[1] == pytest.approx(np.array([[5, 5], [7, 6], [5, 6]]))
    assert charts.corner[1, :2].tolist() == [0, 2]


def test_a_torn_quad_that_would_cover_another_becomes_a_chart_of_its_own():
    # The same, but a triangle of the first chart lies where the second half would come. Exact answer: two charts, the
    # quad's sides as long as in space.
    positions, node = folded_quad()
    positions = np.concatenate([positions, positions[:1] + 9])
    node = np.concatenate([node, [[0, 2, 7]]])
    uv = np.array([[[5, 5], [7, 5], [7, 6]], [[0, 0], [1, .5], [0, .5]], [[5, 5], [7, 6], [5.5, 6]]], float)
    charts = mend(positions, node, Charts(uv, np.array([0, 1, 0]), np.array([[0, 1, 2], [3, 4, 5], [0, 2, 6]]),
                                          np.array([0, 0, 1])), np.zeros(3, bool))
    assert charts.chart[0] == charts.chart[1] != charts.chart[2]
    assert not set(charts.corner[:2].ravel()) & set(charts.corner[2])
    length = lambda corners: np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)  # noqa: E731
    assert length(charts.uv[:2]) == pytest.approx(length(positions[:2]))
    assert torn_corners(charts.uv[:2], node[:2]) == 0


def folded_quad():
    corners = np.array([[0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0]], float)
    axis, arm = np.array([2, 1, 0]) / 5**.5, corners[3]
    along = (arm @ axis) * axis
    turn = np.radians(40)
    corners[3] = along + np.cos(turn) * (arm - along) + np.sin(turn) * np.cross(axis, arm - along)
    node = np.array([[0, 1, 2], [0, 2, 3]])
    return corners[node], node


def test_a_face_that_was_lost_as_a_whole_is_laid_by_itself():
    # Both halves lost. Exact answer: one chart with the quad's area.
    positions, node = folded_quad()
    charts = mend(positions, node, Charts(np.zeros((2, 3, 2)), np.zeros(2, int), node, np.zeros(2, int)),
                  np.array([True, True]))
    assert charts.count == 1
    assert np.abs(uv_areas(charts.uv)) == pytest.approx([1, 1])


def test_a_face_held_together_by_a_corner_alone_is_laid_flat():
    # Two triangles of a face that share one corner (the one between them has no area and is left out), torn. Exact
    # answer: one place for that corner, no triangle over the other.
    positions = np.array([[[0, 0, 0], [1, 0, 0], [1, 1, .1]], [[1, 1, .1], [2, 2, 0], [1, 2, 0]]], float)
    node = np.array([[0, 1, 2], [2, 3, 4]])
    charts = mend(positions, node, Charts(positions[:, :, :2], np.array([0, 1]), np.arange(6).reshape(2, 3),
                                          np.zeros(2, int)), np.zeros(2, bool))
    assert charts.count == 1
    assert charts.uv[0, 2] == pytest.approx(charts.uv[1, 0])
    assert not _overlap(charts.uv[:1], charts.uv[1:])[0]


def test_corners_of_the_mesh_make_faces():
    # A pentagon as a fan, a triangle, a quad: faces 0, 1, 2.
    corner = np.array([[0, 1, 2], [5, 6, 7], [0, 2, 3], [8, 9, 10], [0, 3, 4], [8, 10, 11]])
    assert faces(corner).tolist() == [0, 1, 0, 2, 0, 2]


def test_triangles_that_touch_do_not_overlap():
    # Neighbours along a side, and at a corner: no. One inside the other, one across, the same: yes.
    one = np.array([[0, 0], [1, 0], [0, 1]], float)
    others = np.array([[[1, 0], [1, 1], [0, 1]], [[1, 0], [2, 0], [2, 1]], one * .2 + .1, one - [[-.4, .3]], one])
    assert _overlap(np.broadcast_to(one, others.shape), others).tolist() == [False, False, True, True, True]


def test_a_triangle_without_area_keeps_the_corners_of_its_face():
    # A quad with a fifth corner in the middle of a side, the triangle there without area; the quad beside it shares
    # those vertices. Exact answer: no corner has two places.
    vertices = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [.5, 0, 0], [0, -1, .5], [1, -1, .5]], float)
    triangles = np.array([[0, 1, 2], [0, 2, 3], [0, 4, 1], [5, 6, 1], [5, 1, 0]])
    corner = np.array([[0, 1, 2], [0, 2, 3], [0, 4, 1], [5, 6, 7], [5, 7, 8]])
    uv, _, flat = laid(vertices, triangles, corner)
    assert flat.tolist() == [False, False, True, False, False]
    assert torn_corners(uv, corner) == 0


def test_a_quad_over_two_triangles_keeps_its_corners():
    # A folded quad, and over it two loose triangles, listed first, of which it is a copy, in charts of their own (the
    # fold is above 60 degrees). Exact answer: none of the quad's corners has two places.
    vertices = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [1, 0, 1]], float)
    triangles = np.array([[0, 1, 2], [0, 3, 1], [0, 1, 2], [0, 3, 1]])
    corner = np.array([[0, 1, 2], [3, 4, 5], [6, 8, 9], [6, 7, 8]])
    uv, _, _ = laid(vertices, triangles, corner)
    assert torn_corners(uv, corner) == 0


def test_copies_of_a_quad_share_its_place():
    # A square twice, the second turned by a corner. Exact answer: both cover the same lumels, no corner has two places.
    vertices = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
    triangles = np.array([[0, 1, 2], [0, 2, 3], [2, 3, 0], [2, 0, 1]])
    corner = np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]])
    uv, _, _ = laid(vertices, triangles, corner)
    assert torn_corners(uv, corner) == 0
    assert uv[3] == pytest.approx(uv[0][[2, 0, 1]])

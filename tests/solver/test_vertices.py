"""Vertex colours: the fit to the light inside the triangles."""

import numpy as np
from radiosity.solver.parallel import Run
from radiosity.solver.scene import Scene, Surface
from radiosity.solver.settings import Settings
from radiosity.solver.vertices import corner_receivers
from scipy.optimize import nnls

VERTEX = Settings(target="vertex")


def grid(n, height=lambda x, y: 0 * x):
    """The unit square as n x n squares of two triangles each."""
    x, y = (a.ravel() for a in np.meshgrid(np.linspace(0, 1, n + 1), np.linspace(0, 1, n + 1)))
    i = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    triangles = np.concatenate([np.stack([i, i + 1, i + n + 2], 1), np.stack([i, i + n + 2, i + n + 1], 1)])
    return np.column_stack([x, y, height(x, y)]), triangles


def fitted(scene, light):
    """Corner colours of a light given as a function of the position."""
    receivers, _, fit = corner_receivers(scene, VERTEX, Run())
    return fit(light(receivers.position + scene.origin))


def test_light_that_is_linear_is_reproduced():
    # A plane of 5 x 5 squares under E = (1 + x, 2 + y, 3 + x - y): the corners get exactly these values.
    scene = Scene(*grid(5))
    light = lambda p: np.column_stack([1 + p[:, 0], 2 + p[:, 1], 3 + p[:, 0] - p[:, 1]])  # noqa: E731
    colours = fitted(scene, light)[0]
    expected = light(scene.vertices[scene.triangles].reshape(-1, 3)).reshape(-1, 3, 3)
    assert np.allclose(colours, expected, atol=1e-3)


def test_samples_cover_every_triangle_by_its_area():
    # 8 triangles: parts of equal size tile each one, so the mean of the samples is the middle of the triangle.
    scene = Scene(*grid(2))
    receivers, *_ = corner_receivers(scene, VERTEX, Run())
    for triangle in range(8):
        weight = receivers.barycentric[receivers.triangle == triangle]
        assert np.allclose(weight.mean(axis=0), 1 / 3, atol=1e-6)
        assert weight.min() > 0
        assert weight.sum(axis=1).max() < 1
        assert len(np.unique(weight.round(5), axis=0)) == len(weight)


def test_the_fit_beats_colours_sampled_at_the_corners():
    # A pool of light on a coarse square, narrower than a triangle: the RMS misfit is within 3 % of the least that
    # colours from zero can have (Lawson & Hanson's NNLS), below that of point samples, and so is the error of the mean.
    scene = Scene(*grid(4))
    pool = lambda p: np.repeat(np.exp(-((p[:, :2] - (.37, .62)) ** 2).sum(axis=1) / .01)[:, None], 3, axis=1)  # noqa: E731
    receivers, _, fit = corner_receivers(scene, VERTEX, Run())
    truth = pool(receivers.position + scene.origin)
    basis = np.column_stack([1 - receivers.barycentric.sum(axis=1), receivers.barycentric])
    shown = lambda corners: np.einsum("nc,nck->nk", basis, corners[receivers.triangle])  # noqa: E731
    baked, sampled = fit(truth)[0], pool(scene.vertices[scene.triangles].reshape(-1, 3)).reshape(-1, 3, 3)
    rms = lambda corners: np.sqrt(np.mean((shown(corners) - truth) ** 2))  # noqa: E731
    matrix = np.zeros((len(truth), len(scene.vertices)))
    np.put_along_axis(matrix, scene.triangles[receivers.triangle], basis, axis=1)
    least = nnls(matrix, truth[:, 0])[1] / np.sqrt(len(truth))
    assert rms(baked) < 1.03 * least
    assert rms(baked) < .9 * rms(sampled)
    assert abs(shown(baked).mean() / truth.mean() - 1) < .5 * abs(shown(sampled).mean() / truth.mean() - 1)


def test_no_colour_is_negative():
    # Half in shadow, half in light 1: the fit overshoots at the edge, but never below zero, and stays below 1.2.
    colours = fitted(Scene(*grid(8)), lambda p: np.repeat((p[:, :1] > .53).astype(float), 3, axis=1))[0]
    assert colours.min() >= 0
    assert colours.max() < 1.2


def test_neighbours_share_colours_and_creases_do_not():
    # A roof with its ridge at y = .5, light 1 on one side and 3 on the other: steep, each side keeps its own light to
    # the ridge; nearly flat, both sides meet in one colour between.
    steep, low = (Scene(*grid(4, lambda x, y, s=s: s * np.abs(y - .5))) for s in (1.0, .01))
    light = lambda p: np.where(p[:, 1:2] < .5, 1., 3.) * np.ones(3)  # noqa: E731
    for scene, shared in ((steep, False), (low, True)):
        corners = scene.vertices[scene.triangles].reshape(-1, 3)
        colours = fitted(scene, light)[0].reshape(-1, 3)[:, 0]
        for x in (0, .25, .5, .75, 1):
            here = colours[(np.abs(corners[:, 1] - .5) < 1e-9) & (np.abs(corners[:, 0] - x) < 1e-9)]
            if shared:
                assert np.ptp(here) < 1e-6
                assert 1.5 < here[0] < 2.5
            else:
                assert np.allclose(np.minimum(np.abs(here - 1), np.abs(here - 3)), 0, atol=.01)
                assert np.ptp(here) > 1.9


def test_smooth_normals_join_across_an_edge():
    # The steep roof again, with shading normals that are the same on both sides: one colour at the ridge.
    vertices, triangles = grid(4, lambda x, y: np.abs(y - .5))
    normals = np.tile(np.float32([0, 0, 1]), (len(triangles), 3, 1))
    scene = Scene(vertices, triangles, corner_normals=normals)
    corners = vertices[triangles].reshape(-1, 3)
    colours = fitted(scene, lambda p: np.where(p[:, 1:2] < .5, 1., 3.) * np.ones(3))[0].reshape(-1, 3)
    for x in (0, .25, .5, .75, 1):
        here = (np.abs(corners[:, 1] - .5) < 1e-9) & (np.abs(corners[:, 0] - x) < 1e-9)
        assert np.ptp(colours[here, 0]) < 1e-6


def test_the_same_mesh_corner_has_one_colour():
    # A folded quad whose triangles share two loops of the mesh: one colour each there, whatever the fold.
    vertices = np.array([[0, 0, 0], [1, 0, 1], [1, 1, 0], [0, 1, 1.]])
    ids = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    scene = Scene(vertices, ids, surfaces=(Surface("quad", 0, 2, corner_ids=ids),))
    colours = fitted(scene, lambda p: 1 + p)[0]
    assert np.array_equal(colours[0, 0], colours[1, 0])
    assert np.array_equal(colours[0, 2], colours[1, 1])


def test_triangles_without_area_and_objects_left_out():
    # A degenerate triangle in the mesh, and a second object that does not receive: finite colours, and None.
    vertices, triangles = grid(2)
    triangles = np.vstack([triangles, [[0, 0, 1]], triangles])
    scene = Scene(vertices, triangles, surfaces=(Surface("a", 0, 9), Surface("b", 9, 8, receives=False)))
    first, second = fitted(scene, lambda p: np.ones((len(p), 3)))
    assert np.allclose(first, 1, atol=1e-4)
    assert second is None

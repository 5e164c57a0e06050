"""Glowing images: textured emission as lamps, against sums over the image's texels."""

import numpy as np
import pytest
from radiosity import solver
from radiosity.solver.emission_pieces import emission_pieces, mean_exitance
from radiosity.solver.geometry import Geometry
from radiosity.solver.scene import Scene, Texture

SCREEN = [(-1, -0.5, 1), (1, -0.5, 1), (1, 0.5, 1), (-1, 0.5, 1)]
FLOOR = [(-20, -20, 0), (20, -20, 0), (20, 20, 0), (-20, 20, 0)]
PLACES = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], np.float32)


def _image():
    """64 x 16 texels: red at the left, a blue patch to the right, else black."""
    pixels = np.zeros((16, 64, 3), np.float32)
    pixels[:, :12] = (1, 0.5, 0.2)
    pixels[:8, 40:50] = (0, 0, 3)
    return pixels


def _scene(pixels):
    """A screen of 2 x 1 m, 1 m above a black floor, facing it."""
    uv = np.zeros((4, 3, 2), np.float32)
    uv[0], uv[1] = PLACES[[0, 2, 1]], PLACES[[0, 3, 2]]
    return Scene(np.array(SCREEN + FLOOR, float), [(0, 2, 1), (0, 3, 2), (4, 5, 6), (4, 6, 7)], reflectance=0.0,
                 emission=np.pi * np.array([1, 1, 0, 0])[:, None] * np.ones(3), uv=uv, textures=(Texture(pixels),),
                 emission_texture=np.array([0, 0, -1, -1]))


def _exact(pixels, point):
    """(3,) irradiance at a point of the floor: the sum over texels of L cos cos' / d^2 dA."""
    x, y = np.meshgrid((np.arange(64) + 0.5) / 32 - 1, (np.arange(16) + 0.5) / 16 - 0.5)
    squared = (x - point[0]) ** 2 + (y - point[1]) ** 2 + 1
    return np.einsum("hw,hwc->c", 2 / x.size / squared**2, pixels.astype(float))


def test_a_glowing_image_lights_the_floor_by_its_texels():
    # Points under the middle and beside it; the mean over them to 1 %, each channel.
    points = np.array([(x, y, 0.0) for x in np.linspace(-1.5, 1.5, 12) for y in (-0.6, 0, 0.6)])
    up = np.tile(np.float32([0, 0, 1]), (len(points), 1))
    ours = solver.irradiance(_scene(_image()), solver.Settings(error=0.01), points, up)
    exact = np.array([_exact(_image(), point) for point in points])
    assert ours.mean(axis=0) == pytest.approx(exact.mean(axis=0), rel=0.01)
    assert np.sqrt(((ours - exact) ** 2).mean()) < 0.03 * exact.mean()


def test_pieces_keep_area_and_light():
    # The screen's flux a side: 2 m2 times pi times the image's mean, and the pieces cover it once.
    geometry = Geometry(_scene(_image()))
    exitance = mean_exitance(geometry)
    pieces = emission_pieces(geometry, np.array([0, 1]), exitance)
    area = np.linalg.norm(np.cross(pieces.corners[:, 1] - pieces.corners[:, 0],
                                   pieces.corners[:, 2] - pieces.corners[:, 0]), axis=1) / 2
    assert area.sum() == pytest.approx(2, rel=1e-6)
    assert np.bincount(pieces.triangle, area)[:2] == pytest.approx([1, 1], rel=1e-6)
    exact = 2 * np.pi * _image().mean(axis=(0, 1))
    assert area @ pieces.exitance == pytest.approx(exact, rel=0.02)
    assert geometry.area[:2] @ exitance[:2] == pytest.approx(exact, rel=0.02)


def test_an_even_image_leaves_triangles_whole():
    geometry = Geometry(_scene(np.full((16, 64, 3), 0.7, np.float32)))
    pieces = emission_pieces(geometry, np.array([0, 1]), mean_exitance(geometry))
    assert list(pieces.triangle) == [0, 1]
    assert pieces.exitance == pytest.approx(0.7 * np.pi, rel=1e-5)


def test_a_scene_without_textures_is_read_as_it_is():
    scene = Scene(np.array(SCREEN, float), [(0, 1, 2), (0, 2, 3)], emission=[[1, 2, 3], [4, 5, 6]])
    geometry = Geometry(scene)
    assert np.array_equal(mean_exitance(geometry), [[1, 2, 3], [4, 5, 6]])
    assert len(emission_pieces(geometry, np.array([0, 1]), mean_exitance(geometry)).triangle) == 2

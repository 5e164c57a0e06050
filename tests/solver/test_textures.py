"""Textures are filtered over the piece of surface that is asked about."""

from __future__ import annotations

import numpy as np
import pytest
from radiosity.solver.cells import Cells
from radiosity.solver.geometry import Geometry
from radiosity.solver.parallel import Run
from radiosity.solver.scene import Texture
from radiosity.solver.seen import Seen, SeenFootprints
from radiosity.solver.textures import looked_up
from radiosity.tests.solver.rooms import quad


def _noise(side, seed=3):
    return np.random.default_rng(seed).random((side, side, 3), np.float32)


def test_a_mip_map_keeps_the_mean_and_ends_in_it():
    chain = Texture(_noise(64)).smaller
    assert chain.size.tolist() == [[32 >> level] * 2 for level in range(6)]
    for first, (width, height) in zip(chain.first, chain.size, strict=True):
        assert chain.pixels[first:first + width * height].mean(axis=0) == pytest.approx(_noise(64).mean(axis=(0, 1)),
                                                                                        rel=1e-5)


def test_odd_images_are_halved_up_to_their_edge():
    # Three columns become two: the mean of the first pair, and what is over.
    pixels = np.repeat(np.float32([[1, 3, 7]])[..., None], 3, axis=2)
    chain = Texture(pixels).smaller
    assert chain.size.tolist() == [[2, 1], [1, 1]]
    assert chain.pixels[:, 0].tolist() == [2, 7, 4.5]


def test_a_wide_look_is_the_mean_of_what_it_covers():
    # In the middle of a plain field of 32 texels in noise, looks up to that width see the field alone; the widest sees
    # the mean of all.
    pixels = _noise(128)
    pixels[48:80, 48:80] = 0.25
    texture = Texture(pixels)
    for width in (0.0, 4 / 128, 16 / 128, 32 / 128):
        assert looked_up(texture, np.float32([[0.5, 0.5]]), np.float32([width])) == pytest.approx(0.25)
    wide = looked_up(texture, np.float32([[0.3, 0.8]]), np.float32([256.0]))
    assert wide[0] == pytest.approx(pixels.mean(axis=(0, 1)), rel=1e-5)


def test_a_look_at_a_point_is_what_the_image_shows_there():
    texture, points = Texture(_noise(16)), (np.arange(16, dtype=np.float32)[:, None] + 0.5).repeat(2, axis=1) / 16
    exact = texture.pixels[np.arange(16), np.arange(16)]
    assert looked_up(texture, points) == pytest.approx(exact)
    assert looked_up(texture, points, np.full(16, 1 / 16, np.float32)) == pytest.approx(exact)


def test_a_cell_of_many_texels_knows_its_mean_reflectance_from_one_point():
    # A floor of 1 m, 256 x 256 texels of noise, in cells of 1/16 m: each holds 256 texels with a deviation of .29.
    # Points alone would be off by as much; the mean over the cell is known to a quarter of that or better.
    pixels = _noise(256)
    count, corner = 2, np.float32([[0, 0], [1, 0], [1, 1], [0, 1]])
    scene = quad((0, 0, 0), (1, 0, 0), (0, 1, 0)).scene(
        reflectance=np.ones((count, 3)), uv=corner[[[0, 1, 2], [0, 2, 3]]], textures=(Texture(pixels),),
        reflectance_texture=np.zeros(count, np.int32))
    geometry = Geometry(scene)
    cells = Cells(geometry, 1 / 16)
    x, y = np.meshgrid(np.arange(16) / 16 + 0.02, np.arange(16) / 16 + 0.045)
    below = (x > y + 1 / 16).reshape(-1)
    u, v = np.float32((x - y).reshape(-1)[below]), np.float32(y.reshape(-1)[below])
    sides = cells.sides(np.zeros(len(u), np.int32), u, v, np.ones(len(u), bool))
    places = SeenFootprints(geometry, cells, Seen(sides, u, v, np.ones(len(u), np.float32)).few(), Run(1))
    _, all_u, all_v, _ = cells.places(np.repeat(places.identity, 4096),
                                      *np.random.default_rng(5).random((2, 4096 * len(places))))
    exact = geometry.reflectance(np.zeros(len(all_u), int), all_u, all_v).reshape(len(places), -1, 3).mean(axis=1)
    at_points = places.mean(lambda triangle, u, v, share: geometry.reflectance(triangle, u, v))
    assert (at_points - exact).std() > 0.15
    assert (places.mean(geometry.reflectance) - exact).std() < 0.05

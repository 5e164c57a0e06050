"""Skies in closed form, gathered with quasi-random directions."""

from __future__ import annotations

import numpy as np
import pytest
from radiosity.solver.sampling import cosine_directions, kronecker
from radiosity.solver.scene import Sky
from radiosity.solver.sky import radiance

UP, SIDE = (0, 0, 1), (1, 0, 0)
HEIGHT, WIDTH = 512, 1024


def _directions(height=HEIGHT, width=WIDTH):
    """(height, width, 3): where each texel of a map looks; row 0 down, the middle column along +x."""
    polar = np.pi * (1 - (np.arange(height) + 0.5) / height)[:, None]
    azimuth = 2 * np.pi * (0.5 - (np.arange(width) + 0.5) / width)[None, :]
    return np.stack([np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth),
                     np.cos(polar) + 0 * azimuth], axis=-1)


def _map(function):
    """A sky whose radiance is a function of direction, the three channels alike."""
    return Sky(np.repeat(function(_directions())[..., None], 3, axis=-1))


def _irradiance(sky, normal, count=2**17):
    """pi times the mean radiance over cosine-distributed directions: W/m2, first channel."""
    normal = np.array([normal], np.float32) / np.float32(np.linalg.norm(normal))
    points = kronecker(count, 2)
    directions = cosine_directions(normal, points[None, :, 0], points[None, :, 1])[0]
    return np.pi * radiance(sky, directions)[:, 0].astype(float).mean()


@pytest.mark.parametrize(("normal", "exact"), [(UP, 2.443460952792), (SIDE, 0.9680432200427),
                                               ((0, -1, 0), 0.9680432200427), ((-1, 0, 0), 0.9680432200427)])
def test_cie_overcast_sky_lights_a_roof_and_a_wall(normal, exact, validation):
    # P-48: L = (1 + 2 sin(elevation)) / 3 above the horizon, 0 below: 2.4435 on a roof, .96804 on a wall.
    sky = _map(lambda direction: np.where(direction[..., 2] > 0, (1 + 2 * direction[..., 2]) / 3, 0))
    validation("P-48", f"overcast sky on a surface facing {normal}", exact, _irradiance(sky, normal), relative=1e-3)


@pytest.mark.parametrize("normal", [UP, (0, 0, -1), SIDE, (0, 1, 0), (1, -2, 2), (-3, 1, -0.5)])
@pytest.mark.parametrize("b", [(0, 0, 1), (0.6, 0, 0), (0, -0.5, 0), (0.3, 0.4, -0.5)])
def test_environment_that_is_linear_in_direction_has_a_closed_form(normal, b, validation):
    # P-49: L = 1 + b . w: E = pi + 2 pi / 3 b . n.
    sky = _map(lambda direction: 1 + direction @ np.array(b))
    exact = np.pi + 2 * np.pi / 3 * np.dot(b, normal) / np.linalg.norm(normal)
    validation("P-49", f"L = 1 + {b} . w on a surface facing {normal}", exact, _irradiance(sky, normal), relative=1e-3)


def test_a_constant_sky_has_its_colour_in_every_direction():
    # Radiance (1, 2, 3).
    directions = _directions(8, 16).reshape(-1, 3).astype(np.float32)
    assert np.array_equal(radiance(Sky((1, 2, 3)), directions), np.broadcast_to((1, 2, 3), directions.shape))


def test_every_texel_is_found_in_the_direction_in_which_it_lies():
    # A map of 9 x 16 texels, each of a number of its own.
    number = np.arange(9 * 16 * 3, dtype=np.float32).reshape(9, 16, 3)
    found = radiance(Sky(number), _directions(9, 16).reshape(-1, 3).astype(np.float32))
    assert np.array_equal(found.reshape(number.shape), number)


@pytest.mark.parametrize("direction", [UP, (0, 0, -1), (-1, 0.0, 0), (-1, -0.0, 0), (0, 0, 1.0000001)])
def test_poles_and_the_seam_have_a_texel_too(direction):
    # Straight up is the last row, straight down the first; -x lies on the seam between the last column and the first.
    number = np.arange(4 * 8 * 3, dtype=np.float32).reshape(4, 8, 3)
    row, column = np.argwhere(number[..., 0] == radiance(Sky(number), np.array([direction], np.float32))[0, 0])[0]
    if direction[2]:
        assert row == (3 if direction[2] > 0 else 0)
    else:
        assert column in (0, 7)

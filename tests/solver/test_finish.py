"""Lumels become images, with a margin round every chart."""

from types import SimpleNamespace

import numpy as np
from radiosity.solver.finish import dilate, to_images
from radiosity.solver.receivers import Page
from radiosity.solver.settings import Settings


def slow_dilate(pixels, covered, margin):
    """The definition, texel by texel."""
    pixels, known = np.where(covered[:, :, None], pixels, 0).astype(float), covered.copy()
    height, width = covered.shape
    for _ in range(margin):
        before, was = pixels.copy(), known.copy()
        for y in range(height):
            for x in range(width):
                near = [(j, i) for j in range(max(y - 1, 0), min(y + 2, height))
                        for i in range(max(x - 1, 0), min(x + 2, width)) if was[j, i]]
                if not was[y, x] and near:
                    pixels[y, x] = np.mean([before[place] for place in near], axis=0)
                    known[y, x] = True
    return pixels


def test_one_texel_becomes_a_square_of_its_own_value():
    # A single covered texel of value 3, margin 2: a 5 x 5 square of 3, zero outside.
    pixels, covered = np.zeros((9, 9, 3), np.float32), np.zeros((9, 9), bool)
    pixels[4, 4], covered[4, 4] = 3, True
    expected = np.zeros((9, 9, 3))
    expected[2:7, 2:7] = 3
    assert np.array_equal(dilate(pixels, covered, 2), expected)


def test_dilation_agrees_with_its_definition_and_keeps_covered_texels():
    # Random charts on 20 x 31 texels, also at the border, margin 0, 1, 3: the loop over texels agrees.
    random = np.random.default_rng(0)
    covered = random.uniform(size=(20, 31)) < .07
    pixels = random.uniform(size=(20, 31, 3)).astype(np.float32)
    for margin in (0, 1, 3):
        result = dilate(pixels, covered, margin)
        assert np.allclose(result, slow_dilate(pixels, covered, margin), atol=1e-6)
        assert np.array_equal(result[covered], pixels[covered])


def test_what_lies_in_empty_texels_does_not_leak():
    # Not a number in an uncovered texel: the result is finite everywhere.
    pixels, covered = np.full((5, 5, 3), np.nan, np.float32), np.zeros((5, 5), bool)
    pixels[2, 2], covered[2, 2] = 1, True
    assert np.array_equal(dilate(pixels, covered, 8), np.ones((5, 5, 3)))


def test_values_land_on_their_texels_of_their_pages():
    # Two pages; lumel k has the value k: at row * width + column, row 0 first.
    lumels = SimpleNamespace(pages=(Page("a", 3, 2), Page("b", 2, 2)), page=np.array([0, 1, 0]),
                             pixel=np.array([5, 2, 0]))
    first, second = to_images(lumels, np.array([[1] * 3, [2] * 3, [3] * 3], float), Settings(margin=0))
    assert first[:, :, 0].tolist() == [[3, 0, 0], [0, 0, 1]]
    assert second[:, :, 1].tolist() == [[0, 0], [2, 0]]

"""Rows as ray hits: what they bring, and how sure that is."""

from __future__ import annotations

import numpy as np
import pytest
from radiosity.solver.rows import Rows


def test_a_row_brings_the_mean_of_its_rays_and_errs_by_their_spread():
    # Cells of radiosity 1 and 3 and a sky of 5 (channels 3, 5, 7): rows (1, 3, 1, 3) and (1, 1, 1, sky). Means 2 and 2,
    # variances 1 and 3 over four rays.
    hits = np.array([[0, 1, 0, 1], [0, 0, 0, -1]], np.int32)
    sky = np.zeros((2, 4, 3), np.float32)
    sky[1, 3] = (3, 5, 7)
    rows = Rows(np.array([4, 7], np.int32), hits, np.zeros((2, 4), np.uint8), sky)
    irradiance, variance = rows.sums(np.array([1, 3, 0], np.float32))
    assert irradiance == pytest.approx([2, 2])
    assert variance == pytest.approx([0.25, 0.75])
    assert rows.mean_sky() == pytest.approx(np.array([[0, 0, 0], [0.75, 1.25, 1.75]]))

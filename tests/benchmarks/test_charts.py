"""Charts of a layout whose texels can be counted by hand."""

from __future__ import annotations

import numpy as np
from radiosity.benchmarks.cycles import charts


def _rectangle(left: float, bottom: float, right: float, top: float) -> list[list[list[float]]]:
    a, b, c, d = [left, bottom], [right, bottom], [right, top], [left, top]
    return [[a, b, c], [a, c, d]]


def test_triangles_that_share_an_edge_are_one_chart_and_others_are_not() -> None:
    # Two rectangles that touch in one corner only: two charts of two triangles.
    uv = np.array(_rectangle(0, 0, 0.5, 0.5) + _rectangle(0.5, 0.5, 1, 1))
    label = charts.charts_of_triangles(uv)
    assert label[0] == label[1] != label[2] == label[3]


def test_a_rectangle_covers_the_texels_whose_centres_it_holds() -> None:
    # [.25, .75] x [0, .5] on 8 x 8 texels: columns 2 ... 5, rows 0 ... 3, row 0 at v = 0.
    image, overlaps = charts.chart_image(np.array(_rectangle(0.25, 0, 0.75, 0.5)), 8)
    expected = np.full((8, 8), -1)
    expected[0:4, 2:6] = 0
    np.testing.assert_array_equal(image, expected)
    assert overlaps == 0


def test_overlapping_charts_are_counted() -> None:
    # Two rectangles that share [.5, .75] x [0, 1] of 8 x 8 texels: 2 columns of 8 rows claimed twice; one texel
    # of the diagonals' crossing may lie on an edge, so nothing else is counted.
    uv = np.array(_rectangle(0.01, 0, 0.75, 1) + _rectangle(0.5, 0, 0.99, 1))
    assert charts.chart_image(uv, 8)[1] == 16


def test_both_windings_count_and_triangles_without_area_cover_nothing() -> None:
    # The same triangle clockwise covers the same texels; a sliver of zero area none.
    triangle = np.array([[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]])
    forward, backward = charts.chart_image(triangle, 16)[0], charts.chart_image(triangle[:, ::-1], 16)[0]
    np.testing.assert_array_equal(forward, backward)
    sliver = np.array([[[0.0, 0.0], [0.5, 0.5], [1.0, 1.0]]])
    assert (charts.chart_image(sliver, 16)[0] == -1).all()


def test_chunks_do_not_change_the_image(monkeypatch) -> None:  # type: ignore[no-untyped-def]
    # 200 random small triangles, in one chunk and in chunks of 50 texels.
    random = np.random.default_rng(0)
    uv = random.uniform(0.1, 0.9, (200, 1, 2)) + random.uniform(-0.05, 0.05, (200, 3, 2))
    whole = charts.chart_image(uv, 64)
    monkeypatch.setattr(charts, "CHUNK", 50)
    chunked = charts.chart_image(uv, 64)
    np.testing.assert_array_equal(whole[0], chunked[0])
    assert whole[1] == chunked[1]

"""What a comparison draws: PNG bytes that another reader takes, text, and the colours of the signed error."""

from __future__ import annotations

import numpy as np
import pytest
from radiosity.radiosity_addon import bitmap_font, png

pictures = pytest.importorskip("radiosity.radiosity_addon.compare_pictures", reason="the bpy wheel is not installed")


def test_another_reader_sees_the_same_pixels(tmp_path) -> None:
    # Noise of 37 x 23 pixels, written by zlib alone. Exact answer: matplotlib's reader gives back the same bytes.
    image = pytest.importorskip("matplotlib.image")
    pixels = np.random.default_rng(3).integers(0, 256, (23, 37, 3), np.uint8)
    path = tmp_path / "noise.png"
    path.write_bytes(png.encode(pixels))
    assert np.array_equal(np.rint(image.imread(path)[..., :3] * 255).astype(np.uint8), pixels)


def test_what_is_no_picture_is_refused() -> None:
    with pytest.raises(ValueError, match="give \\(height, width, 3\\) uint8"):
        png.encode(np.zeros((4, 4, 3)))


def test_text_is_drawn_where_it_is_told_and_cut_off_outside() -> None:
    # "1" is five by seven dots with ten of them set; at twice the size forty. Beyond the edge nothing is drawn.
    picture = np.zeros((40, 40, 3), np.uint8)
    bitmap_font.draw_text(picture, "1", 4, 6, (9, 8, 7), 2)
    rows, columns = np.nonzero(picture[..., 0])
    assert len(rows) == 40
    assert (columns.min(), rows.min(), rows.max()) == (6, 6, 19)
    before = picture.copy()
    bitmap_font.draw_text(picture, "1", 40, 6, (9, 8, 7), 2)
    assert np.array_equal(picture, before)


def test_the_errors_colours_are_blue_below_white_at_and_red_above_zero() -> None:
    low, none, high = pictures.error_colours(np.array([-1.0, 0.0, 1.0]))
    assert low[2] > 2 * low[0]
    assert np.ptp(none) == 0
    assert high[0] > 2 * high[2]


@pytest.mark.parametrize(("p95", "span"), [(0.1, 0.2), (0.11, 0.5), (0.3, 1.0), (0.005, 0.01)])
def test_the_scale_ends_at_a_round_number(p95: float, span: float) -> None:
    # One, two or five times a power of ten, at twice the 95th percentile or above.
    assert pictures.span_of(p95) == pytest.approx(span)

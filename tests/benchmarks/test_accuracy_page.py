"""The tables of the page on error and time: Cycles' law, times between points, what is replaced."""

from __future__ import annotations

import math

import pytest
from radiosity.benchmarks.accuracy_page import (
    cycles_seconds,
    factors,
    factors_table,
    levels_table,
    points,
    seconds_to,
    with_tables,
)


def _row(program, knob, seconds, rms):
    return {"scene": "box", "program": program, "knob": str(knob), "seconds": str(seconds), "rms": str(rms),
            "rms_low": str(rms), "rms_high": str(rms), "bias": "0", "lumels": "100", "estimated": ""}


# Cycles: errors .8 / sqrt(samples), 1 s and .05 s a sample. Ours: 2 s at 4 %, 8 s at 1 %. Denoised: 5 s at 4 %.
ROWS = [_row("ours", 0.1, 2, 0.04), _row("ours", 0.03, 8, 0.01), _row("cycles", 64, 4.2, 0.1),
        _row("cycles", 256, 13.8, 0.05), _row("cycles + oidn", 64, 5, 0.04)]


def test_cycles_takes_a_hundred_times_the_samples_to_a_tenth_of_the_error():
    # 1 % needs 80^2 = 6,400 samples: 1 + 320 s.
    assert cycles_seconds(ROWS, "box", 0.01) == pytest.approx(321)
    assert factors(ROWS, "0.03") == {"box": pytest.approx(321 / 8)}


def test_between_points_a_curve_is_straight_on_logarithmic_axes():
    # 4 % in 2 s and 1 % in 8 s: 2 % in 4 s; 5 % in 2 s at most; .5 % nowhere.
    curve = [(0.01, 8.0), (0.04, 2.0)]
    assert seconds_to(curve, 0.02) == pytest.approx(4)
    assert seconds_to(curve, 0.05) == 2
    assert seconds_to(curve, 0.005) == math.inf


def test_errors_that_nobody_reached_are_told():
    # Denoised Cycles ends at 4 %, ours at 1 %.
    table = levels_table(ROWS)
    assert "| box | 1 % | 8.0 s | not reached | 321.0 s (40.1 times ours) |" in table
    assert "| box | 5 % | 2.0 s | 5.0 s (2.5 times ours) |" in table


def test_an_error_that_noise_hides_counts_as_the_most_that_it_may_be():
    # RMS 0, or a little by chance, with intervals from 0 to 2 %: 2 % takes Cycles 1 + .05 * 1600 = 81 s.
    for rms in ("0.0", "0.003"):
        hidden = {**_row("ours", 0.01, 9, 0.0), "rms": rms, "rms_low": "0.0", "rms_high": "0.02"}
        assert points([hidden], "box", ("ours",)) == [(0.02, 9.0)]
        assert factors([*ROWS, hidden], "0.01") == {"box": pytest.approx(81 / 9)}
        assert "| box | at most 2.00 % | 9.0 s | 81 s | 9.0 |" in factors_table([*ROWS, hidden])


def test_tables_are_replaced_and_the_text_stays():
    # A page with the three places, written twice.
    page = "".join(f"{name} text\n<!-- {name} -->\nold\n<!-- end -->\n" for name in ("bakes", "factors", "levels"))
    once = with_tables(page, ROWS)
    assert with_tables(once, ROWS) == once
    assert "old" not in once
    assert "factors text" in once
    with pytest.raises(ValueError, match="levels"):
        with_tables(page.replace("<!-- levels -->", ""), ROWS)

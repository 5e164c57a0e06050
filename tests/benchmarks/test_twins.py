"""Rows of the twins' table: what holds, and that rows of other scenes stay."""

from __future__ import annotations

import csv
import dataclasses

import pytest
from radiosity.benchmarks.twins import HEAD, MOST_BIAS, Twin, write
from radiosity.tools.page_table import line_of, rows_of

ROW = Twin("cornell", 0.02, True, 1000, 0.02, 0.01, 0.03, -MOST_BIAS, 0.001, 0.015, 0.01, 0.02, 0.04, True, 512, 1536,
           100, 0.1, 10, 2, 0.025)


@pytest.mark.parametrize(("change", "held"), [
    ({}, True), ({"rms": 0.0201}, False), ({"bias": 0.0071}, False), ({"bias": -0.0071}, False),
    ({"wanted": 0.01}, False)])
def test_a_row_holds_up_to_the_wanted_error_and_the_largest_bias_either_way(change, held):
    # RMS error 2 % of 2 % wanted and bias -.7 %: holds, and no longer if either is worse.
    assert dataclasses.replace(ROW, **change).holds() == held


def test_a_scene_s_row_takes_the_place_of_its_old_one_and_others_stay(tmp_path):
    # Two scenes, then one of them again with another error: two rows in both files, text around them as it was.
    page = tmp_path / "twins.md"
    page.write_text(f"Before.\n\n{line_of(HEAD)}\n{'|---' * len(HEAD)}|\n\nAfter.\n", encoding="utf-8")
    write(tmp_path, [ROW, dataclasses.replace(ROW, scene="classroom", clean=False)])
    write(tmp_path, [dataclasses.replace(ROW, rms=0.012)])
    with (tmp_path / "twins.csv").open(newline="", encoding="utf-8") as file:
        table = {row["scene"]: row for row in csv.DictReader(file)}
    assert [(name, row["rms"], row["second_samples"]) for name, row in table.items()] == [
        ("classroom", "0.02", "1536"), ("cornell", "0.012", "1536")]
    text = page.read_text(encoding="utf-8")
    assert text.startswith("Before.\n\n|")
    assert text.endswith("|\n\nAfter.\n")
    rows = rows_of(text, HEAD)
    assert list(rows) == ["classroom", "cornell"]
    assert rows["cornell"][2] == "1.20% (1.00% to 3.00%)"
    assert rows["classroom"][6] == "4.0%, too much"


def test_a_page_without_the_table_is_refused(tmp_path):
    # A page of text alone: the command says which head it looks for.
    (tmp_path / "twins.md").write_text("Nothing.\n", encoding="utf-8")
    with pytest.raises(ValueError, match="no table with the head"):
        write(tmp_path, [ROW])
